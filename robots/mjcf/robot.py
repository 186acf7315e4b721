"""Which bodies and joints of an MJCF are the robot, and what they are called."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robot_layouts.core.errors import AssetError, DescriptorError
from robots.guessing.hints import DriveHint
from robots.mjcf.reading import Model, name_of

FREE, BALL, SLIDE, HINGE = range(4)  # MuJoCo's types of joints
JOINT, JOINT_IN_PARENT, TENDON = 0, 1, 3  # of what actuators drive; MuJoCo's numbers
FIXED_GAIN, AFFINE_GAIN = 0, 1  # MuJoCo's kinds of gains and biases
LOCKED = 1e6  # N·s/m, N·m·s/rad; a joint that is damped so much does not move
LISTED = 6  # names in a message


@dataclass(frozen=True, eq=False)
class MjcfRobot:
    """The part of a model that is the robot.

    Attributes:
        model: MuJoCo's model.
        roots: Bodies on the ground, each with a tree of its own.
        bodies: All its bodies, each after its parent.
        joints: Joints of each body that move, in MuJoCo's order.
        links: Link names by body.
        names: Joint names by joint.
        notes: What was left out and why, one sentence each.
    """

    model: Model
    roots: tuple[int, ...]
    bodies: tuple[int, ...]
    joints: dict[int, tuple[int, ...]]
    links: dict[int, str]
    names: dict[int, str]
    notes: tuple[str, ...]

    @property
    def moving(self) -> tuple[int, ...]:
        """All joints that move, in MuJoCo's order."""
        return tuple(joint for body in self.bodies for joint in self.joints[body])


def find_robot(model: Model, path: Path) -> MjcfRobot:
    """Tell the robot from what stands around it.

    Args:
        model: MuJoCo's model.
        path: The MJCF, for messages.

    Raises:
        AssetError: If it has a ball joint behind another joint.
        DescriptorError: If nothing of it is a robot.
    """
    roots = np.unique(model.body_rootid[1:]).tolist()
    root_of = model.body_rootid[model.jnt_bodyid]  # (joints,)
    jointed = set(root_of[np.isin(model.jnt_type, (SLIDE, HINGE))].tolist())
    if not jointed:
        raise DescriptorError(
            f"{path} has no joint that turns or slides; there is nothing to drive"
        )
    driven = [joint for i in range(model.nu) for joint, _ in _targets(model, i)]
    actuated = {int(root_of[joint]) for joint in driven}
    chosen = sorted(jointed & actuated or jointed)
    notes = [*_left_out(model, roots, jointed, chosen)]
    bodies = tuple(np.flatnonzero(np.isin(model.body_rootid, chosen)).tolist())
    joints: dict[int, tuple[int, ...]] = {}
    for body in bodies:
        joints[body], remarks = _moving(model, body, path)
        notes += remarks
    links = _unique((body, name_of(model, "body", body) or f"body{body}") for body in bodies)
    named = _unique(
        (joint, name_of(model, "joint", joint) or f"{links[body]}_joint")
        for body in bodies
        for joint in joints[body]
    )
    return MjcfRobot(model, tuple(chosen), bodies, joints, links, named, tuple(notes))


def _targets(model: Model, actuator: int) -> list[tuple[int, float]]:
    """Return the joints that an actuator drives, also by a tendon, with their coefficients."""
    target = int(model.actuator_trnid[actuator, 0])
    if model.actuator_trntype[actuator] in (JOINT, JOINT_IN_PARENT):
        return [(target, 1.0)]
    return tendon_joints(model, target) if model.actuator_trntype[actuator] == TENDON else []


def tendon_joints(model: Model, tendon: int) -> list[tuple[int, float]]:
    """Return the joints of a fixed tendon and their coefficients; none of a spatial one."""
    first = int(model.tendon_adr[tendon])
    wraps = range(first, first + int(model.tendon_num[tendon]))
    return [
        (int(model.wrap_objid[i]), float(model.wrap_prm[i]))
        for i in wraps
        if int(model.wrap_type[i]) == 1  # mjWRAP_JOINT
    ]


def _left_out(
    model: Model,
    roots: Sequence[int],
    jointed: Set[int],
    chosen: Sequence[int],
) -> Iterator[str]:
    """Yield what is no part of the robot."""
    still = [root for root in roots if root not in jointed]
    idle = [root for root in roots if root in jointed and root not in chosen]
    if still:
        yield f"left out: {_listing(model, still)}, in which no joint turns or slides"
    if idle:
        yield f"left out: {_listing(model, idle)}, of which no actuator drives a joint"
    ground = int(model.body_geomnum[0])
    if ground:
        yield f"left out: what stands on the ground without a body, {ground} shapes"


def _moving(model: Model, body: int, path: Path) -> tuple[tuple[int, ...], list[str]]:
    """Return the joints of a body that move, and remarks on the others.

    Raises:
        AssetError: If there is a ball joint among them.
    """
    moving: list[int] = []
    notes: list[str] = []
    for joint in np.flatnonzero(model.jnt_bodyid == body).tolist():
        kind = int(model.jnt_type[joint])
        name = name_of(model, "joint", joint) or name_of(model, "body", body)
        if kind == FREE or (kind == BALL and model.body_parentid[body] == 0):
            what = "flies freely" if kind == FREE else "turns on a ball joint"
            notes.append(
                f"joint {name!r}, by which the whole robot {what}, is fixed: a layout says where it"
                " stands"
            )
        elif kind == BALL:
            raise AssetError(
                f"{path}: joint {name!r} is a ball joint; only hinges and slides can be driven:"
                " three hinges in a row move as it does"
            )
        elif float(model.dof_damping[model.jnt_dofadr[joint]]) >= LOCKED:
            damping = float(model.dof_damping[model.jnt_dofadr[joint]])
            notes.append(f"joint {name!r} is fixed, as a damping of {damping:g} keeps it still")
        else:
            moving.append(joint)
    return tuple(moving), notes


def _listing(model: Model, bodies: Sequence[int]) -> str:
    names = [name_of(model, "body", body) or f"body{body}" for body in bodies]
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return ", ".join(names[:LISTED]) + more


def _unique(given: Iterator[tuple[int, str]]) -> dict[int, str]:
    """Return names by index, each with a number where it is taken."""
    taken: set[str] = set()
    return {index: take_name(name, taken) for index, name in given}


def take_name(name: str, taken: set[str]) -> str:
    """Return a name with a number where it is taken, and add it to what is taken."""
    free, count = name, 2
    while free in taken:
        free, count = f"{name}_{count}", count + 1
    taken.add(free)
    return free


def find_drives(robot: MjcfRobot) -> dict[str, DriveHint]:
    """Return what an MJCF says of the drive of each joint of a robot, by its name.

    An actuator whose force falls with the joint's position is a spring towards a position: of those
    on the joint itself stiffness and damping are taken. The joint's own damping comes to it.

    Args:
        robot: The robot.
    """
    model = robot.model
    drives: dict[str, DriveHint] = {}
    for joint in robot.moving:
        dof = int(model.jnt_dofadr[joint])
        stiffness, damping = _spring(model, joint)
        own = float(model.dof_damping[dof])
        drives[robot.names[joint]] = DriveHint(
            stiffness=stiffness or None,
            damping=(damping + own) if stiffness else None,
            armature=float(model.dof_armature[dof]) or None,
        )
    return drives


def find_efforts(robot: MjcfRobot) -> dict[int, float]:
    """Return the largest force of each joint's actuators, where an MJCF bounds it (N·m, N)."""
    model = robot.model
    efforts: dict[int, float] = {}
    for joint in robot.moving:
        found = [_force(model, i) * factor for i, factor in _actuators(model, joint)]
        total = sum(found) if found else math.inf
        if model.jnt_actfrclimited[joint]:
            total = min(total, float(abs(model.jnt_actfrcrange[joint]).max()))
        if 0 < total < math.inf:
            efforts[joint] = total
    return efforts


def dry_friction(robot: MjcfRobot) -> list[str]:
    """Return the names of the joints that rub."""
    rub = robot.model.dof_frictionloss
    return [robot.names[j] for j in robot.moving if rub[robot.model.jnt_dofadr[j]] > 0]


def _actuators(model: Model, joint: int) -> list[tuple[int, float]]:
    """Return the actuators of a joint, and the factor from their force to the joint's."""
    return [
        (actuator, abs(float(model.actuator_gear[actuator, 0])) * abs(coefficient))
        for actuator in range(model.nu)
        for target, coefficient in _targets(model, actuator)
        if target == joint and coefficient
    ]


def _spring(model: Model, joint: int) -> tuple[float, float]:
    """Return stiffness and damping of the actuators on a joint itself; 0 if they are no spring."""
    stiffness = damping = 0.0
    for actuator, gear in _actuators(model, joint):
        itself = model.actuator_trntype[actuator] != TENDON
        if itself and model.actuator_biastype[actuator] == AFFINE_GAIN:
            _, position, velocity = model.actuator_biasprm[actuator, :3].tolist()
            stiffness += max(-position, 0.0) * gear**2
            damping += max(-velocity, 0.0) * gear**2
    return stiffness, damping


def _force(model: Model, actuator: int) -> float:
    """Return the largest force of an actuator, before its gear; infinite if nothing bounds it."""
    found = math.inf
    if model.actuator_forcelimited[actuator]:
        found = float(abs(model.actuator_forcerange[actuator]).max())
    plain = int(model.actuator_biastype[actuator]) == 0
    plain &= int(model.actuator_gaintype[actuator]) == FIXED_GAIN
    if plain and model.actuator_ctrllimited[actuator]:  # a motor: what is asked for is its force
        gain = abs(float(model.actuator_gainprm[actuator, 0]))
        found = min(found, gain * float(abs(model.actuator_ctrlrange[actuator]).max()))
    return found
