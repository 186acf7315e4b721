"""``--layout`` and ``--robots``, ``--randomization``: the worlds of a task on a command line."""

from __future__ import annotations

import argparse
from typing import Any

from layouts import Layout
from robots import RobotDescriptor, TaskError
from robots.common.commands import notice
from robots.named import FORMS, is_path, named_robot
from tasks.language.needs import ACT, HOLD
from tasks.varying.randomization import Randomization


def add_cell_options(
    parser: argparse.ArgumentParser, *, robots: bool = True, varying: bool = True
) -> None:
    """Add the options of a command that say which robots stand where, and what varies.

    They are read by `chosen_cell`.

    Args:
        parser: The command's.
        robots: Whether to add ``--robots``, which some commands read themselves.
        varying: Whether to add ``--randomization``; recordings say themselves what varied.
    """
    add = parser.add_argument
    add("--layout", metavar="FILE", help="stand the robots as in this layout (.yaml)")
    if robots:
        add(
            "--robots",
            nargs="+",
            metavar="PLACE=ROBOT",
            help=f"put other robots in some places: left=ur5e.urdf right=xarm7; ROBOT: {FORMS}",
        )
    add(
        "--bystanders",
        choices=(HOLD, ACT),
        help="what robots without a place in the task do (without this, they are refused)",
    )
    if varying:
        add(
            "--randomization",
            metavar="FILE",
            help="let things vary from episode to episode: a tasks.Randomization in YAML or json",
        )


def chosen_cell(options: argparse.Namespace) -> dict[str, Any]:
    """Return the arguments of `tasks.make` that the options ask for; none if there are none.

    Raises:
        RobotLayoutsError: If a robot or layout cannot be had, or a word makes no sense.
    """
    chosen: dict[str, Any] = {}
    if options.robots:  # first, as the layout may hold robots of modules that these words name
        chosen["robots"] = chosen_robots(options.robots)
    if options.layout is not None:
        chosen["layout"] = Layout.load(options.layout)
    if options.bystanders is not None:
        chosen["bystanders"] = options.bystanders
    if getattr(options, "randomization", None) is not None:
        chosen["randomization"] = Randomization.load(options.randomization)
    return chosen


def chosen_robots(words: list[str]) -> RobotDescriptor | dict[str, RobotDescriptor]:
    """Return the robots of words such as ``left=panda``, or of one that names no place.

    Raises:
        TaskError: If a word is malformed, or a place is given twice.
        UnknownNameError: If there is no such robot.
        AssetError: If a URDF is unusable.
    """
    if len(words) == 1 and "=" not in words[0].partition("?")[0]:
        return _robot(words[0])
    robots: dict[str, RobotDescriptor] = {}
    known: dict[str, RobotDescriptor] = {}  # guessing one takes a while
    for word in words:
        place, equals, name = word.partition("=")
        if not (place and equals and name):
            raise TaskError(f"{word!r} should be PLACE=ROBOT, for example left=panda")
        if place in robots:
            raise TaskError(f"the place {place!r} is given twice")
        robots[place] = known[name] = known.get(name) or _robot(name)
    return robots


def _robot(name: str) -> RobotDescriptor:
    robot = named_robot(name)
    if is_path(name):
        command = f"robot-layouts robots guess {name}"
        notice(f"{robot.name}: guessed from {name}; `{command}` says what, and why")
    return robot
