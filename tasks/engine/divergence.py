"""What a step must not lead to: numbers that are not finite, and joints that are far too fast.

NaN spreads without a word: through observations into a policy's weights, through rewards into its
returns. So all results are looked at, which takes about a microsecond a step.

Joint speeds are watched as well, in half a microsecond for one environment. A joint ten times as
fast as its limit was not driven there: links that are inside each other were driven apart, or
something hit it. A `RuntimeWarning` reports that once in an episode, as something may still come of
the episode, and a few times for each joint; beyond a hundred times, physics has diverged.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import NoReturn

import numpy as np

from robot_layouts.simulation import Simulation, State
from robot_layouts.simulation.checks.overlaps import Causes
from robot_layouts.simulation.maths import Array, all_finite
from robot_layouts.simulation.readout import Lost
from robots import DivergedError, TaskError

WARNS, REFUSES = 10.0, 100.0  # times a joint's largest speed
MOST = 3  # reports of a joint
STACK = 5  # calls from a report up to that of `step`


class SpeedWatch:
    """Watches the joints of one simulation.

    Attributes:
        causes: What may have thrown a robot about.
    """

    def __init__(self, simulation: Simulation) -> None:
        """Take a simulation."""
        self.causes = Causes(simulation)
        self._robots = simulation.index.robots
        limits = np.concatenate([robot.speeds for robot in self._robots.values()])
        self._limits, self._least = limits, float((WARNS * limits.min()) ** 2)
        self._joints = [
            (name, joint, group.unit)
            for name, placement in simulation.layout.items()
            for group in placement.robot.action_split.groups.values()
            for joint in group.joints
        ]
        self._reported = np.zeros(simulation.num_envs, bool)
        self._reports = np.zeros(len(limits), int)  # of each joint

    def begin(self, env_ids: Sequence[int]) -> None:
        """Begin episodes, in which nothing was reported yet."""
        self._reported[env_ids] = False

    def look(self, state: State, moving: Sequence[int], elapsed: Array) -> None:
        """Look at the joints after a step.

        Args:
            state: What the worlds look like.
            moving: Which environments were stepped.
            elapsed: Steps of each environment's episode, (N,).

        Raises:
            DivergedError: If a joint is `REFUSES` times as fast as its limit.
        """
        speeds = state.joint_velocities
        if np.vdot(speeds, speeds) < self._least:  # then none is too fast; often enough that is all
            return
        times = np.abs(speeds) / self._limits
        if not times.max() <= WARNS:
            self._report(times, state, moving, elapsed)

    def fastest(self, state: State, robot: str, env: int) -> str:
        """Return the joint of a robot that is the fastest for its limit."""
        speeds = np.abs(state.qvel(robot)[env]) / self._robots[robot].speeds
        joints = [joint for name, joint, _ in self._joints if name == robot]
        return joints[int(np.nan_to_num(speeds, nan=np.inf).argmax())]

    def _report(self, times: Array, state: State, moving: Sequence[int], elapsed: Array) -> None:
        for env in moving:
            worst = int(times[env].argmax())
            if not times[env, worst] <= REFUSES:  # be it NaN
                raise DivergedError(
                    f"physics diverged: {self._words(times, state, env, worst, elapsed)};"
                    " reset(options={'reconfigure': True}) builds its world anew"
                )
            if times[env, worst] > WARNS and not self._reported[env]:
                self._reported[env] = True
                self._reports[worst] += 1
                if self._reports[worst] <= MOST:
                    words = self._words(times, state, env, worst, elapsed)
                    if self._reports[worst] == MOST:
                        words += "; this joint is not reported again"
                    warnings.warn(words, RuntimeWarning, stacklevel=STACK)

    def _words(self, times: Array, state: State, env: int, worst: int, elapsed: Array) -> str:
        robot, joint, unit = self._joints[worst]
        speed, limit = abs(state.joint_velocities[env, worst]), self._limits[worst]
        return (
            f"robot {robot!r} is thrown about: {joint} moves at {speed:.3g} {unit}/s in environment"
            f" {env} at step {elapsed[env]}, {times[env, worst]:.3g} times the {limit:.3g} {unit}/s"
            f" taken as its limit; the likely cause: {self.causes.of(robot, joint, env)}"
        )


class NotFinite(Exception):
    """An observation has numbers that are not finite; the task says which."""


def refuse_state(
    state: State, before: State | None, speeds: SpeedWatch, elapsed: Array
) -> NoReturn:
    """Refuse a state in which something is nowhere.

    Args:
        state: What the worlds look like.
        before: What they looked like before, if that is known.
        speeds: What watches their joints.
        elapsed: Steps of each environment's episode, (N,).

    Raises:
        DivergedError: Always; names robot or body, environment and step, and of a robot the joint
            that was the fastest before, and the likely cause.
    """
    lost = state.lost() or Lost("a frame", 0)
    why = ""
    if lost.robot is not None:
        joint = speeds.fastest(state if before is None else before, lost.robot, lost.env)
        cause = speeds.causes.of(lost.robot, joint)
        why = f" (before, {joint} was the fastest of its joints; the likely cause: {cause})"
    raise DivergedError(
        f"physics diverged: {lost.what} has numbers that are not finite in environment {lost.env}"
        f" at step {elapsed[lost.env]}{why}; reset(options={{'reconfigure': True}}) builds its"
        " world anew"
    )


def refuse_reward(reward: Array, task: object, elapsed: Array) -> NoReturn:
    """Refuse rewards that are not finite.

    Args:
        reward: (N,).
        task: The task.
        elapsed: Steps of each environment's episode, (N,).

    Raises:
        TaskError: Always; names environment and step.
    """
    _refuse(f"{type(task).__name__}.dense_reward() returned", reward, elapsed)


def refuse_observation(
    state: State, parts: Mapping[str, Array], task: object, speeds: SpeedWatch, elapsed: Array
) -> NoReturn:
    """Refuse observations that are not finite.

    Args:
        state: What the worlds look like.
        parts: What the task observes of them.
        task: The task.
        speeds: What watches the robots' joints.
        elapsed: Steps of each environment's episode, (N,).

    Raises:
        TaskError: If a part of the task's is not; names it, environment and step.
        DivergedError: If it is the robots' own.
    """
    for name, part in parts.items():
        if not all_finite(part):
            _refuse(f"{type(task).__name__}.observe(): {name!r} is", part, elapsed)
    refuse_state(state, None, speeds, elapsed)


def _refuse(what: str, values: Array, elapsed: Array) -> NoReturn:
    env = int(np.argwhere(~np.isfinite(values))[0][0])
    wrong = values[env][~np.isfinite(values[env])].ravel()[0]
    raise TaskError(
        f"{what} {wrong} in environment {env} at step {elapsed[env]}; it must be finite"
    )
