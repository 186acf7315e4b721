"""Wrong arguments of resets and steps, of every front: seeds, options, actions, environments."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tests.faults.fault import GOES_ON, Fault

AREA = "arguments"
ONE, TWO = "PickCube-v1", "TwoRobotPickCube-v1"
FRONTS = ("task", "gymnasium", "pettingzoo", "vector", "sb3")

WRONG_SEEDS: dict[str, Any] = {
    repr(seed): seed
    for seed in (
        True,
        -1,
        2**32,
        10**30,
        1.5,
        math.nan,
        "0",
        b"0",
        {},
        {0},
        1j,
        [True],
        [0.5],
        [[0]],
        [-1],
    )
} | {
    "too many": [1, 2, 3, 4],
    "none": [],
    "a float array": np.array([0.0]),
    "a mask": np.array([True]),
    "a ragged list": [[1], [2, 3]],
    "an iterator": iter((0,)),
    "an object": object(),
    "datetime": np.datetime64("2026-01-01"),
}
GOOD_SEEDS: dict[str, Any] = {
    "numpy.int64": np.int64(7),
    "numpy.uint8": np.uint8(7),
    "the largest": 2**32 - 1,
    "zero": 0,
}
WRONG_OPTIONS: tuple[Any, ...] = (
    5,
    "reconfigure",
    ["reconfigure"],
    True,
    0,
    "",
    [],
    {"reconfigure"},
)
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
        for name, seed in GOOD_SEEDS.items():
            yield Fault(AREA, f"{front}: seed {name}", partial(_same_again, front, seed), GOES_ON)
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
        yield Fault(
            AREA, f"{front}: eight of them without a seed", partial(_differ, front), GOES_ON
        )
        yield Fault(AREA, f"{front}: info of reset and step", partial(_same_keys, front), GOES_ON)
    for ids in WRONG_IDS:
        yield Fault(
            AREA, f"task: reset(env_ids={ids!r})", partial(_reset, "task", {"env_ids": ids})
        )
        yield Fault(AREA, f"task: step(env_ids={ids!r})", partial(_step_some, ids))
    for name in _actions("two"):
        if name in _actions("cube") and name not in BRIEFLY:
            continue
        yield Fault(AREA, f"two robots: step with {name}", partial(_step, "two", name))
    for name in _good_actions():
        yield Fault(AREA, f"step with {name}", partial(_moves_alike, name), GOES_ON)
    for mask in (True, [True, False], np.array([1, 0]), np.zeros(2, bool), np.ones(3, bool), "all"):
        wrong = {"options": {"reset_mask": mask}}
        yield Fault(AREA, f"vector: reset_mask={mask!r}", partial(_reset, "vector", wrong))


@functools.cache
def _front(name: str) -> Any:
    """Return a front of two environments where it can have them, made once per process."""
    import gymnasium

    import tasks

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
    import tasks

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


def _same_again(name: str, seed: Any, folder: Path) -> str:
    front = _front(name)
    if _task_of(front).num_envs == 2 and seed == 2**32 - 1:
        seed = seed - 1  # the second environment gets one more
    first, again = (
        _observation(_begin(front, seed=int(seed) if name == "sb3" else seed)) for _ in range(2)
    )
    other = _observation(_begin(front, seed=12345))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    return "the same episode again"


def _observation(begun: Any) -> Any:
    obs = begun[0]
    return np.concatenate([*obs.values()]) if isinstance(obs, dict) else np.asarray(obs)


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
        "1e300": lambda: spoilt(1e300),
        "nothing": lambda: None,
        "a number": lambda: 0.5,
        "a text": lambda: "left",
        "texts": lambda: [["0"] * width] * 2,
        "an empty list": lambda: [],
        "a ragged list": lambda: [[0.0] * width, [0.0]],
        "an object": lambda: object(),
        "objects": lambda: np.full((2, width), None),
        "integers": lambda: np.zeros((2, width), int),
        "truth values": lambda: np.zeros((2, width), bool),
        "complex numbers": lambda: np.zeros((2, width), complex),
        "dates": lambda: np.zeros((2, width), "datetime64[s]"),
        "records": lambda: np.zeros((2, width), "f4,f4"),
        "one number too many": lambda: np.zeros((2, width + 1), np.float32),
        "one number too few": lambda: np.zeros((2, width - 1), np.float32),
        "three environments": lambda: np.zeros((3, width), np.float32),
        "another dimension": lambda: np.zeros((2, width, 1), np.float32),
        "no dimension": lambda: np.float32(0),
        "a complex tensor": lambda: torch.zeros(2, width, dtype=torch.complex64),
        "an integer tensor": lambda: torch.zeros(2, width, dtype=torch.int64),
        "a sparse tensor": lambda: torch.zeros(2, width).to_sparse(),
        "a sparse half tensor": lambda: torch.zeros(2, width, dtype=torch.float16).to_sparse(),
        "a tensor of meta": lambda: torch.zeros(2, width, device="meta"),
        "a half tensor of meta": lambda: torch.zeros(2, width, dtype=torch.bfloat16, device="meta"),
        "a quantized tensor": lambda: torch.quantize_per_tensor(
            torch.zeros(2, width), 0.1, 0, torch.qint8
        ),
        "a list of tensors that learn": lambda: (
            [torch.zeros(width, dtype=torch.cfloat, requires_grad=True)] * 2
        ),
        "unknown robots": lambda: {"lefty": np.zeros((2, 8), np.float32)},
        "no robots": lambda: {},
        "robots that are numbers": lambda: {0: np.zeros((2, 8), np.float32)},
    }
    if kind == "two":
        part = np.zeros((2, 8), np.float32)
        wrong |= {
            "one robot's part": lambda: {"left": part},
            "a part too wide": lambda: {"left": part, "right": np.zeros((2, 9), np.float32)},
            "a part of nothing": lambda: {"left": part, "right": None},
            "a part of texts": lambda: {"left": part, "right": "up"},
            "a robot too many": lambda: {"left": part, "right": part, "middle": part},
            "a part with NaN": lambda: {"left": part, "right": np.full((2, 8), math.nan)},
            "integer parts": lambda: {"left": part, "right": np.zeros((2, 8), int)},
            "a dict in a dict": lambda: {"left": part, "right": {"arm": part}},
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


def _good_actions() -> dict[str, Callable[[Any], Any]]:
    import torch

    return {
        "float64": lambda x: x.astype(np.float64),
        "lists": lambda x: x.tolist(),
        "a half array": lambda x: x.astype(np.float16),
        "a half tensor": lambda x: torch.from_numpy(x).half(),
        "a bfloat16 tensor": lambda x: torch.from_numpy(x).bfloat16(),
        "a double tensor": lambda x: torch.from_numpy(x).double(),
        "a tensor that learns": lambda x: torch.from_numpy(x).requires_grad_(),
        "a transposed array": lambda x: np.asfortranarray(x),
        "a read-only array": lambda x: np.frombuffer(x.tobytes(), np.float32).reshape(x.shape),
        "parts by robot": lambda x: {"arm": x},
    }


def _moves_alike(name: str, folder: Path) -> str:
    env = _front("task")
    action = np.full((2, 8), 0.5, np.float32)  # exact in every type
    _begin(env, seed=3)
    expected = env.step(action)[0].clone()
    _begin(env, seed=3)
    assert (env.step(_good_actions()[name](action))[0] == expected).all()
    return "the same step"


def _differ(name: str, folder: Path) -> str:
    """Make several fronts, none seeded: all differ, and each says how to have it again."""
    makers: dict[str, int] = {"vector": 4, "sb3": 4}
    seen: list[bytes] = []
    count = makers.get(name, 8)
    for _ in range(8 // (2 if name in makers else 1)):
        front = _front.__wrapped__(name)
        if name == "task":
            assert front.seeds == [2022, 2023]  # as native's
            return "tasks.make begins with native's seeds"
        begun = _begin(front)
        obs, seeds = _rows(_observation(begun), name), _seeds(begun[1], name)
        again = _front.__wrapped__(name)
        replayed = _rows(_observation(_begin(again, seed=seeds[0])), name)
        assert np.array_equal(obs, replayed), "the seed that it said gives another episode"
        seen += [row.tobytes() for row in obs]
        front.close()
        again.close()
    assert len(seen) >= count
    assert len(set(seen)) == len(seen), "two played the same episode"
    return f"{len(seen)} different episodes, each repeatable by the seed in its info"


def _rows(obs: Any, name: str) -> Any:
    return obs if name in ("vector", "sb3", "task") else obs[None]


def _seeds(info: Any, name: str) -> list[int]:
    """Return the seeds that an info says."""
    if name == "sb3":
        return [own["seed"] for own in info]
    told = info["arm"] if name == "pettingzoo" else info
    return np.ravel(told["seed"]).tolist()


def _same_keys(name: str, folder: Path) -> str:
    front = _front(name)
    begun = _begin(front, seed=5)[1]
    still = np.zeros((2, 8), np.float32)
    if name == "task":
        stepped = front.step(still)[4]
        assert {*stepped} == {*begun} - {"reconfigure"}  # native says that it rebuilt
        return "native's keys"
    if name in ("gymnasium", "pettingzoo"):
        stepped = front.step(still[0] if name == "gymnasium" else {"arm": still[0]})[4]
    else:
        stepped = front.step(still)[-1]
    if name == "sb3":
        begun, stepped = begun[0], stepped[0]
        assert {*stepped} - {"TimeLimit.truncated"} == {*begun}
    else:
        assert {*stepped} == {*begun}
    told = begun["arm"] if name == "pettingzoo" else begun
    assert np.ravel(told["seed"])[0] == 5
    return f"{len(told)} keys, the same"
