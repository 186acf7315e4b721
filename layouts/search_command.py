"""``python -m layouts search``: look for places on the command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from layouts.frames import Frame, ceiling, table
from layouts.placing import ReachedBy, search
from layouts.validate_command import add_target_option, read_targets
from robots import LayoutError
from robots.named import FORMS


def add_search_options(
    parser: argparse.ArgumentParser, named_robots: Callable[[Sequence[str]], dict[str, str]]
) -> None:
    """Add the words and options of ``search`` to its parser, and what it runs.

    Args:
        parser: The parser.
        named_robots: Returns robots by name from words ``name=robot``.
    """
    add = parser.add_argument
    add(
        "robots",
        nargs="+",
        metavar="NAME=ROBOT",
        help=f"robots in action order; ROBOT: {FORMS}",
    )
    add_target_option(parser)
    add(
        "--reached-by",
        action="append",
        default=[],
        metavar="[TARGET=]WHO",
        help="any (which it is by default), all, or names of robots or limbs, joined by commas,"
        " each of which must reach it; without TARGET, for all that are not named",
    )
    corners = ("X_MIN", "Y_MIN", "X_MAX", "Y_MAX")
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--table",
        type=float,
        nargs=2,
        metavar=("WIDTH", "DEPTH"),
        help="stand the bases along the edges of a table about the origin (m along x and y)",
    )
    where.add_argument(
        "--around",
        type=float,
        nargs=4,
        metavar=corners,
        help="stand the bases on the ground around an area (m)",
    )
    where.add_argument(
        "--ceiling", type=float, metavar="M", help="hang the bases at this height (m)"
    )
    add("--within", type=float, nargs=4, metavar=corners, help="area that bases stand in (m)")
    add(
        "--height",
        type=float,
        default=0.0,
        metavar="M",
        help="height of the bases above the ground (0)",
    )
    add("--keyframe", metavar="NAME", help="keyframe with the joint positions to start from")
    add("--clearance", type=float, metavar="M", help="least distance between robots (m)")
    add("--partial", action="store_true", help="leave out targets that cannot be reached")
    add("--seed", type=int, default=0, metavar="N", help="seed of the search (0)")
    add(
        "--tries",
        type=int,
        metavar="N",
        help="number of placements to begin from; more take longer",
    )
    add("--patience", type=float, metavar="S", help="time limit (s)")
    add("--out", metavar="FILE", help="write the layout as YAML")
    add("--picture", metavar="FILE", help="save a view (.png, .pdf or .svg)")
    parser.set_defaults(call=lambda options: _run(options, named_robots(options.robots)))


def _run(options: argparse.Namespace, robots: dict[str, str]) -> int:
    """Print the layout and its report; return 0 if all targets are reached, else 1."""
    targets = read_targets(options.target)
    chosen: dict[str, Any] = {
        name: value
        for name in ("clearance", "tries", "patience")
        if (value := getattr(options, name)) is not None
    }
    layout = search(
        robots,
        targets,
        around=_around(options),
        within=options.within,
        heights=options.height,
        reached_by=_reached_by(options.reached_by, targets),
        keyframe=options.keyframe,
        partial=options.partial,
        seed=options.seed,
        **chosen,
    )
    print(layout)
    report = layout.validate(targets=targets)
    print(report)
    if options.out is not None:
        print(f"layout: {layout.save(options.out)}")
    if options.picture is not None:
        print(f"picture: {report.picture(options.picture)}")
    return 0 if report.ok else 1


def _around(options: argparse.Namespace) -> dict[str, Frame] | list[float] | None:
    if options.table is not None:
        return table(*options.table)
    if options.ceiling is not None:
        return {"ceiling": ceiling(options.ceiling)}
    return options.around


def _reached_by(words: Sequence[str], targets: Iterable[str]) -> ReachedBy:
    """Return what `layouts.search` takes, from the words of ``--reached-by``.

    Raises:
        LayoutError: If a target, or what holds for all others, is given twice.
    """
    given: dict[str, str | list[str]] = {}
    for word in words:
        name, _, who = word.rpartition("=")
        if name in given:
            what = f"target {name!r}" if name else "all targets"
            raise LayoutError(f"--reached-by says twice who reaches {what}; say it once")
        given[name] = who.split(",") if "," in who else who
    others = given.pop("", "any")
    return {**dict.fromkeys(targets, others), **given}
