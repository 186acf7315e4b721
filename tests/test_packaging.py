"""The distribution: what the wheel carries, what it depends on, and what is never committed."""

import ast
import functools
import re
import subprocess
import sys
import zipfile
from importlib import metadata

import pytest
import yaml

from robot_layouts.core.own_packages import PACKAGES
from tests.checkout import ROOT, tracked_files

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]

ROBOT_FILES = (".urdf", ".srdf", ".stl", ".obj", ".dae", ".glb", ".gltf", ".ply")
RECORDINGS = (".h5", ".hdf5", ".png", ".jpg", ".mp4", ".npz", ".parquet")
FIGURES = "docs/**/*.png"  # drawn by this project's own commands


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory"]
    subprocess.run([*build, str(folder)], cwd=ROOT, check=True, capture_output=True)
    (file,) = folder.glob("*.whl")
    with zipfile.ZipFile(file) as archive:
        yield archive


@pytest.fixture(scope="module")
def files():
    return tracked_files()


class TestWheel:
    def test_carries_every_module_of_every_room(self, wheel):
        modules = {
            path.relative_to(ROOT).as_posix() for room in PACKAGES for path in modules_of(room)
        }
        assert modules <= {*wheel.namelist()}

    @pytest.mark.parametrize("room", PACKAGES)
    def test_is_typed(self, wheel, room):
        assert f"{room}/py.typed" in wheel.namelist()

    def test_carries_what_pages_are_made_of(self, wheel):
        sheets = {f"robot_layouts/core/{name}.css" for name in ("palette", "page")}
        suites = {f"robot_layouts/data/suite/{name}" for name in ("suite.css", "standard.yaml")}
        templates = {
            path.relative_to(ROOT).as_posix()
            for room in ("robot_layouts",)
            for path in (ROOT / room).rglob("templates/*.jinja")
        }
        assert len(templates) >= 5
        assert sheets | suites | templates <= {*wheel.namelist()}
        assert "tasks/parity.json" in wheel.namelist()

    def test_carries_the_asset_manifest_unchanged(self, wheel):
        manifest = (ROOT / "assets_cache" / "manifest.json").read_bytes()
        assert wheel.read("robots/manifest.json") == manifest

    def test_carries_no_robot_file_and_nothing_outside_the_rooms(self, wheel):
        for name in wheel.namelist():
            assert not name.lower().endswith(ROBOT_FILES)
            assert name.split("/")[0] in PACKAGES or ".dist-info/" in name


class TestRelease:
    def test_one_version_everywhere(self):
        cited = yaml.safe_load((ROOT / "CITATION.cff").read_text())
        latest = re.search(
            r"^## (\d\S*) – (\S+)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE
        )
        assert latest is not None
        assert latest.groups() == (cited["version"], cited["date-released"])
        assert cited["version"] == PROJECT["version"]


class TestRepository:
    def test_no_robot_file_or_recording_is_committed(self, files):
        assert len(files) > 20
        others = {*files} - {*ROOT.glob(FIGURES)}
        assert not [f.name for f in others if f.name.lower().endswith(ROBOT_FILES + RECORDINGS)]

    def test_no_file_names_a_path_of_one_machine_or_a_package_registry(self, files):
        path = r"(?<![\w.:/])/(?:work|root|home/\w+|Users/\w+)/\w"
        registry = r"\b(?:pypi|npmjs|pythonhosted|debian)\.(?:org|com)\b"
        found = {
            f"{file.relative_to(ROOT)}: {match.group()}"
            for file in files
            for match in re.finditer(f"{path}|{registry}", file.read_text(errors="ignore"))
        }
        assert not found


class TestDependencies:
    def test_the_rooms_import_what_is_declared(self):
        declared = names_of(PROJECT["dependencies"])
        for extra in (
            *("checks", "preview", "view", "browser", "light", "video", "export", "log", "mjcf"),
            *("motion", "pettingzoo", "ray", "sb3", "served", "usd", "wandb", "xacro"),
        ):
            declared |= names_of(PROJECT["optional-dependencies"][extra])
        used = {module for room in PACKAGES for module in imports_of(room, everywhere=True)}
        # mujoco is of two distributions, which a third one needs.
        assert distributions(used - {"mujoco"}) <= declared

    @pytest.mark.parametrize(
        "room",
        ["robots", "objects", "layouts", "tasks", "robot_layouts/simulation", "robot_layouts/data"],
    )
    def test_importing_a_room_needs_no_extra(self, room):
        assert distributions(imports_of(room, everywhere=False)) <= names_of(
            PROJECT["dependencies"]
        )

    def test_every_core_dependency_is_used(self):
        used = {module for room in PACKAGES for module in imports_of(room, everywhere=True)}
        through_others = {"pycollada"}  # trimesh reads Collada by it
        assert names_of(PROJECT["dependencies"]) <= distributions(used) | through_others

    def test_every_direct_dependency_has_a_tested_version(self):
        extras = PROJECT["optional-dependencies"].values()
        direct = names_of(PROJECT["dependencies"]).union(*map(names_of, extras))
        constraints = (ROOT / "constraints.txt").read_text().splitlines()
        tested = names_of(line for line in constraints if not line.startswith("#"))
        assert direct - {"robot_layouts"} <= tested


# Imported inside functions only, after its extra was found to be installed.
LOADED_WITH_ITS_EXTRA = {
    "robot_layouts/data/export/lerobot.py",
    "robot_layouts/data/export/lerobot_files.py",
    "tasks/interfaces/parallel.py",
    "tasks/interfaces/sb3.py",
}


def modules_of(room):
    return sorted((ROOT / room).rglob("*.py"))


@functools.cache
def imports_of(room, *, everywhere):
    """Third-party packages that a room imports: at import time, or also inside functions."""
    found = set()
    for path in modules_of(room):
        if not everywhere and path.relative_to(ROOT).as_posix() in LOADED_WITH_ITS_EXTRA:
            continue
        tree = parsed(path)
        for node in ast.walk(tree) if everywhere else at_import_time(tree):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
                found.add(node.module.split(".")[0])
    return found - {*PACKAGES} - sys.stdlib_module_names


@functools.cache
def parsed(path):
    return ast.parse(path.read_text())


def at_import_time(node):
    """Walk what runs when a module is imported: no function bodies, no type-checking blocks."""
    for child in ast.iter_child_nodes(node):
        typing_only = isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test)
        if not typing_only and not isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield child
            yield from at_import_time(child)


def distributions(modules):
    providers = metadata.packages_distributions()
    return {normal(name) for module in modules for name in providers.get(module, [module])}


def names_of(requirements):
    return {normal(re.match(r"[\w.-]+", requirement).group()) for requirement in requirements}


def normal(name):
    return re.sub(r"[-_.]+", "_", name).lower()
