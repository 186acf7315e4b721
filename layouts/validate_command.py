"""``python -m layouts validate``: check a layout on the command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from layouts.layout import Layout
from robots import LayoutError


def add_check_options(
    parser: argparse.ArgumentParser, chosen_layout: Callable[[argparse.Namespace], Layout]
) -> None:
    """Add the options of ``validate`` to its parser, and what it runs.

    Args:
        parser: A parser that has the words which say what layout is meant.
        chosen_layout: Returns that layout.
    """
    add_target_option(parser)
    parser.add_argument(
        "--tabletop",
        type=float,
        nargs=4,
        metavar=("X_MIN", "Y_MIN", "X_MAX", "Y_MAX"),
        help="outline of a table with its top at z = 0 (m)",
    )
    parser.add_argument(
        "--samples", type=int, default=20, metavar="N", help="number of draws of joint noise (20)"
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="seed of the joint noise (0)"
    )
    parser.add_argument("--picture", metavar="FILE", help="save a view (.png, .pdf or .svg)")
    parser.set_defaults(call=lambda options: _run(options, chosen_layout(options)))


def add_target_option(parser: argparse.ArgumentParser) -> None:
    """Add ``--target``, which `read_targets` reads."""
    parser.add_argument(
        "--target",
        action="append",
        default=[],
        metavar="[NAME=]X,Y,Z",
        help="a place that some robot must reach (m); with four more numbers, the wxyz orientation"
        " of its TCP; may be given several times",
    )


def _run(options: argparse.Namespace, layout: Layout) -> int:
    """Print the report; return 0 if the layout is ok, else 1."""
    report = layout.validate(
        targets=read_targets(options.target),
        samples=options.samples,
        table=None if options.tabletop is None else tuple(options.tabletop),
        seed=options.seed,
    )
    print(report)
    if options.picture is not None:
        print(f"picture: {report.picture(options.picture)}")
    return 0 if report.ok else 1


def read_targets(words: list[str]) -> dict[str, tuple[float, ...]]:
    """Return targets by name from the words of ``--target``.

    Raises:
        LayoutError: If a word is malformed, or a name is given twice.
    """
    targets: dict[str, tuple[float, ...]] = {}
    for number, word in enumerate(words, start=1):
        name, _, place = word.rpartition("=")
        name = name or f"target {number}"
        if name in targets:
            raise LayoutError(f"target {name!r} is given twice; each needs its own name")
        try:
            targets[name] = tuple(float(x) for x in place.split(","))
        except ValueError:
            raise LayoutError(
                f"{word!r} should be name=x,y,z in metres, for example cube=0.4,0,0.1"
            ) from None
    return targets
