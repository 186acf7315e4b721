"""What is known of a robot before it is guessed from its URDF: from an MJCF, or an SRDF."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from robot_layouts.core.errors import DescriptorError, UnknownNameError
from robots.guessing import words
from robots.guessing.anatomy import FEWEST_ARM_JOINTS, Anatomy, LimbJoints
from robots.urdf.model import ModelJoint, UrdfModel
from robots.urdf.srdf import EndEffector, Semantics, SrdfGroup

LEFT_OUT = ("arm", "manipulator", "group")  # words that say nothing of which arm a group is


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
    """

    name: str
    arm: tuple[str, ...]
    fingers: tuple[str, ...] = ()
    tip: str = ""


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


def hints_of(semantics: Semantics, name: str) -> Hints:
    """Return the hints that an SRDF gives.

    Args:
        semantics: What it says.
        name: Its file's name, for reasons.
    """
    limbs = tuple(_limbs(semantics))
    listing = ", ".join(
        f"{hint.name} ({len(hint.arm)} joints, {len(hint.fingers)} of its gripper)"
        for hint in limbs
    )
    about = f"the arms are its groups {listing}" if limbs else "none of its groups is an arm"
    return Hints(
        source=name,
        limbs=limbs,
        postures=semantics.states,
        allowed=tuple(pair.links for pair in semantics.excluded),
        reasons=(f"{name}: {about}",),
    )


def known_anatomy(model: UrdfModel, found: Anatomy, hints: Hints) -> Anatomy:
    """Return a robot's parts with the arms that are known in the place of those that were found.

    Args:
        model: What its URDF describes.
        found: Its parts by structure and names.
        hints: What is known.
    """
    if not hints.limbs:
        return found
    joints = {joint.name: joint for joint in model.moving}
    limbs = tuple(_limb(hint, name, joints, model) for hint, name in _named(hints.limbs))
    taken = {joint.name for limb in limbs for joint in (*limb.arm, *limb.fingers)}
    parts = {part: _without(group, taken) for part, group in found.parts.items()}
    base = _without(found.base, taken)
    known = taken.union(*({j.name for j in group} for group in (base, *parts.values())))
    left = tuple(joint for joint in model.moving if joint.name not in known)
    parts["body"] = (*parts.get("body", ()), *left)
    reasons = [*hints.reasons]
    held = [joint.name for group in (base, *parts.values()) for joint in group]
    if held:
        reasons.append(f"held still: {', '.join(held)}, of no arm of {hints.source}")
    parts = {part: group for part, group in parts.items() if group}
    return Anatomy(base, tuple(sorted(limbs, key=lambda limb: limb.name)), parts, tuple(reasons))


def renamed(model: UrdfModel, found: Anatomy, names: Mapping[str, str]) -> Anatomy:
    """Return a robot's parts with limbs that are called otherwise; those left out are held still.

    Args:
        model: What its URDF describes.
        found: Its parts.
        names: What each limb was called, by its new name.

    Raises:
        UnknownNameError: If there is no such limb.
        DescriptorError: If a name is no word, or a limb is named twice.
    """
    limbs = {limb.name: limb for limb in found.limbs}
    for new, old in names.items():
        if old not in limbs:
            raise UnknownNameError("limb", old, limbs)
        if re.fullmatch("[A-Za-z0-9]+", new) is None:
            raise DescriptorError(f"limbs: {new!r} names no limb; it takes letters and digits")
    if len(set(names.values())) < len(names):
        raise DescriptorError(f"limbs={dict(names)} names a limb twice")
    kept = tuple(
        replace(limbs[old], name=new if len(names) > 1 else "") for new, old in names.items()
    )
    off = [limb for name, limb in limbs.items() if name not in names.values()]
    held = tuple(joint for limb in off for joint in (*limb.arm, *limb.fingers))
    body = tuple(j for j in model.moving if j in held or j in found.parts.get("body", ()))
    parts = {**found.parts, **({"body": body} if body else {})}
    reasons = [reason for reason in found.reasons if not reason.startswith("limbs: ")]
    if held:
        listing = ", ".join(joint.name for joint in held)
        reasons.append(f"held still: {listing}, as limbs={dict(names)} leaves them out")
    return Anatomy(found.base, kept, parts, tuple(reasons))


def known_tip(model: UrdfModel, limb: LimbJoints, hints: Hints) -> str:
    """Return the link that is known as a limb's end, if it lies beyond its palm; else nothing."""
    own = {joint.name for joint in limb.arm}
    tips = [hint.tip for hint in hints.limbs if own and own == set(hint.arm)]
    beyond = model.rigid_with(limb.palm)[0 if not limb.fingers else 1 :]
    return next((tip for tip in tips if tip in beyond), "")


def _limbs(semantics: Semantics) -> Iterator[LimbHint]:
    hands = {effector.group: effector for effector in semantics.end_effectors}
    carried = {_arm_of(effector, semantics): effector for effector in hands.values()}
    for group in semantics.groups.values():
        effector = carried.get(group.name)
        alone = not group.parts and len(group.joints) >= FEWEST_ARM_JOINTS
        whole = effector is not None or (alone and not _contains_another(group, semantics, hands))
        if group.name in hands or not group.joints or not whole:
            continue
        fingers = semantics.groups[effector.group].joints if effector else ()
        arm = tuple(joint for joint in group.joints if joint not in fingers)
        yield LimbHint(group.name, arm, fingers, group.tip)


def _arm_of(effector: EndEffector, semantics: Semantics) -> str:
    """Return the group that carries an end effector: as it says, or the smallest that may."""
    if effector.parent_group:
        return effector.parent_group
    hand = set(semantics.groups[effector.group].joints)
    arms = [
        group
        for group in semantics.groups.values()
        if group.name != effector.group
        and not group.parts
        and not hand & set(group.joints)
        and (group.tip in ("", effector.parent_link) and len(group.joints) > 1)
    ]
    return min(arms, key=lambda group: len(group.joints)).name if arms else ""


def _contains_another(group: SrdfGroup, semantics: Semantics, hands: Iterable[str]) -> bool:
    """Tell whether another arm is part of a group, which then is an arm with a torso, say."""
    own = set(group.joints)
    return any(
        own > set(other.joints) and len(other.joints) >= FEWEST_ARM_JOINTS
        for other in semantics.groups.values()
        if other.name not in hands
    )


def _named(hints: tuple[LimbHint, ...]) -> list[tuple[LimbHint, str]]:
    """Return the limbs' names: none for a single one, sides, or what the groups are called."""
    if len(hints) == 1:
        return [(hints[0], "")]
    sides = [words.side((hint.name, *hint.arm)) for hint in hints]
    if sorted(sides) == ["left", "right"]:
        return list(zip(hints, sides, strict=True))
    names = [
        "_".join(w for w in re.split(r"[^a-z0-9]+", hint.name.lower()) if w and w not in LEFT_OUT)
        for hint in hints
    ]
    good = len(set(names)) == len(names) and all(names) and "body" not in names
    return list(zip(hints, names if good else map(str, range(1, len(hints) + 1)), strict=True))


def _limb(hint: LimbHint, name: str, joints: dict[str, ModelJoint], model: UrdfModel) -> LimbJoints:
    arm = tuple(joints[joint] for joint in hint.arm)
    fingers = tuple(joints[joint] for joint in hint.fingers)
    if not fingers:
        return LimbJoints(name, arm, (), arm[-1].child)
    moved = {joint.child for joint in fingers}
    outer = [
        joint.parent
        for joint in fingers
        if moved.isdisjoint(before.child for before in model.path_to(joint.parent))
    ]
    carriers = outer or [fingers[0].parent]
    return LimbJoints(name, arm, fingers, max(dict.fromkeys(carriers), key=carriers.count))


def _without(group: tuple[ModelJoint, ...], taken: set[str]) -> tuple[ModelJoint, ...]:
    return tuple(joint for joint in group if joint.name not in taken)
