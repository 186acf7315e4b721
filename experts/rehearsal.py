"""Plays scripts in a private copy of a task until one succeeds."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import pi, remainder
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from experts.driver import ArmDriver
from experts.geometry import heading
from experts.script import OPEN, Pose, Scene, Script, Waypoint
from experts.tips import pose_solver
from kinematics.rotations import Floats, inverse, rotate
from kinematics.solve import by_way
from layouts import Layout
from robots import TaskError, UnknownNameError
from simulation.overlaps import RobotsAlone
from tasks import MultiRobotTask
from tasks.episode import REBUILT

PATIENCE = 40  # control steps without progress after which an arm counts as blocked
PROGRESS = 1e-3  # rad


@dataclass(frozen=True)
class Attempt:
    """What came of playing a script.

    Attributes:
        actions: Shape (T, A).
        success: Whether the task's own success was reached, at the last action.
        reason: Why not, in words.
    """

    actions: NDArray[np.float32]
    success: bool
    reason: str = ""


class Plan(NDArray[np.float32] if TYPE_CHECKING else np.ndarray):
    """Actions, (T, A) float32, and why they do not solve their episode.

    Attributes:
        reason: In words; empty if they do.
    """

    reason: str = ""

    @classmethod
    def of(cls, attempt: Attempt) -> Plan:
        """Return what came of an attempt."""
        plan = attempt.actions.view(cls)
        plan.reason = attempt.reason
        return plan


class Rehearsal:
    """A private copy of a task, in which scripts are tried out from fresh worlds."""

    def __init__(self, task: MultiRobotTask) -> None:
        """Build one environment with the layout and physics of ``task``, without pictures."""
        cheapest = "none" if "none" in task.reward_modes else None
        scenario = replace(
            task.scenario,
            num_envs=1,
            obs_mode="none",
            reward_mode=cheapest,
            render_mode=None,
            check_layout=False,  # it was checked when the task was made
        )
        self.task = type(task)(scenario)
        self._many = len(self.task.layout.arms) > 1
        if self._many:
            self.task.simulation.watch_arms()
        self._alone = RobotsAlone(self.task.layout, scenario.physics)

    def begin(self, seed: int) -> Scene:
        """Start the episode of a seed in a freshly built world, and return what it looks like."""
        self.task.reset(seed, options=REBUILT)
        return self.scene()

    def scene(self) -> Scene:
        """Return what the episode looks like now."""
        return Scene(self.task)

    def step(self, action: NDArray[np.float32]) -> tuple[bool, str]:
        """Take a control step.

        Returns:
            Whether the task is solved then, and which arms touched in it, in words.
        """
        *_, info = self.task.step(action)
        touching = self.task.simulation.arms_touching(0) if self._many else []
        return bool(info["success"][0]), ", ".join(f"{a} touches {b}" for a, b in touching[:1])

    def play(self, script: Script) -> Attempt:
        """Play a script from the present state until success or the end of the episode.

        It fails as soon as two arms touch: robots, or limbs of one robot.

        Args:
            script: Waypoints by robot; robots left out keep still.

        Raises:
            UnknownNameError: If the layout has no such robot, or the script no such waypoint.
            TaskError: If two waypoints of a robot have the same name.
        """
        task, scene = self.task, self.scene()
        _check_names(script, task)
        players = _players(task, script, scene, self._alone)
        done: set[str] = set()
        actions: list[NDArray[np.float32]] = []
        while len(actions) < task.max_episode_steps:
            try:
                parts = [player.act(scene, done) for player in players]
            except _StuckError as error:
                return Attempt(_stack(actions, task), False, str(error))
            actions.append(np.concatenate(parts).astype(np.float32))
            solved, touching = self.step(actions[-1])
            scene = self.scene()
            if touching:
                return Attempt(_stack(actions, task), False, touching)
            if solved:
                return Attempt(_stack(actions, task), True)
        places = ", ".join(player.place for player in players)
        return Attempt(_stack(actions, task), False, f"the episode ended at {places}")


class _StuckError(Exception):
    """A robot cannot go on with its script."""


class _Player:
    """Takes one robot through its waypoints."""

    def __init__(
        self,
        task: MultiRobotTask,
        robot: str,
        waypoints: Sequence[Waypoint],
        scene: Scene,
        alone: RobotsAlone,
    ) -> None:
        self._robot, self._waypoints = robot, list(waypoints)
        self._driver = ArmDriver(task.layout.arm(robot).robot)
        if any(waypoint.to is not None for waypoint in waypoints):
            self._kinematics = pose_solver(task, robot)
            self._posture = _Posture(alone, task.layout, robot)
        if any(waypoint.at is not None for waypoint in waypoints):
            self._reach = task.simulation.point_reach(robot)
            self._base = np.array(task.layout.arm(robot).base_position)
        self._goal = self._driver.arm(scene.qpos(robot))
        self._gripper = OPEN
        self._current: Waypoint | None = None
        self._begun = self._elapsed = 0  # waypoints begun; steps taken in the current one

    @property
    def place(self) -> str:
        """Where it is in its script, as ``robot.waypoint``."""
        return f"{self._robot}.{self._current.name if self._current else 'start'}"

    def act(self, scene: Scene, done: set[str]) -> Floats:
        """Return the next action numbers; adds what is done to ``done``.

        Raises:
            _StuckError: If the next waypoint cannot be reached, or the present one takes too long.
        """
        if self._current is not None and self._is_done(self._current, scene):
            done.add(self.place)
        self._check_time(done)
        if self._may_begin(done):
            self._begin(self._waypoints[self._begun], scene)
        self._elapsed += 1
        return self._driver.action(self._goal, self._gripper, scene.qpos(self._robot))

    def _check_progress(self, away: float) -> None:
        """Give up if the arm is kept from its goal: for `PATIENCE` steps it came no nearer."""
        if away < self._nearest_yet - PROGRESS:
            self._nearest_yet, self._waited = away, 0
        self._waited += 1
        if self._waited > PATIENCE:
            raise _StuckError(f"{self.place} is blocked {away:.2f} rad before its end")

    def _check_time(self, done: set[str]) -> None:
        most = self._current and self._current.most
        if most is not None and self._elapsed >= most and self.place not in done:
            raise _StuckError(f"{self.place} took more than {most} steps")

    def _is_done(self, waypoint: Waypoint, scene: Scene) -> bool:
        if self._elapsed < waypoint.steps:
            return False
        if (waypoint.to, waypoint.turn, waypoint.at) != (None, None, None):
            away = np.abs(self._driver.arm(scene.qpos(self._robot)) - self._goal).max()
            if away > waypoint.near:
                self._check_progress(float(away))
                return False
        return waypoint.until is None or waypoint.until(scene)

    def _may_begin(self, done: set[str]) -> bool:
        if self._begun == len(self._waypoints):
            return False
        if self._current is not None and self.place not in done:
            return False
        return all(name in done for name in self._waypoints[self._begun].after)

    def _begin(self, waypoint: Waypoint, scene: Scene) -> None:
        self._current, self._gripper = waypoint, waypoint.gripper
        self._begun, self._elapsed = self._begun + 1, 0
        self._nearest_yet, self._waited = np.inf, 0
        if waypoint.to is not None:
            self._goal = self._nearest(waypoint.to(scene), scene)
        elif waypoint.turn is not None:
            arm = self._driver.arm(scene.qpos(self._robot))
            self._goal = arm + waypoint.turn(arm)
        elif waypoint.at is not None:
            self._goal = self._reaching(waypoint.at(scene), scene)

    def _nearest(self, poses: Sequence[Pose], scene: Scene) -> Floats:
        """Return the arm joints with the shortest way to one of the poses.

        Those at which the robot is inside itself are passed over, if there are others.
        """
        qpos = scene.qpos(self._robot)
        goals = [goal for pose in poses for goal in self._kinematics.solutions(*pose, qpos)]
        if not goals:
            raise _StuckError(f"{self.place} is out of reach")
        goals = by_way(goals, self._driver.arm(qpos))
        return next((goal for goal in goals if self._posture.is_free(goal, scene)), goals[0])

    def _reaching(self, place: Floats, scene: Scene) -> Floats:
        """Return arm joints that bring the TCP to a place.

        They are sought from the present ones, and from those turned towards the place by the
        first joint, which turns an arm about its base.
        """
        arm, tip = self._reach.arm(scene.qpos(self._robot)), scene.tcp(self._robot)[0]
        origin, turned = self._reach.forward(arm)
        point = rotate(inverse(turned), tip - origin)
        about = remainder(heading(self._base, place) - heading(self._base, tip), 2 * pi)
        starts = [arm + about * side * (np.arange(len(arm)) == 0) for side in (0, 1, -1)]
        goals = [self._reach.solve(point, place, start) for start in starts]
        reachable = [goal for goal in goals if goal is not None]
        if not reachable:
            raise _StuckError(f"{self.place} is out of reach")
        return min(reachable, key=lambda goal: float(np.abs(goal - arm).max()))


class _Posture:
    """Tells whether a robot is inside itself with one of its arms somewhere."""

    def __init__(self, alone: RobotsAlone, layout: Layout, arm: str) -> None:
        self._alone, self._owner = alone, layout.owner(arm)
        joints = layout[self._owner].robot.joints
        self._places = [joints.index(joint) for joint in layout.arm(arm).robot.arm_joints]

    def is_free(self, arm: Floats, scene: Scene) -> bool:
        """Return whether that is so at some arm joints (rad), other joints being as they are."""
        qpos = scene.qpos(self._owner)
        qpos[self._places] = arm
        overlaps = self._alone.overlaps({self._owner: qpos})
        return not any(o.one.robot == o.other.robot == self._owner for o in overlaps)


def _players(
    task: MultiRobotTask, script: Script, scene: Scene, alone: RobotsAlone
) -> list[_Player]:
    """Return who takes the action numbers, in their order, by the names that the script uses."""
    short = task.layout.short_names
    names = {short.get(name, name): name for name in script}
    return [
        _Player(task, name, script.get(name, ()), scene, alone)
        for name in (names.get(part, part) for part in task.layout.action_split)
    ]


def first_success(
    task: MultiRobotTask, seed: int, scripts: Callable[[Scene], Sequence[Script]]
) -> Plan:
    """Try scripts one after the other and return the actions of the first that succeeds.

    Args:
        task: Says layout and physics; left alone.
        seed: The episode.
        scripts: Makes the scripts to try from the episode's first scene, the best first.

    Returns:
        What `search` returns.

    Raises:
        TaskError: If no script could even be begun.
    """

    def attempts(rehearsal: Rehearsal) -> Iterator[Attempt]:
        for i, script in enumerate(scripts(rehearsal.begin(seed))):
            if i > 0:
                rehearsal.begin(seed)
            yield rehearsal.play(script)

    return search(task, seed, attempts)


def search(
    task: MultiRobotTask, seed: int, attempts: Callable[[Rehearsal], Iterable[Attempt]]
) -> Plan:
    """Make attempts until one succeeds and return its actions.

    If none does, the actions of the longest attempt are returned: they fail as honestly.

    Args:
        task: Says layout and physics; left alone.
        seed: The episode.
        attempts: Makes them one by one, each in an episode begun anew.

    Returns:
        Actions (T, A) with T at most the task's ``max_episode_steps``, and the reason if they fail.

    Raises:
        TaskError: If no attempt could even be begun.
    """
    rehearsal = Rehearsal(task)
    made: list[Attempt] = []
    for attempt in attempts(rehearsal):
        made.append(attempt)
        if attempt.success:
            break
    rehearsal.task.close()
    best = max(made, key=lambda attempt: (attempt.success, len(attempt.actions)))
    if not len(best.actions):
        raise TaskError(f"{task.task_id}, seed {seed}: no plan: {best.reason}")
    return Plan.of(best)


def _stack(actions: list[NDArray[np.float32]], task: MultiRobotTask) -> NDArray[np.float32]:
    return np.array(actions, np.float32).reshape(-1, task.layout.action_dim)


def _check_names(script: Script, task: MultiRobotTask) -> None:
    for robot in script:
        if task.layout.arm_name(robot) not in task.layout.action_split:
            raise UnknownNameError("arm that takes numbers", robot, task.layout.places)
    names = [f"{robot}.{waypoint.name}" for robot in script for waypoint in script[robot]]
    for name in names:
        if names.count(name) > 1:
            raise TaskError(f"{names.count(name)} waypoints are called {name!r}; one may be")
    for waypoints in script.values():
        for name in (name for waypoint in waypoints for name in waypoint.after):
            if name not in names:
                raise UnknownNameError("waypoint of this script", name, names)
