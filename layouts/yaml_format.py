"""Layouts as YAML text: written so that reading gives the same layout, read with line numbers.

Only YAML's own strings, lists and mappings are read; nothing in a text is executed. What a word
means (a number, a name) is decided by the key it stands under, so that a robot may be called
``no``, and ``1e-3`` is a number.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields, replace
from os import PathLike
from pathlib import Path
from typing import Any, NoReturn

import yaml

from layouts.arrangement import Arrangement, check_name
from layouts.frames import Frame, HangingError, check_frame_names
from layouts.placement import Placement
from robot_layouts.core.files import read_text
from robot_layouts.core.yaml_text import compose
from robots import (
    LayoutError,
    RobotDescriptor,
    RobotLayoutsError,
    RobotRegistry,
    UnknownNameError,
    UnreadableFileError,
)
from robots.named import FORMS, robot_in_file

VERSION = 1
MAX_LENGTH = 1 << 20  # bytes of a file, characters of a text; 20,000 robots fit
MAX_WORD = 200  # characters
MAX_PATH = 4096  # characters of a robot's path
UNITS = "# positions in m; quaternion: w, x, y, z; rpy and qpos_noise in rad"

# Keys in the order in which they are written. Left-out keys keep the value of the declaration.
FRAME_KEYS = ("on", "position", "quaternion", "rpy")
ROBOT_KEYS = ("robot", *FRAME_KEYS, "keyframe", "qpos_noise", "control_mode", "qpos")

NUMBER = re.compile(r"[-+]?(?:(?:0|[1-9][0-9]*)(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
NOT_FINITE = re.compile(r"[-+]?\.?(?:inf|infinity|nan)", re.IGNORECASE)
PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_.]*")
RESERVED = ("true", "false", "yes", "no", "on", "off", "y", "n", "null")  # YAML 1.1 and 1.2
TAGS = tuple(f"tag:yaml.org,2002:{kind}" for kind in ("str", "seq", "map"))


def to_yaml(layout: Arrangement, word: Callable[[RobotDescriptor], str | None]) -> str:
    """Return a layout as YAML text that `from_yaml` turns into an equal layout.

    Args:
        layout: The layout.
        word: Returns what a robot goes by; see `robots.named.written_robot`.

    Raises:
        LayoutError: If a robot goes by nothing.
    """
    lines = [UNITS, f"version: {VERSION}"]
    if layout.frames:
        lines.append("frames:")
        for name, frame in layout.frames.items():
            lines += _entry(name, _values(frame, FRAME_KEYS))
    lines.append("robots:")
    for name, placement in layout.items():
        robot = word(placement.robot) or _refuse(name, placement.robot)
        lines += _entry(name, {"robot": robot, **_values(placement, ROBOT_KEYS[1:])})
    return "\n".join(lines) + "\n"


def from_yaml(
    text: str, source: str = "", folder: str | PathLike[str] | None = None
) -> Arrangement:
    """Return the layout that a YAML text describes.

    Args:
        text: The text.
        source: Where it comes from, for errors, such as a file's name.
        folder: What paths of robots are relative to; None is the present folder.

    Raises:
        LayoutError: If it describes none; the message names the line.
    """
    if not isinstance(text, str):
        raise LayoutError(
            f"a layout's YAML is {type(text).__name__}; it takes text (Layout.load reads files)"
        )
    if len(text) > MAX_LENGTH:
        raise LayoutError(f"a layout's YAML has {len(text):,} characters; {MAX_LENGTH:,} is most")
    return _Reader(source, Path(folder or "")).layout(text)


def read_layout(path: str | PathLike[str]) -> Arrangement:
    """Return the layout in a file; see `layouts.Layout.load`."""
    try:
        text = read_text(path, MAX_LENGTH)
    except UnreadableFileError as error:
        raise LayoutError(f"cannot read the layout {str(path)!r}: {error.strerror}") from error
    return from_yaml(text, str(path), Path(path).parent)


class _Reader:
    """Reads one text, and names its lines in errors."""

    def __init__(self, source: str, folder: Path) -> None:
        self.source, self.folder = source, folder

    def layout(self, text: str) -> Arrangement:
        root = self._compose(text)
        top = self._mapping(root, "a layout", ("version", "frames", "robots"))
        self._check_version(root, top)
        if "robots" not in top:
            self._fail(root, "a layout needs robots: the robot of each place, by name")
        robots = self._pairs(top["robots"][1], "robots")
        if not robots:
            self._fail(top["robots"][1], "a layout needs at least one robot")
        frames = self._pairs(top["frames"][1], "frames") if "frames" in top else {}
        for name, (key, _) in robots.items():
            with self._at(key):
                check_name(name)
        for name, (key, _) in frames.items():
            with self._at(key):
                check_frame_names({name: Frame()})
        placements = {name: self._placement(name, node) for name, (_, node) in robots.items()}
        try:
            return Arrangement(
                placements, {n: self._frame(n, node) for n, (_, node) in frames.items()}
            )
        except HangingError as error:
            key, node = robots.get(error.name) or frames[error.name]
            self._fail(next((v for k, v in node.value if k.value == "on"), key), str(error))

    def _compose(self, text: str) -> Any:
        try:
            root = compose(text)
        except ValueError as error:
            raise LayoutError(f"{self._where()}{error}") from None
        if root is None:
            raise LayoutError(f"{self._where()}this is empty; a layout has a version and robots")
        return root

    def _check_version(self, root: Any, top: Mapping[str, tuple[Any, Any]]) -> None:
        if "version" not in top:
            self._fail(root, f"a layout needs its schema version; add 'version: {VERSION}'")
        node = top["version"][1]
        version = self._scalar(node, "version")
        if version != str(VERSION):
            self._fail(node, f"version is {version!r}; this library reads version {VERSION}")

    def _frame(self, name: str, node: Any) -> Frame:
        entries = self._mapping(node, f"frame {name!r}", FRAME_KEYS)
        return self._filled(Frame(), entries)

    def _placement(self, name: str, node: Any) -> Placement:
        entries = self._mapping(node, f"robot {name!r}", ROBOT_KEYS)
        if "robot" not in entries:
            self._fail(node, f"{name!r} needs 'robot': {FORMS}")
        robot = entries.pop("robot")[1]
        word = self._word(robot, "robot", MAX_PATH)
        with self._at(robot):
            placement = Placement(robot_in_file(word, name, self.folder))
        return self._filled(placement, entries)

    def _filled(self, declared: Any, entries: Mapping[str, tuple[Any, Any]]) -> Any:
        """Set one value after the other, so that each one's error has its line."""
        readers: Mapping[str, Callable[[Any, str], object]] = {
            "on": self._word,
            "keyframe": self._word,
            "qpos_noise": self._number,
            "control_mode": self._word,
        }
        for key, (_, node) in entries.items():
            value = readers.get(key, self._numbers)(node, key)
            with self._at(node):
                declared = replace(declared, **{key: value})
        return declared

    def _mapping(self, node: Any, what: str, keys: Sequence[str]) -> dict[str, tuple[Any, Any]]:
        """Return the key and value nodes of a mapping that may have certain keys."""
        pairs = self._pairs(node, what)
        for name, (key, _) in pairs.items():
            if name not in keys:
                self._fail(key, f"{what} has an {UnknownNameError('key', name, keys)}")
        return pairs

    def _pairs(self, node: Any, what: str) -> dict[str, tuple[Any, Any]]:
        self._expect_no_tag(node)
        if not isinstance(node, yaml.MappingNode):
            self._fail(node, f"{what} is {_kind(node)}; a mapping (key: value) is needed")
        pairs: dict[str, tuple[Any, Any]] = {}
        for key, value in node.value:
            name = self._scalar(key, f"a key of {what}")
            if name in pairs:
                first = pairs[name][0].start_mark.line + 1
                self._fail(key, f"{name!r} is given twice; the first is in line {first}")
            pairs[name] = (key, value)
        return pairs

    def _numbers(self, node: Any, what: str) -> tuple[float, ...]:
        self._expect_no_tag(node)
        if not isinstance(node, yaml.SequenceNode):
            self._fail(node, f"{what} is {_kind(node)}; a list of numbers is needed: [0, 0, 0]")
        return tuple(self._number(item, what) for item in node.value)

    def _number(self, node: Any, what: str) -> float:
        text = self._scalar(node, what)
        plain = node.style is None
        if plain and NOT_FINITE.fullmatch(text):
            self._fail(node, f"{what} has {text}; a finite number is needed")
        if not (plain and NUMBER.fullmatch(text)):
            self._fail(node, f"{what} has {text!r}; a number is needed")
        if not math.isfinite(float(text)):
            self._fail(node, f"{what} has {text}, which is too large; a finite number is needed")
        return float(text)

    def _word(self, node: Any, what: str, most: int = MAX_WORD) -> str:
        text = self._scalar(node, what, most)
        if node.style is None and (
            not text or NUMBER.fullmatch(text) or text.lower() in ("null", "~", "true", "false")
        ):
            self._fail(node, f"{what} is {text or 'empty'}; a name is needed (or leave it out)")
        return text

    def _scalar(self, node: Any, what: str, most: int = MAX_WORD) -> str:
        self._expect_no_tag(node)
        if not isinstance(node, yaml.ScalarNode):
            self._fail(node, f"{what} is {_kind(node)}; a single word or number is needed")
        if len(node.value) > most:
            self._fail(node, f"{what} has {len(node.value):,} characters; {most:,} is most")
        return node.value

    def _expect_no_tag(self, node: Any) -> None:
        if node.tag not in TAGS:
            self._fail(
                node, f"the tag {node.tag[:MAX_WORD]!r} is not allowed in a layout; leave it out"
            )

    @contextmanager
    def _at(self, node: Any) -> Generator[None, None, None]:
        """Name a node's line in every error of this library."""
        try:
            yield
        except RobotLayoutsError as error:
            self._fail(node, str(error))

    def _fail(self, node: Any, problem: str) -> NoReturn:
        line = node.start_mark.line + 1
        raise LayoutError(f"{self._where()}line {line}: {problem}") from None

    def _where(self) -> str:
        return f"{self.source}, " if self.source else ""


def _kind(node: Any) -> str:
    if isinstance(node, yaml.MappingNode):
        return "a mapping"
    if isinstance(node, yaml.SequenceNode):
        return "a list"
    return repr(node.value[:MAX_WORD]) if node.value else "empty"


def _refuse(place: str, robot: RobotDescriptor) -> NoReturn:
    """Say what a robot lacks that no word brings back."""
    how = f"YAML holds robots by {FORMS}"
    if robot.name not in RobotRegistry.names():
        raise LayoutError(
            f"the robot {robot.name!r} of {place!r} is not registered, nor what is guessed from"
            f" its file; {how}: give the layout MODULE:NAME, or call"
            " RobotRegistry.register(descriptor) here and where the text is read"
        )
    raise LayoutError(
        f"the robot of {place!r} differs from the registered {robot.name!r}; {how}: give the layout"
        " MODULE:NAME, or register it under a name of its own, made with"
        " dataclasses.replace(descriptor, name=...)"
    )


def _values(declared: Any, keys: Sequence[str]) -> dict[str, Any]:
    """Return what a declaration says beyond its defaults, by key."""
    defaults = {field.name: field.default for field in fields(declared)}
    values = {key: getattr(declared, key) for key in keys}
    return {key: value for key, value in values.items() if value != defaults[key]}


def _entry(name: str, values: Mapping[str, Any]) -> list[str]:
    if not values:
        return [f"  {_text(name)}: {{}}"]
    return [f"  {_text(name)}:", *(f"    {key}: {_text(value)}" for key, value in values.items())]


def _text(value: Any) -> str:
    """Write a number, a list of numbers or a word so that it reads as the same one."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_text, value))}]"
    if isinstance(value, (int, float)):
        digits, e, exponent = repr(float(value)).partition("e")
        point = "" if "." in digits else ".0"  # without one, YAML 1.1 reads a word
        return f"{digits}{point}{e}{exponent}"
    if PLAIN.fullmatch(value) and value.lower() not in RESERVED:
        return value
    return f'"{"".join(map(_escaped, value))}"'


def _escaped(character: str) -> str:
    if character in '"\\':
        return f"\\{character}"
    if " " <= character <= "~":
        return character
    return f"\\U{ord(character):08x}"
