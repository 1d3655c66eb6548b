"""Installed, the project is one package: it works from a folder that has its own `sim`."""

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("assets", "scenarios", "sim", "synthesis")
# What is read at run time; pictures of the README are not.
READ = {".py", ".toml", ".xml", ".json"}
# A user's own modules, called as the folders of this repository are.
OWN = "OWN = True\n"
# Scripts of users, and what each prints.
COMMANDS = {
    "list": ("list", "cylinder-tilt"),
    "new": ("new mine", "mine.toml"),
    "check": ("check box-tilt --out checked", "FEASIBLE"),
    "run": ("run mine.toml --controller margin --out run", "PASS"),
    "plan": ("plan box-tilt --out planned", "plan.json"),
    "sweep": (
        "sweep mine.toml --episodes 1 --preset nominal --controllers margin --workers 1 --out many",
        "100.0",
    ),
    "place": (
        "place box-tilt --evaluations 8 --workers 1 --keep hands --reach 0.05",
        "goal largest-margin",
    ),
}


def built(source, kind, folder):
    """The one file that a build of a source leaves in a folder."""
    command = [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(folder)]
    done = subprocess.run(command, check=False, cwd=source, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (file,) = folder.iterdir()
    return file


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    return built(ROOT, "wheel", tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def site(wheel, tmp_path_factory):
    """A folder with the installed wheel, and nothing else."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "pip", "install", "--no-deps", "--no-index", "--target"]
    command += [str(folder), str(wheel)]
    subprocess.run(command, check=True, capture_output=True)
    return folder


def hostile(folder):
    """Put a user's own `sim`, `scenarios` and so on into a folder, as packages and modules."""
    for name in PACKAGES:
        (folder / name).mkdir()
        (folder / name / "__init__.py").write_text(OWN)
        (folder / f"{name}.py").write_text(OWN)
    return folder


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """The folder that commands run in, one after another; with a short scenario of its own."""
    return hostile(tmp_path_factory.mktemp("user"))


def python(site, folder, *arguments, first=()):
    """Run Python with the installed wheel and the dependencies, but without the repository."""
    repository = {ROOT, ROOT / "src"}
    others = [path for path in sys.path if path and Path(path).resolve() not in repository]
    path = os.pathsep.join([*first, str(site), *others])
    environment = os.environ | {"PYTHONPATH": path, "OMP_NUM_THREADS": "1"}
    # Without -S the links of an editable install come after all.
    command = [sys.executable, "-S", *arguments]
    return subprocess.run(
        command, check=False, cwd=folder, env=environment, capture_output=True, text=True
    )


def fulcrum(site, folder, line, **more):
    return python(site, folder, str(site / "bin" / "fulcrum"), *line.split(), **more)


# --- what is in the wheel ---


def top_level(wheel):
    """Names that an installed wheel puts at the top of site-packages."""
    with zipfile.ZipFile(wheel) as archive:
        return {name.split("/")[0].removesuffix(".py") for name in archive.namelist()}


def missing(wheel):
    """Files of the packages that are read at run time, but not in the wheel."""
    with zipfile.ZipFile(wheel) as archive:
        there = set(archive.namelist())
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*")]
    read = [path for path in files if path.suffix in READ and "__pycache__" not in path.parts]
    assert len(read) > 150
    return {f"fulcrum/{path.relative_to(ROOT).as_posix()}" for path in read} - there


def test_only_fulcrum_is_importable(wheel):
    names = top_level(wheel)
    assert {name for name in names if not name.endswith(".dist-info")} == {"fulcrum"}
    assert len(names) == 2


def test_every_file_that_is_read_at_run_time_is_in_the_wheel(wheel):
    assert missing(wheel) == set()


def test_no_pictures_and_no_tests_are_in_the_wheel(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert not [name for name in names if name.endswith(".png") or "test" in name.split("/")[1]]


def test_a_bare_package_and_a_missing_file_would_be_noticed(wheel, tmp_path):
    spoilt = tmp_path / wheel.name
    gone = "fulcrum/scenarios/template.toml"
    with zipfile.ZipFile(wheel) as source, zipfile.ZipFile(spoilt, "w") as copy:
        for name in source.namelist():
            if name != gone:
                copy.writestr(name, source.read(name))
        copy.writestr("sim/__init__.py", "")
    assert "sim" in top_level(spoilt)
    assert missing(spoilt) == {gone}


def test_the_source_distribution_builds_the_same_wheel(wheel, tmp_path):
    source = built(ROOT, "sdist", tmp_path / "source")
    with tarfile.open(source) as archive:
        archive.extractall(tmp_path, filter="data")
    again = built(tmp_path / source.name.removesuffix(".tar.gz"), "wheel", tmp_path / "again")
    assert again.name == wheel.name
    assert again.read_bytes() == wheel.read_bytes()


# --- what is installed ---


def test_every_module_is_imported_from_the_installed_wheel(site, tmp_path):
    code = (
        "import importlib, pkgutil, sys, fulcrum\n"
        "for found in pkgutil.walk_packages(fulcrum.__path__, 'fulcrum.'):\n"
        "    try:\n"
        "        if not found.name.endswith('__main__'):\n"
        "            importlib.import_module(found.name)\n"
        # Drake is an extra.
        "    except ModuleNotFoundError as error:\n"
        "        if error.name != 'pydrake':\n"
        "            raise\n"
        "own = [m for n, m in sys.modules.items() if n.split('.')[0] == 'fulcrum']\n"
        "print(len(own), *{m.__file__.rpartition('/fulcrum/')[0] for m in own})\n"
    )
    done = python(site, tmp_path, "-c", code)
    assert done.returncode == 0, done.stderr
    count, *places = done.stdout.split()
    assert int(count) > 150
    assert places == [str(site)]


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_works_in_a_folder_with_a_sim_of_its_own(name, site, place):
    shutil.copy(ROOT / "scenarios" / "scenes" / "box-tilt.toml", place / "mine.toml")
    if name == "new":
        (place / "mine.toml").unlink()
    line, printed = COMMANDS[name]
    done = fulcrum(site, place, line)
    # A search of few placements may find nothing better.
    assert done.returncode in ((0, 1) if name == "place" else (0,)), done.stderr
    assert printed in done.stdout
    assert done.stderr == ""


def test_a_search_path_that_begins_with_the_folder_changes_nothing(site, tmp_path):
    done = fulcrum(site, hostile(tmp_path), "list", first=(".",))
    assert done.returncode == 0, done.stderr
    assert "box-tilt" in done.stdout


def test_the_module_runs_as_the_command_does_and_names_versions(site, tmp_path):
    hostile(tmp_path)
    done = python(site, tmp_path, "-m", "fulcrum", "--version")
    assert done.returncode == 0, done.stderr
    versions = dict(line.split() for line in done.stdout.splitlines())
    packages = {"mujoco", "dm-control", "clarabel", "pin", "mink", "rerun-sdk"}
    assert set(versions) == {"fulcrum", "Python", *packages}
    (metadata,) = site.glob("fulcrum_testbed-*.dist-info")
    assert metadata.name == f"fulcrum_testbed-{versions['fulcrum']}.dist-info"
    assert versions["Python"] == sys.version.split()[0]


def test_tests_of_a_user_import_both_their_sim_and_fulcrum(site, tmp_path):
    (tmp_path / "sim.py").write_text(OWN)
    (tmp_path / "test_mine.py").write_text(
        "import fulcrum\nimport sim\n\n"
        "def test_both():\n"
        "    assert sim.OWN\n"
        "    assert fulcrum.scenario('box-tilt').name == 'box-tilt'\n"
        "    assert fulcrum.plan and fulcrum.run\n"
    )
    done = python(site, tmp_path, "-m", "pytest", "-q", "-p", "no:cacheprovider")
    assert done.returncode == 0, done.stdout
    assert "1 passed" in done.stdout


def test_the_folder_with_a_sim_of_its_own_would_break_a_bare_import(site, tmp_path):
    done = python(site, hostile(tmp_path), "-c", "import sim.run.execute")
    assert done.returncode == 1
    assert "sim.run" in done.stderr
