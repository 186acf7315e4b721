"""What a recording holds, from the json beside its files: the h5 files are not read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_layouts.data.reading.recording import all_files
from robot_layouts.data.reading.summary import Entry, Summary, read_summary

_UNKNOWN = "unknown"
_Columns = tuple[NDArray[np.int64], NDArray[np.bool_], dict[str, NDArray[np.float64]]]


@dataclass(frozen=True)
class FileFacts:
    """One h5 file of a recording.

    Attributes:
        name: Its name.
        megabytes: Its size (MB).
        episodes: How many episodes it holds.
        first: Seed of the first of them, or None.
        last: Seed of the last, or None.
    """

    name: str
    megabytes: float
    episodes: int
    first: int | None
    last: int | None


@dataclass
class SourceFacts:
    """Episodes of one source: how many, how many succeeded, and their control steps."""

    episodes: int = 0
    successes: int = 0
    steps: int = 0


@dataclass
class Contents:
    """What a recording of n episodes holds.

    Attributes:
        task_id: Id of the task.
        control_mode: Control mode of every episode.
        files: Its files.
        steps: Control steps of each episode, (n,).
        success: Whether each ended in success, (n,).
        sources: Counts of each source, by its name.
        drawn: What was varied, by axis and name: a number for each episode, (n,), NaN where
            nothing was drawn.
    """

    task_id: str
    control_mode: str | dict[str, str]
    files: list[FileFacts] = field(default_factory=list[FileFacts])
    steps: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    success: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, np.bool_))
    sources: dict[str, SourceFacts] = field(default_factory=dict[str, SourceFacts])
    drawn: dict[str, NDArray[np.float64]] = field(default_factory=dict[str, Any])

    @property
    def megabytes(self) -> float:
        """Size of all h5 files (MB)."""
        return sum(file.megabytes for file in self.files)


def read_contents(
    path: Path, progress: Callable[[int, int], None] = lambda done, total: None
) -> Contents:
    """Return what a recording holds.

    Args:
        path: The recording: an h5 file, a folder or a manifest.
        progress: Called with the files read, and those there are.

    Raises:
        TrajectoryError: If a file's json cannot be read.
    """
    files = all_files(path)
    found: Contents | None = None
    parts: list[_Columns] = []
    for number, file in enumerate(files):
        summary = read_summary(file)
        found = found or Contents(summary.task_id, summary.control_mode)
        seeds = [entry.seed for entry in summary.episodes] or [None]
        size = file.stat().st_size / 1e6 if file.exists() else 0.0
        facts = FileFacts(file.name, size, len(summary.episodes), seeds[0], seeds[-1])
        found.files.append(facts)
        for entry in summary.episodes:
            source = found.sources.setdefault(describe_source(entry, summary), SourceFacts())
            source.episodes += 1
            source.successes += bool(entry.success)
            source.steps += entry.steps or 0
        parts.append(_columns(summary.episodes))
        progress(number + 1, len(files))
    assert found is not None  # there is a file at least
    found.steps = np.concatenate([steps for steps, _, _ in parts])
    found.success = np.concatenate([success for _, success, _ in parts])
    found.drawn = {
        name: np.concatenate([drawn.get(name, np.full(len(s), np.nan)) for s, _, drawn in parts])
        for name in dict.fromkeys(name for _, _, drawn in parts for name in drawn)
    }
    return found


def describe_source(entry: Entry, summary: Summary) -> str:
    """Return the name of an episode's source: who acted, and who corrected."""
    source = entry.source
    if source is None:
        named = (summary.source_type, summary.source_desc)
        return " ".join(filter(None, named)) or _UNKNOWN
    actors: list[Mapping[str, Any]] = source.get("actors") or [source]
    words = " and ".join(f"{a.get('kind', '')} {a.get('name', '')}".strip() for a in actors)
    corrected: Mapping[str, Any] | None = source.get("corrects")
    return words + (f", correcting {corrected.get('name', '')}" if corrected else "")


def numbers_of(drawn: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """Yield every number in what was drawn for an episode, by axis and name."""
    if isinstance(drawn, Mapping):
        for key, value in drawn.items():
            yield from numbers_of(value, f"{name}/{key}".lstrip("/"))
    elif isinstance(drawn, list):
        for i, value in enumerate(drawn):
            yield from numbers_of(value, f"{name}[{i}]")
    elif isinstance(drawn, int | float):
        yield name, float(drawn)


def _columns(episodes: tuple[Entry, ...]) -> _Columns:
    """Return steps, success and what was drawn, a number for each episode."""
    steps = np.array([entry.steps or 0 for entry in episodes], np.int64)
    success = np.array([bool(entry.success) for entry in episodes], np.bool_)
    drawn: dict[str, NDArray[np.float64]] = {}
    for number, entry in enumerate(episodes):
        for name, value in numbers_of(entry.drawn or {}):
            if name not in drawn:
                drawn[name] = np.full(len(episodes), np.nan)
            drawn[name][number] = value
    return steps, success, drawn
