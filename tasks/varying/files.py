"""Declarations as files: YAML or json, read as plain data; nothing in a file is executed."""

from __future__ import annotations

import json
from os import PathLike
from pathlib import Path
from typing import Any

import yaml

from robot_layouts.core.bounds import shown
from robot_layouts.core.files import read_text
from robot_layouts.core.writing import write_whole
from robot_layouts.core.yaml_text import WordLoader, compose
from robots import TaskError, UnreadableFileError

MAX_LENGTH = 1 << 18  # bytes
MAX_DEPTH = 16  # of mappings and lists inside one another


def read_data(path: str | PathLike[str], what: str = "randomization") -> Any:
    """Return what a file holds: mappings, lists, numbers and texts. Json is YAML, too.

    Args:
        path: The file.
        what: What it declares, for errors.

    Raises:
        TaskError: If it cannot be read or is no YAML; names the file, and the line if it can.
    """
    try:
        text = read_text(path, MAX_LENGTH)
    except UnreadableFileError as error:
        raise TaskError(f"cannot read the {what} {str(path)!r}: {error.strerror}") from error
    try:
        node = compose(text)
    except ValueError as error:
        raise TaskError(f"{path}, {error}") from error
    _check(text, path)
    return {} if node is None else _plain(node, str(path))


def write_data(path: str | PathLike[str], data: Any) -> None:
    """Write plain data to a file, whole or not at all: json if it ends in ``.json``, else YAML.

    Raises:
        UnwritableFileError: If it cannot be written.
    """
    if Path(path).suffix.lower() == ".json":
        text = json.dumps(data, indent=2) + "\n"
    else:
        text = yaml.safe_dump(data, sort_keys=False, default_flow_style=None, allow_unicode=True)
    write_whole(path, text)


def _check(text: str, path: str | PathLike[str]) -> None:
    """Refuse what plain data does not need."""
    depth = 0
    for event in yaml.parse(text, WordLoader):
        where = f"{path}, line {event.start_mark.line + 1}"
        if isinstance(event, yaml.AliasEvent):
            raise TaskError(f"{where}: aliases (*{event.anchor}) are not read")
        if tag := getattr(event, "tag", None):
            raise TaskError(f"{where}: tags ({shown(tag)}) are not read")
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > MAX_DEPTH:
            raise TaskError(f"{where}: it nests deeper than {MAX_DEPTH} levels")


def _plain(node: yaml.Node, path: str) -> Any:
    if isinstance(node, yaml.SequenceNode):
        return [_plain(inner, path) for inner in node.value]
    if not isinstance(node, yaml.MappingNode):
        quoted = node.style in ("'", '"')  # pyright: ignore[reportAttributeAccessIssue]
        return node.value if quoted else _number(node.value)
    found: dict[str, Any] = {}
    for key, value in node.value:
        name, line = key.value, key.start_mark.line + 1
        if not isinstance(name, str):
            raise TaskError(f"{path}, line {line}: a name must be a text")
        if name in found:
            raise TaskError(f"{path}, line {line}: {name!r} is there twice")
        found[name] = _plain(value, path)
    return found


def _number(word: str) -> Any:
    try:
        return float(word)
    except ValueError:
        return word
