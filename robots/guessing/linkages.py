"""Fingers whose joints hang on each other and are turned by one motor, as parallel jaws are.

In a linkage no joint moves alone: stopped by an object, jaws stay parallel. Joints that are driven
each to its own place do not; the outer ones go on, and the jaws splay. So the joints that carry the
fingers lead, and all others go where these are. Its motor's force and inertia are the linkage's,
whichever joint the motor turns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from robots.guessing.drives import (
    CONTROL_STEP,
    FORCE,
    FREQUENCY,
    STIFFEST_FINGER,
    Drive,
    Drives,
)
from robots.guessing.fingertips import Fingertips
from robots.urdf.model import ModelJoint

CLOSING = 8  # control steps that a hand takes from open to closed
LEAST = 1e-3  # m; of what counts as a tip's travel
PRESS = 30.0  # N, of a finger whose force nothing gives: about what ManiSkill's Panda presses with
SPARE = 2.0  # how much more than its share of the force a leader may take to keep the fingers even


@dataclass(frozen=True)
class Follower:
    """A joint that goes to multiplier · value + offset."""

    joint: ModelJoint
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Linkage:
    """What leads a linkage, and how its joints are driven.

    Attributes:
        leaders: Names of the joints that carry its fingers.
        lead: How far ahead of them the value may be (unit of the value).
        drives: Of each joint.
    """

    leaders: tuple[str, ...]
    lead: float
    drives: tuple[Drive, ...]


def find_linkage(
    followers: Sequence[Follower], span: tuple[float, float], tips: Fingertips, drives: Drives
) -> Linkage | None:
    """Return the linkage that joints are; None if in no finger one hangs on another.

    Args:
        followers: Joints that one value drives.
        span: The value's limits.
        tips: The tips of the fingers.
        drives: The drives of joints.
    """
    leaders = _leaders([follower.joint for follower in followers], tips)
    if not leaders:
        return None

    def apart(value: float) -> float:
        return tips.apart({f.joint.name: f.multiplier * value + f.offset for f in followers})

    (low, high), fingers = span, len(leaders)
    travel = abs(apart(high) - apart(low)) / (high - low)  # of a tip, by the value
    press = _press(followers, fingers, travel)
    moved = sum(f.multiplier**2 * drives.moved_by(f.joint) for f in followers) / fingers
    # A hand that closes within a control step hits what it takes; motors are not as fast.
    inertia = max(moved, press * travel * CONTROL_STEP**2 / (high - low))
    lead = (high - low) / CLOSING

    def drive(follower: Follower) -> Drive:
        joint, factor = follower.joint, abs(follower.multiplier)
        own = inertia / factor**2
        if joint.name not in leaders:
            return drives.geared(joint, own, own * FREQUENCY**2, FORCE)
        force = press * tips.lever(leaders[joint.name], joint)
        stiffness = min(force / (lead * factor), own * STIFFEST_FINGER**2)
        return drives.geared(joint, own, stiffness, SPARE * force, CONTROL_STEP)

    return Linkage(tuple(leaders), round(lead, 6), tuple(map(drive, followers)))


def _leaders(joints: Sequence[ModelJoint], tips: Fingertips) -> dict[str, str]:
    """Return the joints that carry fingers, and their last links, if a finger has several."""
    named = {joint.name for joint in joints}
    paths = {end: tips.stance.model.path_to(end) for end in tips.ends}
    ways = {end: [j.name for j in path if j.name in named] for end, path in paths.items()}
    if not any(len(way) > 1 for way in ways.values()):
        return {}
    return {way[0]: end for end, way in ways.items() if way}


def _press(followers: Sequence[Follower], fingers: int, travel: float) -> float:
    """Return the force with which each finger presses (N), by the motor's where it is given."""
    efforts = [abs(f.multiplier) * f.joint.effort for f in followers if f.joint.effort]
    return min(sum(efforts) / fingers / max(travel, LEAST), FORCE) if efforts else PRESS
