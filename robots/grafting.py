"""Robots made of others: an arm with another gripper or a tool, arms on one body.

Files are read when a robot is put together, since links are looked up in them. What is put together
is described by the parts' own numbers: drives, limits, keyframes, fingers. Only which links may
overlap is found anew, with the hulls of all parts.
"""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, count
from typing import Any

import numpy as np

from robot_layouts.core.errors import DescriptorError, UnknownNameError
from robot_layouts.kinematics.rotations import Floats, inverse_pose, quaternion_of, transform
from robots.action_split import ActionSplit, JointGroup
from robots.assets.assembled import AssembledUrdf, UrdfPart, carried_by
from robots.bodies.allowed import LinkPair, read_allowed_pairs
from robots.bodies.overlaps import guess_allowed
from robots.control_modes import CONTROL_MODES
from robots.descriptor import (
    IDENTITY,
    GripperMaterial,
    Home,
    Limb,
    NativeAgent,
    Quaternion,
    RobotDescriptor,
    UrdfSource,
    Vector3,
)
from robots.mjcf.locator import local_source
from robots.named import named_robot
from robots.urdf.model import ModelJoint, UrdfModel
from robots.urdf.reading import model_of
from robots.urdf.tcp import find_tcp
from robots.urdf.tree import kinematic_tree

RobotLike = RobotDescriptor | str | os.PathLike[str]
"""A descriptor, or what `robots.named.named_robot` takes: a name, a path or ``MODULE:NAME``."""


@dataclass(frozen=True)
class Mount:
    """A robot that stands on a link of another body.

    Attributes:
        robot: The robot.
        link: Link of the body that carries it; its root if empty.
        position: Of the robot's root in that link's frame (m).
        quaternion: How its root is turned there, wxyz.
    """

    robot: RobotLike
    link: str = ""
    position: Vector3 = (0.0, 0.0, 0.0)
    quaternion: Quaternion = IDENTITY


def with_gripper(
    robot: RobotDescriptor,
    gripper: RobotLike,
    *,
    link: str | None = None,
    position: Vector3 | None = None,
    quaternion: Quaternion | None = None,
    name: str | None = None,
) -> RobotDescriptor:
    """Return an arm with another gripper in the place of its own, if it has one.

    A gripper is cut off at the last fixed joint before it. Fingers that hang on the last link of
    the arm itself are cut off alone, and the housing in that link stays.

    Args:
        robot: The arm.
        gripper: The gripper, or an arm whose gripper is taken.
        link: Link that carries it. None takes the one that carries the present gripper or fingers,
            or without one the link of the tool centre point.
        position: Of the gripper's root in that link's frame (m); None takes that of the present
            gripper, or in place of fingers or nothing that of the new one on the arm it is taken
            from.
        quaternion: How its root is turned there, wxyz; likewise.
        name: Registry name; None joins both names.

    Raises:
        DescriptorError: If the present fingers carry parts of the arm, the new ones hang on the arm
            that should lend them, or a robot has limbs.
        UnknownNameError: If there is no such link or robot.
        AssetError: If files cannot be found or are invalid.
    """
    robot = _robot(robot)
    _refuse_limbs(robot, "take another gripper")
    lender = _robot(gripper)
    _refuse_limbs(lender, "lend a gripper")
    tool, origin, root = _gripper_of(lender)
    present = _gripper_joints(robot)
    mount, without = robot.tcp_link, ()
    if present:
        model = _model(robot.urdf)
        if (flange := _flange(model, present)) is not None:
            without, mount, origin = (flange.child,), flange.parent, flange.origin
        else:
            without, mount = _fingers(robot, model, present)
    if link is not None:
        mount, origin = link, np.eye(4)
    part = UrdfPart(
        tool.urdf,
        mount,
        _vector(origin) if position is None else position,
        _quaternion(origin) if quaternion is None else quaternion,
        root=root,
    )
    return _with_part(robot, tool, part, without, name or f"{robot.name}_with_{tool.name}")


def with_tool(
    robot: RobotDescriptor,
    tool: UrdfSource | str | os.PathLike[str],
    *,
    tcp_link: str,
    link: str | None = None,
    position: Vector3 = (0.0, 0.0, 0.0),
    quaternion: Quaternion = IDENTITY,
    name: str | None = None,
) -> RobotDescriptor:
    """Return a robot with a body on one of its links: a pen, a camera's housing, a screwdriver.

    Args:
        robot: The robot.
        tool: A URDF in which nothing moves.
        tcp_link: Link of the tool that is the tool centre point from now on.
        link: Link of the robot that carries it; None takes that of the tool centre point.
        position: Of the tool's root in that link's frame (m).
        quaternion: How its root is turned there, wxyz.
        name: Registry name; None takes the robot's, with ``_with_tool`` behind it.

    Raises:
        DescriptorError: If something moves in the tool, or names are taken.
        UnknownNameError: If there is no such link.
        AssetError: If files cannot be found or are invalid.
    """
    source = local_source(tool) if isinstance(tool, str | os.PathLike) else tool
    model = _model(source)
    if model.moving:
        raise DescriptorError(
            f"the tool moves ({model.moving[0].name}); what moves is a gripper: with_gripper"
        )
    if tcp_link not in model.links:
        raise UnknownNameError("link of the tool", tcp_link, model.links)
    part = UrdfPart(source, link or robot.tcp_link, position, quaternion)
    part = _apart(part, robot)
    urdf = AssembledUrdf(robot.urdf, (part,))
    tcp: dict[str, Any] = {
        "tcp_link": part.prefix + tcp_link,
        "tcp_position_links": (),
        "tcp_offset": (0.0, 0.0, 0.0),
    }
    made = replace(
        robot,
        name=name or f"{robot.name}_with_tool",
        urdf=urdf,
        **tcp,
        limbs={
            key: replace(limb, **tcp) if limb.tcp_link == part.link else limb
            for key, limb in robot.limbs.items()
        },
        allowed_collisions=_allowed(urdf, [(robot, "")]),
    )
    return replace(made, reach=_reach(robot, made))


def on_body(
    name: str, body: UrdfSource | str | os.PathLike[str], mounts: Mapping[str, Mount]
) -> RobotDescriptor:
    """Return one robot made of several that stand on one body: a pedestal, a torso, a gantry.

    Each is a limb of it. Its joint groups are called ``NAME_GROUP`` (``left_arm``,
    ``left_gripper``), its links and joints ``NAME_LINK``. Tool centre point, fingers and reach are
    the first robot's.

    Args:
        name: Registry name.
        body: A URDF in which nothing moves.
        mounts: The robots by name, in the order of the action.

    Raises:
        DescriptorError: If there is no robot, one has limbs, or something moves in the body.
        UnknownNameError: If there is no such link or robot.
        AssetError: If files cannot be found or are invalid.
    """
    if not mounts:
        raise DescriptorError("nothing stands on the body; name at least one robot")
    source = local_source(body) if isinstance(body, str | os.PathLike) else body
    model = _model(source)
    if model.moving:
        raise DescriptorError(f"the body moves ({model.moving[0].name}); only its robots may")
    robots = {key: _robot(mount.robot) for key, mount in mounts.items()}
    for key, robot in robots.items():
        _refuse_limbs(robot, f"stand on a body as {key!r}")
    parts = [
        UrdfPart(robots[key].urdf, m.link or model.root, m.position, m.quaternion, prefix=f"{key}_")
        for key, m in mounts.items()
    ]
    urdf = AssembledUrdf(source, tuple(parts))
    named = {
        key: _renamed(robot, {g: f"{key}_{g}" for g in robot.action_split}, f"{key}_")
        for key, robot in robots.items()
    }
    each, first = named.values(), named[next(iter(named))]
    return replace(
        first,
        name=name,
        urdf=urdf,
        action_split=_joined_groups(each),
        control_modes=_joined_modes(each),
        gripper_material=_material(each),
        cameras=tuple(camera for robot in each for camera in robot.cameras),
        keyframes={"rest": [x for robot in each for x in robot.keyframe(robot.home.keyframe)]},
        home=Home(),
        reach=first.reach + math.hypot(*parts[0].position[:2]),
        source=" and ".join(dict.fromkeys(robot.source for robot in each)),
        allowed_collisions=_allowed(urdf, [(r, f"{key}_") for key, r in robots.items()]),
        no_floor_contact=tuple(link for robot in each for link in robot.no_floor_contact),
        native_agent=NativeAgent(),
        limbs=_limbs(named, model, parts),
    )


def _refuse_limbs(robot: RobotDescriptor, what: str) -> None:
    if robot.limbs:
        raise DescriptorError(
            f"{robot.name} has the limbs {', '.join(robot.limbs)}, and cannot {what}; arms of one"
            " limb can, also before on_body makes them limbs"
        )


def _limbs(
    robots: Mapping[str, RobotDescriptor], body: UrdfModel, parts: Sequence[UrdfPart]
) -> dict[str, Limb]:
    """Return robots, as they are named on a body, as the limbs of one robot."""
    tree = kinematic_tree(body)
    places = tree.forward(np.zeros((1, len(tree.coordinates))))[0]
    limbs: dict[str, Limb] = {}
    for (key, robot), part in zip(robots.items(), parts, strict=True):
        x, y, z = transform(places[tree.link(part.link)], np.array(part.position)).tolist()
        limbs[key] = Limb(
            robot.tcp_link,
            robot.reach,
            (x, y, z),
            robot.fingers,
            robot.tcp_position_links,
            robot.tcp_offset,
            tuple(robot.action_split),
        )
    return limbs


def _joined_groups(robots: Iterable[RobotDescriptor]) -> ActionSplit:
    """Return the joint groups of robots that become one."""
    return ActionSplit(**{k: g for robot in robots for k, g in robot.action_split.groups.items()})


def _joined_modes(robots: Iterable[RobotDescriptor]) -> dict[str, dict[str, JointGroup]]:
    """Return the control modes of their own of robots that become one."""
    joined: dict[str, dict[str, JointGroup]] = {}
    for robot in robots:
        for mode, groups in robot.control_modes.items():
            joined.setdefault(mode, {}).update(groups)
    return joined


def _robot(given: RobotLike) -> RobotDescriptor:
    robot = given if isinstance(given, RobotDescriptor) else named_robot(given)
    if robot.control_mode != CONTROL_MODES[0]:
        raise DescriptorError(
            f"{robot.name} was put into a control mode; take it as it was declared, and put the"
            " robot that is made into one"
        )
    return robot


def _model(source: UrdfSource) -> UrdfModel:
    return model_of(source.locate())


def _gripper_joints(robot: RobotDescriptor) -> frozenset[str]:
    return frozenset(robot.gripper_joints)


def _gripper_of(robot: RobotDescriptor) -> tuple[RobotDescriptor, Floats, str]:
    """Return what a robot says of its gripper alone, where its arm carries it, and its root.

    A robot that is nothing but a gripper or a hand is taken as it is.

    Raises:
        DescriptorError: If it is an arm without a gripper that moves.
    """
    joints = _gripper_joints(robot)
    if not joints and any("arm" in name.split("_") for name in robot.action_split.groups):
        raise DescriptorError(
            f"{robot.name} is an arm, and none of its joint groups is a gripper that could be taken"
        )
    if not joints or not robot.arm_joints or joints >= set(robot.joints):
        return robot, np.eye(4), ""
    model = _model(robot.urdf)
    if (flange := _flange(model, joints)) is None:
        raise DescriptorError(
            f"{robot.name} cannot lend its gripper: no fixed joint carries all of it, its fingers"
            " hang on the arm; take that of another robot"
        )
    root, origin = flange.child, flange.origin
    groups = {k: k for k, g in robot.action_split.groups.items() if set(g.joints) <= joints}
    own = {below.child for near in model.moving_on(root) for below in model.below(near)}
    links = {link for carried in (root, *own) for link in model.rigid_with(carried)}
    alone = replace(
        _renamed(robot, groups),
        tcp_link=robot.tcp_link if robot.tcp_link in links else root,
        tcp_offset=robot.tcp_offset if robot.tcp_link in links else (0.0, 0.0, 0.0),
        cameras=tuple(camera for camera in robot.cameras if camera.link in links),
    )
    return alone, origin, root


def _flange(model: UrdfModel, gripper: frozenset[str]) -> ModelJoint | None:
    """Return the last fixed joint before a gripper that carries all of it; None if none does."""
    first = next(joint for joint in model.ordered if joint.name in gripper)
    for joint in reversed(model.path_to(first.parent)):
        if joint.moves:
            break
        carried = (below for near in model.moving_on(joint.child) for below in model.below(near))
        if gripper <= {below.name for below in carried}:
            return joint
    return None


def _fingers(
    robot: RobotDescriptor, model: UrdfModel, gripper: frozenset[str]
) -> tuple[tuple[str, ...], str]:
    """Return the links of fingers that hang on an arm, to cut off, and a link that carries them.

    Raises:
        DescriptorError: If they carry parts of the arm.
    """
    joints = [joint for joint in model.ordered if joint.name in gripper]
    first = [j for j in joints if gripper.isdisjoint(p.name for p in model.path_to(j.parent))]
    carried = {below.name for joint in first for below in model.below(joint)}
    if not carried <= gripper:
        others = ", ".join(sorted(carried - gripper))
        raise DescriptorError(
            f"the gripper of {robot.name} cannot be cut off: it carries {others}, which are no"
            " joints of a gripper"
        )
    return tuple(joint.child for joint in first), first[0].parent


def _with_part(
    robot: RobotDescriptor,
    tool: RobotDescriptor,
    part: UrdfPart,
    without: tuple[str, ...],
    name: str,
) -> RobotDescriptor:
    part = _apart(part, robot, without)
    urdf = AssembledUrdf(robot.urdf, (part,), without)
    model = _model(urdf)
    body = _model(robot.urdf)
    left = _names(body, {*body.links} - carried_by(body, without))
    kept = {k: k for k, g in robot.action_split.groups.items() if left.issuperset(g.joints)}
    arm = _renamed(robot, kept)
    called = {
        name: f"gripper_{name}" if name in kept and name != "gripper" else name
        for name in tool.action_split
    }
    added = _renamed(tool, called, part.prefix)
    opened = added.keyframe(added.home.keyframe)
    made = replace(
        arm,
        name=name,
        urdf=urdf,
        action_split=_joined_groups([arm, added]),
        control_modes=_joined_modes([arm, added]),
        tcp_link=added.tcp_link,
        tcp_position_links=added.tcp_position_links,
        tcp_offset=added.tcp_offset,
        gripper_material=added.gripper_material,
        fingers=added.fingers,
        cameras=(*(c for c in robot.cameras if c.link in model.links), *added.cameras),
        keyframes={key: (*qpos, *opened) for key, qpos in arm.keyframes.items()},
        source=f"{robot.source}; {tool.source}",
        allowed_collisions=_allowed(urdf, [(robot, ""), (tool, part.prefix)]),
    )
    return replace(made, reach=_reach(robot, made))


def _apart(part: UrdfPart, robot: RobotDescriptor, without: Sequence[str] = ()) -> UrdfPart:
    """Return a part with a prefix, if it has a name that is left of the robot."""
    body, tool = _model(robot.urdf), _model(part.urdf)
    kept = _names(body, {*body.links} - carried_by(body, without))
    added = _names(tool, carried_by(tool, [part.root or tool.root]))
    prefixes = chain(("", "tool_"), (f"tool_{i}_" for i in count(2)))
    free = next(p for p in prefixes if kept.isdisjoint({p + name for name in added}))
    return replace(part, prefix=free)


def _names(model: UrdfModel, links: Collection[str]) -> set[str]:
    """Return the names of links, and of the joints that carry them."""
    return {*links, *(joint.name for joint in model.joints if joint.child in links)}


def _renamed(
    robot: RobotDescriptor, called: Mapping[str, str], prefix: str = ""
) -> RobotDescriptor:
    """Return what a descriptor says of some joint groups, by other names.

    Args:
        robot: The robot.
        called: What each of these groups is called from now on, by its present name.
        prefix: Put before the names of all links, joints and cameras.
    """

    def each(names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(prefix + name for name in names)

    def chosen(groups: Mapping[str, JointGroup]) -> dict[str, JointGroup]:
        return {
            called[name]: replace(
                group,
                joints=each(group.joints),
                leaders=each(group.leaders),
                root_link=group.root_link and prefix + group.root_link,
            )
            for name, group in groups.items()
            if name in called
        }

    places = [
        robot.joints.index(joint)
        for name, group in robot.action_split.groups.items()
        if name in called
        for joint in group.joints
    ]
    modes = {mode: chosen(groups) for mode, groups in robot.control_modes.items()}
    material, fingers = robot.gripper_material, robot.fingers
    return replace(
        robot,
        action_split=ActionSplit(**chosen(robot.action_split.groups)),
        control_modes={mode: groups for mode, groups in modes.items() if groups},
        keyframes={key: [qpos[i] for i in places] for key, qpos in robot.keyframes.items()},
        tcp_link=prefix + robot.tcp_link,
        tcp_position_links=each(robot.tcp_position_links),
        no_floor_contact=each(robot.no_floor_contact),
        gripper_material=material and replace(material, links=each(material.links)),
        fingers=fingers and replace(fingers, links=each(fingers.links)),
        cameras=tuple(
            replace(camera, name=prefix + camera.name, link=prefix + camera.link)
            for camera in robot.cameras
        ),
    )


def _material(robots: Iterable[RobotDescriptor]) -> GripperMaterial | None:
    """Return the material of all grippers; the numbers are the first one's."""
    given = [robot.gripper_material for robot in robots if robot.gripper_material is not None]
    if not given:
        return None
    return replace(given[0], links=tuple(link for one in given for link in one.links))


def _allowed(
    urdf: AssembledUrdf, robots: list[tuple[RobotDescriptor, str]]
) -> tuple[tuple[str, str], ...]:
    """Return the pairs that may overlap: each part's own, and those found in the whole."""
    model = _model(urdf)
    found, _ = guess_allowed(model, urdf.locate())
    pairs: set[LinkPair] = {frozenset(pair) for pair in found}
    for robot, prefix in robots:
        for pair in read_allowed_pairs(robot, _model(robot.urdf), robot.urdf.locate()):
            pairs.add(frozenset(prefix + link for link in pair))
    known = set(model.links)
    kept = sorted(sorted(pair) for pair in pairs if pair <= known and len(pair) == 2)
    return tuple((one, other) for one, other in kept)


def _reach(robot: RobotDescriptor, made: RobotDescriptor) -> float:
    """Return the reach with another tool: longer by what its centre point is farther out."""
    last = robot.arm_joints[-1] if robot.arm_joints else robot.joints[-1]
    return max(round(robot.reach + _length(made, last) - _length(robot, last), 3), 0.01)


def _length(robot: RobotDescriptor, joint: str) -> float:
    """Return the distance from a joint to the tool centre point at the first keyframe (m)."""
    model = _model(robot.urdf)
    tree = kinematic_tree(model, robot.joints)
    poses = tree.forward(np.array([robot.keyframe(robot.home.keyframe)], float))
    carried = next(one.child for one in model.joints if one.name == joint)
    centre = find_tcp(robot, tree).places(poses)[0]
    return float(np.linalg.norm(transform(inverse_pose(poses[0, tree.link(carried)]), centre)))


def _vector(pose: Floats) -> Vector3:
    x, y, z = pose[:3, 3].tolist()
    return (x, y, z)


def _quaternion(pose: Floats) -> Quaternion:
    w, x, y, z = quaternion_of(pose[:3, :3]).tolist()
    return (w, x, y, z)
