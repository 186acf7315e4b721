"""How the actuators of an MJCF drive its joints."""

from __future__ import annotations

import math

from robots.guessing.hints import DriveHint
from robots.mjcf.compiling import Model
from robots.mjcf.robot import JOINT, JOINT_IN_PARENT, TENDON, MjcfRobot, tendon_joints

FIXED_GAIN, AFFINE_GAIN = 0, 1  # MuJoCo's kinds of gains and biases


def find_drives(robot: MjcfRobot) -> dict[int, DriveHint]:
    """Return what an MJCF says of the drive of each joint of a robot.

    An actuator whose force falls with the joint's position is a spring towards a position: of those
    on the joint itself stiffness and damping are taken. The joint's own damping comes to it.

    Args:
        robot: The robot.
    """
    model = robot.model
    drives: dict[int, DriveHint] = {}
    for joint in robot.moving:
        dof = int(model.jnt_dofadr[joint])
        stiffness, damping = _spring(model, joint)
        own = float(model.dof_damping[dof])
        drives[joint] = DriveHint(
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
    found: list[tuple[int, float]] = []
    for actuator in range(model.nu):
        kind, target = int(model.actuator_trntype[actuator]), int(model.actuator_trnid[actuator, 0])
        gear = abs(float(model.actuator_gear[actuator, 0]))
        if kind in (JOINT, JOINT_IN_PARENT) and target == joint:
            found.append((actuator, gear))
        elif kind == TENDON:
            factors = [abs(c) for j, c in tendon_joints(model, target) if j == joint]
            found += [(actuator, gear * factor) for factor in factors if factor]
    return found


def _spring(model: Model, joint: int) -> tuple[float, float]:
    """Return stiffness and damping of the actuators on a joint itself; 0 if they are no spring."""
    stiffness = damping = 0.0
    for actuator in range(model.nu):
        kind = int(model.actuator_trntype[actuator])
        if kind in (JOINT, JOINT_IN_PARENT) and int(model.actuator_trnid[actuator, 0]) == joint:
            if int(model.actuator_biastype[actuator]) == AFFINE_GAIN:
                _, position, velocity = model.actuator_biasprm[actuator, :3].tolist()
                gear = float(model.actuator_gear[actuator, 0]) ** 2
                stiffness += max(-position, 0.0) * gear
                damping += max(-velocity, 0.0) * gear
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
