"""Writes the data module that declares a descriptor, as a person would."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from robots.action_split import ActionSplit, names
from robots.descriptor import RobotDescriptor

WIDTH = 100
_HOMES = {
    "LocalMjcf": "robots.mjcf.locator",
    "LocalUrdf": "robots.assets.locator",
    "Path": "pathlib",
    "RobotRegistry": "robots",
    "UrdfLocator": "robots.assets.locator",
}


def write_module(
    robot: RobotDescriptor, reasons: Sequence[str] = (), also: Iterable[str] = ()
) -> str:
    """Return Python source that declares a descriptor; running it gives an equal one.

    Args:
        robot: The descriptor. A relative `Path` in it is one from the module's folder.
        reasons: Remarks to leave above it, one sentence each.
        also: Further names of this library to import.
    """
    used = set(also)
    body = _write(robot, used, 0, len(robot.name) + 3)
    imports = "\n".join(
        _import(module, sorted({name for name in used if _home(name) == module}))
        for module in sorted({_home(name) for name in used} - {"pathlib"})
    )
    if "Path" in used:
        imports = f"from pathlib import Path\n\n{imports}"
    title = f'"""{robot.name}: {robot.summary}."""'
    remarks = [
        textwrap.fill(reason, WIDTH, initial_indent="# ", subsequent_indent="#   ")
        for reason in reasons
    ]
    return "\n".join([title, "", imports, "", *remarks, f"{robot.name.upper()} = {body}", ""])


def _home(name: str) -> str:
    return _HOMES.get(name, "robots.descriptor")


def _import(module: str, used: list[str]) -> str:
    line = f"from {module} import {', '.join(used)}"
    if len(line) <= WIDTH:
        return line
    return f"from {module} import (\n" + "".join(f"    {name},\n" for name in used) + ")"


def _write(value: Any, used: set[str], indent: int, before: int) -> str:
    """Return the source of a value: on one line if that fits, else one part a line.

    Args:
        value: The value.
        used: Takes the names that the source uses.
        indent: Of the line that the value begins in (characters).
        before: Characters in that line before the value, without the indent.
    """
    opening, parts, closing = _parts(value, used)
    flat = opening + ", ".join(
        f"{label}{_write(part, used, 0, -(10**6))}" for label, part in parts
    ) + ("," if opening == "(" and len(parts) == 1 else "") + closing  # fmt: skip
    if not parts or indent + before + len(flat) + 1 <= WIDTH:
        return flat
    inner = " " * (indent + 4)
    lines = [
        f"{inner}{label}{_write(part, used, indent + 4, len(label))},\n" for label, part in parts
    ]
    return f"{opening}\n{''.join(lines)}{' ' * indent}{closing}"


def _parts(value: Any, used: set[str]) -> tuple[str, list[tuple[str, Any]], str]:
    """Return what opens a value's source, its labelled parts, and what closes it."""
    if isinstance(value, ActionSplit):
        used.add("ActionSplit")
        return "ActionSplit(", [(f"{name}=", group) for name, group in value.groups.items()], ")"
    if is_dataclass(value) and not isinstance(value, type):
        used.add(type(value).__name__)
        return f"{type(value).__name__}(", _arguments(value), ")"
    if isinstance(value, Mapping):
        return "{", [(f"{_quote(key)}: ", part) for key, part in value.items()], "}"
    if isinstance(value, tuple):
        run = _run(value)
        if run is not None:
            used.add("names")
            return f"names({_quote(run[0])}, {run[1]}, {run[2]})", [], ""
        return "(", [("", part) for part in value], ")"
    if isinstance(value, str):
        return _quote(value), [], ""
    if isinstance(value, Path) and not value.is_absolute():
        used.add("Path")
        return f"Path(__file__).parent / {_quote(value.as_posix())}", [], ""
    if isinstance(value, PathLike):
        return _quote(fspath(value)), [], ""
    return repr(value), [], ""


def _arguments(value: Any) -> list[tuple[str, Any]]:
    """Return the arguments that a dataclass's value needs: those that are not its defaults."""
    needed: list[tuple[str, Any]] = []
    for field in fields(value):
        given = getattr(value, field.name)
        if field.default is not MISSING and field.default == given:
            continue
        if field.default_factory is not MISSING and field.default_factory() == given:
            continue
        needed.append((f"{field.name}=", given))
    return needed


def _run(value: tuple[Any, ...]) -> tuple[str, int, int] | None:
    """Return prefix, first and last number of names that are numbered without a gap."""
    if len(value) < 3 or not all(isinstance(part, str) for part in value):
        return None
    match = re.fullmatch(r"(.*?)(\d+)", value[0])
    if match is None:
        return None
    prefix, first = match[1], int(match[2])
    last = first + len(value) - 1
    return (prefix, first, last) if names(prefix, first, last) == value else None


def _quote(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{"".join(map(_printable, escaped))}"'


def _printable(character: str) -> str:
    if character.isprintable():
        return character
    return character.encode("unicode_escape").decode()
