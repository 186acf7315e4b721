"""What a suite's file may include: layouts and randomizations, as files or written out."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from contextlib import suppress
from inspect import signature
from pathlib import Path
from typing import Any

import yaml

from layouts import Layout
from layouts.presets import PRESETS
from robots import LayoutError, TaskError, UnknownNameError
from robots.common.bounds import shown
from robots.named import robot_in_file
from tasks.varying.randomization import Randomization

OWN = "own"  # the task's own layout

_HOW = f"{OWN!r}, a file, a preset ({{preset: ring, robots: …}}), or frames and robots"
_LINE = re.compile(r"^line \d+: ")  # of a text that nobody has seen


def read_layout(value: Any, folder: Path) -> Layout | None:
    """Return the layout that a value describes; None for the task's own.

    Args:
        value: ``"own"``, a file, a preset's name with its arguments, or a layout written out.
        folder: What a file's name is relative to, and below which files are read.

    Raises:
        LayoutError: If it describes none.
        TaskError: If it is a file somewhere else.
        UnknownNameError: If a name in it is unknown.
    """
    if value == OWN:
        return None
    if isinstance(value, str):
        return Layout.load(_below(folder, value))
    if isinstance(value, Mapping) and "preset" in value:
        return _preset(value, folder)
    if isinstance(value, Mapping) and "robots" in value:
        return _written_out(value, folder)
    raise LayoutError(f"a layout is {shown(value)}; it takes {_HOW}")


def written_layout(layout: Layout, folder: Path) -> dict[str, Any]:
    """Return a layout written out, as `read_layout` reads it from a file in a folder.

    Raises:
        LayoutError: See `layouts.Layout.to_yaml`.
    """
    data = yaml.load(layout.to_yaml(folder), _Loader)
    del data["version"]
    return data


def read_randomization(value: Any, folder: Path) -> Randomization | None:
    """Return what varies: a file's, or what a mapping describes; None if it is None.

    Raises:
        TaskError: If it makes no sense.
        UnknownNameError: If there is no such axis.
    """
    if value is None:
        return None
    if isinstance(value, str):
        return Randomization.load(_below(folder, value))
    if not isinstance(value, Mapping):
        raise TaskError(f"randomization is {shown(value)}; it takes a file, or axes by name")
    return Randomization.from_json(value)


def _below(folder: Path, name: str) -> Path:
    """Return the path of a file below a folder; a suite of somebody else reads no other.

    Raises:
        TaskError: If it is not below it, links followed.
    """
    with suppress(ValueError):  # a name that no file has
        if Path(os.path.realpath(folder / name)).is_relative_to(os.path.realpath(folder)):
            return folder / name
    raise TaskError(
        f"{shown(name)} is no file below the suite's folder, and a suite includes no others; copy"
        " it there"
    )


class _Loader(yaml.SafeLoader):
    """Reads the numbers of `Layout.to_yaml`, and all else as texts."""

    yaml_implicit_resolvers = {
        first: [(tag, pattern) for tag, pattern in resolvers if tag.endswith(":float")]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }


def _written_out(value: Mapping[str, Any], folder: Path) -> Layout:
    text = yaml.safe_dump({**value, "version": 1}, sort_keys=False)
    try:
        return Layout.from_yaml(text, folder)
    except LayoutError as error:
        raise LayoutError(_LINE.sub("", str(error))) from error


def _preset(value: Mapping[str, Any], folder: Path) -> Layout:
    options = {key: _whole(given) for key, given in value.items() if key not in ("preset",)}
    if isinstance(robots := options.get("robots"), Mapping):
        options["robots"] = {
            place: robot_in_file(robot, place, folder) if isinstance(robot, str) else robot
            for place, robot in robots.items()
        }
    place = PRESETS[str(value["preset"])]
    takes = signature(place).parameters
    for name in options:
        if name not in takes:
            raise UnknownNameError(f"argument of {value['preset']}", name, takes)
    lacking = [name for name, one in takes.items() if one.default is one.empty]
    for name in lacking:
        if name not in options:
            raise LayoutError(f"{value['preset']} needs {name!r}")
    layout = place(**options)
    if not isinstance(layout, Layout):
        raise LayoutError(f"the preset {value['preset']} returned {shown(layout)}, no Layout")
    return layout


def _whole(value: Any) -> Any:
    """Return a whole number as one; a file's numbers are all read as floats."""
    return int(value) if isinstance(value, float) and value.is_integer() else value
