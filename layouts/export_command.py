"""``python -m layouts export``: a layout for another program."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from layouts.layout import Layout

# Each format by the method that writes it, and by what ``--out`` is.
FORMATS: dict[str, tuple[Callable[..., Path], str]] = {
    "mjcf": (Layout.to_mjcf, "a model for MuJoCo (.xml)"),
    "usd": (Layout.to_usd, "a USD stage (.usd, .usda, .usdc)"),
    "ros2": (Layout.to_ros2, "a ROS 2 package with MoveIt's configuration (a folder)"),
    "urdf": (Layout.to_urdf, "one URDF (.urdf)"),
    "drake": (Layout.to_drake, "Drake's model directives (.dmd.yaml)"),
}


def add_export_options(
    parser: argparse.ArgumentParser, chosen_layout: Callable[[argparse.Namespace], Layout]
) -> None:
    """Add the options of ``export`` to its parser, and what it runs.

    Args:
        parser: A parser that has the words which say what layout is meant.
        chosen_layout: Returns that layout.
    """
    choices = "; ".join(f"{name}: {what}" for name, (_, what) in FORMATS.items())
    parser.add_argument("--format", required=True, choices=FORMATS, help=choices)
    parser.add_argument("--out", required=True, metavar="PATH", help="where to write it")
    parser.add_argument(
        "--no-visuals",
        dest="visuals",
        action="store_false",
        help="leave out what the robots look like, and fetch only what physics needs",
    )
    parser.set_defaults(call=lambda options: _run(options, chosen_layout(options)))


def _run(options: Any, layout: Layout) -> None:
    write, _ = FORMATS[options.format]
    print(f"{options.format}: {write(layout, options.out, visuals=options.visuals)}")
