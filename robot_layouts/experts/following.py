"""Carries out planned motions in a task, whatever its control modes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from robot_layouts.experts.motion_drives import NEAR, Aim, MotionDrive, drive_within_bounds
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.motion import Motion
from robot_layouts.simulation.backend import Overlap
from robot_layouts.simulation.checks.overlaps import between_robots, deepest
from robots import TaskError
from robots.action_split import is_gripper
from robots.gripper_motion import link_tree
from robots.urdf.tcp import find_tcp
from tasks import TaskEnv
from tasks.driving import driven_groups, joint_slices

WAIT = 40  # control steps without progress, after which something is in the way
AWAY = 0.05  # rad, m; farther from its start no motion is begun
_HALVINGS = 6  # of a step of the clock, until all numbers are within bounds
_ALIKE = 1e-6  # m, and of quaternions: of bases that stand in the same place
_ROUNDING = 1e-9  # s


@dataclass(frozen=True, eq=False)
class Followed:
    """The result of following a motion.

    Attributes:
        actions: What was done, (T, A).
        joint_errors: By robot, how far its joints were from where the motion has them at that
            time, at most, in its descriptor's order, (dof,) (rad, m).
        tcp_errors: By arm, the same of its TCP (m).
        strays: By robot, how far any of its links was from where the motion has it at that time
            (m).
        late: How much longer it took than planned, where a control mode could not keep up (s).
        contacts: Robots that were inside each other: the deepest overlap of each pair of links.
    """

    actions: NDArray[np.float32]
    joint_errors: Mapping[str, Floats]
    tcp_errors: Mapping[str, float]
    strays: Mapping[str, float]
    late: float
    contacts: tuple[Overlap, ...]


class Follower:
    """Says what to do next so that the robots of a task carry out a motion, in any control mode.

    Drives lag behind what they are driven to; they are driven further, by what follows from their
    stiffness and damping, and by what they missed. Where a control mode cannot keep up, the
    motion's clock goes slower, for all robots alike, so that they stay on their way. TCP modes
    leave it to the solver how an arm of more joints than needed holds its elbow, and those of
    positions alone how the TCP is turned: there only the TCP follows.

    Attributes:
        motion: What is carried out.
        time: Up to which moment of it the robots have been driven (s).
    """

    def __init__(
        self, task: TaskEnv, motion: Motion, grippers: Mapping[str, float] | None = None
    ) -> None:
        """Take what is to be done.

        Args:
            task: A task with one environment, whose robots stand where the motion begins.
            motion: Of robots of the task; its other robots stay where they are.
            grippers: By arm, the action number of its gripper meanwhile; the grippers of other arms
                move as the motion has it.

        Raises:
            TaskError: If the task has several environments, a robot of the motion is none of the
                task's or stands elsewhere, the control mode leaves joints alone that it moves, or
                an arm carries something and no number of its gripper is given.
            UnknownNameError: If there is no such arm.
        """
        self.motion, self.time = motion, 0.0
        self._task, self._seconds = task, 1 / task.scenario.control_frequency
        self._joints = joint_slices(task.layout)
        given = {task.layout.arm_name(arm): number for arm, number in (grippers or {}).items()}
        _check_task(task, motion)
        for held in motion.held:
            if motion.layout.arm_name(held.place) not in given:
                raise TaskError(
                    f"{held.place} carries {held.obstacle.name!r} in this motion; say what keeps"
                    f" its gripper closed: grippers={{{held.place!r}: -1.0}}"
                )
        self._still = task.simulation.read().joint_positions[0].astype(float)
        self._constant = np.zeros(task.layout.action_dim, np.float32)
        self._drives = self._driven(given)

    @property
    def ended(self) -> bool:
        """Whether the robots have been driven up to the end of the motion."""
        return self.time >= self.motion.duration - _ROUNDING

    def arrived(self) -> bool:
        """Return whether the motion has ended and the robots are there.

        Joints are there within `NEAR`; what is driven by where its TCP is, within `NEAR_TCP`.
        """
        state, end = self._task.simulation.read(), self.joints(self.motion.duration)
        return self.ended and all(drive.arrived(end, state) for drive in self._drives)

    def joints(self, time: float) -> Floats:
        """Return where the motion has all joints of the task's robots, (dof,) (rad, m)."""
        joints = self._still.copy()
        for name, own in self.motion.sample(time).items():
            joints[self._joints[name]] = own
        return joints

    def action(self) -> NDArray[np.float32]:
        """Return the next action, (A,), and let the clock go on."""
        state = self._task.simulation.read()
        for drive in self._drives:
            drive.learn(state)
        action = self._constant.copy()
        share = drive_within_bounds(self._drives, self._aim, state, action, _HALVINGS)
        self.time = min(self.time + share * self._seconds, self.motion.duration)
        return action

    # -- inside ------------------------------------------------------------------------------

    def _driven(self, grippers: Mapping[str, float]) -> list[MotionDrive]:
        """Return what moves along the motion, and note the numbers of what does not."""
        path = np.array([self.joints(time) for time in self.motion.times])
        moving = np.ptp(path, axis=0) > NEAR
        drives: list[MotionDrive] = []
        for driven in driven_groups(self._task.layout):
            moves = bool(moving[driven.joints].any())
            if is_gripper(driven.name) and (number := grippers.get(driven.arm or "")) is not None:
                self._constant[driven.numbers] = number
            elif driven.group.size and not driven.group.asks.drive:
                drives.append(MotionDrive(driven, self._task, moves=moves))
            elif moves:
                raise TaskError(
                    f"the motion moves {driven.robot}'s {driven.name}, which cannot be driven"
                    " along it in this control mode"
                )
        return drives

    def _aim(self, share: float) -> Aim:
        now, then = self.time, self.time + share * self._seconds
        change = np.zeros_like(self._still)
        speeds = self.motion.velocity([now, then])
        for name, rows in speeds.items():
            change[self._joints[name]] = share * (rows[1] - rows[0])
        here = self.joints(now)
        return Aim(here, self.joints(then) - here, change)


def follow(
    task: TaskEnv,
    motion: Motion,
    grippers: Mapping[str, float] | None = None,
    *,
    watch: Callable[[], None] = lambda: None,
) -> Followed:
    """Step a task until its robots have carried out a motion.

    Args:
        task: A task with one environment, whose robots stand where the motion begins.
        motion: Of robots of the task; its other robots stay where they are.
        grippers: By arm, the action number of its gripper meanwhile; the grippers of other arms
            move as the motion has it.
        watch: Called after every step.

    Returns:
        What was done, and how near to the motion the robots stayed.

    Raises:
        TaskError: If the motion does not fit this task, see `Follower`, or the robots make no
            progress for `WAIT` control steps: something is in the way, or the control mode cannot
            do it.
        UnknownNameError: If there is no such arm.
    """
    follower = Follower(task, motion, grippers)
    actions: list[NDArray[np.float32]] = []
    planned, came = [], []
    contacts: dict[tuple[str, str], Overlap] = {}
    idle = steps = 0
    while not follower.arrived():
        before = follower.time
        actions.append(follower.action())
        task.step(actions[-1][None])
        watch()
        planned.append(follower.joints(follower.time))
        came.append(task.simulation.read().joint_positions[0].astype(float))
        for overlap in between_robots(task.simulation.backend.overlaps(0)):
            pair = str(overlap.one), str(overlap.other)
            contacts[pair] = max(overlap, contacts.get(pair, overlap), key=lambda o: o.depth)
        steps += not follower.ended
        idle = 0 if follower.time > before else idle + 1
        if idle > WAIT:
            raise TaskError(_stuck(task.layout, follower, came[-1], contacts.values()))
    seconds = 1 / task.scenario.control_frequency
    errors = _errors(task.layout, np.array(planned), np.array(came))
    late = max(0, steps + 1 - ceil(motion.duration / seconds - _ROUNDING)) * seconds
    rows = np.array(actions, np.float32).reshape(-1, task.layout.action_dim)
    return Followed(rows, *errors, late, tuple(contacts.values()))


def _check_task(task: TaskEnv, motion: Motion) -> None:
    if task.num_envs != 1:
        raise TaskError(f"a motion is followed in 1 environment; the task has {task.num_envs}")
    state = task.simulation.read()
    standing = task.standing()
    for name, placement in motion.layout.items():
        own = standing.get(name)
        if own is None or own.robot.joints != placement.robot.joints:
            raise TaskError(
                f"the motion moves {name!r}, a {placement.robot.name}; the task has"
                f" {', '.join(f'{n}={p.robot.name}' for n, p in task.layout.items())}"
            )
        places = [(*p.base_position, *p.base_quaternion) for p in (own, placement)]
        if not np.allclose(*places, rtol=0, atol=_ALIKE):
            raise TaskError(f"the motion is of a layout in which {name!r} stands elsewhere")
        fingers = [
            joint
            for group, joints in own.robot.action_split.groups.items()
            if is_gripper(group)
            for joint in joints.joints
        ]
        away = np.abs(state.qpos(name)[0] - motion.positions[name][0])
        for joint, far in zip(own.robot.joints, away.tolist(), strict=True):
            if far > AWAY and joint not in fingers:
                raise TaskError(
                    f"{name}'s {joint} is {far:.3g} from where the motion begins; plan from where"
                    " the robots are"
                )


def _stuck(layout: Layout, follower: Follower, came: Floats, contacts: Iterable[Overlap]) -> str:
    """Say which joint is farthest from where it should be, and where robots touch most."""
    missing = np.abs(follower.joints(follower.time) - came)
    name, places = next(
        (n, p) for n, p in joint_slices(layout).items() if p.start <= int(missing.argmax()) < p.stop
    )
    joint = layout[name].robot.joints[int(missing.argmax()) - places.start]
    return (
        f"the robots make no progress at {follower.time:.2f} s of {follower.motion.duration:.2f} s:"
        f" {name}'s {joint} is {missing.max():.3g} (rad or m) from where it should be"
        + "".join(f"; {contact}" for contact in deepest(contacts, than=0.0)[:1])
    )


def _errors(
    layout: Layout, planned: Floats, came: Floats
) -> tuple[dict[str, Floats], dict[str, float], dict[str, float]]:
    """Return how far joints and links of each robot, and each arm's TCP, were from a plan."""
    joints: dict[str, Floats] = {}
    tcps: dict[str, float] = {}
    links: dict[str, float] = {}
    for name, places in joint_slices(layout).items():
        rows = planned[:, places], came[:, places]
        joints[name] = np.abs(rows[0] - rows[1]).max(axis=0)
        tree = link_tree(layout[name].robot)
        poses = [tree.forward(qpos) for qpos in rows]
        for arm in (arm for arm in layout.arms if layout.owner(arm) == name):
            tcp = find_tcp(layout.arm(arm).robot, tree)
            tcps[arm] = _farthest(*(tcp.places(rows) for rows in poses))
        links[name] = _farthest(*(rows[..., :3, 3] for rows in poses))
    return joints, tcps, links


def _farthest(places: Floats, others: Floats) -> float:
    return float(np.linalg.norm(places - others, axis=-1).max())
