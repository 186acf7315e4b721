"""``robot-layouts COMMAND``: every command of the library under one name.

``python -m tasks`` runs whatever is called ``tasks`` in the present folder. A console script looks
for this library first: the folder comes last, for the modules of tasks, experts and policies.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module, metadata
from typing import Any, NamedTuple, NoReturn

from robots.common.commands import MEANINGLESS, commands_spelt, print_error, start
from robots.common.errors import UnknownNameError

NAME = "robot-layouts"


class Command(NamedTuple):
    """A command of the console script.

    Attributes:
        module: What runs it, with ``main(words)``; ``python -m`` runs the same.
        about: What it does, in a few words.
        words: Passed before those of the command line.
    """

    module: str
    about: str
    words: tuple[str, ...] = ()


def _of_rollouts(**about: str) -> dict[str, Command]:
    return {name: Command("rollouts.__main__", text, (name,)) for name, text in about.items()}


COMMANDS: Mapping[str, Command] = {
    **_of_rollouts(
        demo="let an expert play a task, and keep recording, picture and video",
        record="let an expert play episodes in worker processes, and record them",
        replay="play a recording again, and compare what happens",
        certify="play every episode of a recording again, and certify that it is the same",
        evaluate="let a policy or an expert play, and tell how well it does",
        verify="play what a receipt is of again, and compare every bit",
        suite="play tasks × seeds × layouts of one file with receipts; report and verify that",
        convert="record a recording again in another control mode",
        report="write one page on a data set: counts, lengths, sources, what was varied, clips",
        export="write a recording as a dataset for LeRobot or robomimic",
        view="look at an episode of a recording in a browser",
        bench="measure what steps, resets, workers and recordings cost",
        soak="step all tasks for long; nothing may grow",
    ),
    "tasks": Command("tasks.__main__", "list tasks, describe one, or look at it"),
    "layouts": Command("layouts.__main__", "show, validate, export or look at a layout"),
    "motion": Command("motion.__main__", "plan motions that do not collide, and look at them"),
    "robots inspect": Command("robots.inspect", "joints, action numbers and files of robots"),
    "robots fetch": Command("robots.fetch_assets", "bring the files of robots here, or check them"),
    "robots guess": Command("robots.from_urdf", "guess a robot from its URDF"),
    "robots manifest": Command("robots.write_manifest", "list the files of the robots"),
    "robots survey": Command("measurements.robots.__main__", "guess many robots, and judge that"),
    "new task": Command("tasks.new_task", "write the file of a task, its expert and its test"),
    "new robot": Command(
        "robots.new_robot", "write the file of a robot from its URDF, and its test"
    ),
    "portable": Command("robots.portable", "begin a program, with the same bits on any processor"),
    "parity": Command("parity.__main__", "comparisons with native ManiSkill"),
}


def run() -> NoReturn:
    """Be the console script."""
    start(main)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Args:
        arguments: Words after ``robot-layouts``; by default those of this process.

    Returns:
        The command's exit code; 2 if there is no such command.
    """
    words = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    if words[0] in ("-h", "--help"):
        print(_usage(COMMANDS))
        return 0
    if words[0] == "--version":
        print(f"{NAME} {metadata.version(NAME)}")
        return 0
    for count in (2, 1):
        if command := COMMANDS.get(" ".join(words[:count])):
            return _run(command, words[count:])
    group = {name: command for name, command in COMMANDS.items() if name.startswith(f"{words[0]} ")}
    if group and (not words[1:] or words[1] in ("-h", "--help")):
        print(_usage(group))
        return 0
    print_error(UnknownNameError("command", " ".join(words[: 1 + bool(group)]), group or COMMANDS))
    return MEANINGLESS


def spellings() -> dict[str, str]:
    """Return how the console script calls the command of each module; see `commands_spelt`."""
    return {
        about.module.removesuffix(".__main__"): f"{NAME} {name}".removesuffix(
            f" {' '.join(about.words)}"
        )
        for name, about in COMMANDS.items()
    }


def _run(command: Command, words: Sequence[str]) -> int:
    with suppress(OSError):  # it may have been deleted
        if (folder := os.getcwd()) not in sys.path:
            sys.path.append(folder)
    module: Any = import_module(command.module)
    with commands_spelt(spellings()):
        return module.main([*command.words, *words])


def _usage(commands: Mapping[str, Command]) -> str:
    width = max(map(len, commands))
    lines = (f"  {name:<{width}}  {command.about}" for name, command in commands.items())
    return "\n".join([f"usage: {NAME} COMMAND ...\n", *lines])
