"""A process for each task of a sweep, so that one that dies takes nothing with it."""

from __future__ import annotations

import os
import sys
import time
import traceback
from collections.abc import Callable, Generator, Iterable
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import torch

import tasks
from parity.sweep.entries import Entry, blank
from parity.sweep.plan import Plan
from parity.sweep.stages import sweep_task
from robots import RecordingError, RobotLayoutsError
from rollouts.playing.executor import (
    Executor,
    ProcessExecutor,
    WorkersDied,
    modules_of,
    play_all,
    report,
)

LOG = "sweep.log"
STAGE_SECONDS = 86400.0  # that a process may take without a word

Progressed = Callable[[str, str, float], None]  # task, stage, share of it that is done


def sweep(
    plans: Iterable[Plan],
    workers: int = 1,
    progressed: Progressed = lambda task_id, stage, share: None,
    *,
    executor: Executor | None = None,
) -> Generator[Entry]:
    """Carry out plans, each in a process of its own, and yield an entry as each is done.

    Whatever happens to a process, the others go on, and its entry says what happened.

    Args:
        plans: What to do.
        workers: How many at a time.
        progressed: Called now and then with task, stage and the share of the stage that is done.
        executor: Who carries them out instead of ``workers`` processes, such as a cluster whose
            machines share the plans' folders.

    Raises:
        RecordingError: If a folder cannot be made.
        TaskError: If ``workers`` is not a number of processes.
        WorkerError: If no process can be started.
    """
    plans = tuple(plans)
    for plan in plans:
        _make_folder(plan.folder)
    executor = executor or ProcessExecutor(
        workers, attempts=1, fresh=True, episode_timeout=STAGE_SECONDS
    )
    with closing(play_all(executor, SweepJob(plans), range(len(plans)))) as events:
        for event in events:
            if event.seed is None:
                continue
            plan = plans[event.seed]
            if event.note is not None:
                progressed(plan.task_id, *event.note)
            elif event.result is not None:
                yield event.result
            elif not isinstance(event.error, WorkersDied):  # its death was reported before
                what = f"{event.died or event.error}; {plan.folder / LOG} holds its output"
                yield {**blank(plan.task_id, plan.options), "error": what}


@dataclass(frozen=True)
class SweepJob:
    """What processes carry out; they get the number of a plan for a seed.

    Attributes:
        plans: All of them.
    """

    plans: tuple[Plan, ...]

    @property
    def modules(self) -> tuple[str, ...]:
        """What other machines may need."""
        return modules_of(self, *(tasks.get_task_class(plan.task_id) for plan in self.plans))

    def __call__(self) -> Callable[[int], Entry]:
        """Return what carries out a plan, and tells how far it is."""
        torch.set_num_threads(1)  # the tensors are small
        return self._carry_out

    def _carry_out(self, number: int) -> Entry:
        plan, started = self.plans[number], time.monotonic()
        entry = blank(plan.task_id, plan.options)
        with _output_to(plan.folder / LOG):
            try:
                sweep_task(plan, lambda stage, share: report((stage, share)), entry)
            except RobotLayoutsError as error:
                entry["error"] = str(error)
            except Exception as error:  # one task must not end the sweep of the others
                traceback.print_exc()
                entry["error"] = f"{type(error).__name__}: {error}"
        entry["seconds"] = round(time.monotonic() - started, 1)
        return entry


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"cannot write into {folder}: {error}") from error


@contextmanager
def _output_to(path: Path) -> Generator[None]:
    """Send what this process prints, C libraries included, to a file."""
    with path.open("wb") as file:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        for number in (1, 2):
            os.dup2(file.fileno(), number)
        yield
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
