"""The wheel of mani_skill: the user's own pip against a local index that misbehaves."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from robots import RobotRegistry
from robots.assets.fetching import ensure
from robots.assets.manifest import MANI_SKILL, load_manifest
from robots.assets.sources import PackageWheel
from robots.assets.store import AssetStore, FileState
from robots.fetch_assets import robot_files
from tests.robots.conftest import PANDA, contents
from tests.robots.wheel_index import WheelIndex, build_wheel, members, without_pip_settings

pytestmark = pytest.mark.usefixtures("store")

CHECKOUT = Path(__file__).parents[2]
SMALL = [f for package in load_manifest().packages.values() for f in package.files]
SMALL = [f for f in SMALL if f.bytes < 50_000 and f.origin.distribution == MANI_SKILL.name]
# What three programs lack, and whether they draw it.
LACKING = {"panda": False, "so100": True, "koch": False}


@pytest.fixture(scope="module")
def wheel() -> bytes:
    """A wheel with all robot files but the large ones."""
    return build_wheel(members(SMALL, contents))


@pytest.fixture
def index(wheel, monkeypatch):
    with without_pip_settings(), WheelIndex(wheel) as server:
        for name, value in server.settings().items():
            monkeypatch.setenv(name, value)
        yield server


def test_one_download_brings_the_files_of_all_robots_with_their_licences(
    index, store, physics, capfd
):
    ensure(physics, store, [PackageWheel(MANI_SKILL)])
    assert index.downloads == 1
    assert store.unusable(SMALL) == []
    said = capfd.readouterr().err
    assert "kept what came along of " in said
    assert "`robot-layouts robots fetch --check` lists it, with licences\n" in said
    assert said.count("licence ") == len({file.origin for file in physics})
    index.requests.clear()
    for package in load_manifest().packages.values():  # as a demonstration does, group by group
        small = [file for file in package.files if file in set(SMALL)]
        ensure(small, store, [PackageWheel(MANI_SKILL)])
    assert index.requests == []


@pytest.mark.long
def test_what_comes_along_replaces_nothing_that_is_there(index, store, physics):
    mine = next(f for f in SMALL if f.origin.name == "maniskill_koch")
    store.path(mine).parent.mkdir(parents=True)
    store.path(mine).write_text("my own")
    ensure(physics, store, [PackageWheel(MANI_SKILL)])
    assert store.path(mine).read_text() == "my own"


@pytest.mark.long
def test_processes_that_lack_different_files_download_once(index, store):
    """As they do when somebody starts several programs on a new machine."""
    robots = {RobotRegistry.load(name): pictures for name, pictures in LACKING.items()}
    files = {file for robot in robots for file in robot_files(robot, pictures=robots[robot])}
    index.wheel = build_wheel(members(files, contents))
    code = """
import sys
from robots.assets import fetching
from robots.assets.manifest import MANI_SKILL
from robots.assets.sources import PackageWheel
from robots.registry import RobotRegistry
fetching.default_sources = lambda: [PackageWheel(MANI_SKILL)]
RobotRegistry.load(sys.argv[1]).urdf.locate(pictures=sys.argv[2] == "True")
"""
    started = [
        subprocess.Popen(
            [sys.executable, "-c", code, robot.name, str(pictures)],
            cwd=CHECKOUT,
            stderr=subprocess.PIPE,
            text=True,
        )
        for robot, pictures in robots.items()
    ]
    said = [process.communicate(timeout=120)[1] for process in started]
    assert [process.returncode for process in started] == [0, 0, 0], said
    assert index.downloads == 1
    assert sum("downloading the wheel" in words for words in said) == 1


@pytest.mark.long
def test_what_comes_along_and_is_wrong_is_no_reason_to_fail(index, store, physics):
    wrong = next(file for file in PANDA.files if file not in physics)
    packed = members(physics, contents)
    packed[f"{wrong.origin.folder}/{wrong.path}"] = b"something else"
    index.wheel = build_wheel(packed)
    ensure(physics, store, [PackageWheel(MANI_SKILL)])
    assert store.unusable(physics) == []
    assert store.state(wrong) is FileState.MISSING
    assert index.downloads == 1


@pytest.mark.long
def test_no_room_for_what_comes_along_is_no_reason_to_fail(index, physics, tmp_path, capfd):
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1600K", "none", tmp_path]).returncode:
        pytest.skip("may not mount a small disk")
    try:
        store = AssetStore(tmp_path / "assets")
        index.wheel = build_wheel(members(SMALL, contents))
        ensure(physics, store, [PackageWheel(MANI_SKILL)])
        assert store.unusable(physics) == []
    finally:
        subprocess.run(["umount", tmp_path], check=True)
    assert "What came along is not kept" in capfd.readouterr().err
