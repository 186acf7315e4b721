"""``python -m benchmarks engines``: what experts solve in MuJoCo, and what its physics costs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from statistics import median
from time import thread_time
from typing import Any

import torch
from tqdm import tqdm

from benchmarks.records import DOCS, read_record, table, versions_of, write_page, write_record
from robot_layouts.data.comparison import compare
from robot_layouts.data.receipts import Receipt
from robot_layouts.data.suite.results import wilson
from robot_layouts.experts import find_expert, list_experts
from robot_layouts.simulation.backend import SIMULATORS
from robots import RobotLayoutsError
from tasks import TaskEnv, get_task_class, make

RECEIPTS = DOCS / "receipts" / "engines"  # of what learned in one engine and was played in one


def engines(
    *, seeds: int = 5, tasks: tuple[str, ...] | None = None, out: Path = DOCS / "engines.json"
) -> int:
    """Let experts plan in MuJoCo, and play their actions there and in SAPIEN in turns.

    Args:
        seeds: How many episodes of each task; those in the record are not played again.
        tasks: Which tasks; all with an expert if not given.
        out: The record, written after every episode; the page is beside it.

    Raises:
        RobotLayoutsError: If something cannot be read or written.
    """
    torch.set_num_threads(1)
    record = read_record(out, versions={}, episodes={})
    for task in tqdm(_of_the_library() if tasks is None else tasks, disable=None):
        seen = record["episodes"].setdefault(task, {})
        missing = [seed for seed in range(seeds) if str(seed) not in seen]
        envs = {name: make(task, simulator=name, obs_mode="none") for name in SIMULATORS}
        with closing(envs["sapien3"]), closing(envs["mujoco"]):
            for seed in missing:
                seen[str(seed)] = _played(task, envs, seed)
                record["versions"] = versions_of("sapien", "mujoco", "ompl")
                write_record(out, record)
    rows = [_row(task, [*seen.values()]) for task, seen in sorted(record["episodes"].items())]
    heads = ("task", "solved", "the same actions in SAPIEN", "physics, SAPIEN", "physics, MuJoCo")
    failures = [
        f"{task}, seed {seed}: {episode['reason']}"
        for task, seen in sorted(record["episodes"].items())
        for seed, episode in seen.items()
        if episode["reason"]
    ]
    shown = table(heads, rows)
    untried = ", ".join(task for task in _of_the_library() if task not in record["episodes"])
    write_page(
        out,
        "engines",
        versions=record["versions"],
        table=shown,
        failures=failures,
        untried=untried,
        learned=table(("learned in", *SIMULATORS), [*_learned()]),
    )
    return 0


def _learned() -> Iterator[tuple[str, ...]]:
    """Yield how many test episodes a policy solves in each engine, by that in which it learned."""
    for source in SIMULATORS:
        receipts = [Receipt.read(RECEIPTS / f"{source}-{name}.json") for name in SIMULATORS]
        yield source, *(_solved(receipt) for receipt in receipts)


def _solved(receipt: Receipt) -> str:
    count, solved = len(receipt.episodes), sum(e.success for e in receipt.episodes)
    low, high = (100 * share for share in wilson(solved, count))
    return f"{solved} of {count} ({low:.1f} to {high:.1f} %)"


def _of_the_library() -> list[str]:
    """Return the tasks with an expert but for those that a program has added."""
    return [task for task in list_experts() if get_task_class(task).__module__.startswith("tasks.")]


def _played(task: str, envs: dict[str, TaskEnv], seed: int) -> dict[str, Any]:
    """Return how an episode went: whether it was solved, by engine, and what a step took (µs)."""
    try:
        plan = find_expert(task)(envs["mujoco"], seed)
    except RobotLayoutsError as error:
        return {"solved": {}, "steps": 0, "physics": {}, "reason": str(error)}
    clocks = {name: _Clock(env) for name, env in envs.items()}
    found = compare(envs, seed, plan)
    return {
        "solved": dict(found.solved),
        "steps": found.steps,
        "physics": {name: round(clock.stop()) for name, clock in clocks.items()},
        "reason": "" if found.solved["mujoco"] else getattr(plan, "reason", "") or "not solved",
    }


class _Clock:
    """Measures the processor's time that an environment's physics takes."""

    def __init__(self, env: TaskEnv) -> None:
        self._backend: Any = env.simulation.backend
        self._step, self._times = self._backend.step, list[float]()
        self._backend.step = self._timed

    def _timed(self, *what: Any) -> None:
        start = thread_time()
        self._step(*what)
        self._times.append(thread_time() - start)

    def stop(self) -> float:
        """Return the median time of a step (µs), and measure no more."""
        self._backend.step = self._step
        return median(self._times) * 1e6


def _row(task: str, episodes: list[dict[str, Any]]) -> tuple[str, ...]:
    count = len(episodes)
    solved = {n: sum(e["solved"].get(n, False) for e in episodes) for n in SIMULATORS}
    times = {n: [e["physics"][n] for e in episodes if e["physics"]] for n in SIMULATORS}
    physics = [f"{median(times[n]):,.0f} µs" if times[n] else "–" for n in SIMULATORS]
    return task, f"{solved['mujoco']} of {count}", f"{solved['sapien3']} of {count}", *physics
