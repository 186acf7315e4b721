"""What recording, opening and certifying episodes of a task cost, and what many would take."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TypeVar

from rollouts.dataset.certify import certify
from rollouts.playing.executor import choose_executor
from rollouts.reading.recording import Recording, all_files
from rollouts.recording.record import record
from tasks import Randomization

Made = TypeVar("Made")


@dataclass(frozen=True)
class Cost:
    """What some work took.

    Attributes:
        seconds: On the clock (s).
        processor: Processor time of this process alone (s).
    """

    seconds: float
    processor: float


@dataclass(frozen=True)
class Costs:
    """What a dataset of a task took.

    Attributes:
        task: The task's id.
        episodes: How many.
        steps: Control steps of all of them.
        successes: How many succeeded.
        workers: Processes that played; 0: this one.
        bytes: Size of all files.
        files: How many h5 files.
        record: Recording them.
        certify: Playing them again; every one was equal to the last bit, or ``equal`` is less.
        open: Opening the folder and reading one episode.
        resume: Going on with the complete recording.
        equal: How many were equal to the last bit.
        contact_episodes: In how many arms touched.
    """

    task: str
    episodes: int
    steps: int
    successes: int
    workers: int
    bytes: int
    files: int
    record: Cost
    certify: Cost
    open: Cost
    resume: Cost
    equal: int
    contact_episodes: int

    def each(self, cost: Cost) -> float:
        """Return how long an episode kept one process busy (s).

        If this process played, it is processor time, else the clock's.
        """
        whole = cost.seconds * self.workers if self.workers else cost.processor
        return whole / self.episodes

    def __str__(self) -> str:
        """Say it in lines."""
        size, unit = self.bytes / self.episodes, "worker" if self.workers else "processor"
        lines = [
            f"{self.task}: {self.episodes} episodes, {self.successes} successes,"
            f" {self.steps / self.episodes:.1f} steps on average, {self.workers} workers",
            f"record: {self.each(self.record) * 1e3:.0f} ms of a {unit} an episode,"
            f" {size / 1e3:.1f} kB",
            f"certify: {self.each(self.certify) * 1e3:.0f} ms of a {unit} an episode; {self.equal}"
            f" equal, arms touched in {self.contact_episodes}",
            f"open {self.files} files: {self.open.seconds * 1e3:.0f} ms; resume:"
            f" {self.resume.seconds:.1f} s",
        ]
        for count in (10_000, 100_000):
            hours = [
                cost.processor / self.episodes * count / 3600
                for cost in (self.record, self.certify)
            ]
            lines.append(
                f"{count:,} would take {size * count / 1e9:.2f} GB, and {hours[0]:.1f} h of a"
                f" processor to record, {hours[1]:.1f} h to certify"
            )
        return "\n".join(lines)

    def to_json(self) -> dict[str, object]:
        """Return it as plain data."""
        return asdict(self)


def measure(
    task_id: str,
    episodes: int,
    folder: Path,
    workers: int,
    file_size: float,
    randomization: Randomization | None = None,
    progress: Callable[[str], None] = lambda what: None,
) -> Costs:
    """Record and certify episodes of a task in a folder that must be new.

    Args:
        task_id: The task.
        episodes: How many.
        folder: Where to.
        workers: How many processes play; 0: this one.
        file_size: See `rollouts.recording.recorder.Recorder` (MB).
        randomization: What varies, or None.
        progress: Called after each episode with what is going on.
    """

    def make() -> None:
        record(
            task_id,
            range(episodes),
            folder,
            choose_executor(workers),
            file_size=file_size,
            randomization=randomization,
            on_event=lambda summary, event: event and progress("recording"),
        )

    _, recording = timed(make)
    found, certifying = timed(
        lambda: certify(
            folder,
            choose_executor(workers),
            on_event=lambda certificate, event: event and progress("certifying"),
        )
    )
    _, opening = timed(lambda: _open(folder))
    _, resuming = timed(make)
    files = all_files(folder)
    return Costs(
        task_id,
        found.episodes,
        found.steps,
        found.successes,
        workers,
        sum(p.stat().st_size for h5 in files for p in (h5, h5.with_suffix(".json"))),
        len(files),
        recording,
        certifying,
        opening,
        resuming,
        found.equal,
        found.contact_episodes,
    )


def timed(work: Callable[[], Made]) -> tuple[Made, Cost]:
    """Do something, and return what came of it and what it took."""
    began, before = time.perf_counter(), time.process_time()
    made = work()
    return made, Cost(time.perf_counter() - began, time.process_time() - before)


def _open(folder: Path) -> None:
    with Recording(folder) as file:
        file[len(file) // 2]
