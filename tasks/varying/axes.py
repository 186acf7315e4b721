"""What can be varied: which numbers each axis takes, in which unit, and for what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, pi
from typing import Any, ClassVar

from robot_layouts.core.bounds import shown
from robots import TaskError
from tasks.varying.distractors import Distractors
from tasks.varying.distributions import Distribution
from tasks.varying.groups import Group, Limits
from tasks.varying.looks import CameraShift, Light, Surface, Texture


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
            TaskError: If it makes no sense.
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


@dataclass(frozen=True, kw_only=True)
class Shift(Group):
    """How a robot's base is off its placement, in the world or in what it hangs on.

    Attributes:
        x: Along x (m).
        y: Along y (m).
        z: Along z (m).
        yaw: Turn about z, at its own place (rad).
    """

    x: Distribution | None = None
    y: Distribution | None = None
    z: Distribution | None = None
    yaw: Distribution | None = None

    limits: ClassVar[Mapping[str, Limits]] = {
        **dict.fromkeys(("x", "y", "z"), Limits(-100.0, 100.0, "m")),
        "yaw": Limits(-2 * pi, 2 * pi, "rad"),
    }


_FACTOR = Limits(1e-3, 1e3, "factor on what is declared")
_COEFFICIENT = Limits(0.0, 1e3, "coefficient of friction")
_STEPS = Limits(0, 1000, "control steps", whole=True)
_NOISE = Limits(-inf, inf, "added to the number")

AXES = {
    "mass": Axis(_FACTOR),
    "friction": Axis(_COEFFICIENT),
    "size": Axis(Limits(0.01, 100.0, "factor on what is declared"), rebuilds=True),
    "stiffness": Axis(_FACTOR),
    "damping": Axis(_FACTOR),
    "joint_friction": Axis(_COEFFICIENT),
    "gravity": Axis(Limits(0.0, 1000.0, "m/s²"), named=False, rebuilds=True),
    "bases": Axis(Shift),
    "cameras": Axis(CameraShift),
    "lights": Axis(Light),
    "colors": Axis(Surface),
    "textures": Axis(Texture),
    "distractors": Axis(Distractors, named=False),
    "action_noise": Axis(_NOISE),
    "action_delay": Axis(_STEPS, named=False),
    "sensor_noise": Axis(_NOISE),
    "observation_delay": Axis(_STEPS, named=False),
}
"""Every axis by its field in `tasks.Randomization`, in the order in which they are shown."""
