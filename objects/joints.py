"""Joints of things: parts that slide or turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot, inf
from typing import Annotated, Literal

from objects.shapes import Coordinate, Place, Shape, scaled
from robot_layouts.core.bounds import FAR, checked_number, expect_unit
from robot_layouts.core.errors import DescriptorError, UnknownNameError
from robot_layouts.core.schema import check_fields, within
from robot_layouts.kinematics.quaternions import forward
from robots.descriptor import Quaternion

Coefficient = Annotated[float, within(0.0, 1e6)]
Position = Annotated[float, within(-1e3, 1e3)]
_UNIT = 1e-6  # of the length of an axis


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A part of a thing that slides or turns.

    Everything is in the thing's own frame, as it is with all joints at zero. Positions are in m
    for a part that slides, in rad for one that turns by the right-hand rule.

    Attributes:
        name: Its name, which is also that of the part.
        kind: ``"slide"`` or ``"turn"``.
        parts: The shapes that move.
        axis: Along which the part slides, or about which it turns; of length 1.
        at: A point on that axis (m).
        lower: Where it stops; None if it turns without end, and then ``upper`` is None, too. SAPIEN
            keeps its position within 2π of zero.
        upper: Likewise.
        start: Where episodes begin with it.
        friction: Coefficient of dry friction, as that of a robot's joints.
        damping: N·s/m, or N·m·s/rad.
        stiffness: Of a spring that pulls it towards ``rest``: N/m, or N·m/rad.
        rest: Where that spring is slack.
        carrier: Joint whose part carries this one; None if the thing's body does.
        origin: Of the frame whose pose is that of the part (m); the thing's own unless it is given.
        axes: How the joint's frame is turned (wxyz), whose x axis is ``axis``; None leaves the
            other two to the simulator. Physics depends on them in the last bits alone.
    """

    name: str
    kind: Literal["slide", "turn"]
    parts: tuple[Shape, ...]
    axis: tuple[Coordinate, Coordinate, Coordinate]
    at: Place = (0.0, 0.0, 0.0)
    lower: Position | None = 0.0
    upper: Position | None
    start: Position = 0.0
    friction: Coefficient = 0.0
    damping: Coefficient = 0.0
    stiffness: Coefficient = 0.0
    rest: Position = 0.0
    carrier: str | None = None
    origin: Place = (0.0, 0.0, 0.0)
    axes: Quaternion | None = None

    def __post_init__(self) -> None:
        """Refuse what no joint can be.

        Raises:
            DescriptorError: If a value is of a wrong type or out of bounds.
        """
        check_fields(self, DescriptorError)
        if not self.name.isidentifier():
            raise DescriptorError(
                f"joint name {self.name!r} must be a letter followed by letters, digits and _"
            )
        if abs(hypot(*self.axis) - 1) > _UNIT:
            raise DescriptorError(f"joint {self.name}: axis {self.axis} must be of length 1")
        self._check_stops()
        self._check_axes()
        self.check(self.start)
        if not any(part.collides for part in self.parts):
            raise DescriptorError(f"joint {self.name}: no part collides, so that it has no mass")

    def _check_stops(self) -> None:
        if self.lower is None and self.upper is None:
            if self.kind == "slide":
                raise DescriptorError(f"joint {self.name}: a part that slides must stop somewhere")
        elif self.lower is None or self.upper is None:
            raise DescriptorError(
                f"joint {self.name}: one of lower and upper is None; a part that turns without end"
                " stops at neither"
            )
        elif not self.lower < self.upper:
            raise DescriptorError(
                f"joint {self.name}: lower is {self.lower:g}, upper {self.upper:g}; the lower one"
                " must be the smaller"
            )

    def _check_axes(self) -> None:
        if self.axes is None:
            return
        what = f"joint {self.name}: axes"
        expect_unit(what, self.axes, DescriptorError)
        x = forward(self.axes)
        if max(abs(a - b) for a, b in zip(x, self.axis, strict=True)) > _UNIT:
            raise DescriptorError(f"{what} turns x to {x}; it must be the axis, {self.axis}")

    @property
    def is_endless(self) -> bool:
        """Whether it stops nowhere."""
        return self.lower is None

    @property
    def limits(self) -> tuple[float, float]:
        """Where it stops, the lower one first; infinite if it turns without end (m, rad)."""
        if self.lower is None or self.upper is None:
            return -inf, inf
        return self.lower, self.upper

    @property
    def own_parts(self) -> tuple[Shape, ...]:
        """The shapes that move, in the frame of the part instead of the thing's."""
        if not any(self.origin):
            return self.parts
        return tuple(
            replace(part, position=_difference(part.position, self.origin)) for part in self.parts
        )

    @property
    def unit(self) -> str:
        """Of its positions."""
        return "m" if self.kind == "slide" else "rad"

    def check(self, position: float) -> float:
        """Return a position that it can have.

        Raises:
            DescriptorError: If it cannot.
        """
        what = f"joint {self.name}"
        low, high = (min(max(end, -FAR), FAR) for end in self.limits)
        return checked_number(what, position, low, high, DescriptorError, self.unit)

    def scaled(self, factor: float) -> Joint:
        """Return it larger by a factor."""
        ends = {name: getattr(self, name) for name in ("lower", "upper", "start", "rest")}
        ends = {name: end for name, end in ends.items() if end is not None}
        longer = factor if self.kind == "slide" else 1.0
        return replace(
            self,
            parts=tuple(scaled(part, factor) for part in self.parts),
            at=_times(self.at, factor),
            origin=_times(self.origin, factor),
            **{name: end * longer for name, end in ends.items()},
        )


def _times(place: Place, factor: float) -> Place:
    x, y, z = place
    return x * factor, y * factor, z * factor


def _difference(one: Place, other: Place) -> Place:
    x, y, z = (a - b for a, b in zip(one, other, strict=True))
    return x, y, z


def checked_joints(owner: str, joints: Sequence[Joint]) -> tuple[Joint, ...]:
    """Return the joints of a thing, each after the one that carries it.

    Raises:
        DescriptorError: If two have the same name.
        UnknownNameError: If one is carried by none of those before it.
    """
    known = dict[str, Joint]()
    for joint in joints:
        if joint.name in known:
            raise DescriptorError(f"{owner}: two joints are called {joint.name!r}")
        if joint.carrier is not None and joint.carrier not in known:
            raise UnknownNameError(f"joint of {owner} before {joint.name!r}", joint.carrier, known)
        known[joint.name] = joint
    return tuple(known.values())
