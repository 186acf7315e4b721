"""States that make no sense, and tasks whose numbers are not finite."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tasks
from robots import RobotLayoutsError
from tasks.maniskill.pick_cube import PickCube
from tests.faults.fault import Fault

AREA = "arguments"
ONE, TWO = "PickCube-v1", "TwoRobotPickCube-v1"
ENTRIES = {
    ONE: {"actors": ("cube", "goal_site"), "articulations": ("panda",)},
    TWO: {"actors": ("cube",), "articulations": ("panda_wristcam-agent-1",)},
}
FULLY = ((ONE, "cube"), (ONE, "panda"))
BRIEFLY = ("one row too few", "a zero quaternion", "a joint at 1e9")
PLACES = {"a position": 1, "a quaternion": 4, "a velocity": 8, "a spin": 12}
JOINTS = {"qpos": 15, "a finger's qpos": 21, "qvel": 23}
NOT_FINITE = (math.nan, math.inf, -math.inf)

# What an entry may not be: from the entry as it is, (2, k).
SPOILT: dict[str, Callable[[Any], Any]] = {
    "one row too few": lambda x: x[:1],
    "one number too few": lambda x: x[:, :-1],
    "another dimension": lambda x: x[None],
    "a single row": lambda x: x[0],
    "a number": lambda x: 5,
    "a text": lambda x: "home",
    "texts": lambda x: x.astype(str),
    "complex numbers": lambda x: x.astype(complex),
    "a ragged list": lambda x: [x[0].tolist(), [0.0]],
    "a zero quaternion": lambda x: _with(x, slice(3, 7), 0.0),
    "a short quaternion": lambda x: _with(x, slice(3, 7), (0.5, 0.0, 0.0, 0.0)),
    "a position of 1e30 m": lambda x: _with(x, 0, 1e30),
    "a velocity of 1e30 m/s": lambda x: _with(x, 7, 1e30),
}
SPOILT_JOINTS: dict[str, Callable[[Any], Any]] = {
    "a joint at 1e9": lambda x: _with(x, 14, 1e9),
    "joints in degrees": lambda x: _with(x, slice(13, 20), 90.0),
    "fingers at 100 m": lambda x: _with(x, 21, 100.0),
}
SPOILT_STATES: dict[str, Callable[[Any], Any]] = {
    "None": lambda s: None,
    "a number": lambda s: 5,
    "an unknown group": lambda s: {**s, "actor": {}},
    "a group of nothing": lambda s: {**s, "actors": None},
    "an entry as the group": lambda s: {"actors": s["actors"]["cube"]},
    "an unknown body": lambda s: {"actors": {"cub": s["actors"]["cube"]}},
    "a body among the robots": lambda s: {"articulations": {"cube": s["actors"]["cube"]}},
    "a good body before an unknown one": lambda s: {
        "actors": {"cube": s["actors"]["cube"] * 1, "nobody": s["actors"]["cube"]}
    },
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for task_id, groups in ENTRIES.items():
        for group, keys in groups.items():
            places = {**PLACES, **JOINTS} if group == "articulations" else PLACES
            spoilt = {**SPOILT, **SPOILT_JOINTS} if group == "articulations" else SPOILT
            for key in keys:
                fully = (task_id, key) in FULLY  # all are read alike
                for name, place in places.items():
                    for value in NOT_FINITE if fully else NOT_FINITE[:1]:
                        what = f"state: {name} of {task_id}'s {key} is {value}"
                        spoil = partial(_with, place=place, value=value)
                        yield Fault(AREA, what, partial(_set, task_id, group, key, spoil))
                for name, spoil in spoilt.items():
                    if not (fully or name in BRIEFLY):
                        continue
                    what = f"state: {name} for {task_id}'s {key}"
                    yield Fault(AREA, what, partial(_set, task_id, group, key, spoil))
    for name, spoil in SPOILT_STATES.items():
        yield Fault(AREA, f"state: {name}", partial(_set_all, spoil))
    for mode in ("normalized_dense", "dense"):
        for value in NOT_FINITE[:2]:
            what = f"a {mode} reward of {value} in environment 1"
            yield Fault(AREA, what, partial(_bad_reward, mode, value, 1))
    for obs_mode in ("state", "state_dict"):
        for call in ("reset", "step"):
            what = f"an observation of nan at a {call}, {obs_mode}"
            yield Fault(AREA, what, partial(_bad_observation, obs_mode, math.nan, call))


@functools.cache
def _task(task_id: str) -> Any:
    return tasks.make(task_id, num_envs=2)


def _state(env: Any) -> Any:
    return {g: {k: x.clone() for k, x in e.items()} for g, e in env.get_state_dict().items()}


def _with(array: Any, place: Any, value: Any) -> Any:
    """Return the entry with some numbers of the second environment replaced."""
    changed = np.array(array)
    changed[1, place] = value
    return changed


def _set(task_id: str, group: str, key: str, spoil: Callable[[Any], Any], folder: Path) -> None:
    env = _task(task_id)
    env.reset(seed=0)
    state = _state(env)
    for entry in state["actors"].values():
        entry[:, 0] += 0.01  # if anything is set, it is seen
    state[group][key] = spoil(state[group][key].numpy())
    _refused_whole(env, state)


def _set_all(spoil: Callable[[Any], Any], folder: Path) -> None:
    env = _task(ONE)
    env.reset(seed=0)
    state = _state(env)
    state["actors"]["cube"][:, 0] += 0.01
    _refused_whole(env, spoil(state))


def _refused_whole(env: Any, state: Any) -> None:
    before = _state(env)
    try:
        env.set_state_dict(state)
    except RobotLayoutsError:
        after = env.get_state_dict()
        for group, entries in before.items():
            for key, rows in entries.items():
                assert (rows == after[group][key]).all(), f"{key} was set"
        raise


def _spoilt_task(**methods: Any) -> Any:
    """Make PickCube with other methods, two environments."""
    return type("Mine", (PickCube,), methods)


def _bad_reward(mode: str, value: float, env: int, folder: Path) -> None:
    def dense_reward(self: Any, state: Any, action: Any, info: Any) -> Any:
        reward = np.zeros(self.num_envs, np.float32)
        reward[env] = value if info["elapsed_steps"][env] == 3 else 1.0
        return reward

    task = _made(_spoilt_task(dense_reward=dense_reward), reward_mode=mode)
    _expect_step(task, 3, rf"dense_reward\(\) returned .* in environment {env} at step 3")


def _bad_observation(obs_mode: str, value: float, call: str, folder: Path) -> None:
    def observe(self: Any, state: Any, info: Any) -> Any:
        goal = np.zeros((self.num_envs, 3), np.float32)
        if info["elapsed_steps"][1] == (0 if call == "reset" else 2):
            goal[1, 2] = value
        return {"goal": goal}

    cls = _spoilt_task(observe=observe)
    if call == "reset":
        _made(cls, obs_mode=obs_mode)
    _expect_step(_made(cls, obs_mode=obs_mode), 2, "'goal' is .* in environment 1 at step 2")


def _made(cls: Any, **fields: Any) -> Any:
    scenario = cls.scenario
    for name, value in {"num_envs": 2, **fields}.items():
        setattr(scenario, name, value)
    return cls(scenario)


def _expect_step(task: Any, steps: int, message: str) -> None:
    """Play until the last of some steps, which is refused with a message."""
    for _ in range(steps - 1):
        task.step(np.zeros((2, 8), np.float32))
    with pytest.raises(RobotLayoutsError, match=message) as caught:
        task.step(np.zeros((2, 8), np.float32))
    raise caught.value
