"""A descriptor guessed from a URDF alone, with the reason for every guess."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from kinematics.rotations import Floats, inverse_pose, transform
from kinematics.solve import farthest
from kinematics.tree import Tree
from robots.assets.locator import LocalUrdf
from robots.bodies.allowed import joined_pairs, rigid_pairs
from robots.bodies.hulls import Hull, counted_pairs, read_hulls
from robots.bodies.overlaps import guess_allowed
from robots.common.errors import DescriptorError
from robots.descriptor import (
    ActionSplit,
    Fingers,
    GripperMaterial,
    JointGroup,
    RobotDescriptor,
)
from robots.guessing.drives import CONTROL_STEP, Drives, alike, drive_fields
from robots.guessing.fingertips import Fingertips
from robots.guessing.grippers import Gripper, entangled, find_gripper
from robots.guessing.posture import PostureSearch
from robots.guessing.stance import Stance
from robots.guessing.tool import Tool, find_tool
from robots.urdf.anatomy import FARTHEST_SLIDE, PARTS, Anatomy, Limb, find_anatomy
from robots.urdf.masses import read_masses
from robots.urdf.model import ModelJoint, UrdfModel
from robots.urdf.reading import read_model
from robots.urdf.summary import parse_urdf, read_cleaned
from robots.urdf.tree import kinematic_tree

LinkPairs = tuple[tuple[str, str], ...]

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


@dataclass(frozen=True, eq=False)
class _Parts:
    """What the steps of a guess share."""

    model: UrdfModel
    stance: Stance
    anatomy: Anatomy
    hulls: tuple[Hull, ...]
    drives: Drives
    tips: Mapping[str, Fingertips]
    tools: Mapping[str, Tool]
    grippers: Mapping[str, Gripper]


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
    parts = _look_at(path, cleaned.xml)
    main = parts.anatomy.limbs[0]
    split, drives = _action_split(parts)
    allowed, overlaps = guess_allowed(parts.model, path)
    hands, about_hands = _within_hands(parts, allowed)
    allowed += hands
    rest, stance = _rest(parts, allowed)
    distance, measured = _reach(parts, main, rest)
    fields: dict[str, Any] = {
        "name": name or _as_name(parts.model.name or path.stem),
        "urdf": locator,
        "action_split": split,
        "tcp_link": parts.tools[main.name].link,
        "tcp_position_links": parts.tools[main.name].links,
        "gripper_material": _material(parts.anatomy),
        "fingers": _fingers(main),
        "keyframes": {"rest": tuple(rest[joint] for joint in split.joints)},
        "reach": distance,
        "source": f"guessed from {path.name}",
        "allowed_collisions": allowed,
    }
    unknown = sorted(set(overrides) - set(RobotDescriptor.__dataclass_fields__))
    if unknown:
        known = ", ".join(RobotDescriptor.__dataclass_fields__)
        raise DescriptorError(f"a descriptor has no fields {unknown}; it has {known}")
    tools = [tool.reason for tool in parts.tools.values()]
    repairs = [f"repaired: {repair}" for repair in cleaned.repairs]
    about = (*parts.anatomy.reasons, *tools, *_about_grasps(parts), *drives, *stance, measured)
    given = tuple(f"{field}: given, not guessed" for field in overrides)
    return Guess(
        RobotDescriptor(**{**fields, **overrides}),
        (*repairs, *about, *overlaps, *about_hands, *given),
    )


def _look_at(path: Path, xml: bytes) -> _Parts:
    model = read_model(xml, path.as_posix())
    anatomy = find_anatomy(model, path.as_posix())
    stance = Stance(model)
    hulls = read_hulls(model, path) if find_spec("fcl") and find_spec("trimesh") else ()
    bodies: dict[int, list[Floats]] = {}
    for hull in hulls:
        bodies.setdefault(hull.link, []).append(hull.corners)
    masses = read_masses(parse_urdf(xml, path.as_posix()), stance.tree, bodies)
    drives = Drives(stance, masses)
    hands = [limb for limb in anatomy.limbs if limb.fingers]
    tips = {limb.name: Fingertips(stance, limb, hulls) for limb in hands}
    tools = {limb.name: find_tool(stance, limb, tips.get(limb.name)) for limb in anatomy.limbs}
    grippers = {limb.name: find_gripper(limb, tips[limb.name], drives) for limb in hands}
    return _Parts(model, stance, anatomy, hulls, drives, tips, tools, grippers)


def _as_name(text: str) -> str:
    name = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_").lower()
    return name if re.match(r"[a-z]", name) else f"robot_{name}".rstrip("_")


def _action_split(parts: _Parts) -> tuple[ActionSplit, list[str]]:
    groups: dict[str, JointGroup] = {}
    drives = parts.drives
    for limb in parts.anatomy.limbs:
        for name, joints in _by_unit("arm", limb.arm):
            groups[_of(limb, name)] = _relative(joints, drives)
        if limb.name in parts.grippers:
            groups.update(parts.grippers[limb.name].groups)
    for part in PARTS:
        for name, joints in _by_unit(part, parts.anatomy.parts.get(part, ())):
            groups[name] = _held(joints, drives)
    for name, joints in _by_unit("base", parts.anatomy.base):
        groups[name] = JointGroup.hold(
            _names(joints), stiffness=1e5, damping=1e4, force_limit=1e5, unit=joints[0].unit
        )
    reasons = [
        "drives: stiffness from the inertia that hangs on each joint, critically damped, so that a"
        f" control step of {CONTROL_STEP:g} s covers what the action asks for; forces from the"
        " URDF's efforts",
        "action: arm joints move per control step by up to 0.1 rad or m, or as far as their force"
        " brings them",
    ]
    if drives.raised:
        listing = ", ".join(drives.raised)
        reasons.append(
            f"forces: more than the URDF's efforts for {listing}, which would not bring them 0.04"
            " rad or m in a control step"
        )
    return ActionSplit(**groups), reasons


def _of(limb: Limb, group: str) -> str:
    """Return the name of a limb's group: ``arm``, ``left_arm``, or ``arm_2``."""
    if not limb.name:
        return group
    return f"{group}_{limb.name}" if limb.name.isdigit() else f"{limb.name}_{group}"


def _by_unit(part: str, joints: Sequence[ModelJoint]) -> Iterator[tuple[str, list[ModelJoint]]]:
    for unit, suffix in (("m", "_slide"), ("rad", "")):
        alike = [joint for joint in joints if joint.unit == unit]
        if alike:
            yield part + suffix, alike


def _relative(joints: Sequence[ModelJoint], drives: Drives) -> JointGroup:
    made = [drives.of(joint) for joint in joints]
    step = alike([drive.step for drive in made])
    return JointGroup(
        _names(joints),
        lower=-step if isinstance(step, float) else tuple(-value for value in step),
        upper=step,
        delta=True,
        unit=joints[0].unit,
        limits=tuple(joint.span for joint in joints),
        **drive_fields(made),
    )


def _held(joints: Sequence[ModelJoint], drives: Drives) -> JointGroup:
    fields = drive_fields([drives.holding(joint) for joint in joints])
    return JointGroup.hold(_names(joints), unit=joints[0].unit, **fields)


def _finger_links(limb: Limb) -> tuple[str, ...]:
    links = tuple(joint.child for joint in limb.fingers)
    return (limb.palm, *links) if len(links) == 1 else links


def _material(anatomy: Anatomy) -> GripperMaterial | None:
    links = tuple(link for limb in anatomy.limbs if limb.fingers for link in _finger_links(limb))
    return GripperMaterial(links, 2.0, 2.0, 0.0, patch_radius=0.1) if links else None


def _fingers(limb: Limb) -> Fingers | None:
    """Return the grasping links if both slide along their own y axis."""
    if len(limb.fingers) != 2:
        return None
    one, other = limb.fingers
    slide = all(j.type == "prismatic" and abs(j.axis[1]) > 0.99 for j in (one, other))
    if not slide:
        return None
    signs = (1 if one.axis[1] > 0 else -1, 1 if other.axis[1] > 0 else -1)
    return Fingers((one.child, other.child), opening_signs=signs)


def _about_grasps(parts: _Parts) -> Iterator[str]:
    for gripper in parts.grippers.values():
        yield from gripper.reasons
    material = _material(parts.anatomy)
    if material is None:
        return
    links = ", ".join(material.links)
    yield f"gripper_material: friction 2 on {links}, as ManiSkill's grippers have"
    if _fingers(parts.anatomy.limbs[0]):
        yield "fingers: both slide along their y axis, in which they open"
    else:
        yield "fingers: none, so grasps go unnoticed; a Fingers(...) with two links changes that"


def _within_hands(parts: _Parts, allowed: LinkPairs) -> tuple[LinkPairs, tuple[str, ...]]:
    """Return the pairs of a hand's links that overlap however it stands, and a reason."""
    found: dict[tuple[str, str], None] = {}
    pairs = _counted(parts, allowed)
    for limb in parts.anatomy.limbs:
        if limb.name in parts.grippers:
            gripper, ends = parts.grippers[limb.name], parts.tips[limb.name].ends
            inside = entangled(parts.stance, limb, parts.hulls, pairs, gripper, ends)
            found |= dict.fromkeys(inside)
    if not found:
        return (), ()
    listing = ", ".join(f"{one} and {other}" for one, other in found)
    return tuple(found), (
        f"allowed_collisions, too: {listing}, of hands, which overlap while these are open",
    )


def _counted(parts: _Parts, allowed: LinkPairs) -> tuple[tuple[int, int], ...]:
    """Return the pairs of hulls whose overlaps count, by their indices."""
    excused = joined_pairs(parts.model) | rigid_pairs(parts.model)
    excused |= frozenset(map(frozenset, allowed))
    return counted_pairs(parts.stance.tree, parts.hulls, excused)


def _rest(parts: _Parts, allowed: LinkPairs) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return the keyframe (rad, m) and the reasons for it."""
    pairs = _counted(parts, allowed)
    hands = [gripper.postures for gripper in parts.grippers.values()]
    tools = [(limb, parts.tools[limb.name]) for limb in parts.anatomy.limbs]
    torso = parts.anatomy.parts.get("torso", ())
    found = PostureSearch(parts.stance, tools, parts.hulls, pairs, hands, torso).run()
    rest = parts.stance.all_joints(found.position)
    for postures in hands:  # joints that one number drives need not mimic each other in the URDF
        rest |= next(p for p in postures if _agree(p, rest, parts.stance))
    return rest, found.reasons


def _agree(posture: Mapping[str, float], rest: Mapping[str, float], stance: Stance) -> bool:
    leaders = [joint for joint in posture if joint in stance.index]
    return all(abs(posture[joint] - rest[joint]) < 1e-5 for joint in leaders)


def _reach(parts: _Parts, limb: Limb, rest: dict[str, float]) -> tuple[float, str]:
    tree, tool = kinematic_tree(parts.model), parts.tools[limb.name]
    start = np.array([rest.get(joint, 0.0) for joint in tree.coordinates])
    poses = tree.forward(start[None])[0]
    palm = tree.link(limb.palm)
    tips = [tree.link(link) for link in tool.origins]
    point = transform(inverse_pose(poses[palm]), poses[tips, :3, 3]).mean(axis=0)
    moving = [joint for joint in limb.arm if not _flies(joint)]
    starts = _postures(tree, start, moving)
    free = [tree.coordinates.index(joint.name) for joint in moving]
    limits = tree.limits.copy()
    limits[free] = np.array([joint.span for joint in moving]).reshape(-1, 2)
    found = farthest(replace(tree, limits=limits), palm, point, starts, free)
    if found < 0.01 or len(moving) < len(limb.arm):
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


def _names(joints: Sequence[ModelJoint]) -> tuple[str, ...]:
    return tuple(joint.name for joint in joints)
