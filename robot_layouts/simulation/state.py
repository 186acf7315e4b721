"""What a batch of worlds looks like after a step: poses, joints, contacts, grasps, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache, wraps
from typing import Any, Concatenate, Literal, ParamSpec, TypeVar
from warnings import warn

import numpy as np
from numpy.typing import NDArray

from robot_layouts.simulation.backend import Readout, Velocity
from robot_layouts.simulation.grasps import grasped
from robot_layouts.simulation.maths import (
    Array,
    Flags,
    Floats,
    concatenate,
    counted,
    doubles,
    full,
    like,
    norm,
    stack,
)
from robot_layouts.simulation.readout import Lost, MeanFrame, Moment, ReadoutIndex
from robot_layouts.simulation.rotations import last_euler_angle, rotation_matrix
from robots import Fingers, SimulationError
from robots.descriptor import Vector3

_NOTHING = np.empty(0, np.float32)
_Arguments = ParamSpec("_Arguments")
_Owner = TypeVar("_Owner")
_State = TypeVar("_State", bound="State")
_Value = TypeVar("_Value")


def remembered(
    compute: Callable[Concatenate[_State, _Arguments], _Value],
) -> Callable[Concatenate[_State, _Arguments], _Value]:
    """Compute once per state and arguments: rewards ask for what success was judged by.

    Views of what was read cost less than a look-up and are not remembered.
    """

    @wraps(compute)
    def look_up(self: _State, *args: _Arguments.args, **kwargs: _Arguments.kwargs) -> _Value:
        key = (compute, args, *kwargs.items()) if kwargs else (compute, args)
        found = self.memo.get(key)
        if found is None:
            found = self.memo[key] = compute(self, *args, **kwargs)
        return found

    return look_up


def once_per_state(
    compute: Callable[[_Owner, State], _Value],
) -> Callable[[_Owner, State], _Value]:
    """Compute a method of a task once per state: rewards need what success was judged by."""

    @wraps(compute)
    def look_up(self: _Owner, state: State) -> _Value:
        value = state.memo.get(compute)
        if value is None:
            value = state.memo[compute] = compute(self, state)
        return value

    return look_up


class State:
    """A read-out of N worlds right after a step or a reset.

    Poses and joints are read at once; velocities and contacts on first use, which must be before
    the simulation moves on. Poses are position (m) and quaternion (wxyz), in the world frame.
    Numbers are float32 arrays that share memory with the state: copy one before changing it.

    Attributes:
        num_envs: Number of worlds N.
        all_poses: Poses of all frames of `ReadoutIndex`, (F, N, 7).
        joint_positions: Joint positions of all robots, in layout order, (N, dof) (rad, m).
        joint_velocities: Their velocities, (N, dof) (rad/s, m/s).
        memo: What was computed from it already.
    """

    __slots__ = (
        "_distances",
        "_forces",
        "_index",
        "_moment",
        "_offsets",
        "_speeds",
        "_velocities",
        "all_poses",
        "joint_positions",
        "joint_velocities",
        "memo",
        "num_envs",
    )

    def __init__(self, readout: Readout, index: ReadoutIndex, moment: Moment) -> None:
        """Take what was read.

        Args:
            readout: Poses and joints.
            index: Where what stands in them.
            moment: Reads the rest.
        """
        poses, self.joint_positions, self.joint_velocities = readout
        self._index, self._moment = index, moment
        self.memo: dict[Any, Any] = {}
        self._offsets = self._distances = self._velocities = self._speeds = _NOTHING
        self._forces: tuple[int, Floats | None] = 0, None  # of so many pairs
        self.num_envs = len(self.joint_positions)
        self.all_poses = with_means(poses, index.mean_frames) if index.mean_frames else poses

    @property
    def scale(self) -> float:
        """How long in the world what the state calls 1 m is (m); 1 unless a task is fitted."""
        return 1.0

    def lost(self) -> Lost | None:
        """Return the first robot or body with numbers that are not finite, or None.

        Looks at poses and joints.
        """
        index = self._index
        for robot in index.robots:
            parts = [self.all_poses[frame] for frame in index.links[robot].values()]
            parts += [self.qpos(robot), self.qvel(robot)]
            if (env := _first_not_finite(np.concatenate(parts, 1))) is not None:
                return Lost(f"robot {robot!r}", env, robot)
        for body, frame in index.bodies.items():
            if (env := _first_not_finite(self.all_poses[frame])) is not None:
                return Lost(f"body {body!r}", env)
        return None

    # -- arrays of one's own -----------------------------------------------------------------

    def array(self, values: Any) -> Floats:
        """Return numbers as the state's arrays are: float32, where those are.

        Args:
            values: Nested tuples of numbers, or lists; the array of tuples is kept, and must not
                be changed.
        """
        return like(self.joint_positions, values)

    def doubles(self, values: Sequence[Any]) -> Array:
        """Return numbers as an array of its own, float64: where native's are."""
        return doubles(self.joint_positions, values)

    def full(self, value: float) -> Array:
        """Return a number or a flag for every environment, shape (N,)."""
        return full(self.joint_positions, self.num_envs, value)

    def among(self, env_ids: Iterable[int]) -> Flags:
        """Tell which environments some numbers are, shape (N,) bool."""
        flags = self.full(False)
        flags[list(env_ids)] = True
        return flags

    @property
    def env_ids(self) -> Array:
        """The environments' numbers, shape (N,) int64."""
        return counted(self.joint_positions, self.num_envs)

    # -- frames ------------------------------------------------------------------------------

    def poses(self, frames: NDArray[np.intp]) -> Floats:
        """Return a copy of the poses of some frames of `ReadoutIndex`, shape (K, N, 7)."""
        return self.all_poses.take(frames, 0)

    # -- bodies ------------------------------------------------------------------------------

    def pose(self, body: str) -> Floats:
        """Pose of a body, shape (N, 7)."""
        return self.all_poses[self._index.bodies[body]]

    def position(self, body: str) -> Floats:
        """Position of a body, shape (N, 3) (m)."""
        return self.all_poses[self._index.bodies[body], :, :3]

    def quaternion(self, body: str) -> Floats:
        """Orientation of a body, wxyz, shape (N, 4)."""
        return self.all_poses[self._index.bodies[body], :, 3:]

    @remembered
    def rotation(self, body: str) -> Floats:
        """Rotation matrix of a body, shape (N, 3, 3); its columns are the body's axes."""
        return rotation_matrix(self.quaternion(body))

    @remembered
    def last_euler_angle(self, body: str) -> Floats:
        """Angle about z of a body turned about its own x, then y, then z, shape (N,) (rad)."""
        return last_euler_angle(self.rotation(body))

    def linear_velocity(self, body: str) -> Floats:
        """Linear velocity of a body in the world frame, shape (N, 3) (m/s)."""
        return self._velocity(body, "linear")

    def angular_velocity(self, body: str) -> Floats:
        """Angular velocity of a body in the world frame, shape (N, 3) (rad/s)."""
        return self._velocity(body, "angular")

    def speed(self, body: str) -> Floats:
        """Euclidean norm of a body's linear velocity, shape (N,) (m/s)."""
        return self._speed(body, "linear")

    def spin(self, body: str) -> Floats:
        """Euclidean norm of a body's angular velocity, shape (N,) (rad/s)."""
        return self._speed(body, "angular")

    def velocities(self, bodies: tuple[str, ...]) -> Floats:
        """Linear and angular velocities of bodies, (bodies, 2, N, 3) (m/s and rad/s, world)."""
        self._index.bodies.expect(*bodies)
        if not bodies:
            return np.empty((0, 2, self.num_envs, 3), np.float32)
        both = self._moment.velocities(_both_velocities(bodies))
        return both.reshape(len(bodies), 2, self.num_envs, 3)

    def root_velocities(self) -> Floats:
        """Linear and angular velocity of each robot's root, (robots, N, 6) (m/s, rad/s)."""
        return self._moment.root_velocities()

    @remembered
    def body_joints(self, body: str) -> Floats:
        """Positions, then velocities of a body's joints, (N, 2 · joints) (m, rad, and per s)."""
        self._index.body_joints.expect(body)
        return self._moment.body_joints(body)

    def joint(self, body: str, joint: str) -> Floats:
        """Position of a joint of a body, shape (N,) (m or rad)."""
        return self.body_joints(body)[:, self._index.body_joints[body][joint]]

    def joint_velocity(self, body: str, joint: str) -> Floats:
        """Velocity of a joint of a body, shape (N,) (m/s or rad/s)."""
        joints = self._index.body_joints[body]
        return self.body_joints(body)[:, len(joints) + joints[joint]]

    # -- robots ------------------------------------------------------------------------------

    def qpos(self, robot: str) -> Floats:
        """Joint positions of a robot in the order of its descriptor, shape (N, dof) (rad, m)."""
        return self.joint_positions[:, self._index.joints[robot]]

    def qvel(self, robot: str) -> Floats:
        """Joint velocities of a robot, ordered likewise, shape (N, dof) (rad/s, m/s)."""
        return self.joint_velocities[:, self._index.joints[robot]]

    def native_joints(self, robot: str) -> list[Floats]:
        """Joint positions and velocities of a robot in native's order, which is SAPIEN's."""
        joints, order = self._index.joints[robot], self._index.loaded_order[robot]
        rows = [self.joint_positions[:, joints], self.joint_velocities[:, joints]]
        return rows if order is None else [row[:, order] for row in rows]

    def arm_qvel(self, robot: str) -> Floats:
        """Joint velocities of a robot without its gripper, shape (N, arm joints) (rad/s)."""
        return self.joint_velocities[:, self._index.arm_joints[robot]]

    def link_pose(self, robot: str, link: str) -> Floats:
        """Pose of a link, shape (N, 7)."""
        return self.all_poses[self._index.links[robot][link]]

    def link_position(self, robot: str, link: str) -> Floats:
        """Position of a link, shape (N, 3) (m)."""
        return self.all_poses[self._index.links[robot][link], :, :3]

    def link_poses(self, robot: str, links: Iterable[str]) -> Floats:
        """Poses of links one after the other, shape (N, 7 · links)."""
        return concatenate([self.link_pose(robot, link) for link in links], 1)

    def base_pose(self, robot: str) -> Floats:
        """Pose of a robot's root link, shape (N, 7)."""
        return self.all_poses[self._index.bases[robot]]

    def base_position(self, robot: str) -> Floats:
        """Position of a robot's root link, shape (N, 3) (m)."""
        return self.all_poses[self._index.bases[robot], :, :3]

    def tcp_pose(self, robot: str) -> Floats:
        """Pose of a robot's tool centre point, shape (N, 7)."""
        return self.all_poses[self._index.tcps[robot]]

    def tcp_position(self, robot: str) -> Floats:
        """Position of a robot's tool centre point, shape (N, 3) (m)."""
        return self.all_poses[self._index.tcps[robot], :, :3]

    def finger_heights(self, robot: str) -> tuple[Floats, Floats] | None:
        """Height of a robot's two finger links, each (N,) (m), or None if it has none."""
        fingers = self._index.fingers[robot]
        if fingers is None:
            return None
        first, second = (self.all_poses[self._index.links[robot][f], :, 2] for f in fingers.links)
        return first, second

    def finger_gap(self, robot: str) -> Floats:
        """Distance between the origins of a robot's two finger links, shape (N,) (m).

        Raises:
            SimulationError: If the robot has no fingers.
        """
        fingers = self._index.fingers[robot]
        if fingers is None:
            raise SimulationError(f"robot {robot!r} has no fingers")
        first, second = (self._index.links[robot][link] for link in fingers.links)
        return self._distance(second, first)

    @remembered
    def gripper_opening(self, robot: str) -> Floats:
        """How far a robot's gripper is open, shape (N,): 0 closed, 1 wide open, 1 without one."""
        gripper = self._index.grippers[robot]
        if gripper is None:
            return self.full(1.0)
        joints, widest = gripper
        return self.joint_positions[:, joints].sum(1) / widest

    @remembered
    def arm_speed(self, robot: str) -> Floats:
        """Euclidean norm of the arm's joint velocities, shape (N,) (rad/s)."""
        return norm(self.arm_qvel(robot))

    @remembered
    def is_static(self, robot: str, threshold: float = 0.2) -> Flags:
        """Whether no arm joint is faster than ``threshold`` (rad/s), shape (N,) bool."""
        slow: Any = abs(self.joint_velocities[:, self._index.arm_joints[robot]]) <= threshold
        return slow.all(1)

    # -- contacts ----------------------------------------------------------------------------

    def contact_force(self, robot: str, link: str, body: str | None = None) -> Floats:
        """Sum of the contact forces of a body on a link, shape (N, 3) (N, world frame).

        Args:
            robot: Robot name.
            link: Link name.
            body: Body name; None sums the forces of all that touches the link, links as well.
        """
        number = self._index.force(robot, link, body)
        forces = self._all_forces(number)
        return np.zeros((self.num_envs, 3), np.float32) if forces is None else forces[number]

    @remembered
    def is_grasping(self, robot: str, body: str, max_angle: float | None = None) -> Flags:
        """Whether a robot's two fingers hold a body, shape (N,) bool; see `robots.Fingers`.

        Args:
            robot: Robot name.
            body: Body name.
            max_angle: Largest angle between force and opening direction (degrees), if not that
                of the robot's fingers.
        """
        fingers = self._index.fingers[robot]
        if fingers is None:
            warn(
                f"{robot!r} has no fingers, so that is_grasping({robot!r}, {body!r}) is never true;"
                " a task that needs them says so in `needs`",
                RuntimeWarning,
                stacklevel=3,
            )
            return np.zeros(self.num_envs, bool)
        pairs = self._index.grasp(robot, body)
        forces = self._all_forces(pairs[-1])
        if forces is None:
            return np.zeros(self.num_envs, bool)
        if max_angle is not None:
            fingers = within(fingers, max_angle)
        poses = [self.link_pose(robot, link) for link in fingers.links]
        return grasped(fingers, forces.take(pairs, 0), poses)

    @remembered
    def is_held(self, robot: str, body: str, fingers: Fingers) -> Flags:
        """Whether two links of a robot hold a body as fingers do, shape (N,) bool.

        For hands of more than two fingers, and what grasps besides a robot's own fingers.

        Args:
            robot: Robot name.
            body: Body name.
            fingers: The links, and what counts as a grasp.
        """
        forces = stack([self.contact_force(robot, link, body) for link in fingers.links])
        poses = [self.link_pose(robot, link) for link in fingers.links]
        return grasped(fingers, forces, poses)

    # -- distances ---------------------------------------------------------------------------

    def offset(self, start: str, end: str) -> Floats:
        """Way from one body's origin to another's, shape (N, 3) (m, world frame)."""
        return self._offset(self._index.bodies[start], self._index.bodies[end])

    def distance(self, start: str, end: str) -> Floats:
        """Distance between the origins of two bodies, shape (N,) (m)."""
        return self._distance(self._index.bodies[start], self._index.bodies[end])

    def planar_distance(self, start: str, end: str) -> Floats:
        """Distance between the origins of two bodies seen from above, shape (N,) (m)."""
        return self._distance(self._index.bodies[start], self._index.bodies[end], planar=True)

    def tcp_offset(self, robot: str, body: str) -> Floats:
        """Way from a robot's tool centre point to a body's origin, shape (N, 3) (m, world)."""
        return self._offset(self._index.tcps[robot], self._index.bodies[body])

    def tcp_distance(self, robot: str, body: str) -> Floats:
        """Distance from a robot's tool centre point to a body's origin, shape (N,) (m)."""
        return self._distance(self._index.tcps[robot], self._index.bodies[body])

    # -- inside ------------------------------------------------------------------------------

    def _offset(self, start: int, end: int) -> Floats:
        place = self._index.pairs.place(start, end, planar=False)
        return self._all_offsets(place)[place]

    def _distance(self, start: int, end: int, *, planar: bool = False) -> Floats:
        place = self._index.pairs.place(start, end, planar=planar)
        if place >= len(self._distances):
            self._measure()
        return self._distances[place]

    def _measure(self) -> None:
        """Take all distances and speeds that were ever asked for; norms cost little but the call.

        Those speeds are left out whose velocities were not read in time.
        """
        ways = self._all_offsets(self._index.pairs.frames.shape[1] - 1)
        velocities = self._velocities
        if not self._moment.past:
            velocities = self._all_velocities(len(self._index.velocities.keys) - 1)
        lengths = norm(concatenate([rows for rows in (ways, velocities) if len(rows)]))
        self._distances, self._speeds = lengths[: len(ways)], lengths[len(ways) :]

    def _all_offsets(self, place: int) -> Floats:
        """Offsets of all pairs that were ever asked for, (K, N, 3), at least up to ``place``."""
        if place >= len(self._offsets):
            pairs = self._index.pairs
            ends, starts = self.all_poses.take(pairs.frames, 0)
            ways = ends - starts
            ways[pairs.planar, :, 2] = 0.0  # exact: a zero adds nothing to a norm
            self._offsets = ways[:, :, :3]
        return self._offsets

    def _velocity(self, body: str, kind: Literal["linear", "angular"]) -> Floats:
        place = self._index.velocity(body, kind)
        return self._all_velocities(place)[place]

    def _speed(self, body: str, kind: Literal["linear", "angular"]) -> Floats:
        place = self._index.velocity(body, kind)
        if place >= len(self._speeds):
            self._all_velocities(place)
            self._measure()
        return self._speeds[place]

    def _all_velocities(self, place: int) -> Floats:
        """Velocities that were ever asked for, (K, N, 3), at least up to ``place``."""
        if place >= len(self._velocities):
            self._velocities = self._moment.velocities(self._index.velocities.keys)
        return self._velocities

    def _all_forces(self, place: int) -> Floats | None:
        """Forces of pairs that were ever asked for, (P, N, 3), at least up to ``place``.

        None if there are none anywhere.
        """
        count, forces = self._forces
        if place >= count:
            pairs = self._index.forces.keys
            forces = self._moment.forces(pairs)
            self._forces = len(pairs), forces
        return forces


def with_means(poses: Floats, means: Sequence[MeanFrame]) -> Floats:
    """Return poses, (F, N, 7), and after them those of frames that lie between or beside others.

    Args:
        poses: Of those others.
        means: See `ReadoutIndex`.
    """
    between = poses[[orientation for orientation, _, _ in means]]
    for row, (_, points, offset) in zip(between, means, strict=True):
        row[:, :3] = sum(poses[point, :, :3] for point in points) / len(points)
        if any(offset):
            row[:, :3] += _turned(row[:, 3:], offset)
    return concatenate((poses, between))


def _turned(quaternion: Floats, vector: Vector3) -> Floats:
    """Return a vector turned by quaternions, wxyz, (N, 4); shape (N, 3)."""
    (w, x, y, z), (a, b, c) = quaternion.T, vector
    p, q, r = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return stack(
        (a + w * p + y * r - z * q, b + w * q + z * p - x * r, c + w * r + x * q - y * p), 1
    )


@cache  # asked for with every state that is recorded
def _both_velocities(bodies: tuple[str, ...]) -> tuple[Velocity, ...]:
    return tuple(Velocity(body, kind) for body in bodies for kind in ("linear", "angular"))


@cache  # making one checks it, which is too slow for every step
def within(fingers: Fingers, max_angle: float) -> Fingers:
    """Return fingers whose force may be so far from straight (degrees)."""
    return replace(fingers, max_angle=max_angle)


def _first_not_finite(rows: Floats) -> int | None:
    wrong = ~np.isfinite(rows).all(1)
    return int(wrong.argmax()) if wrong.any() else None
