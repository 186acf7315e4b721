"""Which action brings TCPs nearer to where people want them, whatever the control mode."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.motion_drives import Aim, MotionDrive, drive_within_bounds
from robot_layouts.experts.script import CLOSED, OPEN
from robot_layouts.kinematics.rotations import (
    Floats,
    inverse_pose,
    pose_matrix,
    rotation_about,
    rotation_vector,
)
from robot_layouts.kinematics.solve import IkGoal, approach
from robot_layouts.simulation import State
from robots import TaskError
from robots.action_split import is_gripper
from robots.gripper_motion import link_tree
from robots.urdf.tcp import find_tcp
from tasks import TaskEnv
from tasks.driving import DrivenGroup, driven_groups, joint_slices

SPEED, TURN_SPEED = 0.5, 2.0  # of a TCP (m/s, rad/s)
JOINT_SPEED = {"rad": 2.0, "m": 0.3}  # rad/s, m/s
LEAD = {"rad": 0.02, "m": 0.005}  # how far joints are driven ahead of what stops them (rad, m)
_HALVINGS = 5  # of a step, until all numbers are within bounds


class _Arm:
    """An arm that can be steered.

    Attributes:
        name: As the task calls it.
        grippers: Its grippers.
        drives: What drives its TCP.
        joints: Those joints, among those of all robots.
        lead: How far each is driven ahead of what stops it (rad, m).
        turns: Whether its control mode says how the TCP is turned, too.
        others: Its other groups, such as fingers that are no gripper.
    """

    def __init__(self, name: str, task: TaskEnv, driven: Sequence[DrivenGroup]) -> None:
        """Take the groups of an arm, one or more of which are no gripper."""
        self.name, layout = name, task.layout
        self._robot = layout.owner(name)
        robot, self._own = layout[self._robot].robot, joint_slices(layout)[self._robot]
        first = self._own.start
        tree = link_tree(robot)
        tcp = find_tcp(layout.arm(name).robot, tree)
        self._tree = tree.towards(tcp.needed)
        self._links = [self._tree.link(tree.links[link]) for link in tcp.links]
        self._turned, self._offset = self._tree.link(tree.links[tcp.turned]), tcp.offset
        moving = {first + int(joint) for joint in self._tree.drivers}
        self.grippers = [group for group in driven if is_gripper(group.name)]
        arm = [group for group in driven if group not in self.grippers]
        groups = [group for group in arm if moving & {*np.r_[group.joints].tolist()}]
        self.others = [group for group in arm if group not in groups]
        self.drives = [MotionDrive(group, task, moves=True) for group in groups]
        self.joints = np.concatenate([np.r_[group.joints] for group in groups])
        self._free: list[int] = (self.joints - first).tolist()
        self._rest = task.simulation.read().joint_positions[0, self.joints].astype(float)
        self.turns = all(group.group.asks.turn for group in groups if group.group.asks.tcp)
        self.lead, self._fastest = (
            np.concatenate([np.full(len(g.group.joints), by[g.group.unit]) for g in groups])
            for by in (LEAD, JOINT_SPEED)
        )

    def ahead(self, target: Floats, joints: Floats, state: State, seconds: float) -> Floats:
        """Return joints of all robots of which this arm's are a step nearer to a pose.

        Args:
            target: Where the TCP is to be: position (m, world), quaternion (wxyz), (7,).
            joints: Of all robots, (dof,) (rad, m).
            state: The world.
            seconds: Of a step (s).
        """
        base = state.base_pose(self._robot)[0].astype(float)
        wanted = inverse_pose(pose_matrix(base[:3], base[3:])) @ pose_matrix(target[:3], target[3:])
        qpos = joints[self._own]
        poses = self._tree.forward(qpos[None])[0]
        rotation = poses[self._turned, :3, :3]
        place = poses[self._links, :3, 3].mean(axis=0) + rotation @ self._offset
        way = _shortened(wanted[:3, 3] - place, SPEED * seconds)
        turn = _shortened(rotation_vector(wanted[:3, :3] @ rotation.T), TURN_SPEED * seconds)
        turned = _turn(turn) @ rotation if self.turns else None
        goal = IkGoal(place + way, self._links, turned, self._turned, self._offset)
        moved = joints.copy()
        longest = self._fastest * seconds
        moved[self._own] = approach(self._tree, goal, qpos, self._free, longest, self._rest)
        return moved


class Steering:
    """Says what to do next so that TCPs get to where they should be.

    TCPs go straight there, at `SPEED` and `TURN_SPEED` at most; the place comes before the
    orientation where an arm cannot have both. What stops an arm is pushed by `LEAD` and no more.

    Attributes:
        arms: Names of the arms that can be steered, as the task calls them.
        with_gripper: Those of them that have a gripper.
        turned: Those of them whose control mode says how the TCP is turned, too.
        reference: Where joints are driven to, those of all robots, (dof,) (rad, m).
    """

    def __init__(self, task: TaskEnv) -> None:
        """Take a task that has been reset.

        Raises:
            TaskError: If it has several environments, or no arm of it can be steered.
        """
        if task.num_envs != 1:
            raise TaskError(f"people steer in 1 environment; the task has {task.num_envs}")
        self._task, self._seconds = task, 1 / task.scenario.control_frequency
        driven = [d for d in driven_groups(task.layout) if d.group.size and not d.group.asks.drive]
        self._arms: dict[str, _Arm] = {}
        for name, full in task.layout.places.items():
            groups = [d for d in driven if d.arm == full]
            if not all(is_gripper(group.name) for group in groups):
                self._arms[name] = _Arm(name, task, groups)
        still = [d for d in driven if d.arm is None]
        still += [group for arm in self._arms.values() for group in arm.others]
        self._still = [MotionDrive(group, task, moves=False) for group in still]
        self.arms = tuple(self._arms)
        self.with_gripper = tuple(name for name, arm in self._arms.items() if arm.grippers)
        self.turned = tuple(name for name, arm in self._arms.items() if arm.turns)
        if not self.arms:
            raise TaskError(f"{task.task_id} has no arm that can be steered in this control mode")
        self.begin_anew()

    def begin_anew(self) -> None:
        """Start from where all joints are now, after something else has moved them."""
        self._begun = self._task.simulation.read().joint_positions[0].astype(float)
        self.reference = self._begun.copy()
        self._speed = np.zeros_like(self.reference)

    def closed(self, action: NDArray[np.float32]) -> dict[str, bool]:
        """Return by arm whether an action closes its gripper."""
        return {
            name: any(
                np.abs(action[g.numbers] - _gripper_number(g, True)).sum()
                < np.abs(action[g.numbers] - _gripper_number(g, False)).sum()
                for g in arm.grippers
            )
            for name, arm in self._arms.items()
        }

    def tcp(self, arm: str) -> Floats:
        """Return where an arm's TCP is: position (m, world), quaternion (wxyz), (7,)."""
        return self._task.simulation.read().tcp_pose(arm)[0].astype(float)

    def action(
        self, targets: Mapping[str, Floats], closed: Mapping[str, bool]
    ) -> NDArray[np.float32]:
        """Return the next action, (A,).

        Args:
            targets: By arm, where its TCP is to be: position (m, world), quaternion (wxyz), (7,).
            closed: By arm, whether its gripper is to be closed.
        """
        state = self._task.simulation.read()
        where = state.joint_positions[0].astype(float)
        action = np.zeros(self._task.layout.action_dim, np.float32)
        here, then = self._begun.copy(), self._begun.copy()
        for name, arm in self._arms.items():
            own, lead = arm.joints, arm.lead
            start = where.copy()
            start[own] = np.clip(self.reference[own], where[own] - lead, where[own] + lead)
            here[own] = start[own]
            then[own] = arm.ahead(targets[name], start, state, self._seconds)[own]
        for arm in self._arms.values():
            self._drive(arm.drives, arm.joints, here, then, state, action)
            for gripper in arm.grippers:
                action[gripper.numbers] = _gripper_number(gripper, closed[arm.name])
        self._drive(self._still, np.array([], np.intp), here, here, state, action)
        return action

    # -- inside ------------------------------------------------------------------------------

    def _drive(
        self,
        drives: list[MotionDrive],
        joints: NDArray[np.intp],
        here: Floats,
        then: Floats,
        state: State,
        action: NDArray[np.float32],
    ) -> None:
        """Fill in the numbers that drive joints as far as they go within bounds."""

        def aim(share: float) -> Aim:
            way = share * (then - here)
            return Aim(here, way, way / self._seconds - self._speed)

        for drive in drives:
            drive.learn(state)
        aimed = aim(drive_within_bounds(drives, aim, state, action, _HALVINGS))
        self.reference[joints] = (aimed.here + aimed.way)[joints]
        self._speed[joints] = aimed.way[joints] / self._seconds


def _gripper_number(gripper: DrivenGroup, closed: bool) -> Floats | float:
    if gripper.group.normalised:
        return CLOSED if closed else OPEN
    low, high = np.array(gripper.group.ranges).T
    return low if closed else high


def _shortened(way: Floats, longest: float) -> Floats:
    length = float(np.linalg.norm(way))
    return way if length <= longest else way * (longest / length)


def _turn(vector: Floats) -> Floats:
    """Return the rotation about a vector by its length (rad), (3, 3)."""
    angle = float(np.linalg.norm(vector))
    axis = vector / angle if angle > 0 else np.array([0.0, 0.0, 1.0])
    return rotation_about(axis.tolist(), np.array(angle))
