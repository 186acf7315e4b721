"""How grippers hold boxes, as was seen in physics."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from layouts import single
from robot_layouts.kinematics.rotations import Floats, pose_matrix, quaternion_of
from robot_layouts.simulation.checks.grasp import Closing
from robot_layouts.simulation.checks.trial import NAME
from robots import DescriptorError, RobotDescriptor
from robots.gripper_motion import GripperMotion, gripper_motion, link_tree
from robots.urdf.tcp import find_tcp
from tasks import Needs, TaskEnv

WIDER = (1.45, 2.0, 1.2)  # than a cube a gripper is open before it closes, in the order of trial
ROOMY = (1.7, 1.45)  # the same where an arm of few joints comes down on it, the best first
ASIDE = (0.0, 0.25, -0.25, 0.5, -0.5)  # of its side: how far from the middle of the pads it may be
MIDDLE_DEPTHS = (0.0, 0.2, -0.2, 0.4)  # shares of its side before the middle of the pads
PARALLEL = 0.05  # rad; jaws that are turned less need no trial
SLIPS = 0.1  # of a cube's side that it may move in a hand that is shaken


@dataclass(frozen=True, eq=False)
class Grip:
    """How a gripper holds a box.

    Attributes:
        pose: Of the box in the TCP link's frame before it closes, (4, 4) (m): its y axis runs from
            finger to finger, and its z axis about as the gripper points.
        share: How far the gripper is open before it closes.
        held: How far it is open when it holds the box.
        firmness: Factor on the usual force with which it has to hold the box.
        shut: Pose of the box in the TCP link's frame then.
        side: Of the box, from finger to finger (m).
    """

    pose: Floats
    share: float
    held: float
    firmness: float
    shut: Floats
    side: float


def swings(motion: GripperMotion, opening: float) -> bool:
    """Return whether a gripper's pads are turned against each other where they hold something.

    Args:
        motion: How it moves.
        opening: How wide the thing is (m).
    """
    return motion.angle(motion.share(opening)) >= PARALLEL


def role_grip(task: TaskEnv, robot: str) -> Grip | None:
    """Return how jaws that swing as they close take the widest thing that their role is to hold.

    None of other grippers, of a role that says nothing of such a thing, and of jaws that do not
    hold a cube of that width.

    Args:
        task: Says what the role needs.
        robot: Its name in the layout.

    Raises:
        AssetError: If the robot's files cannot be found.
    """
    needs = task.task.needs
    held = needs.get(robot, needs.get("*", Needs())).opening
    owner, arm = task.layout.owner(robot), task.layout.arm(robot).robot
    if held is None or not may_swing(arm):
        return None
    limb, whole = task.layout.arm_name(robot).removeprefix(owner), task.layout[owner].robot
    width, simulator = round(held * task.task.fit.scale, 6), task.scenario.simulator
    if not swings(gripper_motion(arm), width):
        return None
    grips = (
        grip_of(whole, limb, width, depth, 1.0, simulator, (wide,))
        for wide, depth in product(ROOMY, MIDDLE_DEPTHS)
    )
    return next((grip for grip in grips if grip is not None), None)


def may_swing(robot: RobotDescriptor) -> bool:
    """Return whether a robot has a driven gripper whose pads turn against each other."""
    motion = driven_gripper(robot)
    return motion is not None and bool(motion.angles.max() >= PARALLEL)


@lru_cache(maxsize=64)
def driven_gripper(robot: RobotDescriptor) -> GripperMotion | None:
    """Return how the gripper of a robot moves; None without one that is driven."""
    with suppress(DescriptorError):
        return gripper_motion(robot)
    return None


@lru_cache(maxsize=64)
def grip_of(
    robot: RobotDescriptor,
    limb: str,
    side: float,
    depth: float,
    firmness: float,
    simulator: str,
    wider: tuple[float, ...] = WIDER,
    shaken: bool = True,
) -> Grip | None:
    """Return how a gripper holds a cube, as it was seen to in physics; None if it does not.

    Args:
        robot: The robot.
        limb: What the limb's name adds to the robot's; empty if it is the robot itself.
        side: Of the cube (m).
        depth: How far before the middle of its pads the cube's middle is when they close, as a
            share of its side.
        firmness: Factor on the usual force with which it holds the cube.
        simulator: In which that is tried.
        wider: How far it may be open before it closes, as factors of the side, the best first.
        shaken: Whether the cube must stay in the hand when that is shaken.

    Raises:
        RobotLayoutsError: If the robot cannot be built.
    """
    layout = single({NAME: robot})
    own, closing = layout.arm(NAME + limb).robot, Closing(layout, NAME + limb, side, simulator)
    motion, tree = gripper_motion(own), link_tree(robot)
    gripper = [robot.joints.index(joint) for joint in motion.joints]
    base, tcp = layout[NAME].base_pose, find_tcp(own, tree).turned
    for wide, aside in product(wider, ASIDE):
        share, qpos = motion.share(wide * side), np.array(layout[NAME].start_qpos, float)
        qpos[gripper] = motion.positions(share)
        pose = np.eye(4)
        pose[:3, :3] = motion.turn
        pose[:3, 3] = motion.middle(share) + motion.turn @ (0.0, aside * side, depth * side)
        link = pose_matrix(base.position, base.quaternion) @ tree.forward(qpos[None])[0, tcp]
        cube = link @ pose
        place = cube[:3, 3], quaternion_of(cube[:3, :3])
        if not closing.has_room(qpos, place):
            continue
        closed = closing.close(qpos, place, firmness, shaken)
        if closed.held and closed.slipped < SLIPS * side:
            return Grip(pose, share, closed.share, firmness, closed.pose, side)
    return None
