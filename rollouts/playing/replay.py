"""Plays recorded actions again, and says whether the same happens."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from robots import TaskError
from rollouts.reading.recorded_task import task_class, task_for
from rollouts.reading.recording import FILE, Recording, Trajectory, TrajectoryError
from tasks import MultiRobotTask, get_task_class
from tasks.episode import States, play

Start = Literal["seed", "state"]
STARTS: tuple[Start, ...] = ("seed", "state")

__all__ = [
    "FILE",
    "STARTS",
    "Replayed",
    "Start",
    "StateDifference",
    "find_official",
    "first_difference",
    "open_recording",
    "replay",
    "task_for",
]


@dataclass(frozen=True)
class StateDifference:
    """Where the states of a replay part from the recorded ones.

    Attributes:
        step: Control step; 0 is the state after the reset.
        entry: The first body or robot that differs there, by its key in the state dict.
        largest: Largest |Δ| over the whole episode (m, rad and their velocities).
        largest_entry: The body or robot that has it, by its key in the state dict.
    """

    step: int
    entry: str
    largest: float
    largest_entry: str

    def __str__(self) -> str:
        """Say it in words."""
        where = "at the start" if self.step == 0 else f"from step {self.step}"
        also = "" if self.largest_entry == self.entry else f" in {self.largest_entry}"
        return f"{where} in {self.entry}, max |Δ| {self.largest:.1e}{also}"


@dataclass(frozen=True)
class Replayed:
    """What came of an episode that was played again.

    Attributes:
        episode_id: Its number in the file.
        seed: Seed of its reset, if it has one.
        steps: Its control steps.
        recorded: Whether the recorded episode ended in success, or None if the file is silent.
        success: Whether it ended in success here.
        compared: Whether the file holds states to compare with.
        difference: Where the states part, or None.
        exact: Whether the states must be equal to the last bit.
        varied_alike: Whether what varies in its world was drawn here as it was recorded.
    """

    episode_id: int
    seed: int | None
    steps: int
    recorded: bool | None
    success: bool
    compared: bool
    difference: StateDifference | None
    exact: bool
    varied_alike: bool = True

    @property
    def agrees(self) -> bool:
        """Whether success and world are as recorded, and states are where they must be."""
        if self.recorded not in (None, self.success) or not self.varied_alike:
            return False
        return not (self.exact and self.difference)


def open_recording(path: Path | None, task_id: str | None) -> Recording:
    """Open a recording: a file, all files in a folder, or else the official one of a task.

    Raises:
        TrajectoryError: If there is none, or it cannot be read or is of another task.
        UnknownNameError: If there is no such task.
    """
    if path is None:
        if task_id is None:
            raise TaskError("neither a file nor a task is given to replay")
        path = find_official(get_task_class(task_id).task_id)
    file = Recording(path)
    try:
        task_class(file, task_id)
    except BaseException:
        file.close()
        raise
    return file


def official_folder() -> Path:
    """Return where ManiSkill keeps demonstrations: ``$MS_ASSET_DIR/demos``."""
    return Path(os.environ.get("MS_ASSET_DIR", "~/.maniskill")).expanduser() / "demos"


def find_official(task_id: str) -> Path:
    """Return the official demonstrations of a task that can be played here.

    Those recorded on the CPU come first: a seed means the same there as here.

    Raises:
        TrajectoryError: If there are none; says why each that is there cannot be played.
    """
    folder = official_folder() / task_id
    playable: list[tuple[bool, Path]] = []
    reasons: list[str] = []
    for path in sorted(folder.rglob("*.h5")):
        try:
            with Recording(path) as file:
                other = file.env_kwargs.get("sim_backend", "physx_cpu") != "physx_cpu"
                playable.append((other, path))
        except TrajectoryError as error:
            reasons.append(f"\n  {error}")
    if not playable:
        raise TrajectoryError(
            f"there is no recording of {task_id} in {folder} that can be played; give a file, or"
            f" record one with `robot-layouts record`{''.join(reasons)}"
        )
    return min(playable)[1]


def replay(task: MultiRobotTask, trajectory: Trajectory, start: Start = "seed") -> Replayed:
    """Play the actions of a recorded episode.

    Args:
        task: A task with one environment; see `task_for`.
        trajectory: The episode.
        start: ``"seed"`` resets with its seed, ``"state"`` then puts everything into the first
            recorded state. The latter is not exact, as PhysX's memory is not part of a state.

    Raises:
        TrajectoryError: If the file does not say the seed, or has no states to start from.
    """
    first = None
    if start == "state":
        if trajectory.states is None:
            raise _refusal(trajectory, "holds no states; start from its seed")
        first = _first(trajectory.states)
    elif trajectory.seed is None:
        raise _refusal(trajectory, "has no reset seed; start from its state")
    episode = play(task, trajectory.seed or 0, trajectory.actions, start=first)
    compared = trajectory.states is not None
    return Replayed(
        episode_id=trajectory.episode_id,
        seed=trajectory.seed,
        steps=len(trajectory.actions),
        recorded=trajectory.solved,
        success=episode.solved,
        compared=compared,
        difference=first_difference(trajectory.states or {}, episode.states) if compared else None,
        exact=start == "seed" and trajectory.rebuilt,
        varied_alike=trajectory.drawn in (None, episode.drawn),
    )


def first_difference(recorded: States, played: States) -> StateDifference | None:
    """Return where two episodes' states part, to the last bit; None if they do not.

    An entry that only one of them has differs from the start.
    """
    steps: dict[str, int] = {}
    sizes: dict[str, float] = {}
    for name, before, now in _pairs(recorded, played):
        if before is None or now is None or before.shape != now.shape:
            steps[name], sizes[name] = 0, float("inf")
        elif differing := np.flatnonzero((before != now).any(axis=1)).tolist():
            steps[name] = differing[0]
            sizes[name] = float(np.abs(before.astype(float) - now).max())
    if not steps:
        return None
    first, most = min(steps, key=steps.__getitem__), max(sizes, key=sizes.__getitem__)
    return StateDifference(steps[first], first, sizes[most], most)


def _pairs(
    recorded: States, played: States
) -> list[tuple[str, np.ndarray | None, np.ndarray | None]]:
    return [
        (name, recorded.get(kind, {}).get(name), played.get(kind, {}).get(name))
        for kind in dict.fromkeys([*recorded, *played])
        for name in dict.fromkeys([*recorded.get(kind, {}), *played.get(kind, {})])
    ]


def _first(states: States) -> States:
    return {
        kind: {name: rows[:1] for name, rows in entries.items()} for kind, entries in states.items()
    }


def _refusal(trajectory: Trajectory, why: str) -> TrajectoryError:
    return TrajectoryError(f"traj_{trajectory.episode_id} {why}")
