"""Suites as YAML files: read with all that they include, and written so that they need no other."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from inspect import signature
from os import PathLike
from pathlib import Path
from shlex import quote
from typing import Any

import yaml

from layouts import Layout
from layouts.presets import PRESETS
from robot_layouts.core.bounds import shown
from robot_layouts.core.writing import write_whole
from robot_layouts.data.suite.suite import Case, Suite, checked_name
from robots import LayoutError, RobotLayoutsError, TaskError, UnknownNameError
from robots.named import robot_in_file
from tasks import MultiRobotTask, get_task_class
from tasks.randomization.declaration import Randomization, read_data

SHIPPED = {"standard": Path(__file__).with_name("standard.yaml")}
"""Suites that come with the library, by name."""

SHARED = ("seeds", "control_mode", "obs_mode", "randomization")  # for all tasks, or for one
TOP = ("name", *SHARED, "policies", "tasks")
ENTRY = ("task", "name", *SHARED, "layout", "layouts")
OTHERS = "others"  # in a mapping of policies: every task that is not named
OWN = "own"  # the task's own layout

_HOW = f"{OWN!r}, a file, a preset ({{preset: ring, robots: …}}), or frames and robots"
_LINE = re.compile(r"^line \d+: ")  # of a text that is in no file


def load_suite(path: str | PathLike[str], *, import_tasks: bool = False) -> Suite:
    """Return a suite.

    Args:
        path: A YAML file, or the name of a suite that comes with the library: ``"standard"``.
        import_tasks: Whether to import the modules of the tasks that it names as ``module:Id``.
            Otherwise these have to be imported already, so that another person's file runs no
            code.

    Raises:
        UnknownNameError: If it is neither.
        TaskError: If the file cannot be read, describes no suite, or names a task whose module has
            not been imported; the message names the file.
    """
    file = SHIPPED.get(str(path), Path(path))
    if file.suffix.lower() not in (".yaml", ".yml"):
        raise UnknownNameError("suite", str(path), SHIPPED, "Or give a file ending in .yaml.")
    data = read_data(file, "suite")
    try:
        return _suite(data, file.parent, import_tasks)
    except RobotLayoutsError as error:
        raise TaskError(f"{file}: {error}") from error


def save_suite(suite: Suite, path: str | PathLike[str]) -> None:
    """Write a suite with all that it includes to one YAML file, whole or not at all.

    `load_suite` returns one of the same hash.

    Raises:
        UnwritableFileError: If it cannot be written (also an ``OSError``).
    """
    data: dict[str, Any] = {"name": suite.name}
    if suite.policies:
        data["policies"] = dict(suite.policies)
    data["tasks"] = [_entry(case, Path(path).parent) for case in suite.cases]
    text = yaml.safe_dump(data, sort_keys=False, default_flow_style=None, allow_unicode=True)
    write_whole(path, f"# suite {suite.id}\n{text}")


def _suite(data: Any, folder: Path, import_tasks: bool) -> Suite:
    top = _mapping(data, "a suite", TOP)
    name = checked_name("a suite", top.get("name"))
    entries = top.get("tasks")
    if not isinstance(entries, list) or not entries:
        raise TaskError(f"the suite {name} is empty; it needs 'tasks', a list of one or more")
    shared = {key: top[key] for key in SHARED if key in top}
    cases = [
        case
        for number, entry in enumerate(entries, 1)
        for case in _cases(entry, shared, folder, number, import_tasks)
    ]
    return Suite(name, tuple(cases), _policies(top.get("policies", {}), import_tasks))


def _policies(given: Any, import_tasks: bool) -> dict[str, str]:
    """Return who plays, as written; tasks are looked up when it is played."""
    found = _mapping(given, "policies")
    for task, policy in found.items():
        if not isinstance(policy, str):
            raise TaskError(f"the policy of {task} is {shown(policy)}; it must be MODULE:NAME")
        if task != OTHERS:
            _task_class(task, import_tasks)
    return dict(found)


def _task_class(name: str, import_tasks: bool) -> type[MultiRobotTask]:
    """Return the class of a task that a suite names; see `load_suite`."""
    module = name.rpartition(":")[0]
    if module and module not in sys.modules and not import_tasks:
        raise TaskError(
            f"nothing installed lists {name}, and a file does not choose which code runs; if you"
            f" trust its module, type: --task {quote(name)} (in Python, import it first)"
        )
    return get_task_class(name)


def _cases(
    entry: Any, shared: Mapping[str, Any], folder: Path, number: int, import_tasks: bool
) -> Sequence[Case]:
    """Return the cases of an entry: one for each of its layouts."""
    named = entry.get("task") if isinstance(entry, Mapping) else entry
    try:
        own = {"task": entry} if isinstance(entry, str) else _mapping(entry, "an entry", ENTRY)
        about = {**shared, **own}
        for key in ("task", "seeds"):
            if key not in about:
                raise TaskError(f"{key!r} is missing; it needs a task, and seeds unless all share")
        cls = _task_class(str(about["task"]), import_tasks)
        return [
            Case(
                about["task"],
                about["seeds"],
                name,
                read_layout(layout, folder),
                about.get("control_mode"),
                about.get("obs_mode", "state"),
                read_randomization(about.get("randomization"), folder),
            )
            for name, layout in _places(about, str(about.get("name") or cls.task_id))
        ]
    except RobotLayoutsError as error:
        which = f" ({named})" if isinstance(named, str) else ""
        raise TaskError(f"task {number}{which}: {error}") from error


def _places(about: Mapping[str, Any], name: str) -> list[tuple[str, Any]]:
    """Return the name and the layout of each case of an entry."""
    if "layouts" not in about:
        return [(name, about.get("layout", OWN))]
    if "layout" in about:
        raise TaskError("it has 'layout' and 'layouts'; the latter holds several, by name")
    several = _mapping(about["layouts"], "layouts")
    if not several:
        raise TaskError(f"layouts is empty; leave it out for the task's {OWN}")
    return [(name if key == OWN else f"{name}.{key}", value) for key, value in several.items()]


def _entry(case: Case, folder: Path) -> dict[str, Any]:
    """Return a case as an entry that includes everything."""
    about = {key: value for key, value in case.to_json().items() if value is not None}
    if case.layout is not None:
        about["layout"] = written_layout(case.layout, folder)
    return about


def _mapping(value: Any, what: str, keys: Sequence[str] | None = None) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise TaskError(f"{what} is {shown(value)}; it takes a mapping (key: value)")
    for key in value:
        if keys is not None and key not in keys:
            raise UnknownNameError(f"key of {what}", key, keys)
    return value


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
        try:
            text = yaml.safe_dump({**value, "version": 1}, sort_keys=False)
            return Layout.from_yaml(text, folder)
        except LayoutError as error:
            raise LayoutError(_LINE.sub("", str(error))) from error
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
        TaskError: If it is invalid.
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
    """Return the path of a file below a folder; another person's suite reads no other.

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


def _preset(value: Mapping[str, Any], folder: Path) -> Layout:
    preset = str(value["preset"])
    options = {
        # A file's numbers are all read as floats.
        key: int(given) if isinstance(given, float) and given.is_integer() else given
        for key, given in value.items()
        if key != "preset"
    }
    if isinstance(robots := options.get("robots"), Mapping):
        options["robots"] = {
            place: robot_in_file(robot, place, folder) if isinstance(robot, str) else robot
            for place, robot in robots.items()
        }
    place = PRESETS[preset]
    takes = signature(place).parameters
    for name in options:
        if name not in takes:
            raise UnknownNameError(f"argument of {preset}", name, takes)
    for name, one in takes.items():
        if one.default is one.empty and name not in options:
            raise LayoutError(f"{preset} needs {name!r}")
    layout = place(**options)
    if not isinstance(layout, Layout):
        raise LayoutError(f"the preset {preset} returned {shown(layout)}, no Layout")
    return layout
