"""``robot-layouts layouts``: shows, validates, searches, views or exports a layout."""

from __future__ import annotations

import argparse
import inspect
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from layouts.export_command import add_export_options
from layouts.frames import EDGES
from layouts.layout import Layout
from layouts.maniskill import TASKS, from_maniskill
from layouts.presets import FACING, PRESETS
from layouts.search_command import add_search_options
from layouts.validate_command import add_check_options
from layouts.view_command import add_view_options
from robots import LayoutError, UnknownNameError
from robots.common.bounds import shown
from robots.common.commands import start
from robots.common.console import add_command, main_of
from robots.named import FORMS, named_robot

# What presets take besides the robots.
OPTIONS = ("spacing", "radius", "facing", "columns", "edges", "table", "inset", "keyframe")


def add_layout_words(parser: argparse.ArgumentParser) -> None:
    """Add the words and options that say which layout a command is about; see `chosen_layout`."""
    parser.add_argument(
        "what",
        metavar="WHAT",
        help=f"a layout's file (.yaml), a preset ({', '.join(PRESETS)}), or the id of one of"
        " ManiSkill's tasks",
    )
    parser.add_argument(
        "robots",
        nargs="*",
        metavar="NAME=ROBOT",
        help=f"of a preset, in action order; of others, robots for some places; ROBOT: {FORMS}",
    )
    for name, help_text in (
        ("--spacing", "distance between neighbouring bases (m)"),
        ("--radius", "distance of the bases from the middle (m)"),
        ("--inset", "distance of the bases from the table's edge (m)"),
    ):
        parser.add_argument(name, type=_distance, metavar="M|auto", help=help_text)
    parser.add_argument(
        "--facing", metavar="WAY", help=f"which way robots of a ring face: {', '.join(FACING)}"
    )
    parser.add_argument("--columns", type=int, metavar="N", help="robots in a row of a grid")
    parser.add_argument(
        "--edges", type=_words, metavar="EDGE,…", help=f"edge of each robot: {', '.join(EDGES)}"
    )
    parser.add_argument(
        "--table",
        type=float,
        nargs=2,
        metavar=("WIDTH", "DEPTH"),
        help="size of the table along x and y (m)",
    )
    parser.add_argument(
        "--keyframe", metavar="NAME", help="keyframe with the joint positions to start from"
    )


def chosen_layout(options: argparse.Namespace) -> Layout:
    """Return the layout that the words of `add_layout_words` are about.

    Raises:
        RobotLayoutsError: If there is none such.
    """
    values = {name: getattr(options, name) for name in OPTIONS}
    given = [f"--{name}" for name, value in values.items() if value is not None]
    if options.what in PRESETS:
        return build(options.what, options.robots, **values)
    if Path(options.what).suffix.lower() in (".yaml", ".yml"):
        read = Layout.load
    elif options.what in TASKS:
        read = from_maniskill
    else:
        raise UnknownNameError(
            "layout preset", options.what, [*PRESETS, *TASKS], "Or give a file ending in .yaml."
        )
    if given:
        raise LayoutError(f"{options.what} says where robots stand; it takes no {' '.join(given)}")
    robots = {name: named_robot(word) for name, word in named_robots(options.robots).items()}
    return read(options.what).replace_robots(**robots)  # which may be those that it cannot name


def build(preset: str, robots: Sequence[str], **options: Any) -> Layout:
    """Build a layout from the words of a command line.

    Args:
        preset: Name of a preset.
        robots: Words ``name=robot``, in action order.
        options: What the preset takes besides the robots; None if not given.

    Raises:
        UnknownNameError: If there is no such preset, robot or keyframe.
        LayoutError: If a word is malformed, or the preset lacks or does not take an option.
    """
    place = PRESETS[preset]
    given = {name: value for name, value in options.items() if value is not None}
    parameters = dict(inspect.signature(place).parameters)
    del parameters["robots"]
    for name in given:
        if name not in parameters:
            takes = ", ".join(f"--{parameter}" for parameter in parameters)
            raise LayoutError(f"{preset} takes no --{name}; it takes {takes}")
    for name, parameter in parameters.items():
        if parameter.default is parameter.empty and name not in given:
            raise LayoutError(f"{preset} needs --{name}")
    layout = place(named_robots(robots), **given)
    if not isinstance(layout, Layout):
        raise LayoutError(f"the preset {preset} returned {shown(layout)}; a Layout is needed")
    return layout


def named_robots(words: Sequence[str]) -> dict[str, str]:
    """Return robots by name from words ``name=robot``.

    Raises:
        LayoutError: If a word is malformed, or a name is given twice.
    """
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
    layout = chosen_layout(options)
    print(layout)
    if options.save is not None:
        print(f"layout: {layout.save(options.save)}")
    if options.preview is not None:
        print(f"picture: {layout.preview(options.preview)}")


def _distance(word: str) -> float | str:
    try:
        return word if word == "auto" else float(word)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{word!r} is no distance; it takes a number (m) or auto"
        ) from None


def _words(word: str) -> list[str]:
    return word.split(",")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    show = add_command(commands, "show", "print a layout as a table, and draw it if asked")
    add_layout_words(show)
    show.add_argument("--save", metavar="FILE", help="write the layout as YAML")
    show.add_argument("--preview", metavar="FILE", help="save a top view (.png, .pdf or .svg)")
    show.set_defaults(call=_show)
    check = add_command(commands, "validate", "check a layout for collisions and reach")
    add_layout_words(check)
    add_check_options(check, chosen_layout)
    search = add_command(commands, "search", "look for places from which robots reach targets")
    add_search_options(search, named_robots)
    view = add_command(commands, "view", "look at a layout in a browser, and move its joints")
    add_layout_words(view)
    add_view_options(view, chosen_layout)
    export = add_command(commands, "export", "write a layout for MuJoCo, USD, ROS 2, Drake …")
    add_layout_words(export)
    add_export_options(export, chosen_layout)


def run(options: argparse.Namespace) -> int | None:
    """Run the command that is chosen; returns its exit code, None for 0.

    Raises:
        RobotLayoutsError: If it makes no sense, or fails.
    """
    return options.call(options)


main = main_of("layouts")

if __name__ == "__main__":
    start(main)
