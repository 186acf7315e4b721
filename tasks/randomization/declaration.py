"""The declaration of what varies from episode to episode: its axes, and the files that hold it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from math import inf, pi
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import yaml

from robot_layouts.core.bounds import shown
from robot_layouts.core.files import read_text
from robot_layouts.core.writing import write_whole
from robot_layouts.core.yaml_text import WordLoader, compose
from robots import RobotLayoutsError, TaskError, UnknownNameError, UnreadableFileError
from tasks.randomization.distractors import Distractors
from tasks.randomization.distributions import Distribution
from tasks.randomization.groups import Declared, Group, Limits
from tasks.randomization.looks import CameraShift, Light, Surface, Texture

SETTINGS = ("fixed", "spread", "varied")  # of tasks, from easy to hard
MAX_LENGTH = 1 << 18  # bytes of a file
MAX_DEPTH = 16  # of mappings and lists inside one another


@dataclass(frozen=True)
class Axis:
    """One way in which worlds vary.

    Attributes:
        takes: What is drawn: a number within limits, or a group of numbers.
        named: Whether it is declared for each of several things, by name.
        rebuilds: Whether a world must be built anew to change it.
    """

    takes: Limits | type[Group]
    named: bool = True
    rebuilds: bool = False

    def read(self, data: Any, what: str) -> Any:
        """Return what was declared for an axis, checked: one thing, or by name.

        Raises:
            TaskError: If it is invalid.
        """
        if not self.named:
            return None if data is None else self.takes.read(data, what)
        if not isinstance(data, Mapping):
            raise TaskError(
                f"{what} is {shown(data)}; it takes what is drawn by name, such as"
                f" {what}={{'cube': Uniform(0.5, 2)}}"
            )
        for name in data:
            if not isinstance(name, str) or not name:
                raise TaskError(f"{what} has the name {shown(name)}; names are texts")
        return {name: self.takes.read(given, f"{what} of {name!r}") for name, given in data.items()}


_Metres: TypeAlias = Annotated[Declared, Limits(-100.0, 100.0, "m")]


@dataclass(frozen=True, kw_only=True)
class Shift(Group):
    """How a robot's base is off its placement, in the world or in what it hangs on.

    Attributes:
        x: Along x (m).
        y: Along y (m).
        z: Along z (m).
        yaw: Turn about z, at its own place (rad).
    """

    x: _Metres = None
    y: _Metres = None
    z: _Metres = None
    yaw: Annotated[Declared, Limits(-2 * pi, 2 * pi, "rad")] = None


_FACTOR = Limits(1e-3, 1e3, "factor on what is declared")
_COEFFICIENT = Limits(0.0, 1e3, "coefficient of friction")
_STEPS = Limits(0, 1000, "control steps", whole=True)
_NOISE = Limits(-inf, inf, "added to the number")
_SIZE = Limits(0.01, 100.0, "factor on what is declared")
_SHARE = Limits(0.0, 1.0, "share of what is declared")
_GRAVITY = Limits(0.0, 1000.0, "m/s²")


def _axis(takes: Limits | type[Group], *, named: bool = True, rebuilds: bool = False) -> Any:
    """Return a field of `Randomization`; see `Axis`."""
    axis = {"axis": Axis(takes, named, rebuilds)}
    if named:
        return field(default_factory=dict[str, Any], metadata=axis)
    return field(default=None, metadata=axis)


@dataclass(frozen=True, kw_only=True)
class Randomization:
    """What varies from episode to episode, and from which distributions it is drawn.

    It is drawn at every reset from the episode's seed, in streams of its own: the task's draws stay
    what they are. Things go by name; in a name ``*`` stands for any letters, and of several names
    that mean the same thing the last one counts. Each thing that a name with ``*`` means gets a
    draw of its own.

    Attributes:
        mass: Factor on the mass and the inertia of a body (``"cube"``), of all links of a robot
            alike (``"left"``), or of one link (``"left.panda_hand"``).
        friction: Coefficient of friction, static and dynamic, of a body, all links of a robot
            alike, or one link. PhysX takes the mean of the two that touch.
        size: Factor on the size of a body, its lowest point staying where it is put; its mass
            follows with the third power. Rebuilds the world at every reset.
        stiffness: Factor on the stiffness of drives: of a robot, a joint group (``"left.arm"``)
            or a joint (``"left.panda_joint1"``).
        damping: Factor on their damping, likewise; joints have no other in PhysX.
        joint_friction: Friction coefficient of joints, likewise.
        gravity: Strength of gravity (m/s²), in the direction that the physics settings say.
            Rebuilds the world at every reset. The robots' own links do not feel it.
        bases: How far robots stand from their placements, by name, each a `Shift`.
        cameras: How cameras that observe are off their places: the task's own (``"base_camera"``)
            and those of robots (``"left.hand_camera"``).
        lights: How the lights ``"side"``, ``"top"`` and ``"ambient"`` differ from their own.
        colors: What a body, a robot or a link is painted with.
        textures: Which pattern covers a body; the colour of one that has both is the pattern's.
        distractors: Bodies that have nothing to do with the task; see `Distractors`.
        spread: Share of its area within which each body of the task begins, and of the angles by
            which it is turned: with 0 all begin in the middle.
        action_noise: Added to the action numbers of a robot, or of a joint group, anew at every
            step, in the unit of the numbers.
        action_delay: After how many control steps actions arrive; until the first does, joints
            are held where they are.
        sensor_noise: Added to the numbers of named parts of the observation, anew at every step:
            ``"left.qpos"``, ``"*_pose"``. Images, reward and success are spared.
        observation_delay: How many control steps old observations are; until there is one that
            old, the episode's first.
    """

    mass: Mapping[str, Distribution] = _axis(_FACTOR)
    friction: Mapping[str, Distribution] = _axis(_COEFFICIENT)
    size: Mapping[str, Distribution] = _axis(_SIZE, rebuilds=True)
    stiffness: Mapping[str, Distribution] = _axis(_FACTOR)
    damping: Mapping[str, Distribution] = _axis(_FACTOR)
    joint_friction: Mapping[str, Distribution] = _axis(_COEFFICIENT)
    gravity: Distribution | None = _axis(_GRAVITY, named=False, rebuilds=True)
    bases: Mapping[str, Shift] = _axis(Shift)
    cameras: Mapping[str, CameraShift] = _axis(CameraShift)
    lights: Mapping[str, Light] = _axis(Light)
    colors: Mapping[str, Surface] = _axis(Surface)
    textures: Mapping[str, Texture] = _axis(Texture)
    distractors: Distractors | None = _axis(Distractors, named=False)
    spread: Distribution | None = _axis(_SHARE, named=False)
    action_noise: Mapping[str, Distribution] = _axis(_NOISE)
    action_delay: Distribution | None = _axis(_STEPS, named=False)
    sensor_noise: Mapping[str, Distribution] = _axis(_NOISE)
    observation_delay: Distribution | None = _axis(_STEPS, named=False)

    def __post_init__(self) -> None:
        """Refuse invalid declarations.

        Raises:
            TaskError: If something is no distribution, or may draw what cannot be.
        """
        for name, axis in AXES.items():
            object.__setattr__(self, name, axis.read(getattr(self, name), name))

    def __bool__(self) -> bool:
        """Tell whether anything varies."""
        return bool(self.declared)

    @property
    def declared(self) -> dict[str, Any]:
        """What is declared of each axis that varies, by axis."""
        given = {name: getattr(self, name) for name in AXES}
        return {name: value for name, value in given.items() if value not in (None, {})}

    def to_json(self) -> dict[str, Any]:
        """Return it as plain data for a file; `from_json` returns an equal one."""
        return {
            name: {key: drawn.to_json() for key, drawn in value.items()}
            if AXES[name].named
            else value.to_json()
            for name, value in self.declared.items()
        }

    @classmethod
    def from_json(cls, data: Any) -> Randomization:
        """Return what plain data describes.

        Args:
            data: By axis, such as ``{"mass": {"cube": {"uniform": [0.5, 2.0]}}}``.

        Raises:
            TaskError: If it is invalid.
            UnknownNameError: If there is no such axis.
        """
        if not isinstance(data, Mapping):
            raise TaskError(f"a randomization is given by axis, a mapping; given: {shown(data)}")
        for name in data:
            if name not in AXES:
                raise UnknownNameError("axis of a randomization", name, AXES)
        return cls(**data)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Randomization:
        """Return the randomization in a file, YAML or json.

        Raises:
            TaskError: If the file cannot be read or describes none; the message names it.
        """
        data = read_data(path)
        try:
            return cls.from_json(data)
        except RobotLayoutsError as error:
            raise TaskError(f"{path}: {error}") from error

    def save(self, path: str | PathLike[str]) -> Path:
        """Write it to a file, whole or not at all, and return its path.

        Args:
            path: Where; json if it ends in ``.json``, else YAML.

        Raises:
            UnwritableFileError: If it cannot be written (also an ``OSError``).
        """
        if Path(path).suffix.lower() == ".json":
            text = json.dumps(self.to_json(), indent=2) + "\n"
        else:
            text = yaml.safe_dump(
                self.to_json(), sort_keys=False, default_flow_style=None, allow_unicode=True
            )
        write_whole(path, text)
        return Path(path)

    def __str__(self) -> str:
        """Show a line for each thing that varies."""
        lines: list[str] = []
        for name, value in self.declared.items():
            named = value.items() if AXES[name].named else [("", value)]
            lines += [f"{' '.join(filter(None, (name, key)))}: {drawn}" for key, drawn in named]
        return "\n".join(lines) or "nothing varies"


AXES: dict[str, Axis] = {axis.name: axis.metadata["axis"] for axis in fields(Randomization)}
"""Every axis by its field, in the order in which they are shown."""


# -- files: YAML or json, read as plain data; nothing in a file is executed ------------------------


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
