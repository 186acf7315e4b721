"""What pictures, files and pages ask of a motion; `robot_layouts.motion.Motion` is one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from numpy.typing import ArrayLike

from layouts import Layout
from robot_layouts.kinematics.rotations import Floats


class TimedMotion(Protocol):
    """A motion; see `robot_layouts.motion.Motion`."""

    @property
    def layout(self) -> Layout:
        """The robots, and where they stand."""
        ...

    @property
    def times(self) -> Floats:
        """Of the knots, (T,) (s)."""
        ...

    @property
    def positions(self) -> Mapping[str, Floats]:
        """Joint positions there by robot, (T, dof) (rad, m)."""
        ...

    @property
    def velocities(self) -> Mapping[str, Floats]:
        """Joint velocities there by robot, (T, dof) (rad/s, m/s)."""
        ...

    @property
    def obstacles(self) -> tuple[Any, ...]:
        """What the robots were kept clear of."""
        ...

    @property
    def held(self) -> tuple[Any, ...]:
        """Bodies that they carry."""
        ...

    @property
    def table(self) -> tuple[float, float, float, float] | None:
        """Outline of a table, as x_min, y_min, x_max, y_max (m)."""
        ...

    @property
    def clearance(self) -> float:
        """How far the robots were asked to stay from everything (m)."""
        ...

    @property
    def largest_velocities(self) -> Mapping[str, Floats]:
        """What the joints may do by robot, (dof,) (rad/s, m/s)."""
        ...

    @property
    def largest_accelerations(self) -> Mapping[str, Floats]:
        """The same for accelerations, (dof,) (rad/s², m/s²)."""
        ...

    @property
    def duration(self) -> float:
        """How long it takes (s)."""
        ...

    def sample(self, times: ArrayLike) -> dict[str, Floats]:
        """Return joint positions by robot at some times (rad, m)."""
        ...

    def velocity(self, times: ArrayLike) -> dict[str, Floats]:
        """Return joint velocities by robot at some times (rad/s, m/s)."""
        ...
