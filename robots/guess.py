"""A descriptor guessed from a URDF alone, with the reason for every guess."""

from __future__ import annotations

import random
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from kinematics.rotations import Floats, inverse_pose, transform
from kinematics.solve import farthest
from kinematics.tree import Tree
from robots.assets.locator import LocalUrdf
from robots.common.errors import DescriptorError
from robots.descriptor import (
    ActionSplit,
    Fingers,
    GripperMaterial,
    JointGroup,
    RobotDescriptor,
)
from robots.urdf.anatomy import FARTHEST_SLIDE, Anatomy, find_anatomy
from robots.urdf.model import ModelJoint, UrdfModel
from robots.urdf.reading import read_model
from robots.urdf.summary import read_cleaned
from robots.urdf.tree import kinematic_tree

STIFFNESS, DAMPING, FORCE = 1e3, 1e2, 100.0  # what ManiSkill gives its Panda
STEP = 0.1  # of an arm joint, per control step (rad, m)
SQUEEZE = 0.01  # how far beyond closed a parallel gripper's target is (m)
REACH_STARTS = 8  # of the search for the largest distance


@dataclass(frozen=True)
class Guess:
    """A guessed descriptor.

    Attributes:
        descriptor: The descriptor.
        reasons: What was guessed and why, one sentence each.
    """

    descriptor: RobotDescriptor
    reasons: tuple[str, ...]

    def __str__(self) -> str:
        """Return name and reasons, one a line."""
        head = f"{self.descriptor.name}: {self.descriptor.summary}, all guessed"
        return "\n".join([head, *(f"  {reason}" for reason in self.reasons)])

    def module(self) -> str:
        """Return the data module that declares the descriptor, to paste and correct."""
        from robots.data_module import write_module

        return write_module(self.descriptor, self.reasons)


def guess(urdf: Path, name: str | None, overrides: dict[str, Any]) -> Guess:
    """Guess a descriptor.

    Args:
        urdf: The URDF.
        name: Registry name; None takes that of the URDF.
        overrides: Fields of the descriptor that are known better.

    Raises:
        AssetError: If the URDF or a mesh of it is missing, or it describes no robot.
        DescriptorError: If nothing moves, or an override contradicts the rest.
    """
    locator = LocalUrdf(str(urdf))
    path = locator.locate()
    cleaned = read_cleaned(path)
    model = read_model(cleaned.xml, path.as_posix())
    anatomy = find_anatomy(model, path.as_posix())
    split, drives = _action_split(anatomy)
    rest, stance = _rest(anatomy, split)
    distance, measured = _reach(model, anatomy, rest)
    fields: dict[str, Any] = {
        "name": name or _as_name(model.name or path.stem),
        "urdf": locator,
        "action_split": split,
        "tcp_link": anatomy.tcp,
        "tcp_position_links": anatomy.tips,
        "gripper_material": _material(anatomy),
        "fingers": _fingers(anatomy),
        "keyframes": {"rest": tuple(rest[joint] for joint in split.joints)},
        "reach": distance,
        "source": f"guessed from {path.name}",
    }
    unknown = sorted(set(overrides) - set(RobotDescriptor.__dataclass_fields__))
    if unknown:
        known = ", ".join(RobotDescriptor.__dataclass_fields__)
        raise DescriptorError(f"a descriptor has no fields {unknown}; it has {known}")
    repairs = (f"repaired: {repair}" for repair in cleaned.repairs)
    reasons = (*repairs, *anatomy.reasons, *drives, *_about_grasps(anatomy), stance, measured)
    given = tuple(f"{field}: given, not guessed" for field in overrides)
    return Guess(RobotDescriptor(**{**fields, **overrides}), (*reasons, *given))


def _as_name(text: str) -> str:
    name = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_").lower()
    return name if re.match(r"[a-z]", name) else f"robot_{name}".rstrip("_")


def _action_split(anatomy: Anatomy) -> tuple[ActionSplit, list[str]]:
    groups: dict[str, JointGroup] = {}
    for part, joints in (("arm", anatomy.arm), ("body", anatomy.body)):
        for name, alike in _by_unit(part, joints):
            groups[name] = _relative(alike)
    if anatomy.fingers:
        groups["gripper"] = _gripper(anatomy.fingers)
    for name, alike in _by_unit("base", anatomy.base):
        groups[name] = JointGroup.hold(
            _names(alike), stiffness=1e5, damping=1e4, force_limit=1e5, unit=alike[0].unit
        )
    order = ["arm_slide", "arm", "gripper"]  # then what else there is, the base last
    ranked = sorted(groups, key=lambda name: order.index(name) if name in order else len(order))
    return ActionSplit(**{name: groups[name] for name in ranked}), [
        f"drives: stiffness {STIFFNESS:g}, damping {DAMPING:g} as ManiSkill's Panda; forces from"
        f" the URDF's efforts, {FORCE:g} where it has none",
        f"action: arm joints move by up to {STEP:g} rad or m per control step",
    ]


def _by_unit(part: str, joints: Sequence[ModelJoint]) -> Iterator[tuple[str, list[ModelJoint]]]:
    for unit, suffix in (("m", "_slide"), ("rad", "")):
        alike = [joint for joint in joints if joint.unit == unit]
        if alike:
            yield part + suffix, alike


def _relative(joints: Sequence[ModelJoint]) -> JointGroup:
    return JointGroup(
        _names(joints),
        lower=-STEP,
        upper=STEP,
        delta=True,
        unit=joints[0].unit,
        limits=tuple(joint.span for joint in joints),
        **_drive(joints),
    )


def _gripper(fingers: Sequence[ModelJoint]) -> JointGroup:
    unit = fingers[0].unit
    leaders = [joint for joint in fingers if joint.mimics is None]
    common: dict[str, Any] = {
        "reset_noise": False,
        "unit": unit,
        "limits": tuple(joint.span for joint in fingers),
        **_drive(fingers),
    }
    if any(joint.unit != unit for joint in fingers):
        raise DescriptorError(
            f"the gripper {', '.join(_names(fingers))} both turns and slides; declare its joint"
            " groups by hand: action_split=ActionSplit(...)"
        )
    if len(leaders) == 1 or _is_parallel(leaders):
        low, high = leaders[0].span
        ratios = [_ratio(joint, fingers) for joint in fingers]
        return JointGroup(
            _names(fingers),
            lower=low - SQUEEZE if unit == "m" else low,
            upper=high,
            mimic=len(fingers) > 1,
            multipliers=_unless(1.0, [multiplier for multiplier, _ in ratios]),
            offsets=_unless(0.0, [offset for _, offset in ratios]),
            **common,
        )
    return JointGroup(_names(fingers), lower=-STEP, upper=STEP, delta=True, **common)


def _is_parallel(leaders: Sequence[ModelJoint]) -> bool:
    spans = {joint.span for joint in leaders}
    return len(leaders) == 2 and len(spans) == 1 and leaders[0].type == "prismatic"


def _ratio(joint: ModelJoint, joints: Sequence[ModelJoint]) -> tuple[float, float]:
    """Return multiplier and offset from the leading joint to one that mimics it."""
    if joint.mimics is None:
        return 1.0, 0.0
    leader = next((other for other in joints if other.name == joint.mimics), None)
    if leader is None:
        raise DescriptorError(f"{joint.name} mimics {joint.mimics}, which is not of the gripper")
    multiplier, offset = _ratio(leader, joints)
    return joint.multiplier * multiplier, joint.multiplier * offset + joint.offset


def _unless(default: float, numbers: list[float]) -> tuple[float, ...]:
    return () if all(number == default for number in numbers) else tuple(numbers)


def _drive(joints: Sequence[ModelJoint]) -> dict[str, Any]:
    forces = tuple(joint.effort if joint.effort else FORCE for joint in joints)
    same = len(set(forces)) == 1
    return {
        "stiffness": STIFFNESS,
        "damping": DAMPING,
        "force_limit": forces[0] if same else forces,
    }


def _finger_links(anatomy: Anatomy) -> tuple[str, ...]:
    links = tuple(joint.child for joint in anatomy.fingers)
    return (anatomy.palm, *links) if len(links) == 1 else links


def _material(anatomy: Anatomy) -> GripperMaterial | None:
    if not anatomy.fingers:
        return None
    return GripperMaterial(_finger_links(anatomy), 2.0, 2.0, 0.0, patch_radius=0.1)


def _fingers(anatomy: Anatomy) -> Fingers | None:
    """Return the grasping links if both slide along their own y axis."""
    if len(anatomy.fingers) != 2:
        return None
    one, other = anatomy.fingers
    slide = all(j.type == "prismatic" and abs(j.axis[1]) > 0.99 for j in (one, other))
    if not slide:
        return None
    signs = (1 if one.axis[1] > 0 else -1, 1 if other.axis[1] > 0 else -1)
    return Fingers((one.child, other.child), opening_signs=signs)


def _about_grasps(anatomy: Anatomy) -> Iterator[str]:
    if not anatomy.fingers:
        return
    mimics = [f"{joint.name} follows {joint.mimics}" for joint in anatomy.fingers if joint.mimics]
    if mimics:
        yield f"mimic joints, from the URDF: {', '.join(mimics)}"
    elif _is_parallel(anatomy.fingers):
        yield "one number drives both fingers, as they slide alike"
    links = ", ".join(_finger_links(anatomy))
    yield f"gripper_material: friction 2 on {links}, as ManiSkill's grippers have"
    if _fingers(anatomy):
        yield "fingers: both slide along their y axis, in which they open"
    else:
        yield "fingers: none, so grasps go unnoticed; a Fingers(...) with two links changes that"


def _rest(anatomy: Anatomy, split: ActionSplit) -> tuple[dict[str, float], str]:
    """Return the keyframe: arms at 0 or mid-range, grippers open (rad, m)."""
    everything = (*anatomy.base, *anatomy.arm, *anatomy.body, *anatomy.fingers)
    rest = {joint.name: _middle(joint) for joint in everything}
    gripper = split.groups.get("gripper")
    if gripper is not None and not gripper.delta:
        value = gripper.ranges[0][1]
        for joint, (multiplier, offset) in zip(gripper.joints, gripper.followers, strict=True):
            rest[joint] = multiplier * value + offset
    return rest, "keyframe 'rest': joints at 0, or mid-range where 0 is out; the gripper at its end"


def _middle(joint: ModelJoint) -> float:
    low, high = joint.span
    return 0.0 if low <= 0.0 <= high else round((low + high) / 2, 6)


def _reach(model: UrdfModel, anatomy: Anatomy, rest: dict[str, float]) -> tuple[float, str]:
    tree = kinematic_tree(model)
    start = np.array([rest.get(joint, 0.0) for joint in tree.coordinates])
    poses = tree.forward(start[None])[0]
    palm = tree.link(anatomy.palm)
    tips = [tree.link(link) for link in anatomy.tips or (anatomy.tcp,)]
    tool = transform(inverse_pose(poses[palm]), poses[tips, :3, 3]).mean(axis=0)
    moving = [joint for joint in anatomy.arm if not _flies(joint)]
    starts = _postures(tree, start, moving)
    free = [tree.coordinates.index(joint.name) for joint in moving]
    limits = tree.limits.copy()
    limits[free] = np.array([joint.span for joint in moving]).reshape(-1, 2)
    found = farthest(replace(tree, limits=limits), palm, tool, starts, free)
    if found < 0.01 or len(moving) < len(anatomy.arm):
        return 1.0, "reach: 1 m, without ground, as nothing stands fixed or nothing reaches out"
    return round(found, 3), (
        "reach: the TCP's largest distance from the base's z axis within the joint limits;"
        " data sheets, which measure to the flange, give less"
    )


def _postures(tree: Tree, rest: Floats, moving: Sequence[ModelJoint]) -> Floats:
    """Return where the search for the reach starts: in the joints' middle, and in random places."""
    starts = np.tile(rest, (REACH_STARTS, 1))
    generator = random.Random(0)  # the same answer every time
    for i, start in enumerate(starts):
        for joint in moving:
            position = generator.uniform(*joint.span) if i else sum(joint.span) / 2
            start[tree.coordinates.index(joint.name)] = position
    return starts


def _flies(joint: ModelJoint) -> bool:
    low, high = joint.span
    return joint.unit == "m" and high - low > FARTHEST_SLIDE


def _names(joints: Iterable[ModelJoint]) -> tuple[str, ...]:
    return tuple(joint.name for joint in joints)
