"""What processes hold on to: memory, file descriptors, threads, processes, shared memory.

Read from Linux's ``/proc``.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from itertools import combinations
from pathlib import Path

import numpy as np

_SHARED = ("/memfd:", "/dev/shm/")  # where shared memory shows in a list of mappings


@dataclass(frozen=True)
class Level:
    """What one process holds at a moment.

    Attributes:
        memory: Its own memory, without files and without what it shares (MB).
        descriptors: Open file descriptors.
        threads: Threads.
        processes: Processes that it started and that have not been waited for.
        shared: Pieces of shared memory, mapped or open.
    """

    memory: float
    descriptors: float
    threads: float
    processes: float
    shared: float


QUANTITIES = tuple(field.name for field in fields(Level))


def read_level(pid: int | None = None) -> Level:
    """Return what a process holds.

    Args:
        pid: The process; None is this one.

    Raises:
        OSError: If it is gone, or is another user's.
    """
    folder = Path("/proc") / ("self" if pid is None else str(pid))
    open_files = [_target(link) for link in (folder / "fd").iterdir()]
    threads = list((folder / "task").iterdir())
    return Level(
        memory=_anonymous(folder / "smaps_rollup"),
        descriptors=sum(not target.startswith("/proc/") for target in open_files),  # not our own
        threads=len(threads),
        processes=sum(len((thread / "children").read_text().split()) for thread in threads),
        shared=_count_shared(open_files) + _count_shared(_mappings(folder / "maps")),
    )


def growth(series: Sequence[Sequence[float]]) -> float:
    """Return by how much values grow while equal work is done again and again.

    The slope that three quarters of all pairs of values exceed, times the length: a single step up,
    or values that rise and fall, count for nothing. The first third of each series is warming up.

    Args:
        series: Values after each round of work, one or more series of them, each of the same
            length.
    """
    settled = [values[len(values) // 3 :] for values in series]
    slopes = [
        (values[j] - values[i]) / (j - i)
        for values in settled
        for i, j in combinations(range(len(values)), 2)
    ]
    return float(np.quantile(slopes, 0.25)) * (len(settled[0]) - 1) if slopes else 0.0


def grown(series: Sequence[Sequence[Level]]) -> Level:
    """Return the `growth` of every quantity."""
    return Level(
        *(
            growth([[getattr(level, name) for level in levels] for levels in series])
            for name in QUANTITIES
        )
    )


def worst(levels: Iterable[Level]) -> Level:
    """Return the largest value of each quantity."""
    found = list(levels)
    return Level(*(max(getattr(level, name) for level in found) for name in QUANTITIES))


def _anonymous(path: Path) -> float:
    for line in path.read_text().splitlines():
        if line.startswith("Anonymous:"):
            return int(line.split()[1]) / 1024
    raise OSError(f"{path} does not tell anonymous memory")


def _target(link: Path) -> str:
    try:
        return os.readlink(link)
    except FileNotFoundError:  # closed since it was listed
        return "/proc/"


def _mappings(path: Path) -> Iterable[str]:
    return (line.split(maxsplit=5)[-1] for line in path.read_text().splitlines())


def _count_shared(names: Iterable[str]) -> int:
    return sum(name.startswith(_SHARED) for name in names)
