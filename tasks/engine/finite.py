"""Errors for results of a step that are not finite: a body's pose, an observation, a reward.

NaN spreads without a word: through observations into a policy's weights, through rewards into its
returns. So everything is looked at, which takes about a microsecond a step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NoReturn

import numpy as np

from robot_layouts.simulation import State
from robot_layouts.simulation.maths import Array, all_finite
from robot_layouts.simulation.readout import Lost
from robots import SimulationError, TaskError
from tasks.engine.speeds import SpeedWatch


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
        SimulationError: Always; names robot or body, environment and step, and of a robot the joint
            that was the fastest before, and the likely cause.
    """
    lost = state.lost() or Lost("a frame", 0)
    why = ""
    if lost.robot is not None:
        joint = speeds.fastest(state if before is None else before, lost.robot, lost.env)
        cause = speeds.causes.of(lost.robot, joint)
        why = f" (before, {joint} was the fastest of its joints; the likely cause: {cause})"
    raise SimulationError(
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
        SimulationError: If it is the robots' own.
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
