"""The declaration of what varies from episode to episode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from os import PathLike
from pathlib import Path
from typing import Any

from robot_layouts.core.bounds import shown
from robots import RobotLayoutsError, TaskError, UnknownNameError
from tasks.varying.axes import AXES, Shift
from tasks.varying.distractors import Distractors
from tasks.varying.distributions import Distribution
from tasks.varying.files import read_data, write_data
from tasks.varying.looks import CameraShift, Light, Surface, Texture


def _by_name() -> Any:
    return field(default_factory=dict[str, Any])


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
        action_noise: Added to the action numbers of a robot, or of a joint group, anew at every
            step, in the unit of the numbers.
        action_delay: After how many control steps actions arrive; until the first does, joints
            are held where they are.
        sensor_noise: Added to the numbers of named parts of the observation, anew at every step:
            ``"left.qpos"``, ``"*_pose"``. Images, reward and success are spared.
        observation_delay: How many control steps old observations are; until there is one that
            old, the episode's first.
        cameras: How cameras that observe are off their places: the task's own (``"base_camera"``)
            and those of robots (``"left.hand_camera"``).
        lights: How the lights ``"side"``, ``"top"`` and ``"ambient"`` differ from their own.
        colors: What a body, a robot or a link is painted with.
        textures: Which pattern covers a body; the colour of one that has both is the pattern's.
        distractors: Bodies that have nothing to do with the task; see `Distractors`.
    """

    mass: Mapping[str, Distribution] = _by_name()
    friction: Mapping[str, Distribution] = _by_name()
    size: Mapping[str, Distribution] = _by_name()
    stiffness: Mapping[str, Distribution] = _by_name()
    damping: Mapping[str, Distribution] = _by_name()
    joint_friction: Mapping[str, Distribution] = _by_name()
    gravity: Distribution | None = None
    bases: Mapping[str, Shift] = _by_name()
    action_noise: Mapping[str, Distribution] = _by_name()
    action_delay: Distribution | None = None
    sensor_noise: Mapping[str, Distribution] = _by_name()
    observation_delay: Distribution | None = None
    cameras: Mapping[str, CameraShift] = _by_name()
    lights: Mapping[str, Light] = _by_name()
    colors: Mapping[str, Surface] = _by_name()
    textures: Mapping[str, Texture] = _by_name()
    distractors: Distractors | None = None

    def __post_init__(self) -> None:
        """Refuse what makes no sense.

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
            TaskError: If it makes no sense.
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
        write_data(path, self.to_json())
        return Path(path)

    def __str__(self) -> str:
        """Show a line for each thing that varies."""
        lines: list[str] = []
        for name, value in self.declared.items():
            named = value.items() if AXES[name].named else [("", value)]
            lines += [f"{' '.join(filter(None, (name, key)))}: {drawn}" for key, drawn in named]
        return "\n".join(lines) or "nothing varies"


assert {field.name for field in fields(Randomization)} == AXES.keys()
