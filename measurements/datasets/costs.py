"""What recording, opening and certifying episodes of a task cost, and what many would take."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TypeVar

from rollouts.dataset.certify import certify
from rollouts.playing.executor import ProcessExecutor
from rollouts.reading.recording import all_files, open_trajectories
from rollouts.recording.record import record
from tasks import Randomization

Made = TypeVar("Made")


@dataclass(frozen=True)
class Cost:
    """What some work took.

    Attributes:
        seconds: On the clock (s).
        processor: Processor time of this process and of those that it waited for (s).
    """

    seconds: float
    processor: float

    def rate(self, count: int) -> str:
        """Say how much of it one of so many things took."""
        return f"{self.processor / count * 1e3:.1f} ms of a processor, {count / self.seconds:.2f}/s"


@dataclass(frozen=True)
class Costs:
    """What a data set of a task took.

    Attributes:
        task: The task's id.
        episodes: How many.
        steps: Control steps of all of them.
        successes: How many succeeded.
        workers: Processes that played.
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

    def __str__(self) -> str:
        """Say it in lines."""
        size = self.bytes / self.episodes
        lines = [
            f"{self.task}: {self.episodes} episodes, {self.successes} successes,"
            f" {self.steps / self.episodes:.1f} steps on average, {self.workers} workers",
            f"record: {self.record.rate(self.episodes)}; {size / 1e3:.1f} kB an episode",
            f"certify: {self.certify.rate(self.episodes)}; {self.equal} equal, arms touched in"
            f" {self.contact_episodes}",
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
        workers: How many processes play.
        file_size: See `rollouts.recording.recorder.Recorder` (MB).
        randomization: What varies, or None.
        progress: Called after each episode with what is going on.
    """

    def make() -> None:
        record(
            task_id,
            range(episodes),
            folder,
            ProcessExecutor(workers),
            file_size=file_size,
            randomization=randomization,
            on_event=lambda summary, event: progress("recording"),
        )

    _, recording = timed(make)
    found, certifying = timed(
        lambda: certify(
            folder,
            ProcessExecutor(workers),
            on_event=lambda certificate, event: progress("certifying"),
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
    began, before = time.perf_counter(), _processor()
    made = work()
    return made, Cost(time.perf_counter() - began, _processor() - before)


def _processor() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def _open(folder: Path) -> None:
    with open_trajectories(folder) as file:
        file[len(file) // 2]
