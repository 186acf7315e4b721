"""Experts that look at every step: a function of what is seen, in the place of a script."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experts.rehearsal import Attempt, Plan, Rehearsal, rehearsing
from experts.script import Scene
from tasks import MultiRobotTask
from tasks.engine.actions import ActionReader


def rehearse(task: MultiRobotTask, seed: int, act: Callable[[Scene], Any]) -> Plan:
    """Let a function act in a private copy of a task until it succeeds or the episode ends.

    It also ends, and has failed, when two arms touch: robots, or limbs of one robot.

    Args:
        task: Says layout and physics; left alone.
        seed: The episode.
        act: Called before every step with what there is to see; returns the action, (A,), or a
            mapping robot name → (a,) with every robot.

    Returns:
        What it did, (T, A), and the reason if that fails.

    Raises:
        ActionError: If an action has the wrong shape or numbers that are not finite.
    """
    with rehearsing(task) as rehearsal:
        return Plan.of(_attempt(rehearsal, seed, act), task)


def _attempt(rehearsal: Rehearsal, seed: int, act: Callable[[Scene], Any]) -> Attempt:
    copy, scene = rehearsal.task, rehearsal.begin(seed)
    reader, actions = ActionReader(copy.layout, 1), list[NDArray[np.float32]]()
    success, touching = False, ""
    while not (success or touching) and len(actions) < copy.max_episode_steps:
        actions.append(reader.read(act(scene))[0].copy())
        success, touching = rehearsal.step(actions[-1])
        scene = rehearsal.scene()
    success = success and not touching
    reason = "" if success else touching or f"no success within {len(actions)} steps"
    done = np.stack(actions)
    return Attempt(done, success, reason, episode=rehearsal.episode(done))
