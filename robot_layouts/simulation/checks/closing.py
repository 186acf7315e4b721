"""Closes a gripper on a floating cube, and sees whether and how it holds it."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from layouts import Layout
from objects.shapes import Box
from robot_layouts.kinematics.rotations import Floats, inverse, inverse_pose, pose_matrix, rotate
from robot_layouts.simulation.backend import CLONING
from robot_layouts.simulation.checks.overlaps import stand
from robot_layouts.simulation.checks.trial import NAME, RobotAlone
from robot_layouts.simulation.physics import SAPIEN_DEFAULTS
from robots.gripper_motion import gripper_motion

CUBE = "cube"  # its name in the world

_CLOSING, _HOLDING, _SHAKING = 200, 20, 40  # steps
_CLOSE, _HOLD = 30.0, 3.0  # N with which fingers close until they feel the cube, and hold it
_STEP = 2e-4  # m by which they close in a step at least
_SHAKE, _PERIOD = 0.1, 10  # rad or m to both sides, and steps; 0.5 m away that is some 8 m/s²
_ROOM = 0.02  # of the cube's side: farther a cube moves in a step that is inside the hand
_WEIGHTLESS = replace(SAPIEN_DEFAULTS, gravity=(0.0, 0.0, 0.0))


class Closed(NamedTuple):
    """What was seen.

    Attributes:
        grasped: Whether the fingers grasped it when they had closed.
        held: Whether they still did when the arm had shaken it.
        slipped: How far it moved in the hand meanwhile (m); infinite if it was thrown away.
        share: How far the gripper was open once it had closed; see
            `robots.gripper_motion.GripperMotion`.
        pose: Of the cube in the TCP link's frame then, (4, 4) (m).
    """

    grasped: bool
    held: bool
    slipped: float
    share: float
    pose: Floats


class Closing:
    """A gripper of a robot alone, that closes on a cube which floats between its fingers."""

    def __init__(self, layout: Layout, arm: str, side: float, simulator: str = CLONING) -> None:
        """Take the gripper.

        Args:
            layout: The robot alone, under the name `NAME`.
            arm: The robot, or the limb, by its name in the layout.
            side: Of the cube (m).
            simulator: In which it does; see `robot_layouts.simulation.Simulation`.

        Raises:
            DescriptorError: If it has no fingers.
            RobotLayoutsError: If the robot cannot be built.
        """
        layout = layout.in_control_mode("pd_joint_pos")
        self._arm, self._part, self._side = arm, layout.arm(arm).robot, side
        self._motion = gripper_motion(self._part)
        self._joints = layout[NAME].robot.joints
        self._gripper = [self._joints.index(joint) for joint in self._motion.joints]
        cube = Box((side / 2, side / 2, side / 2))
        self._alone = RobotAlone(layout, (CUBE, cube), physics=_WEIGHTLESS, simulator=simulator)

    def has_room(self, open_: Floats, place: tuple[Floats, Floats]) -> bool:
        """Return whether the cube is not inside the open hand; see `close`."""
        self._begin(open_, place)
        self._alone.step(self._alone.numbers_for(open_.tolist()))
        away = self._alone.simulation.read().position(CUBE)[0].astype(float) - place[0]
        return float(np.linalg.norm(away)) < _ROOM * self._side

    def close(self, open_: Floats, place: tuple[Floats, Floats], firmness: float = 1.0) -> Closed:
        """Close on the cube, hold it, and shake it with the arm's first joint.

        Args:
            open_: All joints of the robot at first, (dof,) (rad, m).
            place: Where the cube floats then: its place, (3,) (m), and orientation, wxyz.
            firmness: Factor on the force with which it is held.
        """
        self._begin(open_, place)
        alone, target = self._alone, open_.copy()
        for _ in range(_CLOSING):
            target[self._gripper] = self._pressed(firmness)
            alone.step(alone.numbers_for(target))
        grasped, first, share = self._grasps(), self._in_hand(), self._share()
        pose = self._in_link()
        slipped, grasps = 0.0, list[bool]()
        arm = [joint for joint in self._part.joints if joint in self._part.arm_joints][:1]
        for step in range(_HOLDING + _SHAKING):
            target[self._gripper] = self._pressed(firmness)
            shaken = target.copy()
            for joint in arm:
                turns = max(step - _HOLDING, 0) / _PERIOD
                shaken[self._joints.index(joint)] += _SHAKE * np.sin(2 * np.pi * turns)
            alone.step(alone.numbers_for(shaken))
            grasps.append(self._grasps())
            way = float(np.linalg.norm(self._in_hand() - first))
            slipped = max(slipped, way if np.isfinite(way) else np.inf)
        held = grasped and any(grasps[-_PERIOD:])
        return Closed(grasped, held, slipped, share, pose)

    def _begin(self, open_: Floats, place: tuple[Floats, Floats]) -> None:
        stand(self._alone.simulation)
        world = self._alone.simulation.worlds[0]
        world.stand(NAME, open_)
        world.set_pose(CUBE, *place)

    def _share(self) -> float:
        now = self._alone.simulation.read().qpos(NAME)[0].astype(float)
        return self._motion.share_at(now[self._gripper])

    def _pressed(self, firmness: float) -> Floats:
        """Return where the gripper's joints are to go: to close, or to hold what they grasp."""
        share = self._share()
        closing = max(_CLOSE, self._motion.force(_STEP, self._motion.share(self._side)))
        force = firmness * _HOLD if self._grasps() else closing
        return self._motion.positions(share - self._motion.pressing(force, share))

    def _grasps(self) -> bool:
        return bool(self._alone.simulation.read().is_grasping(self._arm, CUBE)[0])

    def _in_link(self) -> Floats:
        state = self._alone.simulation.read()
        link = state.link_pose(self._arm, self._part.tcp_link)[0].astype(float)
        cube = state.pose(CUBE)[0].astype(float)
        return inverse_pose(pose_matrix(link[:3], link[3:])) @ pose_matrix(cube[:3], cube[3:])

    def _in_hand(self) -> Floats:
        """Return where the cube is in the frame of the first finger, (3,) (m)."""
        state, fingers = self._alone.simulation.read(), self._part.fingers
        assert fingers is not None  # or it had no gripper that moves
        finger = state.link_pose(self._arm, fingers.links[0])[0].astype(float)
        return rotate(inverse(finger[3:]), state.pose(CUBE)[0, :3].astype(float) - finger[:3])
