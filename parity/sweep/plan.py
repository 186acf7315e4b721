"""What a sweep does with each task."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tasks
from experts import list_experts
from parity.records.inventory import find_files
from robots import TaskError


@dataclass(frozen=True)
class Plan:
    """What to do with one task.

    Attributes:
        task_id: The task.
        demos: Files of recorded episodes; without any, the expert plays, else chance.
        episodes: How many episodes to compare, at most.
        folder: Where its files go.
        video: Whether to film native and make a clip.
    """

    task_id: str
    demos: tuple[str, ...]
    episodes: int
    folder: Path
    video: bool

    @property
    def options(self) -> dict[str, Any]:
        """What a summary remembers of this plan, to tell whether it was carried out."""
        return {"demos": list(self.demos), "episodes": self.episodes, "video": self.video}


def plan(args: argparse.Namespace) -> list[Plan]:
    """Return what the arguments ask for, one plan for each task.

    Raises:
        RobotLayoutsError: If a number or a name makes no sense, or there is no such folder.
    """
    for name in ("episodes", "workers"):
        if getattr(args, name) < 1:
            raise TaskError(f"--{name} is {getattr(args, name)}; it must be 1 or more")
    classes = [tasks.get_task_class(name) for name in args.tasks or tasks.list_clones()]
    demos, unreadable = find_files(args.demos) if args.demos else ({}, [])
    for file in unreadable:
        print(f"{file.path} is left out: {file.problem}", file=sys.stderr)
    task_ids = dict.fromkeys(cls.task_id for cls in classes)
    for task_id in list_experts() if args.experts else ():
        demos.pop(task_id, None)
    return [
        Plan(
            task_id,
            tuple(map(str, demos.get(task_id, ()))),
            args.episodes,
            args.out / task_id,
            not args.no_video,
        )
        for task_id in task_ids
    ]
