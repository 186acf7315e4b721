"""What is known of a robot before it is guessed from its URDF: from an MJCF, or an SRDF."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class DriveHint:
    """What is known of a joint's drive; None where nothing is.

    Attributes:
        stiffness: Of a drive to positions (N·m/rad or N/m).
        damping: Of it, with the joint's own (N·m·s/rad or N·s/m).
        armature: Inertia of motor and gear (kg·m² or kg).
    """

    stiffness: float | None = None
    damping: float | None = None
    armature: float | None = None


@dataclass(frozen=True)
class LimbHint:
    """An arm that is known.

    Attributes:
        name: What it is called; empty if nothing says.
        arm: Names of its joints that move.
        fingers: Names of its gripper's joints that move.
        tip: Link at its end; empty if it is not known.
        palm: Link that carries the gripper, or the last one; empty if it is not known.
    """

    name: str
    arm: tuple[str, ...]
    fingers: tuple[str, ...] = ()
    tip: str = ""
    palm: str = ""


@dataclass(frozen=True)
class Hints:
    """What is known of a robot; nothing, unless something is given.

    Attributes:
        source: What says so, such as ``"the MJCF"``.
        limbs: Its arms.
        postures: Named positions of joints, not always of all (rad, m).
        first_is_home: Whether the first of these is where the robot starts, whatever its name.
        allowed: Pairs of links that may overlap.
        drives: By joint.
        frames_at_joints: Whether the frames of fingers lie where these are hinged, not at tips.
        reasons: What was made of the source, one sentence each.
    """

    source: str = ""
    limbs: tuple[LimbHint, ...] = ()
    postures: Mapping[str, Mapping[str, float]] = field(
        default_factory=dict[str, Mapping[str, float]]
    )
    first_is_home: bool = False
    allowed: tuple[tuple[str, str], ...] = ()
    drives: Mapping[str, DriveHint] = field(default_factory=dict[str, DriveHint])
    frames_at_joints: bool = False
    reasons: tuple[str, ...] = ()


NOTHING = Hints()
