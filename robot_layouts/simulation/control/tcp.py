"""TCP control: from action numbers to the pose of a tool centre point, and on to joint targets."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from layouts import Layout
from robot_layouts.kinematics.quaternions import inverted, multiplied
from robot_layouts.simulation.backend import Backend, Joints, PoseFollower
from robot_layouts.simulation.control.approximate import ApproximateArm, nearest_turns
from robot_layouts.simulation.control.joint_positions import DrivenGroup
from robot_layouts.simulation.maths import Floats, cos, norm, sin
from robot_layouts.simulation.readout import ReadoutIndex
from robot_layouts.simulation.rotations import Row, quaternion, upright
from robot_layouts.simulation.state import State
from robots.action_split import JOINTS_OF_A_POSE

_ONE, _NOTHING = np.float32(1), np.float32(0)


def row(numbers: Iterable[Any]) -> Row:
    """Return numbers of a float32 array one by one."""
    return tuple(numbers)


def turned(quaternion: Row, point: Row) -> Row:
    """Return a point, three numbers, turned by a quaternion."""
    return multiplied(multiplied(quaternion, (_NOTHING, *point)), inverted(quaternion))[1:]


def added(one: Row, other: Row) -> Row:
    """Return the sum of two points."""
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


def inverse(pose: Row) -> Row:
    """Return the inverse of a pose."""
    x, y, z, *quaternion = pose
    back = inverted((*quaternion,))
    return *turned(back, (-x, -y, -z)), *back


def combined(first: Row, second: Row) -> Row:
    """Return ``first · second``: the pose ``second`` of what is seen from ``first``."""
    place = added(first[:3], turned(first[3:], second[:3]))
    return *place, *upright(multiplied(first[3:], second[3:]))


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

    def __init__(self, tool: DrivenGroup, layout: Layout) -> None:
        """Take what is driven."""
        assert tool.arm is not None
        self.tool, self.arm, group = tool, tool.arm, tool.group
        self._robot, self._limb = layout[tool.robot].robot, layout.arm(tool.arm).robot
        start = tool.numbers.start
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
        tool, links = self.tool, index.links[self.tool.robot]
        root_link = tool.group.root_link
        self._tcp_frame, self._link_frame = index.tcps[self.arm], links[self._limb.tcp_link]
        self._root_frame = index.bases[tool.robot] if root_link is None else links[root_link]
        self._follower = backend.pose_follower(
            tool.robot, self._limb.tcp_link, root_link, tool.group.joints
        )
        own = slice(tool.joints.start - tool.own.start, tool.joints.stop - tool.own.start)
        self._limits = index.robots[tool.robot].limits[own]

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
        group, place = self.tool.group, row(scaled[self._place])
        turn = self._turn(action) if group.asks.turn else None
        if not group.delta:
            assert turn is not None
            return *place, *turn
        before = row(self.targets[env]) if group.target else self._now(state, env)
        spot, way = before[:3], before[3:]
        moved = place if self._by_root else turned(way, place)
        if turn is not None:
            way = multiplied(turn, way) if self._turns_by_root else multiplied(way, turn)
        return *added(spot, moved), *upright(way)

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
            self._roots[key] = inverse(row(root))
        return combined(self._roots[key], row(state.all_poses[self._tcp_frame, env]))

    def _of_link(self, wanted: Row, state: State, env: int) -> Row:
        """Return where the link that orients the TCP is, if the TCP is where it is wanted."""
        if self._tcp_frame == self._link_frame:
            return wanted
        tcp, link = (
            row(state.all_poses[frame, env]) for frame in (self._tcp_frame, self._link_frame)
        )
        return combined(wanted, combined(inverse(tcp), link))
