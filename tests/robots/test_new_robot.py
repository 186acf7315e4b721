"""The file that `new robot` writes goes wherever a robot goes, and moves with its URDF."""

from __future__ import annotations

import shutil
import subprocess
import sys

import pytest

from layouts.__main__ import main as layouts
from robot_layouts.__main__ import main
from robots.named import named_robot
from robots.registry import ROBOTS, RobotRegistry
from tests.robots.urdf_parts import Parts


@pytest.fixture
def folder(tmp_path, monkeypatch):
    parts = Parts()
    parts.arm(parts.link("base"), "arm", "0 0 0.1")
    (tmp_path / "lab").mkdir()
    parts.write(tmp_path / "lab")
    monkeypatch.chdir(tmp_path / "lab")
    monkeypatch.syspath_prepend(tmp_path / "lab")
    monkeypatch.setattr(ROBOTS, "registered", {})
    yield tmp_path / "lab"
    sys.modules.pop("made", None)


def test_it_holds_a_path_relative_to_itself(folder, monkeypatch, capsys):
    assert main(["new", "robot", "robot.urdf", "--out", "robots/own", "--folder", ".."]) == 0
    assert "made:MADE" in capsys.readouterr().err
    source = (folder / "robots" / "own" / "made.py").read_text()
    assert str(folder) not in source
    assert 'path=Path(__file__).parent / "../../robot.urdf"' in source
    assert 'folder=Path(__file__).parent / "../../.."' in source
    moved = folder.parent / "elsewhere"
    shutil.move(folder, moved)
    monkeypatch.chdir("/")
    monkeypatch.syspath_prepend(moved / "robots" / "own")
    urdf = named_robot("made:MADE").urdf.locate()
    assert urdf.samefile(moved / "robot.urdf")


def test_its_name_is_enough_on_a_command_line(folder, capsys):
    assert main(["new", "robot", "robot.urdf"]) == 0
    words = "face_to_face left=panda right=made:MADE --spacing auto --save cell.yaml"
    assert layouts(["show", *words.split()]) == 0
    sys.modules.pop("made")
    ROBOTS.registered.clear()
    assert layouts(["show", "cell.yaml", "right=made:MADE"]) == 0
    assert capsys.readouterr().out.count("right  made") == 2


@pytest.mark.long
def test_the_tests_that_it_writes_pass(folder):
    shutil.copytree(RobotRegistry.load("panda").urdf.locate().parent, folder / "panda")
    (urdf,) = (folder / "panda").glob("panda_v2.urdf")
    assert main(["new", "robot", str(urdf), "--name", "made", "--folder", str(folder)]) == 0
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_made.py"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "5 passed" in done.stdout
