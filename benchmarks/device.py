"""``python -m benchmarks device``: steps per second of thousands of worlds on one device.

It needs nothing but what `tasks.interfaces.device` does, so that it runs where SAPIEN cannot:
``python -m benchmarks.device`` loads no other benchmark.
"""

from __future__ import annotations

import json
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import torch
from gymnasium.vector import AutoresetMode

from robots import RobotLayoutsError
from tasks import make
from tasks.interfaces.device import DeviceTask

TASKS = ("PickCube-v1", "TwoRobotPickCube-v1")
WORLDS = (1024, 4096, 16384)
ALIKE, CHECKED = 8, 20  # worlds that are compared with MuJoCo's own, and control steps
SEED = 0


def device(
    *,
    device: str = "cuda:0",
    tasks: tuple[str, ...] = TASKS,
    worlds: tuple[int, ...] = WORLDS,
    steps: int = 50,
    out: Path = Path("runs/device.json"),
) -> int:
    """Step tasks on a device with random actions, and write how fast that is.

    Args:
        device: ``"cuda:0"`` or ``"cpu"``.
        tasks: Which tasks.
        worlds: How many worlds, one number after the other.
        steps: Control steps that are measured.
        out: The record, written after every measurement.
    """
    record: dict[str, Any] = {"device": _name(device), "checks": {}, "speed": []}
    for task in tasks:
        record["checks"][task] = _tried(lambda task=task: check(task, device))
        _write(out, record)
        for count in worlds:
            found = _tried(lambda task=task, count=count: speed(task, count, device, steps))
            record["speed"].append({"task": task, "worlds": count, **found})
            _write(out, record)
    return 0


def check(task: str, device: str) -> dict[str, Any]:
    """Return how far worlds on a device are from MuJoCo's, and whether a step waits for it."""
    since = time.perf_counter()
    with closing(DeviceTask(task, ALIKE, device, AutoresetMode.DISABLED, starts=ALIKE)) as env:
        first = env.seeds[0]
        env.reset(seed=first)
        found: dict[str, Any] = {"seconds_to_make": round(time.perf_counter() - since, 1)}
        actions = _actions(env, CHECKED)
        away, since = 0.0, time.perf_counter()
        with closing(make(task, ALIKE, simulator="mujoco")) as host:
            host.reset(seed=first)
            for action in actions:
                obs, *_ = env.step(action)
                seen, *_ = host.step(action.cpu())
                away = max(away, (obs.cpu() - seen).abs().max().item())
        found["seconds_of_first_steps"] = round(time.perf_counter() - since, 1)
        found["largest_difference_of_observations"] = away
        again = [_played(env, first, actions) for _ in range(2)]
        found["equal_bits_again"] = bool(torch.equal(*again))
        if env.device.type == "cuda":
            found["waits_for_the_device"] = _waits(env, actions[0])
    return found


def speed(task: str, count: int, device: str, steps: int) -> dict[str, Any]:
    """Return how many steps a second a task takes, in so many worlds, and what resets cost."""
    rates: dict[str, float] = {}
    found: dict[str, Any] = {}
    info: dict[str, Any] = {}
    for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED):
        since = time.perf_counter()
        with closing(DeviceTask(task, count, device, mode)) as env:
            env.reset()
            actions = _actions(env, 4)
            for action in actions:  # kernels are compiled, and graphs captured
                env.step(action)
            _wait(env)
            found[f"seconds_to_make, {mode.value}"] = round(time.perf_counter() - since, 1)
            since = time.perf_counter()
            for i in range(steps):
                *_, info = env.step(actions[i % len(actions)])
            _wait(env)
            seconds = (time.perf_counter() - since) / steps
            rates[mode.value] = seconds
            if mode is AutoresetMode.NEXT_STEP:
                found |= {
                    "steps_per_second": round(count / seconds),
                    "milliseconds": round(1e3 * seconds, 2),
                    "overflowed": int(info["overflowed"].sum()),
                    "diverged": int(info["diverged"].sum()),
                    "memory_GB": _memory(env),
                }
    with_resets, without = rates.values()
    found["share_of_resets"] = round(1 - without / with_resets, 3)
    return found


def _played(env: DeviceTask, seed: int, actions: torch.Tensor) -> torch.Tensor:
    """Return what is observed of an episode of each environment, (steps, N, D)."""
    env.reset(seed=seed)
    return torch.stack([env.step(action)[0] for action in actions])


def _waits(env: DeviceTask, action: torch.Tensor) -> str:
    """Return what in a step waits for the device; nothing if nothing does."""
    env.step(action)
    torch.cuda.set_sync_debug_mode("error")
    try:
        env.step(action)
    except RuntimeError as error:
        return str(error)
    finally:
        torch.cuda.set_sync_debug_mode("default")
    return ""


def _actions(env: DeviceTask, count: int) -> torch.Tensor:
    """Return random actions on the device, (count, N, A)."""
    generator = torch.Generator().manual_seed(SEED)
    shape: Any = env.action_space.shape
    rows = torch.rand((count, *shape), generator=generator)
    return (2.0 * rows - 1.0).to(env.device)


def _wait(env: DeviceTask) -> None:
    if env.device.type == "cuda":
        torch.cuda.synchronize(env.device)


def _memory(env: DeviceTask) -> float | None:
    """Return how much of the card's memory is taken (GB)."""
    if env.device.type == "cpu":
        return None
    free, total = torch.cuda.mem_get_info(env.device)
    return round((total - free) / 1e9, 2)


def _name(device: str) -> str:
    return torch.cuda.get_device_name(device) if device.startswith("cuda") else device


def _tried(measure: Any) -> dict[str, Any]:
    try:
        return measure()
    except (RobotLayoutsError, RuntimeError) as error:
        return {"error": str(error)}


def _write(out: Path, record: dict[str, Any]) -> None:
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(record, indent=1) + "\n")
    print(json.dumps(record), flush=True)


if __name__ == "__main__":
    sys.exit(device())
