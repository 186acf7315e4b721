"""The joint groups of a hand: how many numbers drive it, and which way it opens.

In a linkage, as of parallel jaws, no joint moves alone: stopped by an object, the jaws stay
parallel. Joints that are driven each to its own place do not; the outer ones go on, and the jaws
splay. So the joints that carry the fingers lead, and all others go where these are. The force and
the inertia of its motor are the linkage's, whichever joint the motor turns.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots.action_split import JointGroup
from robots.bodies.hulls import Hull
from robots.bodies.overlaps import overlapping
from robots.guessing.anatomy import LimbJoints
from robots.guessing.drives import (
    CONTROL_STEP,
    FORCE,
    FREQUENCY,
    STIFFEST_FINGER,
    Drive,
    Drives,
    drive_fields,
)
from robots.guessing.fingertips import Fingertips
from robots.guessing.groups import by_steps, held_still, name_of
from robots.guessing.pinch import Pinch, find_pinch
from robots.guessing.stance import Stance, middle_of
from robots.urdf.model import ModelJoint

SQUEEZE = 0.01  # how far beyond closed a parallel gripper's target is (m)
SAME = 0.02  # of a range; how much two fingers' ranges may differ
OFF = 0.05  # of a joint's range; how far one with a number of its own stands off its stops
OPENINGS = (1.0, 0.75, 0.5, 0.25, 0.0)  # of the way, in which a hand may stand
MOST_JOINTS = 20  # of a hand whose fingers collide with each other
USUALLY = 0.5  # of `POSTURES`; links of a hand that overlap so often are one mechanism
POSTURES = 32  # random ones of a hand
NOTICEABLE = 1e-4  # m; how much opening changes the distance of the tips
CLOSING = 8  # control steps that a hand takes from open to closed
LEAST = 1e-3  # m; of what counts as a tip's travel
PRESS = 30.0  # N, of a finger whose force nothing gives: about what ManiSkill's Panda presses with
SPARE = 2.0  # how much more than its share of the force a leader may take to keep the fingers even


@dataclass(frozen=True)
class MimicJoint:
    """A joint that goes to multiplier · value + offset."""

    joint: ModelJoint
    multiplier: float
    offset: float

    def at(self, value: float) -> float:
        """Return where it goes (rad, m)."""
        return self.multiplier * value + self.offset


@dataclass(frozen=True)
class Gripper:
    """The groups of a hand.

    Attributes:
        groups: Joint groups by name.
        postures: Where its joints are, wide open first, then less and less (rad, m).
        reasons: One sentence each.
        pinch: How two fingers meet whose joints are driven each on its own; None of others.
    """

    groups: Mapping[str, JointGroup]
    postures: tuple[Mapping[str, float], ...]
    reasons: tuple[str, ...]
    pinch: Pinch | None = None

    @property
    def closing(self) -> tuple[Mapping[str, float], ...]:
        """Where its joints are as it closes, wide open first (rad, m)."""
        if self.pinch is None:
            return self.postures
        wide, shut = self.postures[0], self.pinch.joints
        return tuple(
            {**wide, **{j: part * wide[j] + (1 - part) * at for j, at in shut.items()}}
            for part in OPENINGS
        )


def find_gripper(limb: LimbJoints, tips: Fingertips, drives: Drives) -> Gripper:
    """Return the groups of a hand: one number for what moves together, else one for each leader.

    Args:
        limb: The limb that ends in the hand.
        tips: Its finger tips.
        drives: The drives of its joints.
    """
    name = name_of(limb, "gripper")
    followers = _followers(limb.fingers)
    leaders = [joint for joint in limb.fingers if joint.name in followers]
    if len(leaders) > 1:
        idle = [joint for joint in leaders if not _moves_a_tip(followers[joint.name], tips)]
        moving = [joint for joint in leaders if joint not in idle]
        if idle and moving:
            driven = _driven(limb, name, moving, followers, tips, drives)
            return _with_idle(name, idle, driven, drives)
    return _driven(limb, name, leaders, followers, tips, drives)


def _moves_a_tip(followers: Sequence[MimicJoint], tips: Fingertips) -> bool:
    own = {follower.joint.name for follower in followers}
    paths = (tips.stance.model.path_to(end) for end in tips.ends)
    return any(joint.name in own for path in paths for joint in path)


def _with_idle(name: str, idle: Sequence[ModelJoint], driven: Gripper, drives: Drives) -> Gripper:
    """Return a hand that also has joints which move no finger, such as a motor's shaft."""
    held = held_still(f"{name}_idle", idle, drives)
    reason = f"{name}, held still: {_listing(idle)}, by which no finger tip moves"
    groups, reasons = {**driven.groups, **held}, (*driven.reasons, reason)
    return replace(driven, groups=groups, reasons=reasons)


def _driven(
    limb: LimbJoints,
    name: str,
    leaders: Sequence[ModelJoint],
    followers: Mapping[str, list[MimicJoint]],
    tips: Fingertips,
    drives: Drives,
) -> Gripper:
    merged = _merged(leaders, followers, tips)
    if merged:
        reasons = [f"{name}: one number drives {_listing(leaders)}, as they move alike"]
        followers, leaders = {leaders[0].name: merged}, leaders[:1]
    else:
        reasons = []
    if len(leaders) > 1:
        return _many(name, leaders, followers, tips, drives)
    group, postures, about = _one(name, leaders[0], followers[leaders[0].name], tips, drives)
    mimics = [f"{j.name} follows {j.mimics}" for j in limb.fingers if j.mimics]
    if mimics:
        reasons.append(f"{name}, mimic joints, from the URDF: {', '.join(mimics)}")
    return Gripper({name: group}, postures, (*reasons, *about))


def entangled(
    stance: Stance,
    limb: LimbJoints,
    hulls: Sequence[Hull],
    pairs: Sequence[tuple[int, int]],
    gripper: Gripper,
    grasping: Sequence[str],
) -> list[tuple[str, str]]:
    """Return the pairs of links of a hand that overlap as it stands, which means nothing then.

    In a hand that one number drives, those that overlap while it is more open than closed, and of
    what does not grasp those that ever do: parts of one mechanism. In others, those that overlap
    in each of the hand's postures, or in half of its random ones; in hands of very many joints
    all, as physics tells only so many sets of links apart.

    Args:
        stance: The robot.
        limb: The limb that ends in the hand.
        hulls: The robot's hulls.
        pairs: Indices of hulls whose overlaps count.
        gripper: What drives the hand.
        grasping: The last link of each finger.
    """
    moved = (limb.palm, *(joint.child for joint in limb.fingers))
    inside = {stance.tree.link(link) for own in moved for link in stance.model.rigid_with(own)}
    mine = np.array([p for p in pairs if {hulls[i].link for i in p} <= inside], int).reshape(-1, 2)
    if len(limb.fingers) > MOST_JOINTS:
        return _names(stance, hulls, mine)
    overlaps = np.array(
        [
            overlapping(hulls, stance.poses(stance.with_joints(posture))[0], mine)
            for posture in gripper.postures
        ]
    )
    always = overlaps.all(axis=0)
    if sum(group.size for group in gripper.groups.values()) == 1:
        open_enough = overlaps[: len(OPENINGS) // 2 + 1].any(axis=0)
        ends = {stance.tree.link(link) for end in grasping for link in stance.model.rigid_with(end)}
        inner = np.array([not {hulls[i].link for i in pair} <= ends for pair in mine], bool)
        always = open_enough | (overlaps.any(axis=0) & inner)
    else:
        always |= _usually(stance, limb, hulls, mine)
    return _names(stance, hulls, mine[always])


def _usually(
    stance: Stance, limb: LimbJoints, hulls: Sequence[Hull], pairs: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """Tell which pairs of a hand's hulls overlap in half of its random postures, (pairs,)."""
    leaders = [joint for joint in limb.fingers if joint.name in stance.index]
    places = [stance.index[joint.name] for joint in leaders]
    low, high = np.array([joint.span for joint in leaders]).T
    drawn = np.tile(stance.middle, (POSTURES, 1))
    drawn[:, places] = np.random.default_rng(0).uniform(low, high, (POSTURES, len(places)))
    counts = sum(overlapping(hulls, poses, pairs).astype(int) for poses in stance.poses(drawn))
    return np.asarray(counts > USUALLY * POSTURES, bool)


def _names(stance: Stance, hulls: Sequence[Hull], pairs: NDArray[np.intp]) -> list[tuple[str, str]]:
    links = [stance.tree.links[hull.link] for hull in hulls]
    return list(dict.fromkeys((links[a], links[b]) for a, b in pairs))


def _followers(fingers: Sequence[ModelJoint]) -> dict[str, list[MimicJoint]]:
    """Return for each leading joint what follows it, itself first."""
    named = {joint.name: joint for joint in fingers}
    groups: dict[str, list[MimicJoint]] = {
        joint.name: [MimicJoint(joint, 1.0, 0.0)] for joint in fingers if joint.mimics not in named
    }
    for joint in fingers:
        if joint.name not in groups:
            multiplier, offset, at = 1.0, 0.0, joint
            while at.name not in groups:
                offset += multiplier * at.offset
                multiplier *= at.multiplier
                at = named[at.mimics or ""]
            groups[at.name].append(MimicJoint(joint, multiplier, offset))
    return groups


def _merged(
    leaders: Sequence[ModelJoint], followers: Mapping[str, Sequence[MimicJoint]], tips: Fingertips
) -> list[MimicJoint]:
    """Return what one number can drive, if the leaders are fingers that move alike or mirrored."""
    first = leaders[0]
    if len(leaders) < 2 or any(not _alike(first, joint) for joint in leaders[1:]):
        return []
    if any(len(followers[joint.name]) != len(followers[first.name]) for joint in leaders):
        return []
    if len({tips.finger_of(joint.child).name for joint in leaders}) < len(leaders):
        return []
    merged = list(followers[first.name])
    for joint in leaders[1:]:
        sign = _sense(first, joint, tips) if len(leaders) == 2 else 1.0
        low, _ = joint.span
        offset = low - first.span[0] if sign > 0 else low + first.span[1]
        merged += [
            MimicJoint(f.joint, f.multiplier * sign, f.multiplier * _tidy(offset) + f.offset)
            for f in followers[joint.name]
        ]
    return merged


def _alike(one: ModelJoint, other: ModelJoint) -> bool:
    ranges = [joint.span[1] - joint.span[0] for joint in (one, other)]
    return one.unit == other.unit and abs(ranges[0] - ranges[1]) <= SAME * max(ranges)


def _sense(first: ModelJoint, other: ModelJoint, tips: Fingertips) -> float:
    """Return whether a finger moves with (1) or against (-1) the first, so that both close."""
    if first.span == other.span and first.span[0] == 0.0:
        return 1.0
    (a, b), (c, d) = first.span, other.span

    def change(at: tuple[float, float]) -> float:
        ends = (tips.apart({first.name: f, other.name: o}) for f, o in zip((a, b), at, strict=True))
        low, high = ends
        return abs(high - low)

    return -1.0 if change((d, c)) > change((c, d)) + NOTICEABLE else 1.0


def _one(
    name: str,
    leader: ModelJoint,
    followers: Sequence[MimicJoint],
    tips: Fingertips,
    drives: Drives,
) -> tuple[JointGroup, tuple[dict[str, float], ...], tuple[str, ...]]:
    """Return the group that one number drives, where it is open, and the reasons.

    The number grows as the hand opens: where it opens towards the leader's lower limit, it counts
    from the upper one.
    """
    low, high = leader.span
    opens_down = _apart(tips, followers, low) > _apart(tips, followers, high) + NOTICEABLE
    if opens_down:
        flipped = [
            MimicJoint(f.joint, -f.multiplier, f.multiplier * high + f.offset) for f in followers
        ]
        followers, low, high = flipped, 0.0, high - low
    mimic = len(followers) > 1 or opens_down
    lower = _tidy(low - SQUEEZE if leader.unit == "m" else low)
    group = _group(followers, (lower, _tidy(high)), (low, high), tips, drives, mimic=mimic)
    postures = tuple(_led_to(followers, low + (high - low) * part) for part in OPENINGS)
    where = f"{leader.name} at {postures[0][leader.name]:g} {leader.unit}"
    reasons = [f"{name}: +1 opens it, with {where}, as the finger tips part there"]
    if group.leaders:
        led = " and ".join(group.leaders)
        reasons.append(f"{name}: a linkage, in which all joints go where {led} are")
    return group, postures, tuple(reasons)


def _group(
    followers: Sequence[MimicJoint],
    span: tuple[float, float],
    way: tuple[float, float],
    tips: Fingertips,
    drives: Drives,
    *,
    mimic: bool = True,
) -> JointGroup:
    """Return the group of joints that one value drives, within a span, and goes a way."""
    linkage = find_linkage(followers, way, tips, drives)
    made = linkage.drives if linkage else [drives.gripping(f.joint) for f in followers]
    ahead: dict[str, Any] = {"leaders": linkage.leaders, "lead": linkage.lead} if linkage else {}
    return JointGroup(
        tuple(f.joint.name for f in followers),
        lower=span[0],
        upper=span[1],
        mimic=mimic,
        multipliers=_unless(1.0, [f.multiplier for f in followers]) if mimic else (),
        offsets=_unless(0.0, [f.offset for f in followers]) if mimic else (),
        unit=followers[0].joint.unit,
        reset_noise=False,
        limits=tuple(f.joint.span for f in followers),
        **drive_fields(made),
        **ahead,
    )


def _apart(
    tips: Fingertips, followers: Sequence[MimicJoint], lead: float, ends: Iterable[str] = ()
) -> float:
    return tips.apart({f.joint.name: f.at(lead) for f in followers}, ends)


def _many(
    name: str,
    leaders: Sequence[ModelJoint],
    followers: Mapping[str, Sequence[MimicJoint]],
    tips: Fingertips,
    drives: Drives,
) -> Gripper:
    """Return the groups of a hand whose fingers move each on its own."""
    groups: dict[str, JointGroup] = {}
    alone = [joint for joint in leaders if len(followers[joint.name]) == 1]
    for unit, suffix in (("rad", ""), ("m", "_slide")):
        joints = [joint for joint in alone if joint.unit == unit]
        if joints:
            made = [drives.finger(joint) for joint in joints]
            groups[name + suffix] = by_steps(joints, made, reset_noise=False)
    for leader in leaders:
        led = followers[leader.name]
        if len(led) > 1:
            own = f"{name}_{re.sub('[^A-Za-z0-9]+', '_', leader.name).strip('_').lower()}"
            while own in groups:
                own += "_"
            groups[own] = _finger_group(led, leader, tips, drives)
    counts = f"{len(leaders)} numbers drive it, one for each joint that mimics none"
    postures = _alone(leaders, followers, middle_of)
    ends = tips.grasping()
    if ends and tips.solid and tips.contact(ends, tips.stance.with_joints(postures[0])) is not None:
        postures = _alone(leaders, followers, lambda joint: max(joint.span, key=abs))
    pinch = find_pinch(tips, postures, leaders)
    if pinch is not None:
        led = (_led_to(followers[joint], at) for joint, at in pinch.joints.items())
        pinch = replace(pinch, joints={joint: at for joints in led for joint, at in joints.items()})
    return Gripper(groups, postures, (f"{name}: {counts}",), pinch)


def _finger_group(
    followers: Sequence[MimicJoint], leader: ModelJoint, tips: Fingertips, drives: Drives
) -> JointGroup:
    """Return the group of a finger whose joints follow one, as firm as fingers with a joint each.

    A linkage's drives press as its motor does, which may be little beside a finger that is driven
    by the inertia of its joints: that one would push the other open.
    """
    group = _group(followers, leader.span, leader.span, tips, drives)
    firm = [drives.finger(follower.joint) for follower in followers]
    softest = float(np.min(group.stiffness))
    if min(drive.stiffness for drive in firm) <= softest:
        return group
    return replace(group, leaders=(), lead=0.0, **drive_fields(firm))


def _alone(
    leaders: Sequence[ModelJoint],
    followers: Mapping[str, Sequence[MimicJoint]],
    opened: Callable[[ModelJoint], float],
) -> tuple[dict[str, float], ...]:
    """Return where the joints of a hand are on their way from open to mid-range, off their stops.

    Args:
        leaders: Those that follow no other.
        followers: What follows each, itself first.
        opened: Where one is when the hand is open (rad, m).
    """
    postures: list[dict[str, float]] = []
    for part in OPENINGS:
        postures.append({})
        for joint in leaders:
            low, high = joint.span
            value = part * opened(joint) + (1 - part) * (low + high) / 2
            value = min(max(value, low + OFF * (high - low)), high - OFF * (high - low))
            postures[-1].update(_led_to(followers[joint.name], value))
    return tuple(postures)


def _led_to(followers: Sequence[MimicJoint], lead: float) -> dict[str, float]:
    """Return where joints go, each within its limits."""
    return {
        f.joint.name: min(max(_tidy(f.at(lead)), f.joint.span[0]), f.joint.span[1])
        for f in followers
    }


def _unless(default: float, numbers: Sequence[float]) -> tuple[float, ...]:
    tidy = tuple(_tidy(number) for number in numbers)
    return () if all(number == default for number in tidy) else tidy


def _tidy(value: float) -> float:
    """Return a number without the dust of sums, and without a negative zero."""
    return round(value, 9) + 0.0


def _listing(joints: Sequence[ModelJoint]) -> str:
    return " and ".join(joint.name for joint in joints)


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
    followers: Sequence[MimicJoint], span: tuple[float, float], tips: Fingertips, drives: Drives
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
    (low, high), fingers = span, len(leaders)
    ways = [_apart(tips, followers, lead, leaders.values()) for lead in span]
    travel = abs(ways[1] - ways[0]) / (high - low)
    press = _press(followers, fingers, travel)
    moved = sum(f.multiplier**2 * drives.moved_by(f.joint) for f in followers) / fingers
    # A hand that closes within a control step hits what it takes; motors are not as fast.
    inertia = max(moved, press * travel * CONTROL_STEP**2 / (high - low))
    lead = (high - low) / CLOSING

    def drive(follower: MimicJoint) -> Drive:
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


def _press(followers: Sequence[MimicJoint], fingers: int, travel: float) -> float:
    """Return the force with which each finger presses (N), by the motor's where it is given."""
    efforts = [abs(f.multiplier) * f.joint.effort for f in followers if f.joint.effort]
    return min(sum(efforts) / fingers / max(travel, LEAST), FORCE) if efforts else PRESS
