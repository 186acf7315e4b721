"""A process for each task of a sweep, so that one that dies takes nothing with it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path

import torch

from parity.sweep.entries import Entry, blank
from parity.sweep.plan import Plan
from parity.sweep.stages import sweep_task
from robots import RecordingError, RobotLayoutsError

LOG = "sweep.log"

Progressed = Callable[[str, str, float], None]  # task, stage, share of it that is done


@dataclass
class _Worker:
    plan: Plan
    process: BaseProcess
    reports: Connection
    entry: Entry | None = None


def sweep(
    plans: Iterable[Plan],
    workers: int = 1,
    progressed: Progressed = lambda task_id, stage, share: None,
) -> Generator[Entry]:
    """Carry out plans, each in a process of its own, and yield an entry as each is done.

    Whatever happens to a process, the others go on, and its entry says what happened.

    Args:
        plans: What to do.
        workers: How many at a time.
        progressed: Called now and then with task, stage and the share of the stage that is done.
    """
    waiting, running = list(plans), list[_Worker]()
    try:
        while waiting or running:
            while waiting and len(running) < workers:
                running.append(_start(waiting.pop(0)))
            wait([worker.reports for worker in running])
            for worker in list(running):
                if _hear(worker, progressed):
                    continue
                running.remove(worker)
                yield _finished(worker)
    finally:
        for worker in running:
            worker.process.kill()
            worker.process.join()


def _start(plan: Plan) -> _Worker:
    try:
        plan.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"cannot write into {plan.folder}: {error}") from error
    context = multiprocessing.get_context("spawn")  # fork and PhysX's threads do not mix
    reports, send = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(plan, send), daemon=True)
    process.start()
    send.close()  # so that the end of the process is the end of the pipe
    return _Worker(plan, process, reports)


def _hear(worker: _Worker, progressed: Progressed) -> bool:
    """Take in what a worker says; return whether it may say more."""
    try:
        while worker.reports.poll():
            said = worker.reports.recv()
            if isinstance(said, dict):
                worker.entry = said
            else:
                progressed(worker.plan.task_id, *said)
    except EOFError:
        return False
    return True


def _finished(worker: _Worker) -> Entry:
    worker.process.join()
    worker.reports.close()
    if worker.entry is not None:
        return worker.entry
    code = worker.process.exitcode or 0
    how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
    log = worker.plan.folder / LOG
    return {
        **blank(worker.plan.task_id, worker.plan.options),
        "error": f"its process ended with {how}; {log} holds what it said",
    }


def _work(plan: Plan, reports: Connection) -> None:
    """Carry out one plan in this process, and say how it goes."""
    torch.set_num_threads(1)  # the tensors are small
    threading.Thread(target=_end_with_parent, daemon=True).start()
    entry, started = blank(plan.task_id, plan.options), time.monotonic()
    with _output_to(plan.folder / LOG):
        try:
            sweep_task(plan, lambda stage, share: reports.send((stage, share)), entry)
        except (KeyboardInterrupt, BrokenPipeError):  # nobody waits for it any more
            sys.exit(1)
        except RobotLayoutsError as error:
            entry["error"] = str(error)
        except Exception as error:  # one task must not end the sweep of the others
            traceback.print_exc()
            entry["error"] = f"{type(error).__name__}: {error}"
    entry["seconds"] = round(time.monotonic() - started, 1)
    reports.send(entry)


def _end_with_parent() -> None:
    """End this process when the sweep that started it is gone, even killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


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
