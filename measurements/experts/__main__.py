"""``python -m measurements.experts``: how often experts of several robots succeed, and touch.

Each task is played in its own layout, and in others: those that `layouts.search` returns for what
its arms must reach, and for Relay rings of any number of robots. Every plan is played in a fresh
environment, in which each step of physics is looked at for arms that touch. The record is JSON and
goes on where it stopped; the table is beside it as markdown.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path
from typing import Any

import torch

from experts import find_expert
from experts.touching import ArmWatch
from layouts import Layout
from measurements.experts.cells import TASKS, other_layout
from measurements.experts.table import markdown
from measurements.robots.record import versions_of
from robots import LayoutError, RecordingError, TaskError
from robots.common.commands import exit_code, start
from robots.common.writing import write_whole
from rollouts.progress import LiveLine
from tasks import MultiRobotTask, make
from tasks.episode import play

RECORD = Path("docs/experts.json")

Seen = dict[str, Any]


def main(arguments: list[str] | None = None) -> int:
    """Run the command.

    Returns:
        0 if everything was played, 1 if something cannot be read or written.
    """
    parser = argparse.ArgumentParser(prog="python -m measurements.experts", description=__doc__)
    add = parser.add_argument
    add("--tasks", nargs="+", choices=TASKS, default=TASKS, metavar="TASK", help="(all)")
    add("--seeds", type=int, default=100, metavar="N", help="in its own layout (%(default)s)")
    add("--layouts", type=int, default=10, metavar="N", help="other layouts (%(default)s)")
    add("--layout-seeds", type=int, default=10, metavar="N", help="in each of them (%(default)s)")
    add("--out", type=Path, default=RECORD, metavar="FILE", help="the record (%(default)s)")
    add("--table", action="store_true", help="play nothing; write the table of the record anew")
    options = parser.parse_args(arguments)
    return exit_code(lambda: _run(options))


def _run(options: argparse.Namespace) -> int:
    torch.set_num_threads(1)
    record: Seen = {"versions": {}, "tasks": {}}
    if options.out.exists():
        record = _read(options.out)
    if not options.table:
        record["versions"] |= versions_of("sapien", "ompl", "python-fcl")
        _measure(record, options)
    table = options.out.with_suffix(".md")
    write_whole(table, "\n".join(markdown(record)) + "\n")
    print(f"{options.out}, {table}: {len(record['tasks'])} tasks")
    return 0


def _read(path: Path) -> Seen:
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        return {"versions": dict(record["versions"]), "tasks": dict(record["tasks"])}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RecordingError(f"{path} holds no record of experts: {error!r}") from error


def _measure(record: Seen, options: argparse.Namespace) -> None:
    """Play what the record lacks; it is written after every episode."""
    count = options.seeds + options.layouts * options.layout_seeds

    def save() -> None:
        write_whole(options.out, json.dumps(record, indent=1) + "\n")

    with LiveLine(len(options.tasks) * count, "episodes") as line:
        for task_id in options.tasks:
            seen = record["tasks"].setdefault(task_id, {"own": {}, "others": {}})
            for _ in _play(make(task_id, obs_mode="none"), seen["own"], options.seeds):
                save()
                line.advance(1, f"{task_id}, its own layout")
            for number in range(options.layouts):
                other = _other(seen["others"], task_id, number)
                if "layout" in other:
                    layout = Layout.from_yaml(other["layout"])
                    task = make(task_id, layout=layout, obs_mode="none")
                    for _ in _play(task, other["episodes"], options.layout_seeds):
                        save()
                        line.advance(1, f"{task_id}, layout {number + 1}")
            save()


def _other(others: Seen, task_id: str, number: int) -> Seen:
    """Return what is known of a layout, which is searched for unless it is known."""
    if str(number) not in others:
        try:
            layout = other_layout(task_id, number).to_yaml()
            others[str(number)] = {"layout": layout, "episodes": {}}
        except LayoutError as error:
            others[str(number)] = {"error": str(error)}
    return others[str(number)]


def _play(task: MultiRobotTask, episodes: Seen, seeds: int) -> Iterable[int]:
    """Play the seeds that are missing and yield each one."""
    expert = find_expert(task.task_id)
    arms = ArmWatch(task)
    with closing(task):
        for seed in range(seeds):
            if str(seed) not in episodes:
                episodes[str(seed)] = _episode(task, seed, expert, arms)
            yield seed


def _episode(task: MultiRobotTask, seed: int, expert: Any, arms: ArmWatch) -> Seen:
    """Return what came of an expert's plan: success, steps, the arms that touched, and why."""
    try:
        plan = expert(task, seed)
    except TaskError as error:
        return {"success": False, "steps": 0, "touching": [], "reason": str(error)}
    touching: dict[str, None] = {}

    def watch() -> None:
        touching.update(dict.fromkeys(f"{a}, {b}" for a, b in arms.touching()))

    played = play(task, seed, plan, watch)
    return {
        "success": played.solved,
        "steps": len(plan),
        "touching": list(touching),
        "reason": getattr(plan, "reason", ""),
    }


if __name__ == "__main__":
    start(main)
