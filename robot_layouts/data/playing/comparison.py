"""Where an episode that was played again first differs from the recorded one, to the last bit."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_layouts.data.reading.provenance import STATES
from robot_layouts.data.reading.recording import Trajectory
from tasks.episode import PlayedEpisode, States

COLUMNS = ("rewards", "success", "terminated", "truncated")
DRAWN = "drawn"


@dataclass(frozen=True)
class Difference:
    """Where two episodes first differ.

    Attributes:
        step: Control step; 0 is the state after the reset.
        array: The first array that differs there, as it is called in the h5 file; ``drawn`` if
            something else was varied in its world.
        largest: Largest |Δ| of any array over the whole episode (m, rad and their velocities).
        largest_array: The array that has it.
    """

    step: int
    array: str
    largest: float
    largest_array: str

    def __str__(self) -> str:
        """Name step, bodies or robots, and size."""
        where = "at the start" if self.step == 0 else f"from step {self.step}"
        first, most = (name.rpartition("/")[2] for name in (self.array, self.largest_array))
        also = "" if most == first else f" in {most}"
        return f"{where} in {first}, max |Δ| {self.largest:.1e}{also}"


def first_difference(
    recorded: Trajectory, played: PlayedEpisode, *, everything: bool = False
) -> Difference | None:
    """Return where a replay first differs from the recording; None if every bit is the same.

    Args:
        recorded: The recorded episode.
        played: The same, played again.
        everything: Whether to compare rewards, flags and what was varied, too, not states alone.
    """
    if everything and json.loads(json.dumps(played.drawn)) != recorded.drawn:
        return Difference(0, DRAWN, float("inf"), DRAWN)
    steps: dict[str, int] = {}
    sizes: dict[str, float] = {}
    for name, before, now in _arrays(recorded, played, everything):
        if before is None or now is None or before.shape != now.shape:
            steps[name], sizes[name] = 0, float("inf")
        elif (row := first_row(before, now)) is not None:
            steps[name] = row + (name in COLUMNS)  # which have no row for the reset
            sizes[name] = float(np.abs(before.astype(float) - now).max())
    if not steps:
        return None
    first, most = min(steps, key=steps.__getitem__), max(sizes, key=sizes.__getitem__)
    return Difference(steps[first], first, sizes[most], most)


def first_row(before: NDArray[Any], now: NDArray[Any]) -> int | None:
    """Return the first row in which two arrays of rows of one size differ in any bit.

    A longer one differs after the last row of the other. None if there is no difference.
    """
    common = min(len(before), len(now))
    bits = [
        np.ascontiguousarray(rows[:common]).reshape(common, -1).view(np.uint8)
        for rows in (before, now)
    ]
    if differing := np.flatnonzero((bits[0] != bits[1]).any(axis=1)).tolist():
        return differing[0]
    return None if len(before) == len(now) else common


def _arrays(
    recorded: Trajectory, played: PlayedEpisode, everything: bool
) -> Iterator[tuple[str, NDArray[Any] | None, NDArray[Any] | None]]:
    """Yield each array's name, its numbers as recorded and as played."""
    before, now = (_by_name(states or {}) for states in (recorded.states, played.states))
    for name in dict.fromkeys([*before, *now]):
        yield name, before.get(name), now.get(name)
    for name in COLUMNS if everything else ():
        yield name, getattr(recorded, name), getattr(played, name)


def _by_name(states: States) -> dict[str, NDArray[np.float32]]:
    return {
        f"{STATES}{kind}/{name}": np.asarray(rows, np.float32)  # as recordings are read
        for kind, entries in states.items()
        for name, rows in entries.items()
    }
