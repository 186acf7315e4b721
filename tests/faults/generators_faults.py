"""Generators: names under which nothing can be imported, unusable robots and folders."""

from __future__ import annotations

import ast
import io
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from pathlib import Path

from robots import RobotLayoutsError, new_robot
from tasks import new_task
from tests.faults.fault import GOES_ON, Fault
from tests.faults.toy_robots import toy

AREA = "generators"
TASK_NAMES = {
    "is taken by a task": "PickCube",
    "is that of a package of this library, as a module": "Layouts",
    "is that of a module of Python": "Random",
    "is that of an installed package": "Torch",
    "is a keyword of Python, as a module": "Class",
    "is a keyword of Python, as a class": "None",
    "begins with a digit": "9lives",
    "has letters of another alphabet": "Überarm",
    "is a path": "../Reach",
    "has a version that is no number": "Reach-vx",
    "is empty": "",
}
ROBOT_NAMES = {
    "is taken by a robot": "panda",
    "is that of a package of this library": "tasks",
    "is that of a module of Python": "random",
    "is a keyword of Python": "lambda",
    "has a hyphen": "my-arm",
}
PLACES = {
    "no place": ["panda"],
    "a place with a blank": ["a b=panda"],
    "a place twice": ["a=panda", "a=ur5"],
    "a robot that nobody knows": ["a=pandda"],
    "a URDF that is not there": ["a=nowhere/arm.urdf"],
    "a URDF that is a folder": ["a=FOLDER/."],
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for what, name in TASK_NAMES.items():
        yield Fault(AREA, f"a task's name {what}: {name!r}", partial(_named_task, name))
    for what, robots in PLACES.items():
        yield Fault(AREA, f"a task of {what}", partial(_task_of, robots))
    for what, name in ROBOT_NAMES.items():
        yield Fault(AREA, f"a robot's name {what}: {name!r}", partial(_named_robot, name))
    yield Fault(AREA, "a task whose test is there already", _test_is_there)
    yield Fault(AREA, "a task into a folder that is a file", _folder_is_a_file)
    yield Fault(AREA, "a robot whose URDF is cut off", _cut_off)
    yield Fault(AREA, "a URDF in a folder whose name has quotes", _quotes, GOES_ON)


def _ran(main: Callable[[list[str]], int], *words: str) -> None:
    """Run a generator, and raise what it refuses.

    Raises:
        RobotLayoutsError: If it refuses.
    """
    said = io.StringIO()
    with redirect_stderr(said), redirect_stdout(io.StringIO()):
        code = main([*words])
    if code:
        raise RobotLayoutsError(said.getvalue().partition("error: ")[2].rstrip())


def _named_task(name: str, folder: Path) -> None:
    try:
        _ran(new_task.main, name, "--robots", "a=panda", "--out", str(folder))
    finally:
        assert not list(folder.iterdir())


def _task_of(robots: list[str], folder: Path) -> None:
    words = [robot.replace("FOLDER", str(folder)) for robot in robots]
    try:
        _ran(new_task.main, "Reach", "--robots", *words, "--out", str(folder))
    finally:
        assert not list(folder.iterdir())


def _named_robot(name: str, folder: Path) -> None:
    urdf = folder / "arm.urdf"
    urdf.write_text(toy())
    try:
        _ran(new_robot.main, str(urdf), "--name", name, "--out", str(folder))
    finally:
        assert list(folder.iterdir()) == [urdf]


def _test_is_there(folder: Path) -> None:
    (folder / "test_reach.py").write_text("mine")
    try:
        _ran(new_task.main, "Reach", "--robots", "a=panda", "--out", str(folder))
    finally:
        assert {path.name: path.read_text() for path in folder.iterdir()} == {
            "test_reach.py": "mine"
        }


def _folder_is_a_file(folder: Path) -> None:
    (folder / "out").write_text("mine")
    _ran(new_task.main, "Reach", "--robots", "a=panda", "--out", str(folder / "out"))


def _cut_off(folder: Path) -> None:
    urdf = folder / "arm.urdf"
    urdf.write_text(toy()[:-40])
    try:
        _ran(new_robot.main, str(urdf), "--name", "my_arm", "--out", str(folder))
    finally:
        assert list(folder.iterdir()) == [urdf]


def _quotes(folder: Path) -> None:
    place = folder / """a"b'c"""
    place.mkdir()
    (place / "arm.urdf").write_text(toy())
    _ran(new_task.main, "Reach", "--robots", f"a={place / 'arm.urdf'}", "--out", str(folder))
    ast.parse((folder / "reach.py").read_text())
