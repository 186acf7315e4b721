"""How long one step takes: native, ours, and the physics alone, interleaved in one run."""

from __future__ import annotations

import argparse
import json
import logging
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

import tasks
from parity.native import make_native, native_action
from tasks import MultiRobotTask

BLOCK = 50  # steps timed in one go; one block of each contestant, then the next


@dataclass(frozen=True)
class StepTimes:
    """Medians over blocks (µs per environment and step).

    Attributes:
        task: Task id.
        native: Native's ``step`` with observation, reward and success.
        ours: Our ``step`` with observation, reward and success.
        physics: The physics substeps of the same motion alone.
        batched: Our ``step`` with ``batch`` environments in this process.
        batched_physics: The physics substeps of that batch alone.
        batch: Number of environments of the batch.
    """

    task: str
    native: float
    ours: float
    physics: float
    batched: float
    batched_physics: float
    batch: int

    @property
    def speedup(self) -> float:
        """How many times faster than native one environment steps."""
        return self.native / self.ours

    @property
    def overhead(self) -> float:
        """Cost of a batch's step as a multiple of its physics."""
        return self.batched / self.batched_physics


def measure(task_id: str, blocks: int, batch: int, tick: Callable[[], None]) -> StepTimes:
    """Time one task with random actions, one block of each contestant after the other.

    Args:
        task_id: The task.
        blocks: Number of timed blocks of each contestant.
        batch: Environments in the batched contestant.
        tick: Called after every round of blocks.
    """
    native = make_native(task_id)
    ours, floor = tasks.make(task_id), tasks.make(task_id)
    many, many_floor = (tasks.make(task_id, num_envs=batch) for _ in range(2))
    width = ours.single_action_space.shape[0]  # type: ignore[index]
    rng = np.random.RandomState(0)
    times: dict[str, list[float]] = {k: [] for k in ("native", "ours", "physics", "many", "floor")}
    for block in range(blocks + 1):
        single = rng.uniform(-1, 1, (BLOCK, 1, width)).astype(np.float32)
        wide = rng.uniform(-1, 1, (BLOCK // 5, batch, width)).astype(np.float32)
        for env in (native, ours, floor, many, many_floor):
            env.reset(seed=block)
        round_times = {
            "native": _time_native(native, single),
            "ours": _time_steps(ours, single),
            "physics": _time_physics(floor, single),
            "many": _time_steps(many, wide) / batch,
            "floor": _time_physics(many_floor, wide) / batch,
        }
        if block > 0:  # the first round warms up
            for name, value in round_times.items():
                times[name].append(value)
        tick()
    median = {name: statistics.median(values) for name, values in times.items()}
    return StepTimes(
        task_id,
        median["native"],
        median["ours"],
        median["physics"],
        median["many"],
        median["floor"],
        batch,
    )


def _time_native(env: Any, actions: np.ndarray) -> float:
    prepared = [native_action(env, action[0]) for action in actions]
    start = time.perf_counter()
    for action in prepared:
        env.step(action)
    return (time.perf_counter() - start) / len(actions) * 1e6


def _time_steps(env: MultiRobotTask, actions: np.ndarray) -> float:
    prepared = [torch.from_numpy(action) for action in actions]
    start = time.perf_counter()
    for action in prepared:
        env.step(action)
    return (time.perf_counter() - start) / len(actions) * 1e6


def _time_physics(env: MultiRobotTask, actions: np.ndarray) -> float:
    total = 0.0
    for action in actions:
        total += env.simulation.timed_step(action)
    return total / len(actions) * 1e6


def table(results: Sequence[StepTimes]) -> Table:
    """Return the results as a table."""
    batch = results[0].batch
    rows = Table(title="One step with observation, reward and success (µs, medians)")
    for column in ("task", "native", "ours", "physics", "native/ours", f"{batch} envs, per env",
                   f"{batch} envs, physics", "envs/physics"):  # fmt: skip
        rows.add_column(column, justify="left" if column == "task" else "right", no_wrap=True)
    for r in results:
        rows.add_row(
            r.task,
            f"{r.native:.0f}",
            f"{r.ours:.0f}",
            f"{r.physics:.0f}",
            f"{r.speedup:.2f}",
            f"{r.batched:.0f}",
            f"{r.batched_physics:.0f}",
            f"{r.overhead:.2f}",
        )
    return rows


def main(argv: Sequence[str] | None = None) -> int:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(prog="python -m parity.bench", description=__doc__)
    parser.add_argument("--task", action="append", help="task id; all clones if left out")
    parser.add_argument("--blocks", type=int, default=20, help=f"timed blocks of {BLOCK} steps")
    parser.add_argument("--batch", type=int, default=16, help="environments of the batched run")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    args = parser.parse_args(argv)
    torch.set_num_threads(1)
    logging.disable(logging.WARNING)
    task_ids = args.task or tasks.list_clones()
    results: list[StepTimes] = []
    with Progress(console=Console(stderr=True)) as progress:
        bar = progress.add_task("timing", total=len(task_ids) * (args.blocks + 1))
        for task_id in task_ids:
            progress.update(bar, description=f"timing {task_id}")
            results.append(measure(task_id, args.blocks, args.batch, lambda: progress.advance(bar)))
    Console(width=120).print(table(results))
    if args.json:
        args.json.write_text(json.dumps([asdict(r) for r in results], indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
