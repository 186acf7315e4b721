"""Actions of one control mode as those of another: what moved robots there moves them here.

The episode is played in both. What its joints were driven to is the reference; at every step it is
put into the words of the other mode, from where the robots then are. Where a step of the other mode
is too short, several are taken. If the task is not solved then, other numbers of them are tried.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinematics.rotations import inverse, multiply, rotate, rotation_of
from robots import JointGroup
from simulation import State
from tasks import MultiRobotTask
from tasks.episode import REBUILT, follow, moments

Floats = NDArray[np.float64]

_PATIENCE = (4, 1, 10)  # steps for one of the reference; ManiSkill's replay_trajectory takes 4
_SETTLING = 10  # steps at the end, while the task is not solved
_NEARLY = 1.0 + 1e-6  # of a normalised number that is just at its bound


@dataclass(frozen=True)
class Reference:
    """What an episode drove joints to, robots in layout order, (T, dof) (rad, m).

    Attributes:
        targets: What the drives were set to.
        reached: Where the joints were after the step.
        numbers: The actions, (T, A).
    """

    targets: NDArray[np.float32]
    reached: NDArray[np.float32]
    numbers: NDArray[np.float32]


def converted(
    source: MultiRobotTask, seed: int, actions: NDArray[np.float32], task: MultiRobotTask
) -> NDArray[np.float32]:
    """Return actions for a task that move its robots as some moved those of another.

    Nothing is promised of where they end: play them and look.

    Args:
        source: The same task in the control mode of ``actions``, with one environment.
        seed: The episode.
        actions: Shape (T, A).
        task: The task in another control mode, with one environment; both are stepped.

    Returns:
        Shape (T', A').
    """
    reference = followed(source, seed, actions)
    writer = ActionWriter(source, task)
    written: list[NDArray[np.float32]] = []
    for most in _PATIENCE:
        written, solved = _written(writer, reference, task, seed, most)
        if solved:
            break
    return np.array(written, np.float32)


def _written(
    writer: ActionWriter, reference: Reference, task: MultiRobotTask, seed: int, most: int
) -> tuple[list[NDArray[np.float32]], bool]:
    """Return the actions of one try, and whether they solve the task.

    Args:
        writer: Writes them.
        reference: What they are to reach.
        task: Is stepped.
        seed: The episode.
        most: Steps that may be taken for one of the reference.
    """
    task.reset(seed, options=REBUILT)
    steps = len(reference.numbers)
    written: list[NDArray[np.float32]] = []
    solved = False
    for step in range(steps + _SETTLING):
        if step >= steps and solved:
            break
        for _ in range(most):
            numbers, enough = writer.write(reference, min(step, steps - 1))
            written.append(numbers)
            info = task.advance(numbers[None])[-1]
            solved = bool(info["success"][0])
            if enough:
                break
    return written, solved


def followed(task: MultiRobotTask, seed: int, actions: NDArray[np.float32]) -> Reference:
    """Play an episode and return what it drove joints to."""
    happening = moments(task, seed, follow(actions), len(actions))
    next(happening)
    targets: list[NDArray[np.float32]] = []
    reached: list[NDArray[np.float32]] = []
    for _ in happening:
        targets.append(task.simulation.drive_targets[0].copy())
        reached.append(task.simulation.read().joint_positions[0].copy())
    return Reference(np.array(targets), np.array(reached), np.asarray(actions, np.float32))


@dataclass(frozen=True)
class _Part:
    """A joint group of the task that is written for.

    Attributes:
        arm: The robot or limb that it belongs to; None if it has no TCP.
        robot: Its robot.
        group: What is driven, and how.
        before: The same group in the mode that is read.
        numbers: Where its numbers stand in an action.
        read: Where those of ``before`` stand in an action of that mode.
        joints: Where its joints are among those of all robots.
    """

    arm: str | None
    robot: str
    name: str
    group: JointGroup
    before: JointGroup
    numbers: slice
    read: slice
    joints: slice


class ActionWriter:
    """Writes actions in a task's control mode that drive its joints towards a reference."""

    def __init__(self, source: MultiRobotTask, task: MultiRobotTask) -> None:
        """Take both tasks, which differ in nothing but their control modes."""
        self._task = task
        self._parts = list(_parts(source, task))
        self._frequency = task.scenario.control_frequency
        self._forward: dict[str, Callable[[Any], tuple[Floats, Floats]]] = {
            part.arm: task.simulation.point_reach(part.arm).forward
            for part in self._parts
            if part.group.asks.tcp and part.arm is not None
        }
        self._action_dim = task.layout.action_dim

    def write(self, reference: Reference, step: int) -> tuple[NDArray[np.float32], bool]:
        """Return the action of one step, (A,), and whether it reaches the reference.

        Args:
            reference: What is to be reached.
            step: Which step of it.
        """
        state = self._task.simulation.read()
        action = np.zeros(self._action_dim, np.float32)
        enough = True
        for part in self._parts:
            if part.group == part.before and not part.group.delta:
                action[part.numbers] = reference.numbers[step, part.read]
                continue
            values = self._values(part, reference, step, state)
            if part.group.normalised:
                values, within = _normalised(part.group, values)
                enough = enough and within
            action[part.numbers] = values
        return action, enough

    # -- inside ------------------------------------------------------------------------------

    def _values(self, part: _Part, reference: Reference, step: int, state: State) -> Floats:
        """Return what a group's numbers ask for, in its units."""
        group, asks = part.group, part.group.asks
        if not group.size:
            return np.zeros(0)
        targets = reference.targets if part.before.asks.positions else reference.reached
        if part.before.asks.tcp:
            targets = reference.targets
        wanted = targets[step, part.joints].astype(float)
        if asks.tcp:
            return self._pose(part, targets[step], state)
        now = state.joint_positions[0, part.joints].astype(float)
        values: list[Floats] = []
        if asks.positions:
            base = self._kept(part, "target_qpos") if group.target else now
            positions = wanted - base if group.delta else wanted
            multiplier, offset = group.followers[0]
            if group.mimic:
                positions = (positions[:1] - (0.0 if group.delta else offset)) / multiplier
            values.append(positions)
        if asks.velocities and not asks.positions:
            after = reference.reached[step, part.joints].astype(float)
            values.append((after - now) * self._frequency)
        elif asks.velocities:
            values.append(np.zeros(len(group.joints)))  # a drive to positions brakes
        return np.concatenate(values)

    def _pose(self, part: _Part, targets: NDArray[np.float32], state: State) -> Floats:
        """Return the TCP pose that joint targets stand for, or the way there."""
        assert part.arm is not None
        layout, group = self._task.layout, part.group
        robot = layout.arm(part.arm).robot
        places = self._task.simulation.index.joints[part.arm]
        own = dict(zip(robot.joints, np.asarray(targets[places], float), strict=True))
        place, turn = self._forward[part.arm]([own[joint] for joint in robot.arm_joints])
        link = state.link_pose(part.robot, robot.tcp_link)[0].astype(float)
        tcp = state.tcp_pose(part.arm)[0].astype(float)
        place = place + rotate(turn, rotate(inverse(link[3:]), tcp[:3] - link[:3]))
        root_link = group.root_link
        root = (
            state.base_pose(part.robot)
            if root_link is None
            else state.link_pose(part.robot, root_link)
        )[0].astype(float)
        place, turn = _seen_from(root, place, turn)
        if not group.delta:
            return np.concatenate([place, _angles(turn)])
        if group.target:
            kept = self._kept(part, "target_pose")
            before, ways = kept[:3], kept[3:]
        else:
            before, ways = _seen_from(root, tcp[:3], tcp[3:])
        moves, turns = group.frame.split(":")
        way = place - before
        way = way if moves.startswith("root") else rotate(inverse(ways), way)
        if not group.asks.turn:
            return way
        back = inverse(ways)
        rest = multiply(turn, back) if turns.startswith("root") else multiply(back, turn)
        return np.concatenate([way, _angles(rest)])

    def _kept(self, part: _Part, kind: str) -> Floats:
        modes = self._task.simulation.modes
        assert modes is not None
        names = [(kept.robot, kept.group, kept.kind) for kept in modes.remembered]
        return modes.recall()[names.index((part.robot, part.name, kind))][0].astype(float)


def _parts(source: MultiRobotTask, task: MultiRobotTask) -> Iterator[_Part]:
    arms = task.layout.arms_by_group
    number = read = joint = 0
    for robot, placement in task.layout.items():
        earlier: Mapping[str, JointGroup] = source.layout[robot].robot.action_split.groups
        for name, group in placement.robot.action_split.groups.items():
            before = earlier[name]
            yield _Part(
                arms.get((robot, name)),
                robot,
                name,
                group,
                before,
                slice(number, number + group.size),
                slice(read, read + before.size),
                slice(joint, joint + len(group.joints)),
            )
            number, read = number + group.size, read + before.size
            joint += len(group.joints)


def _normalised(group: JointGroup, values: Floats) -> tuple[Floats, bool]:
    """Return values as numbers in [-1, 1], and whether none had to be cut."""
    low, high = np.array(group.ranges).T
    numbers = (values - (high + low) / 2) / ((high - low) / 2)
    if group.asks.turn:
        turn = values[3:] / low[-1]  # ManiSkill scales a turn by its lower bound
        length = float(np.linalg.norm(turn))
        numbers[3:] = turn / max(length, 1.0)
        return np.clip(numbers, -1, 1), length <= _NEARLY and bool((abs(numbers) <= _NEARLY).all())
    return np.clip(numbers, -1, 1), bool((abs(numbers) <= _NEARLY).all())


def _seen_from(root: Floats, place: Floats, turn: Floats) -> tuple[Floats, Floats]:
    """Return a pose of the world in the frame of another."""
    back = inverse(root[3:])
    return rotate(back, place - root[:3]), multiply(back, turn)


def _angles(quaternion: Floats) -> Floats:
    """Return the turns about x, then the turned y, then the turned z (rad), (3,)."""
    matrix = rotation_of(quaternion)
    return np.array(
        [
            np.arctan2(-matrix[1, 2], matrix[2, 2]),
            np.arcsin(np.clip(matrix[0, 2], -1, 1)),
            np.arctan2(-matrix[0, 1], matrix[0, 0]),
        ]
    )
