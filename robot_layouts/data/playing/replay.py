"""Plays recorded actions again, and says whether the same happens, to the last bit."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from typing_extensions import Self

from robot_layouts.data.playing.executor import modules_of
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.provenance import STATES
from robot_layouts.data.reading.recorded_task import task_class, task_for
from robot_layouts.data.reading.recording import Recording, Trajectory
from robots import TaskError
from tasks import MultiRobotTask, TaskEnv, get_task_class
from tasks.episode import PlayedEpisode, States, play

COLUMNS = ("rewards", "success", "terminated", "truncated")
DRAWN = "drawn"
Start = Literal["seed", "state"]


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
    differs = bytes_of(before[:common]) != bytes_of(now[:common])
    if differing := np.flatnonzero(differs.any(axis=1)).tolist():
        return differing[0]
    return None if len(before) == len(now) else common


def bytes_of(rows: NDArray[Any]) -> NDArray[np.uint8]:
    """Return the bytes of each row of an array."""
    return np.ascontiguousarray(rows).reshape(len(rows), -1).view(np.uint8)


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


@dataclass(frozen=True)
class Replayed:
    """The result of an episode that was played again.

    Attributes:
        episode_id: Its number in the file.
        seed: Seed of its reset, if it has one.
        steps: Its control steps.
        recorded: Whether the recorded episode ended in success, or None if the file is silent.
        success: Whether it ended in success here.
        compared: Whether the file holds states to compare with.
        difference: Where it differs first, or None.
        exact: Whether the states must be equal to the last bit.
        varied_alike: Whether what varies in its world was drawn here as it was recorded.
    """

    episode_id: int
    seed: int | None
    steps: int
    recorded: bool | None
    success: bool
    compared: bool
    difference: Difference | None
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
    file = Recording(recording_path(path, task_id))
    try:
        task_class(file, task_id)
    except BaseException:
        file.close()
        raise
    return file


def recording_path(path: Path | None, task_id: str | None) -> Path:
    """Return where a recording is; see `open_recording`."""
    if path is not None:
        return path
    if task_id is None:
        raise TaskError("neither a file nor a task is given")
    return find_official(get_task_class(task_id).task_id)


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


def replay(
    task: TaskEnv,
    trajectory: Trajectory,
    start: Start = "seed",
    *,
    everything: bool = False,
    watch: Callable[[], None] = lambda: None,
    keep: Callable[[PlayedEpisode], None] | None = None,
) -> Replayed:
    """Play the actions of a recorded episode again, and compare.

    Args:
        task: A task with one environment; see `task_for`.
        trajectory: The episode.
        start: ``"seed"`` resets with its seed, ``"state"`` then puts everything into the first
            recorded state. The latter is not exact, as PhysX's memory is not part of a state.
        everything: Whether to compare rewards, flags and what was varied, too, not states alone.
        watch: Called after the reset and after every step.
        keep: Given the episode with what the task observed in it, if it agrees with the recording;
            from its seed alone.

    Raises:
        TrajectoryError: If the file does not say the seed, or has no states to start from.
    """
    states = trajectory.states
    if start == "state" and states is None:
        raise _refusal(trajectory, "holds no states; start from its seed")
    if start == "seed" and trajectory.seed is None:
        raise _refusal(trajectory, "has no reset seed; start from its state")
    first = {
        kind: {name: rows[:1] for name, rows in entries.items()}
        for kind, entries in (states or {}).items()
    }
    begin = first if start == "state" else None
    observed = keep is not None
    episode = play(
        task, trajectory.seed or 0, trajectory.actions, watch, start=begin, observed=observed
    )
    compared = states is not None
    found = Replayed(
        episode_id=trajectory.episode_id,
        seed=trajectory.seed,
        steps=len(trajectory.actions),
        recorded=trajectory.solved,
        success=episode.solved,
        compared=compared,
        difference=(
            first_difference(trajectory, episode, everything=everything) if compared else None
        ),
        exact=start == "seed" and trajectory.rebuilt,
        varied_alike=trajectory.drawn in (None, episode.drawn),
    )
    if keep is not None and found.agrees:
        keep(_signed(episode, trajectory))
    return found


def _signed(episode: PlayedEpisode, recorded: Trajectory) -> PlayedEpisode:
    """Return an episode that was played again with what the recording says of who acted."""
    return replace(
        episode,
        source=recorded.source,
        actor=recorded.actor,
        corrections=recorded.corrections,
        reason=recorded.reason,
    )


def _refusal(trajectory: Trajectory, why: str) -> TrajectoryError:
    return TrajectoryError(f"traj_{trajectory.episode_id} {why}")


@dataclass(frozen=True)
class RecordedJob:
    """Episodes of a recording that workers play; can be pickled.

    Attributes:
        path: The recording; workers read it at the same place.
        places: Place of each episode in the recording, by the seed that workers are given.
        cell: Where robots stood and which, where the file cannot say it, and what is observed: the
            arguments of `task_for`.
        task: Class of the task, which other machines may need.
    """

    path: Path
    places: Mapping[int, int]
    cell: Mapping[str, Any]
    task: type[MultiRobotTask]

    @classmethod
    def of(
        cls, file: Recording, places: Mapping[int, int], cell: Mapping[str, Any] | None, **own: Any
    ) -> Self:
        """Return the job of an open recording, with the fields that its class adds."""
        return cls(file.opened.absolute(), places, dict(cell or {}), task_class(file), **own)

    @property
    def modules(self) -> tuple[str, ...]:
        """What other machines may need to play it."""
        return modules_of(self.task)

    def __call__(self) -> RecordedPlay:
        """Open the recording and make its task in a worker.

        Raises:
            RobotLayoutsError: If that is impossible there.
        """
        return RecordedPlay(self)

    def tools(self, task: TaskEnv) -> Any:
        """Return what else a worker needs to play any of them; it is closed if it can be."""
        return None

    def play(self, task: TaskEnv, episode: Trajectory, tools: Any) -> Any:
        """Return the result of an episode."""
        raise NotImplementedError


class RecordedPlay:
    """Plays the episodes of a job in a worker."""

    def __init__(self, job: RecordedJob) -> None:
        """Open the recording, and make its task.

        Raises:
            TrajectoryError: If that is impossible here.
        """
        torch.set_num_threads(1)  # sums are the same everywhere, and other workers want the cores
        self._job, self._file = job, Recording(job.path)
        self._task = task_for(self._file, **job.cell)
        self._tools = job.tools(self._task)

    def __call__(self, seed: int) -> Any:
        """Return the result of the episode of a seed."""
        job = self._job
        return job.play(self._task, self._file[job.places[seed]], self._tools)

    def close(self) -> None:
        """Let the worlds go, and the file."""
        for held in (self._tools, self._task, self._file):
            if hasattr(held, "close"):
                held.close()


def places_by_seed(file: Recording, count: int | None = None) -> dict[int, int] | None:
    """Return the places of the first episodes of a recording by the seeds of their resets.

    None if the file does not name a seed for each, or one twice.
    """
    seeds = file.seeds[:count]
    places = {seed: place for place, seed in enumerate(seeds) if seed is not None}
    return places if len(places) == len(seeds) else None
