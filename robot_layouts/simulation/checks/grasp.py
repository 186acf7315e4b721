"""Tries grippers: whether the TCP is where the fingers meet, and whether they hold a cube."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from layouts import Layout, single
from layouts.validation.collisions import Postures, fixed, nearest
from layouts.validation.collisions import stand as stand_hulls
from objects.shapes import Box
from robot_layouts.kinematics.rotations import (
    Floats,
    inverse,
    inverse_pose,
    pose_matrix,
    quaternion_of,
    rotate,
)
from robot_layouts.simulation.backend import CLONING
from robot_layouts.simulation.checks.overlaps import stand
from robot_layouts.simulation.checks.trial import NAME, RobotAlone
from robot_layouts.simulation.physics import SAPIEN_DEFAULTS
from robots import RobotDescriptor
from robots.action_split import is_gripper
from robots.bodies.hulls import convex_hull, load_model
from robots.gripper_motion import gripper_motion
from robots.parts import Fingers
from robots.urdf.tcp import find_tcp

OFF = 5e-3  # m; a TCP may be so far from where the fingers meet
SIDES, SHARE = (0.02, 0.03), 0.6  # m; and of how far the fingers part: the cube's side
SLIPS = 0.01  # m; a cube that moves farther in the hand is not held

_SHARES = 33  # postures from one end of the gripper to the other
_POINT = 1e-4  # m; half the size of the body that stands for a point
_AJAR = 1.4  # of the cube's side: how far the fingers are apart before they close
_DEEP = 0.1  # of the cube's side: how far it lies from the TCP towards the palm


class GraspTrial(NamedTuple):
    """What was seen of a gripper.

    Attributes:
        arm: The robot, or the limb, by its name in the layout.
        fingers: The two links that grasp; None if they are not known.
        tcp_off: How far the TCP is from where they meet (m), 0 between them or in their surfaces;
            infinite if they are not known or have no shapes.
        side: Of the cube that they were closed on (m); 0 if there was none.
        closed: Whether they grasped it when they had closed.
        held: Whether they still did when the arm had shaken it.
        slipped: How far it moved in the hand meanwhile (m).
    """

    arm: str
    fingers: tuple[str, str] | None
    tcp_off: float = np.inf
    side: float = 0.0
    closed: bool = False
    held: bool = False
    slipped: float = np.inf

    @property
    def between(self) -> bool:
        """Whether the TCP is where the fingers meet."""
        return self.tcp_off < OFF

    @property
    def grasps(self) -> bool:
        """Whether a cube stays in the hand."""
        return self.held and self.slipped < SLIPS

    @property
    def problem(self) -> str | None:
        """What is wrong, or None."""
        if self.fingers is None:
            return f"the fingers of {self.arm} are not known, so that its grasps go unnoticed"
        pair, side = " and ".join(self.fingers), f"a cube of {self.side * 1e3:.3g} mm"
        if np.isinf(self.tcp_off):
            return f"{pair} are not to be tried: one of them has no collision shapes"
        if not self.between:
            off = f"{self.tcp_off * 1e3:.3g} mm"
            return f"the TCP of {self.arm} is {off} from where {pair} meet"
        if self.side == 0:
            return f"{pair} do not part at the TCP of {self.arm}, so that nothing fits between them"
        if not self.closed:
            return f"{pair} close on {side} without grasping it"
        if not self.grasps:
            return f"{pair} grasp {side}, and lose it when the arm shakes it"
        return None


def try_grasps(robot: RobotDescriptor) -> Iterator[GraspTrial]:
    """Close each gripper of a robot on a cube, hold it, and shake it with the arm's first joint.

    Nothing has weight: the cube floats between the fingers until they have closed. If one cube is
    lost, a larger one is tried.

    Args:
        robot: The robot.

    Yields:
        What was seen of each gripper that is driven; nothing of a robot without one.

    Raises:
        RobotLayoutsError: If it cannot be built.
    """
    layout = single({NAME: robot})
    for arm in layout.places.values():
        part = layout.arm(arm).robot
        groups = part.action_split.groups
        if not any(is_gripper(name) and group.size for name, group in groups.items()):
            continue
        if part.fingers is None:
            yield GraspTrial(arm, None)
        else:
            yield _Gripper(robot, arm, part.fingers).trial()


class _Gripper:
    """A gripper of a robot alone, at places between its two ends, of which the first is closed."""

    def __init__(self, robot: RobotDescriptor, arm: str, fingers: Fingers) -> None:
        layout = single({NAME: robot})
        placement, part = layout[NAME], layout.arm(arm).robot
        self._layout, self._arm, self._fingers = layout, arm, fingers
        model = load_model(robot)
        tree, motion = model.kinematics, gripper_motion(part)
        gripper = [robot.joints.index(joint) for joint in motion.joints]
        rows = np.tile(np.array(placement.start_qpos), (_SHARES, 1))
        rows[:, gripper] = [motion.positions(at) for at in np.linspace(0, 1, _SHARES)]
        self._hulls = stand_hulls(NAME, placement.base_pose, model, rows)
        base = placement.base_pose
        poses = pose_matrix(base.position, base.quaternion) @ tree.forward(rows)
        self._tcps = find_tcp(part, tree).places(poses)
        bodies = [tree.bodies[tree.link(link)] for link in fingers.links]
        self._pairs = [
            [(i, 0) for i, hull in enumerate(model.hulls) if tree.bodies[hull.link] == body]
            for body in bodies
        ]
        self._roots = poses[:, [tree.link(link) for link in fingers.links]][..., :3, 3].mean(axis=1)
        self._rows = rows

    def trial(self) -> GraspTrial:
        """Compare TCP and fingers, and close them on a cube."""
        seen = GraspTrial(self._arm, self._fingers.links)
        if not all(self._pairs):
            return seen
        ends = np.array([self._near(at) for at in range(_SHARES)])
        gaps = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
        off = np.linalg.norm(ends - self._tcps[:, None], axis=2).max(axis=1)
        shut, wide = int(gaps.argmin()), int(gaps.argmax())
        seen = seen._replace(tcp_off=float(max(off[shut] - gaps[shut] / 2, 0.0)))
        between = range(wide, shut, 1 if shut > wide else -1)
        for largest in SIDES:
            side = min(SHARE * float(gaps[wide]), largest)
            if not (seen.between and side > 0):
                return seen
            fitting = [at for at in between if gaps[at] >= side][-1]
            ajar = [at for at in between if gaps[at] >= _AJAR * side][-1:] or [wide]
            open_, cube = self._rows[ajar[0]], self._cube(ends[fitting], fitting, side)
            closed = Closing(self._layout, self._arm, side).close(open_, cube)
            seen = seen._replace(
                side=side, closed=closed.grasped, held=closed.held, slipped=closed.slipped
            )
            if seen.grasps:
                break
        return seen

    def _near(self, at: int) -> Floats:
        """Return the points of both fingers that are nearest to the TCP, (2, 3) (m)."""
        tcp, ends = self._tcps[at], list[Floats]()
        corners = np.array(np.meshgrid(*[(-_POINT, _POINT)] * 3)).reshape(3, -1).T
        point = fixed("TCP", convex_hull(0, tcp + corners, "TCP"), 1)
        for pairs in self._pairs:
            approach = nearest(self._posture(at), point, pairs)
            if approach is None or approach.distance <= 0:
                ends.append(tcp)
            else:
                ends.append(np.array(approach.points[0]))
        return np.array(ends)

    def _cube(self, ends: Floats, at: int, side: float) -> tuple[Floats, Floats]:
        """Return place, (3,) (m), and orientation, wxyz, of a cube that lies between the fingers.

        It is turned as they part and as they point, and lies a little nearer to the palm than the
        TCP, which may be at the very end of the fingers.
        """
        one, other = ends
        apart = (one - other) / np.linalg.norm(one - other)
        ahead = ends.mean(axis=0) - self._roots[at]
        ahead -= ahead @ apart * apart
        if not np.linalg.norm(ahead) > _POINT:
            ahead = np.cross(apart, np.eye(3)[np.abs(apart).argmin()])
        ahead /= np.linalg.norm(ahead)
        turn = np.stack([np.cross(apart, ahead), apart, ahead], axis=1)
        return ends.mean(axis=0) - _DEEP * side * ahead, quaternion_of(turn)

    def _posture(self, at: int) -> Postures:
        hulls, one = self._hulls, slice(at, at + 1)
        return replace(hulls, poses=hulls.poses[one], low=hulls.low[one], high=hulls.high[one])


CUBE = "cube"  # its name in the world

_CLOSING, _HOLDING, _SHAKING = 200, 20, 40  # steps
_LONGER = 800  # more of them at most, if jaws still close, as slow ones do
_STILL = 1e-4  # of a share, by which those that have come to rest move in a step
_CLOSE, _HOLD = 30.0, 3.0  # N with which fingers close until they feel the cube, and hold it
_HEAVY = 0.04  # m; a cube of a longer side is held by as much more as it is heavier
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

    def close(
        self, open_: Floats, place: tuple[Floats, Floats], firmness: float = 1.0, shake: bool = True
    ) -> Closed:
        """Close on the cube, hold it, and shake it with the arm's first joint.

        Args:
            open_: All joints of the robot at first, (dof,) (rad, m).
            place: Where the cube floats then: its place, (3,) (m), and orientation, wxyz.
            firmness: Factor on the force with which it is held.
            shake: Whether it is held and shaken at all; if not, what it grasps it is to hold.
        """
        self._begin(open_, place)
        alone, target = self._alone, open_.copy()
        for _ in range(_CLOSING):
            self._press(target, firmness)
        for _ in range(_LONGER):
            share = self._share()
            if self._grasps():
                break
            self._press(target, firmness)
            if abs(self._share() - share) < _STILL:
                break
        grasped, first, share = self._grasps(), self._in_hand(), self._share()
        pose = self._in_link()
        if not shake:
            return Closed(grasped, grasped, 0.0, share, pose)
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

    def _press(self, target: Floats, firmness: float) -> None:
        target[self._gripper] = self._pressed(firmness)
        self._alone.step(self._alone.numbers_for(target.tolist()))

    def _share(self) -> float:
        now = self._alone.simulation.read().qpos(NAME)[0].astype(float)
        return self._motion.share_at(now[self._gripper])

    def _pressed(self, firmness: float) -> Floats:
        """Return where the gripper's joints are to go: to close, or to hold what they grasp."""
        share = self._share()
        closing = max(_CLOSE, self._motion.force(_STEP, self._motion.share(self._side)))
        hold = firmness * _HOLD * max(self._side / _HEAVY, 1.0) ** 3
        force = hold if self._grasps() else closing
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
