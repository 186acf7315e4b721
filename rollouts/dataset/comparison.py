"""Whether an episode that was played again is the recorded one, to the last bit."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experts.touching import ArmWatch
from rollouts.reading.provenance import STATES
from rollouts.reading.recording import Trajectory, TrajectoryError
from tasks import MultiRobotTask
from tasks.episode import PlayedEpisode, play

COLUMNS = ("rewards", "success", "terminated", "truncated")
DRAWN = "drawn"


@dataclass(frozen=True)
class Difference:
    """Where a replay parts from the recording first.

    Attributes:
        step: Control step; 0 is the state after the reset.
        array: The array that differs there, as it is called in the h5 file; ``drawn`` if something
            else was varied in its world.
    """

    step: int
    array: str

    def __str__(self) -> str:
        """Say it in words."""
        return (
            f"at the start in {self.array}" if not self.step else f"step {self.step}, {self.array}"
        )


@dataclass(frozen=True)
class Replay:
    """What came of an episode that was played again.

    Attributes:
        steps: Its control steps.
        success: Whether it ended in success.
        difference: Where it parts from the recording, or None.
        touching: Control steps in which links of different arms touched, by pair; each step of
            physics is looked at.
        touching_steps: Control steps in which any did.
    """

    steps: int
    success: bool
    difference: Difference | None
    touching: dict[str, int]
    touching_steps: int


def play_again(task: MultiRobotTask, trajectory: Trajectory, arms: ArmWatch) -> Replay:
    """Play the actions of an episode, compare all that was recorded, and count touching arms.

    Args:
        task: A task with one environment.
        trajectory: The episode.
        arms: Watches its arms.

    Raises:
        TrajectoryError: If it cannot be played exactly.
    """
    if trajectory.seed is None or not trajectory.rebuilt or trajectory.states is None:
        raise TrajectoryError(
            f"episode {trajectory.episode_id} cannot be played exactly: it needs the seed of its"
            " reset, which must have built the world anew, and states to compare with"
        )
    moments: list[set[str]] = []

    def watch() -> None:
        moments.append({", ".join(sorted(map(str, pair))) for pair in arms.touching()})

    played = play(task, trajectory.seed, trajectory.actions, watch)
    steps = moments[1:]  # the first is that after the reset
    touching = Counter(pair for pairs in steps for pair in pairs)
    differs = difference(trajectory, played)
    return Replay(
        len(played.actions), played.solved, differs, dict(touching), sum(map(bool, steps))
    )


def difference(recorded: Trajectory, played: PlayedEpisode) -> Difference | None:
    """Return where a replay parts from the recording first; None if every bit is the same."""
    if json.loads(json.dumps(played.drawn)) != recorded.drawn:
        return Difference(0, DRAWN)
    found = [
        Difference(first, name)
        for name, before, now, shift in _pairs(recorded, played)
        if (first := _first(before, now, shift)) is not None
    ]
    return min(found, key=lambda difference: difference.step, default=None)


def _first(before: NDArray[Any] | None, now: NDArray[Any] | None, shift: int) -> int | None:
    if before is None or now is None or before.shape != now.shape:
        return 0
    rows = [np.ascontiguousarray(array).reshape(len(array), -1) for array in (before, now)]
    if not len(rows[0]) or rows[0].tobytes() == rows[1].tobytes():
        return None
    bits = [array.view(np.uint8).reshape(len(array), -1) for array in rows]
    return int(np.flatnonzero((bits[0] != bits[1]).any(axis=1))[0]) + shift


def _pairs(
    recorded: Trajectory, played: PlayedEpisode
) -> Iterator[tuple[str, NDArray[Any] | None, NDArray[Any] | None, int]]:
    """Yield each array's name, its numbers before and now, and the step of its first row."""
    states = recorded.states or {}
    for kind in dict.fromkeys([*states, *played.states]):
        before, now = states.get(kind, {}), played.states.get(kind, {})
        for name in dict.fromkeys([*before, *now]):
            rows = now.get(name)
            same = None if rows is None else np.asarray(rows, np.float32)  # as they are read
            yield f"{STATES}{kind}/{name}", before.get(name), same, 0
    for name in COLUMNS:
        yield name, getattr(recorded, name), getattr(played, name), 1
