"""Whether recording takes the same memory however many episodes there are.

A few episodes are really played; what is recorded are copies of them under other seeds, which go
the way that all episodes go: encoded, stored, joined and noted.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from experts import find_expert
from measurements.datasets.costs import Cost, timed
from rollouts.playing.executor import Event
from rollouts.reading.recording import Recording
from rollouts.recording.record import record
from tasks import make
from tasks.episode import PlayedEpisode, play

PLAYED = 20  # episodes that are really played


@dataclass(frozen=True)
class Moment:
    """How far a recording is.

    Attributes:
        episodes: Recorded so far.
        memory: Of this process (MB).
        parts: Episodes that are not joined yet.
    """

    episodes: int
    memory: float
    parts: int


@dataclass(frozen=True)
class Growth:
    """How a recording grew.

    Attributes:
        moments: How far it was, at times.
        record: What it took in all.
        open: What opening the whole and reading one episode of each thousand took.
        resume: What going on with the complete recording took.
    """

    moments: tuple[Moment, ...]
    record: Cost
    open: Cost
    resume: Cost

    @property
    def slope(self) -> float:
        """Bytes of memory by which an episode lets this process grow, in the second half."""
        first, last = self.moments[len(self.moments) // 2], self.moments[-1]
        count = last.episodes - first.episodes
        return (last.memory - first.memory) * 1e6 / count if count else 0.0

    def __str__(self) -> str:
        """Say it in lines."""
        lines = [
            f"{moment.episodes:7,} episodes: {moment.memory:6.0f} MB, {moment.parts} parts"
            for moment in self.moments
        ]
        count = self.moments[-1].episodes
        return "\n".join(
            [
                *lines,
                f"{self.slope:.0f} bytes of memory an episode",
                f"joined: {self.record.processor / count * 1e3:.2f} ms of a processor an episode",
                f"opened, one episode of each thousand read: {self.open.seconds:.1f} s;"
                f" resumed: {self.resume.seconds:.1f} s",
            ]
        )


class Copies:
    """An executor that gives copies of a few episodes under the seeds that are asked for."""

    def __init__(self, episodes: list[PlayedEpisode]) -> None:
        """Take the episodes."""
        self._episodes = episodes

    def run(self, prepare: Callable[[], Any], seeds: Iterable[int]) -> Generator[Event]:
        """See `rollouts.playing.executor.Executor.run`."""
        encoder = prepare.encoder  # pyright: ignore[reportFunctionMemberAccess]
        for seed in seeds:
            episode = replace(self._episodes[seed % len(self._episodes)], seed=seed)
            yield Event(seed, result={seed: (episode.score, encoder.encode(episode))})


def measure(
    task_id: str,
    episodes: int,
    folder: Path,
    file_size: float,
    progress: Callable[[str], None] = lambda what: None,
) -> Growth:
    """Record copies of a task's episodes in a folder that must be new.

    Args:
        task_id: The task.
        episodes: How many copies.
        folder: Where to.
        file_size: See `rollouts.recording.recorder.Recorder` (MB).
        progress: Called after each episode with what is going on.
    """
    executor, moments = Copies(list(_played(task_id))), list[Moment]()
    every = max(1, episodes // 10)
    count = 0

    def note(*_: object) -> None:
        nonlocal count
        count += 1
        progress("recording copies")
        if (count - 1) % every == 0:
            parts = folder / "trajectory.parts"
            moments.append(Moment(count - 1, _memory(), sum(1 for _ in parts.iterdir())))

    def make_all() -> None:
        record(task_id, range(episodes), folder, executor, file_size=file_size, on_event=note)

    _, recording = timed(make_all)
    found = tuple(moments)
    _, opening = timed(lambda: _read_some(folder))
    _, resuming = timed(make_all)
    return Growth(found, recording, opening, resuming)


def _played(task_id: str) -> Iterator[PlayedEpisode]:
    expert = find_expert(task_id)
    task = make(task_id, obs_mode="none")
    for seed in range(PLAYED):
        yield play(task, seed, expert(task, seed))
    task.close()


def _read_some(folder: Path) -> None:
    with Recording(folder) as file:
        for number in range(0, len(file), 1000):
            file[number]


def _memory() -> float:
    """Return the memory that this process has now (MB)."""
    found = re.search(r"VmRSS:\s+(\d+) kB", Path("/proc/self/status").read_text())
    return int(found[1]) / 1e3 if found else 0.0
