"""Names of ten million characters, wherever a name is taken: the answer is short."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import tasks
from layouts import Layout, single
from robots import RobotLayoutsError, RobotRegistry
from tests.faults.fault import Fault

AREA = "long names"
NAME = "panda " * (10**7 // 6)
LONGEST = 4000  # characters of a message


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for what, take in _TAKES.items():
        yield Fault(AREA, f"{what} of 10 MB", partial(_refused_in_short, take))


def _make(**arguments: Any) -> Any:
    return tasks.make(**{"task_id": "PushCube-v1", **arguments})


_TAKES: dict[str, Callable[[str], Any]] = {
    "a robot's name": RobotRegistry.load,
    "a task's id": lambda name: _make(task_id=name),
    "a robot in a task": lambda name: _make(robots={"panda": name}),
    "a control_mode": lambda name: _make(control_mode=name),
    "an argument": lambda name: _make(**{name: 1}),
    "a place in a layout": lambda name: single({name: "panda"}),
    "a layout in YAML": Layout.from_yaml,
}


def _refused_in_short(take: Callable[[str], Any], _: Path) -> None:
    with pytest.raises(RobotLayoutsError) as caught:
        take(NAME)
    assert len(str(caught.value)) <= LONGEST
    raise caught.value
