"""Layouts on the command line: ``python -m layouts show face_to_face left=panda right=panda``."""

from __future__ import annotations

import argparse
import inspect
import sys
from collections.abc import Sequence

from layouts.layout import Layout
from layouts.presets import PRESETS
from robots import LayoutError, RobotLayoutsError, RobotRegistry, UnknownNameError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        arguments: Words after ``python -m layouts``; by default those of this process.

    Returns:
        Exit status: 0 if all went well, 1 after an error that was printed.
    """
    options = _parser().parse_args(arguments)
    try:
        _show(options)
    except RobotLayoutsError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def build(preset: str, robots: Sequence[str], **options: float | str | None) -> Layout:
    """Build a layout from the words of a command line.

    Args:
        preset: Name of a preset.
        robots: Words ``name=robot``, in action order.
        options: What the preset takes besides the robots; None if not given.

    Raises:
        UnknownNameError: If there is no such preset, robot or keyframe.
        LayoutError: If a word is malformed, or the preset lacks or does not take an option.
    """
    if preset not in PRESETS:
        raise UnknownNameError("layout preset", preset, PRESETS)
    given = {name: value for name, value in options.items() if value is not None}
    parameters = dict(inspect.signature(PRESETS[preset]).parameters)
    del parameters["robots"]
    for name in given:
        if name not in parameters:
            takes = ", ".join(f"--{parameter}" for parameter in parameters)
            raise LayoutError(f"{preset} takes no --{name}; it takes {takes}")
    for name, parameter in parameters.items():
        if parameter.default is parameter.empty and name not in given:
            raise LayoutError(f"{preset} needs --{name}")
    return PRESETS[preset](_named_robots(robots), **given)


def _named_robots(words: Sequence[str]) -> dict[str, str]:
    robots: dict[str, str] = {}
    for word in words:
        name, equals, robot = word.partition("=")
        if not (name and equals and robot):
            raise LayoutError(f"{word!r} should be name=robot, for example left=panda")
        if name in robots:
            raise LayoutError(f"name {name!r} is given twice; each robot needs its own name")
        robots[name] = robot
    return robots


def _show(options: argparse.Namespace) -> None:
    layout = build(
        options.preset, options.robots, spacing=options.spacing, keyframe=options.keyframe
    )
    print(layout)
    if options.preview is not None:
        print(f"picture: {layout.preview(options.preview)}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m layouts", description="Say which robots stand where, and look at it."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    show = commands.add_parser("show", help="print a layout as a table, and draw it if asked")
    show.add_argument("preset", metavar="PRESET", help=", ".join(PRESETS))
    show.add_argument(
        "robots",
        nargs="+",
        metavar="NAME=ROBOT",
        help=f"in action order; robots: {', '.join(RobotRegistry.names())}",
    )
    show.add_argument("--spacing", type=float, metavar="M", help="distance between bases (m)")
    show.add_argument("--keyframe", metavar="NAME", help="joint positions to start from")
    show.add_argument("--preview", metavar="FILE", help="save a top view (.png, .pdf or .svg)")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
