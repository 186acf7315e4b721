"""Wrong arguments of resets and steps, of every front: seeds, options, actions, environments."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import tasks
from tests.faults.fault import Fault

AREA = "arguments"
ONE, TWO = "PickCube-v1", "TwoRobotPickCube-v1"
FRONTS = ("task", "gymnasium", "pettingzoo", "vector", "sb3")

WRONG_SEEDS: dict[str, Any] = {
    repr(seed): seed for seed in (True, -1, 2**32, 1.5, math.nan, "0", {}, 1j, [True], [0.5], [-1])
} | {
    "too many": [1, 2, 3, 4],
    "none": [],
    "a mask": np.array([True]),
    "a ragged list": [[1], [2, 3]],
    "an object": object(),
}
WRONG_OPTIONS: tuple[Any, ...] = (5, "reconfigure", True, 0, "", [], {"reconfigure"})
WRONG_REBUILDS: tuple[Any, ...] = (1, 0, "no", None, [], math.nan)
# Fronts hand what they are given to the task, where it is checked: of each of these once.
BRIEFLY = ("-1", "'0'", "[0.5]", "none", "NaN", "a text", "one number too many", "objects") + (
    "unknown robots",
    "a half tensor of meta",
)
WRONG_IDS: tuple[Any, ...] = (
    *(0, 1.5, "01", [2], [-1], [0, 0], [0.5], [None], [True, False], [[0]], True, {0.5}),
    *(np.array([True, False]), np.array([0.0]), range, ["0"], 10**30),
)


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for front in FRONTS:
        for name, seed in WRONG_SEEDS.items():
            if front == "task" or (front != "sb3" and name in BRIEFLY):
                yield Fault(
                    AREA, f"{front}: reset(seed={name})", partial(_reset, front, {"seed": seed})
                )
        for options in WRONG_OPTIONS if front == "task" else WRONG_OPTIONS[:2]:
            if front != "sb3":
                yield Fault(
                    AREA,
                    f"{front}: reset(options={options!r})",
                    partial(_reset, front, {"options": options}),
                )
        for value in WRONG_REBUILDS if front == "task" else WRONG_REBUILDS[:1]:
            wrong = {"options": {"reconfigure": value}}
            yield Fault(AREA, f"{front}: reconfigure={value!r}", partial(_reset, front, wrong))
        if front == "task":  # fronts are given options of other packages, and ignore them
            wrong = {"options": {"reconfig": True}}
            yield Fault(AREA, f"{front}: an unknown option", partial(_reset, front, wrong))
        for name in _actions("cube"):
            if front != "task" and name not in BRIEFLY:
                continue
            yield Fault(AREA, f"{front}: step with {name}", partial(_step, front, name))
    for ids in WRONG_IDS:
        yield Fault(
            AREA, f"task: reset(env_ids={ids!r})", partial(_reset, "task", {"env_ids": ids})
        )
        yield Fault(AREA, f"task: step(env_ids={ids!r})", partial(_step_some, ids))
    for name in _actions("two"):
        if name in _actions("cube") and name not in BRIEFLY:
            continue
        yield Fault(AREA, f"two robots: step with {name}", partial(_step, "two", name))
    for mask in (True, [True, False], np.array([1, 0]), np.zeros(2, bool), np.ones(3, bool), "all"):
        wrong = {"options": {"reset_mask": mask}}
        yield Fault(AREA, f"vector: reset_mask={mask!r}", partial(_reset, "vector", wrong))


@functools.cache
def _front(name: str) -> Any:
    """Return a front of two environments where it can have them, made once per process."""
    import gymnasium

    makers: dict[str, Callable[[], Any]] = {
        "task": lambda: tasks.make(ONE, num_envs=2),
        "two": lambda: tasks.make(TWO, num_envs=2),
        "gymnasium": lambda: gymnasium.make(f"RobotLayouts/{ONE}", disable_env_checker=True),
        "pettingzoo": lambda: tasks.parallel_env(ONE),
        "vector": lambda: gymnasium.make_vec(f"RobotLayouts/{ONE}", num_envs=2, num_workers=0),
        "sb3": lambda: tasks.sb3_vec_env(ONE, num_envs=2, num_workers=0),
    }
    return makers[name]()


def _task_of(front: Any) -> Any:
    if isinstance(front, tasks.TaskEnv):
        return front
    front = getattr(front, "unwrapped", front)
    if hasattr(front, "vector"):
        front = front.vector
    return front.task if hasattr(front, "task") else front._backend.batches[0]._task


def _begin(front: Any, **arguments: Any) -> Any:
    if not hasattr(front, "set_options"):
        return front.reset(**arguments)
    if arguments.get("seed") is not None:
        front.seed(arguments["seed"])
    if "options" in arguments:
        front.set_options(arguments["options"])
    try:
        return front.reset(), front.reset_infos
    finally:
        front._reset_options()
        front._reset_seeds()


def _unchanged(front: Any, call: Callable[[], Any]) -> None:
    """Call what must be refused: nothing may have changed then."""
    task = _task_of(front)
    before = task.get_state_dict(), list(task.seeds), task._elapsed.copy()
    try:
        call()
    except Exception:
        after = task.get_state_dict()
        for group, entries in before[0].items():
            for key, rows in entries.items():
                assert (rows == after[group][key]).all(), f"{key} has changed"
        assert before[1] == task.seeds
        assert (before[2] == task._elapsed).all()
        raise


def _reset(name: str, arguments: dict[str, Any], folder: Path) -> None:
    front = _front(name)
    _unchanged(front, lambda: _begin(front, **arguments))


def _actions(kind: str) -> dict[str, Callable[[], Any]]:
    """Return wrong actions of the batch (2, A), by what is wrong with them."""
    import torch

    width = 16 if kind == "two" else 8

    def spoilt(value: float) -> Any:
        array = np.zeros((2, width))
        array[-1, -1] = value
        return array

    wrong: dict[str, Callable[[], Any]] = {
        "NaN": lambda: spoilt(math.nan),
        "inf": lambda: spoilt(math.inf),
        "nothing": lambda: None,
        "a text": lambda: "left",
        "a ragged list": lambda: [[0.0] * width, [0.0]],
        "objects": lambda: np.full((2, width), None),
        "integers": lambda: np.zeros((2, width), int),
        "one number too many": lambda: np.zeros((2, width + 1), np.float32),
        "one number too few": lambda: np.zeros((2, width - 1), np.float32),
        "another dimension": lambda: np.zeros((2, width, 1), np.float32),
        "a tensor of meta": lambda: torch.zeros(2, width, device="meta"),
        "a half tensor of meta": lambda: torch.zeros(2, width, dtype=torch.bfloat16, device="meta"),
        "a list of tensors that learn": lambda: (
            [torch.zeros(width, dtype=torch.cfloat, requires_grad=True)] * 2
        ),
        "unknown robots": lambda: {"lefty": np.zeros((2, 8), np.float32)},
    }
    if kind == "two":
        part = np.zeros((2, 8), np.float32)
        wrong |= {
            "one robot's part": lambda: {"left": part},
            "a part of nothing": lambda: {"left": part, "right": None},
            "a robot too many": lambda: {"left": part, "right": part, "middle": part},
            "a part with NaN": lambda: {"left": part, "right": np.full((2, 8), math.nan)},
        }
    return wrong


def _step(name: str, action: str, folder: Path) -> None:
    front = _front(name)
    _begin(front, seed=0)
    wrong = _actions("two" if name == "two" else "cube")[action]()
    if name in ("gymnasium", "pettingzoo"):
        wrong = _first_row(wrong)
    if name == "pettingzoo" and not isinstance(wrong, dict):
        wrong = {"arm": wrong}
    _unchanged(front, lambda: front.step(wrong))


def _first_row(wrong: Any) -> Any:
    """Return what is as wrong for one environment."""
    if isinstance(wrong, np.ndarray) and wrong.ndim >= 2 and wrong.shape[0] == 2:
        return wrong[-1]
    return wrong


def _step_some(ids: Any, folder: Path) -> None:
    env = _front("task")
    _begin(env, seed=0)
    _unchanged(env, lambda: env.step(np.ones((2, 8), np.float32), env_ids=ids))
