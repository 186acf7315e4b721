"""TCP control: from action numbers to the pose of a tool centre point, and on to joint targets.

Where no joints reach that pose, they are those that bring the TCP nearest to it, the place first.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from robot_layouts.kinematics.quaternions import inverted, multiplied, rotated
from robot_layouts.kinematics.rotations import pose_matrix
from robot_layouts.kinematics.solve import IkGoal, approach, shortfalls
from robot_layouts.simulation.backend import Backend, Joints, PoseFollower
from robot_layouts.simulation.control.joint_positions import DrivenGroup
from robot_layouts.simulation.maths import Floats, cos, norm, sin
from robot_layouts.simulation.readout import ReadoutIndex
from robot_layouts.simulation.rotations import Row, quaternion, upright
from robot_layouts.simulation.solvers import tree_of
from robot_layouts.simulation.state import State
from robots import JointGroup, RobotDescriptor
from robots.action_split import JOINTS_OF_A_POSE
from robots.urdf.tcp import find_tcp

_ONE = np.float32(1)
# Of approximate inverse kinematics.
_ROUNDS = 20
_LONGEST = 0.5  # way of a joint in a round (rad, m)
_STRIDE = 0.1  # way of the TCP in a round (m), until one brings it no nearer
_SHORTER = 0.3  # times that ever after
_NEAR_ENOUGH = 1e-4  # m; where the place is had, or no stride brings the TCP nearer
_GAIN = 1e-5, 1e-4  # m, rad; less counts as no gain
_BEYOND = 1e-3  # a limit, that a joint may be sent (rad, m)


def added(one: Row, other: Row) -> Row:
    """Return the sum of two points."""
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


def inverse(pose: Row) -> Row:
    """Return the inverse of a pose."""
    x, y, z, *quaternion = pose
    back = inverted((*quaternion,))
    return *rotated(back, (-x, -y, -z)), *back


def rotation(angles: Floats) -> Row:
    """Return the quaternion, w ≥ 0, of turns about x, then the new y, then the new z, (3,)."""
    cx, cy, cz = cos(angles)
    sx, sy, sz = sin(angles)
    both, other = sx * sy, cx * sy
    return quaternion(
        (cy * cz, -cy * sz, sy),
        (both * cz + cx * sz, both * -sz + cx * cz, -sx * cy),
        (-other * cz + sx * sz, -other * -sz + sx * cz, cx * cy),
    )


def clipped_turn(angles: Floats) -> Floats:
    """Return angles, (3,), scaled down to a norm of 1 if theirs is above."""
    length = norm(angles[None])[0]
    return angles * (_ONE / length) if length > _ONE else angles


class TcpController:
    """Drives a joint group by the pose of its TCP, in every world.

    Attributes:
        tool: The joint group.
        arm: Name of the robot or the limb whose TCP it is.
        targets: Where the TCP was last asked to be in its root link's frame, (N, 7).
        shortfalls: By how much the joints of the last step miss what it asked for, if the group
            approximates: place (m) and orientation (rad), (N, 2).
    """

    _upright = staticmethod(upright)

    def __init__(self, tool: DrivenGroup, layout: Layout) -> None:
        """Take what is driven."""
        assert tool.arm is not None
        self.tool, self.arm, group = tool, tool.arm, tool.group
        self._robot, self._limb = layout[tool.robot].robot, layout.arm(tool.arm).robot
        first, start = tool.own.start, tool.numbers.start
        self._own = slice(tool.joints.start - first, tool.joints.stop - first)
        self._place, self._angles = slice(start, start + 3), slice(start + 3, start + 6)
        moves, turns = group.frame.split(":")
        self._by_root, self._turns_by_root = moves.startswith("root"), turns.startswith("root")
        # Native scales a turn by its lower bound, so that 1 turns backwards.
        self._turn_scale = np.float32(group.ranges[-1][0])
        self._follower: PoseFollower | None = None
        self._arm: ApproximateArm | None = None
        self._limits: Floats = np.zeros((0, 2), np.float32)
        self._tcp_frame = self._link_frame = self._root_frame = 0
        self._roots: dict[bytes, Row] = {}
        self.targets: Floats = np.zeros((0, 7), np.float32)
        self.shortfalls: Floats = np.zeros((0, 2), np.float32)

    def build(self, backend: Backend, index: ReadoutIndex) -> None:
        """Find the frames, and what solves for joints."""
        tool, group = self.tool, self.tool.group
        self.find(index)
        self._follower = backend.pose_follower(
            tool.robot, self._limb.tcp_link, group.root_link, group.joints
        )
        self._limits = index.robots[tool.robot].limits[self._own]

    def find(self, index: ReadoutIndex) -> None:
        """Find the frames in worlds that were built."""
        links, root_link = index.links[self.tool.robot], self.tool.group.root_link
        self._tcp_frame, self._link_frame = index.tcps[self.arm], links[self._limb.tcp_link]
        self._root_frame = index.bases[self.tool.robot] if root_link is None else links[root_link]

    def begin(self, state: State, env_ids: Iterable[int]) -> None:
        """Let the targets of some worlds be where the TCPs are, which miss nothing."""
        if len(self.targets) != state.num_envs:
            self.targets = np.zeros((state.num_envs, 7), np.float32)
            self.shortfalls = np.zeros((state.num_envs, 2), np.float32)
        for env in env_ids:
            self.targets[env] = self._now(state, env)
            self.shortfalls[env] = 0.0

    def drive(self, action: Floats, scaled: Floats, state: State, env: int, joints: Floats) -> None:
        """Write the joint targets that bring the TCP where an action asks it to be.

        If there are none they are left as they are, or go as near as they get if the group
        approximates.

        Args:
            action: Of one world, (A,).
            scaled: The same, clipped and scaled to metres.
            state: The worlds before the step.
            env: Which world.
            joints: Joint targets of that world, (dof,) (rad, m), which hold the present joints.
        """
        wanted = self._wanted(action, scaled, state, env)
        if self.tool.group.target:
            self.targets[env] = wanted
        if self.tool.group.approximates:
            found, self.shortfalls[env] = self._nearest(wanted, state, env)
        else:
            found = self._followed(wanted, state, env)
        if found is not None:
            joints[self.tool.joints] = found

    # -- inside ------------------------------------------------------------------------------

    def _followed(self, wanted: Row, state: State, env: int) -> Joints | None:
        """Return the joints that ManiSkill's search finds, or None."""
        assert self._follower is not None
        pose: Floats = np.array(self._of_link(wanted, state, env), np.float32)
        qpos = state.joint_positions[env, self.tool.own]
        return self._follower.follow(pose[:3], pose[3:], qpos)

    def _nearest(self, wanted: Row, state: State, env: int) -> tuple[Joints, tuple[float, float]]:
        """Return the joints that bring the TCP where it is wanted, or nearest; and what misses."""
        tool, joints = self.tool, state.joint_positions[env].astype(float)
        if len(tool.group.joints) >= JOINTS_OF_A_POSE:
            found = self._followed(wanted, state, env)
            if found is not None:
                found = nearest_turns(found, joints[tool.joints], self._limits)
            if found is not None:
                return found, (0.0, 0.0)
        if self._arm is None:
            self._arm = ApproximateArm(self._robot, self._limb, tool.group)
        return self._arm.nearest(np.array(wanted, float), joints[tool.own])

    def _wanted(self, action: Floats, scaled: Floats, state: State, env: int) -> Row:
        """Return where the TCP is to be, in its root link's frame."""
        group, place = self.tool.group, tuple(scaled[self._place])
        turn = self._turn(action) if group.asks.turn else None
        before = ()
        if group.delta:
            before = tuple(self.targets[env]) if group.target else self._now(state, env)
        return self._asked(place, turn, before)

    def _asked(self, place: Row, turn: Row | None, before: Row) -> Row:
        """Return the pose that a place and a turn ask for, from the one before if they are ways."""
        if not self.tool.group.delta:
            assert turn is not None
            return *place, *turn
        spot, way = before[:3], before[3:]
        moved = place if self._by_root else rotated(way, place)
        if turn is not None:
            way = multiplied(turn, way) if self._turns_by_root else multiplied(way, turn)
        return *added(spot, moved), *self._upright(way)

    def _combined(self, first: Row, second: Row) -> Row:
        """Return ``first · second``: the pose ``second`` of what is seen from ``first``."""
        place = added(first[:3], rotated(first[3:], second[:3]))
        return *place, *self._upright(multiplied(first[3:], second[3:]))

    def _turn(self, action: Floats) -> Row:
        angles = action[self._angles]
        if self.tool.group.normalised:
            angles = clipped_turn(angles) * self._turn_scale
        return rotation(angles)

    def _now(self, state: State, env: int) -> Row:
        """Return where the TCP is, in its root link's frame."""
        root = state.all_poses[self._root_frame, env]
        key = root.tobytes()
        if key not in self._roots:  # roots seldom move
            if len(self._roots) > state.num_envs:
                self._roots.clear()
            self._roots[key] = inverse(tuple(root))
        return self._combined(self._roots[key], tuple(state.all_poses[self._tcp_frame, env]))

    def _of_link(self, wanted: Row, state: State, env: int) -> Row:
        """Return where the link that orients the TCP is, if the TCP is where it is wanted."""
        if self._tcp_frame == self._link_frame:
            return wanted
        tcp, link = (
            tuple(state.all_poses[frame, env]) for frame in (self._tcp_frame, self._link_frame)
        )
        return self._combined(wanted, self._combined(inverse(tcp), link))


class ApproximateArm:
    """An arm that goes as near to a pose of its TCP as it gets from where it is."""

    def __init__(self, robot: RobotDescriptor, arm: RobotDescriptor, group: JointGroup) -> None:
        """Read the robot's links.

        Args:
            robot: The robot.
            arm: The robot, or its limb whose TCP it is.
            group: The joints that may move.

        Raises:
            AssetError: If the robot's files cannot be found or read.
        """
        tree = tree_of(robot)
        tcp = find_tcp(arm, tree)
        root = () if group.root_link is None else (tree.link(group.root_link),)
        self._tree = needed = tree.towards([*tcp.needed, *root])
        self._root = 0 if group.root_link is None else needed.link(group.root_link)
        self._links = [needed.link(tree.links[link]) for link in tcp.links]
        self._turned, self._offset = needed.link(tree.links[tcp.turned]), tcp.offset
        self._free = [robot.joints.index(joint) for joint in group.joints]

    def nearest(self, pose: Joints, qpos: Joints) -> tuple[Joints, tuple[float, float]]:
        """Return the joints that bring the TCP nearest to a pose, and by how much it falls short.

        Args:
            pose: Of the TCP in the frame of the group's root link: position (m), then quaternion
                (wxyz), (7,).
            qpos: Where all joints of the robot are, (dof,) (rad, m).

        Returns:
            Positions of the group's joints, (joints,) (rad, m), and what is missing to the place
            (m) and to the orientation (rad).
        """
        joints = qpos
        root = self._tree.forward(joints[None])[0, self._root]
        wanted = root @ pose_matrix(pose[:3], pose[3:])
        goal = IkGoal(wanted[:3, 3], self._links, wanted[:3, :3], self._turned, self._offset)
        best, stride = self._misses(goal, joints), _STRIDE
        for _ in range(_ROUNDS):
            near = self._on_the_way(goal, joints, stride)
            moved = approach(self._tree, near, joints, self._free, _LONGEST, qpos[self._free])
            misses = self._misses(goal, moved)
            if _nearer(misses, best):
                joints, best = moved, misses
            elif min(best[0], stride) < _NEAR_ENOUGH:
                break
            else:
                stride *= _SHORTER
        return joints[self._free], best

    def _on_the_way(self, goal: IkGoal, joints: Joints, stride: float) -> IkGoal:
        """Return a goal whose place is at most a stride from where the TCP is."""
        poses = self._tree.forward(joints[None])[0]
        here = poses[self._links, :3, 3].mean(axis=0) + poses[self._turned, :3, :3] @ self._offset
        way = goal.position - here
        length = float(np.linalg.norm(way))
        return goal if length <= stride else replace(goal, position=here + way * (stride / length))

    def _misses(self, goal: IkGoal, joints: Joints) -> tuple[float, float]:
        away, turned_away = shortfalls(self._tree, goal, joints[None])
        return float(away[0]), float(turned_away[0])


def _nearer(misses: tuple[float, float], best: tuple[float, float]) -> bool:
    """Tell whether a place is missed by less, or an orientation without losing the place."""
    place, turn = best[0] - misses[0], best[1] - misses[1]
    return place > _GAIN[0] or (place > -_GAIN[0] and turn > _GAIN[1])


def nearest_turns(found: Joints, present: Joints, limits: NDArray[np.floating]) -> Joints | None:
    """Return joints by the turn that is nearest to where they are, or None beyond their limits.

    Args:
        found: Joint positions, of which joints that turn without end lie in (-π, π], (joints,).
        present: Where they are now, (joints,) (rad, m).
        limits: Their lower and upper limits, (joints, 2); infinite without an end.
    """
    low, high = limits.astype(float).T
    turns = np.where(np.isinf(high - low), np.round((present - found) / (2 * np.pi)), 0.0)
    turned = np.where(turns == 0.0, found, found + turns * 2 * np.pi)
    inside = (turned >= low - _BEYOND) & (turned <= high + _BEYOND)
    return turned if inside.all() else None
