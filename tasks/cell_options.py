"""``--layout`` and ``--robots``, ``--randomization``: the worlds of a task on a command line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from layouts import Layout
from robot_layouts.core.cli import File, Word, by_name
from robot_layouts.core.commands import notice
from robot_layouts.simulation.backend import SIMULATORS
from robots import RobotDescriptor, TaskError
from robots.named import FORMS, is_path, named_robot
from tasks.language.needs import ACT, HOLD
from tasks.randomization.declaration import SETTINGS, Randomization

Simulator = Annotated[str, Word(choices=tuple(SIMULATORS))]
PlacedRobot = Annotated[str, Word("PLACE=ROBOT", about=FORMS)]


@dataclass(frozen=True, kw_only=True)
class RecordedCell:
    """Which robots stood where, as far as a recording does not say it.

    Attributes:
        layout: Stand the robots as in this layout (.yaml).
        robots: Put other robots in some places, as in left=ur5e.urdf right=xarm7.
        bystanders: What robots without a place in the task do (without this, they are refused).
    """

    layout: File | None = None
    robots: Sequence[PlacedRobot] = ()
    bystanders: Annotated[str, Word(choices=(HOLD, ACT))] | None = None

    def making(self) -> dict[str, Any]:
        """Return the arguments of `tasks.make` that are given.

        Raises:
            RobotLayoutsError: If there is no such robot or layout, or a value is invalid.
        """
        chosen: dict[str, Any] = {}
        if self.robots:  # first, as the layout may hold robots of modules that these words name
            chosen["robots"] = chosen_robots(self.robots)
        if self.layout is not None:
            chosen["layout"] = Layout.load(self.layout)
        if self.bystanders is not None:
            chosen["bystanders"] = self.bystanders
        return chosen


@dataclass(frozen=True, kw_only=True)
class CellOptions(RecordedCell):
    """Which robots stand where, and what varies.

    Attributes:
        randomization: What varies from episode to episode: a setting of the task (fixed, spread,
            varied), or a tasks.Randomization in YAML or json.
        simulator: What computes physics (sapien3).
    """

    randomization: File | None = None
    simulator: Simulator | None = None

    def making(self) -> dict[str, Any]:
        """Return the arguments of `tasks.make` that are given; see `RecordedCell.making`."""
        chosen = super().making()
        if self.simulator is not None:
            chosen["simulator"] = self.simulator
        if self.randomization is not None:
            setting = str(self.randomization) in SETTINGS
            chosen["randomization"] = (
                str(self.randomization) if setting else Randomization.load(self.randomization)
            )
        return chosen


def chosen_robots(words: Sequence[str]) -> RobotDescriptor | dict[str, RobotDescriptor]:
    """Return the robots of words such as ``left=panda``, or of one that names no place.

    Raises:
        TaskError: If a word is malformed, or a place is given twice.
        UnknownNameError: If there is no such robot.
        AssetError: If a URDF is unusable.
    """
    if len(words) == 1 and "=" not in words[0].partition("?")[0]:
        return _robot(words[0])
    names = by_name(words, "PLACE=ROBOT", "left=panda", TaskError, "the place")
    known = {name: _robot(name) for name in dict.fromkeys(names.values())}  # guessing takes a while
    return {place: known[name] for place, name in names.items()}


def _robot(name: str) -> RobotDescriptor:
    robot = named_robot(name)
    if is_path(name):
        command = f"robot-layouts robots guess {name}"
        notice(f"{robot.name}: guessed from {name}; `{command}` says what, and why")
    return robot
