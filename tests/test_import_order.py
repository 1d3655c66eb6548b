"""Imports inside the house go down its order, and never in a circle, wherever they stand."""

import pytest

from tests.helpers.house import ROOT, circles, module_graph, package_graph, sources

# The packages of `sim` from the lowest up: each imports from lower ones only.
ORDER = (
    {"signals"},
    {"geometry"},
    {"scenario"},
    {"model"},
    {"motion"},
    {"planning", "world", "evaluation"},
    {"plant", "control", "analysis", "recording"},
    {"run"},
    {"sweep", "placement"},
)


def against_the_order(graph):
    """Imports inside `sim` that do not go down, as pairs of modules."""
    rank = {f"sim.{each}": k for k, level in enumerate(ORDER) for each in level}

    def level(module):
        return rank.get(".".join(module.split(".")[:2]), len(ORDER))

    found = {
        (module, target)
        for module, targets in graph.items()
        for target in targets
        if module.startswith("sim.") and target.startswith("sim.")
        if module.split(".")[1] != target.split(".")[1] and level(target) >= level(module)
    }
    # A package goes with its modules.
    parts = {(module, target.rpartition(".")[0]) for module, target in found}
    return found - parts


def test_the_order_names_all_packages_of_sim():
    folders = {path.name for path in (ROOT / "sim").iterdir() if (path / "__init__.py").is_file()}
    assert set().union(*ORDER) == folders


def test_imports_inside_sim_go_down():
    assert against_the_order(module_graph(sources())) == set()


def test_no_modules_and_no_packages_import_in_a_circle():
    graph = module_graph(sources())
    assert circles(graph) == []
    assert circles(package_graph(graph)) == []


HOUSE = {
    "sim.signals": "",
    "sim.signals.trace": "",
    "sim.model": "",
    "sim.model.scene": "from fulcrum.sim.signals.trace import Trace",
    "sim.motion": "",
    "sim.motion.ik": "from fulcrum.sim.model import scene",
    "sim.run": "from fulcrum.sim.run.loop import Loop",
    "sim.run.loop": "import fulcrum.sim.motion.ik",
}


def test_a_house_in_order_is_let_pass():
    graph = module_graph(HOUSE)
    assert graph["sim.motion.ik"] == {"sim.model", "sim.model.scene"}
    assert against_the_order(graph) == set()
    assert circles(graph) == circles(package_graph(graph)) == []


@pytest.mark.parametrize(
    "source",
    [
        "from fulcrum.sim.run.loop import Loop",
        "def f():\n    from fulcrum.sim.run import loop",
        "if TYPE_CHECKING:\n    import fulcrum.sim.run.loop",
    ],
)
def test_an_import_upwards_and_the_circle_it_makes_are_caught(source):
    graph = module_graph(HOUSE | {"sim.model.scene": source})
    assert against_the_order(graph) == {("sim.model.scene", "sim.run.loop")}
    modules = ["sim.model.scene", "sim.motion.ik", "sim.run", "sim.run.loop"]
    assert circles(graph) == [modules]
    assert circles(package_graph(graph)) == [["sim.model", "sim.motion", "sim.run"]]


def test_a_circle_by_way_of_a_package_and_one_of_packages_alone_are_caught():
    # Whoever imports a module imports its package, too, and what that imports.
    hidden = {"sim.run": "import fulcrum.sim.run.loop", "sim.motion.ik": "import fulcrum.sim.run.x"}
    assert circles(module_graph(HOUSE | hidden | {"sim.run.x": ""})) != []
    packages = HOUSE | {"sim.model.pose": "import fulcrum.sim.motion.track", "sim.motion.track": ""}
    assert circles(module_graph(packages)) == []
    assert circles(package_graph(module_graph(packages))) == [["sim.model", "sim.motion"]]
