"""What action numbers can ask of a joint group: positions, velocities, or poses of the TCP."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

FRAMES = (
    "root_translation:root_aligned_body_rotation",
    "body_translation:root_aligned_body_rotation",
    "root_translation:body_aligned_body_rotation",
    "body_translation:body_aligned_body_rotation",
)
"""ManiSkill's names of the frames that a relative TCP pose is in.

A translation is along the axes of the root or of the TCP, a rotation about them. Of what asks for
the TCP's position alone the first half counts.
"""

_PLACE = ("x", "y", "z")
_TURN = ("roll", "pitch", "yaw")


@dataclass(frozen=True)
class JointCommand:
    """What the action numbers of a joint group ask for.

    Attributes:
        positions: Whether there is a number for each joint's position.
        velocities: Whether there is one for each joint's velocity, after those.
        place: Whether there are three for the position of the TCP (m).
        turn: Whether there are three for its orientation: angles about x, y and z of the frame
            that is turned, in this order (rad).
        drive: Whether there are two for a base that rolls: its speed forward and that of its turn.
            Its joints slide along x and y and turn about z, in this order.
    """

    positions: bool = False
    velocities: bool = False
    place: bool = False
    turn: bool = False
    drive: bool = False

    @property
    def tcp(self) -> bool:
        """Whether the TCP is asked for, for which joint positions have to be found."""
        return self.place

    def numbers(self, joints: tuple[str, ...], unit: str) -> tuple[tuple[str, str], ...]:
        """Return what each number moves, and in which unit.

        Args:
            joints: Those of the group.
            unit: Of their positions: ``"rad"`` or ``"m"``.
        """
        named: list[tuple[str, str]] = []
        if self.positions:
            named += [(joint, unit) for joint in joints]
        if self.velocities:
            named += [(f"{joint}.velocity", f"{unit}/s") for joint in joints]
        if self.place:
            named += [(axis, "m") for axis in _PLACE]
        if self.turn:
            named += [(axis, "rad") for axis in _TURN]
        if self.drive:
            named += [("forward", "m/s"), ("turn", "rad/s")]
        return tuple(named)


COMMANDS: Mapping[str, JointCommand] = MappingProxyType(
    {
        "position": JointCommand(positions=True),
        "velocity": JointCommand(velocities=True),
        "position_velocity": JointCommand(positions=True, velocities=True),
        "tcp_position": JointCommand(place=True),
        "tcp_pose": JointCommand(place=True, turn=True),
        "base_velocity": JointCommand(drive=True),
    }
)
"""What a `robots.JointGroup` can be asked for, by name."""
