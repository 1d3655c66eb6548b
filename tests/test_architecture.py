"""The house's order: which way imports run, who steps, who records, and what files look like."""

import ast
import re

import pytest

from tests.helpers.house import (
    FILES,
    PACKAGES,
    ROOT,
    SOURCES,
    name,
    shared_types,
    sources,
)

# What each package may import of the others; the way of the data is scenarios -> sim -> synthesis.
ALLOWED = {
    "scenarios": {"sim", "synthesis", "assets"},
    "sim": {"synthesis", "assets"},
    "synthesis": {"assets"},
    "assets": set(),
}
SIMULATORS = {"mujoco", "dm_control", "dm_env", "mink", "pinocchio", "pydrake", "rerun"}
STEPS = {"mj_step", "mj_step1", "mj_step2"}
MAX_LINES = 350
# Names for a cuboid, of MuJoCo, Rerun and ours; `synthesis` and `sim` may not say the words else.
API_WORDS = re.compile(
    r"mjGEOM_BOX\b|Boxes3D\b|\"box\"|plane, sphere, capsule, ellipsoid, cylinder, box\b"
    r"|\bBox(?=\(|:$)",
    re.MULTILINE,
)
TESTS = sorted((ROOT / "tests").rglob("*.py"))

FEWEST_FILES, MOST_FILES = 3, 12


def imported(source):
    """Dotted names of all modules that a source imports, wherever in it the import stands."""
    modules = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = "." * node.level + (node.module or "")
            modules |= {base} | {f"{base}.{alias.name}" for alias in node.names}
    return modules


def packages_imported(source):
    """First names of what a source imports; of the house's own modules the package."""
    found = set()
    for module in imported(source):
        parts = module.split(".")
        own = parts[0] == "fulcrum" and len(parts) > 1 and parts[1] in PACKAGES
        found.add(parts[1] if own else parts[0])
    return found


def against_the_arrows(path, source):
    """Packages of the house that a file imports but may not; relative imports hide them."""
    own = path.split("/")[0]
    found = packages_imported(source)
    return (found & set(PACKAGES)) - ALLOWED[own] - {own} | (found & {""})


def bare_names(source):
    """Packages of the house that a source imports by their bare names: that doubles every class."""
    return {module.split(".")[0] for module in imported(source)} & set(PACKAGES)


def steps_taken(source):
    """Calls in a source that advance MuJoCo: its step functions, or `step` of a physics."""
    calls = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute) and node.attr in STEPS:
            calls.append(node.attr)
        if isinstance(node, ast.ImportFrom):
            calls += [alias.name for alias in node.names if alias.name in STEPS]
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            owner = ast.unparse(node.func.value).lower()
            if node.func.attr == "step" and owner.split(".")[-1].endswith("physics"):
                calls.append(f"{owner}.step")
    return calls


def forbidden_words(source):
    return re.findall(r"box|baxter", API_WORDS.sub("", source), re.IGNORECASE)


def module_docstring(source):
    return ast.get_docstring(ast.parse(source))


def test_every_package_is_looked_at():
    # Guards the tests below against an empty list of files.
    assert {path.relative_to(ROOT).parts[0] for path in FILES} == set(PACKAGES)
    assert len(FILES) > 30


@pytest.mark.parametrize("path", FILES, ids=name)
def test_imports_run_one_way(path):
    assert against_the_arrows(name(path), path.read_text()) == set()


@pytest.mark.parametrize(
    ("path", "source", "caught"),
    [
        ("sim/run/loop.py", "from fulcrum.scenarios import scenario", {"scenarios"}),
        ("synthesis/conic.py", "def f():\n    import fulcrum.sim.plant.mujoco", {"sim"}),
        ("assets/visuals.py", "from fulcrum.synthesis.errors import FulcrumError", {"synthesis"}),
        ("sim/run/loop.py", "from ..scenarios import scenario", {""}),
        ("scenarios/cli.py", "from fulcrum.sim.run.execute import execute", set()),
        ("sim/motion/ik.py", "from fulcrum.sim.model import scene\nimport fulcrum.assets", set()),
    ],
)
def test_imports_against_the_arrows_are_caught(path, source, caught):
    assert against_the_arrows(path, source) == caught


@pytest.mark.parametrize("path", [*FILES, *TESTS], ids=name)
def test_all_imports_go_through_the_one_package(path):
    assert bare_names(path.read_text()) == set()


@pytest.mark.parametrize(
    "source", ["import sim.run", "def f():\n    from synthesis import Problem"]
)
def test_a_bare_name_is_caught(source):
    assert bare_names(source)


def test_only_the_recording_imports_rerun():
    importers = {name(p) for p in FILES if "rerun" in packages_imported(p.read_text())}
    assert importers
    assert all(path.startswith("sim/recording/") for path in importers)


def test_only_the_plants_own_modules_import_drake():
    importers = {name(p) for p in FILES if "pydrake" in packages_imported(p.read_text())}
    assert importers
    assert all(path.startswith("sim/plant/drake") for path in importers)


def test_synthesis_imports_no_simulator_and_no_recorder():
    for path in FILES:
        if name(path).startswith("synthesis/"):
            assert not packages_imported(path.read_text()) & SIMULATORS, name(path)


def test_an_import_inside_a_function_or_of_a_part_is_caught():
    assert packages_imported("def f():\n    from rerun.experimental import X") == {"rerun"}
    assert packages_imported("if TYPE_CHECKING:\n    import mujoco") == {"mujoco"}


def test_only_the_plant_steps_mujoco():
    assert {name(p) for p in FILES if steps_taken(p.read_text())} == {"sim/plant/mujoco.py"}


@pytest.mark.parametrize(
    "source",
    [
        "mujoco.mj_step(model, data)",
        "from mujoco import mj_step2",
        "advance = mujoco.mj_step1",
        "self.plant.physics.step()",
        "self._physics.step(3)",
    ],
)
def test_a_step_elsewhere_is_caught(source):
    assert steps_taken(source)


def test_a_plant_and_an_environment_are_no_steps_of_mujoco():
    assert steps_taken("plant.step()\nenvironment.step(action)\nmujoco.mj_kinematics(m, d)") == []


def test_neither_synthesis_nor_sim_knows_the_words_box_and_baxter():
    for path in FILES:
        if name(path).startswith(("synthesis/", "sim/")):
            assert forbidden_words(path.read_text()) == [], name(path)


@pytest.mark.parametrize(
    "source",
    ["# the Box slides", "BAXTER = 1", "mailbox = 2", "'box'", 'name="box-tilt"', "mjGEOM_BOXES"],
)
def test_the_words_are_caught(source):
    assert forbidden_words(source)


def test_names_of_mujoco_and_rerun_for_a_cuboid_are_allowed():
    assert forbidden_words('rr.Boxes3D(); mjtGeom.mjGEOM_BOX; kind="box"') == []


@pytest.mark.parametrize("path", FILES, ids=name)
def test_every_module_says_what_it_is_for(path):
    assert module_docstring(path.read_text())


def test_a_module_without_docstring_is_caught():
    assert not module_docstring("# only a comment\nx = 1")


def test_files_have_at_most_350_lines():
    lengths = {name(path): len(path.read_text().splitlines()) for path in [*FILES, *TESTS]}
    assert {path: n for path, n in lengths.items() if n > MAX_LINES} == {}


def test_the_package_is_typed():
    assert (ROOT / "src" / "fulcrum" / "py.typed").is_file()


def odd_sizes(modules):
    """Packages of `sim` with too few or too many files, `__init__` not counted."""
    counts = {}
    for parts in (module.split(".") for module in modules):
        if parts[0] == "sim" and len(parts) == 3:
            counts[parts[1]] = counts.get(parts[1], 0) + 1
    return {each: n for each, n in counts.items() if not FEWEST_FILES <= n <= MOST_FILES}


def test_packages_of_sim_have_few_files_but_several():
    assert odd_sizes(SOURCES) == {}


def test_too_few_and_too_many_files_are_caught():
    many = [f"sim.run.part_{k}" for k in range(13)]
    assert odd_sizes(["sim.plant", "sim.plant.a", "sim.plant.b", *many]) == {"plant": 2, "run": 13}


def test_no_two_public_types_share_a_name():
    assert shared_types(sources()) == {}


def test_a_name_that_two_modules_define_is_caught():
    twice = {"a": "class Plan:\n    pass", "b": "Plan = tuple[float, float]", "c": "Plan()"}
    assert shared_types(twice) == {"Plan": ["a", "b"]}
    assert shared_types({"a": "class _Own: pass\nLIMIT = 1", "b": "class _Own: pass"}) == {}
