"""Records episodes that an expert plays, and goes on where it stopped."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import torch

import tasks
from experts import find_expert
from experts.registry import Expert
from layouts import Layout
from layouts.placement import RobotLike
from robots import RecordingError
from rollouts.playing.executor import (
    EPISODE_SECONDS,
    Event,
    Executor,
    WorkersDied,
    choose_executor,
    modules_of,
    play_all,
)
from rollouts.playing.plan_conversion import Planner
from rollouts.playing.seeds import checked_seeds
from rollouts.reading.provenance import describe_layout, differences, listing
from rollouts.recording.episode_files import PartWriter
from rollouts.recording.recorder import FILE_SIZE, Recorder
from tasks import MultiRobotTask, Scenario
from tasks.episode import Score, play
from tasks.registry import make_scenario

FILE = "trajectory.h5"


@dataclass(frozen=True)
class EpisodeJob:
    """Everything but the seed that decides an episode; can be pickled.

    Attributes:
        task: Class of the task.
        scenario: How to make it.
        expert: Who plays.
        writer: What encodes finished episodes.
    """

    task: type[MultiRobotTask]
    scenario: Scenario
    expert: Expert
    writer: PartWriter

    @property
    def modules(self) -> tuple[str, ...]:
        """What other machines may need to play it."""
        return modules_of(self.task, self.expert)

    def __call__(self) -> Callable[[int], tuple[Score, bytes]]:
        """Make the task in a worker, and return what plays and encodes the episode of a seed.

        Raises:
            RecordingError: If the robot files of this machine are not those of the recording.
        """
        torch.set_num_threads(1)  # the tensors are small, and other workers want the cores
        return _Player(self)


class _Player:
    """Plays episodes in one world, which is built anew for each, and encodes them."""

    def __init__(self, job: EpisodeJob) -> None:
        self._env, self._writer = job.task(job.scenario), job.writer
        self._expect_same_robots()
        self._plan = Planner(self._env, job.expert)

    def __call__(self, seed: int) -> tuple[Score, bytes]:
        """Play and encode the episode of a seed."""
        episode = play(self._env, seed, self._plan(seed))
        reason = "" if episode.solved else self._plan.reason
        return replace(episode.score, reason=reason), self._writer.encode(episode)

    def close(self) -> None:
        """Let the worlds go."""
        self._env.close()
        self._plan.close()

    def _expect_same_robots(self) -> None:
        found = differences(self._writer.header["layout"], describe_layout(self._env.layout))
        if found:
            raise RecordingError(
                f"a worker would record something else than this recording is of ({listing(found)})"
            )


@dataclass
class Summary:
    """What came of a recording.

    Attributes:
        recorded: Episodes in the file in the end.
        already: How many of those asked for were there before.
        damaged: Episodes that were there before and are damaged, in words.
        played: Episodes played this time, by seed.
        failed: Why an episode could not be played, by seed.
        deaths: Workers that died, in words.
        workers: Who played, in words.
    """

    recorded: int = 0
    already: int = 0
    damaged: list[str] = field(default_factory=list[str])
    played: dict[int, Score] = field(default_factory=dict[int, Score])
    failed: dict[int, Exception] = field(default_factory=dict[int, Exception])
    deaths: list[str] = field(default_factory=list[str])
    workers: set[str] = field(default_factory=set[str])


def record(
    task_id: str,
    seeds: Sequence[int],
    folder: Path,
    executor: Executor | None = None,
    *,
    workers: int | None = None,
    episode_timeout: float | None = EPISODE_SECONDS,
    control_mode: str | Mapping[str, str] | None = None,
    layout: Layout | None = None,
    robots: RobotLike | Mapping[str, RobotLike] | None = None,
    bystanders: str | None = None,
    file_size: float = FILE_SIZE,
    on_event: Callable[[Summary, Event | None], None] = lambda summary, event: None,
) -> Summary:
    """Record the episodes of some seeds; those that are in the folder already are kept.

    Args:
        task_id: The task.
        seeds: Which episodes.
        folder: Where ``trajectory.h5`` and ``trajectory.json`` are written.
        executor: Who plays, such as `rollouts.playing.ray_executor.RayExecutor`; None: processes
            of this machine.
        workers: How many processes; None: one for each core that this process may use; 0: none,
            but this one.
        episode_timeout: Seconds that an episode may take in a worker until that is ended and the
            episode played again, three times in all; None if it may take for ever.
        control_mode: Control mode of the recorded actions, or those by arm; see `tasks.Scenario`.
        layout: Where robots stand, if not where the task's own do; see `tasks.make`.
        robots: Other robots for some places; see `tasks.make`.
        bystanders: What robots do that have no place in the task; see `tasks.Scenario`.
        file_size: Size at which a further h5 file is begun (MB); see `Recorder`.
        on_event: Called once at the start without an event, and after every event.

    Raises:
        UnknownNameError: If there is no such task.
        TaskError: If the task has no expert, a number makes no sense, or a seed is there twice.
        RecordingError: If the folder cannot be written or holds a recording of something else;
            the finished episodes are kept.
        WorkerError: If workers cannot be started, die again and again, or end before all is
            played; they are kept, too.
        KeyboardInterrupt: If interrupted; they are kept, too.
    """
    executor = choose_executor(workers, executor, episode_timeout)
    cls, expert = tasks.get_task_class(task_id), find_expert(task_id)
    seeds = checked_seeds(seeds)
    cell: dict[str, Any] = {"layout": layout, "robots": robots, "bystanders": bystanders}
    scenario = make_scenario(cls, control_mode=control_mode, **cell)
    description = f"{getattr(expert, '__module__', '')}:{getattr(expert, '__qualname__', expert)}"
    env = cls(scenario)
    summary = Summary()
    keeping: dict[str, Any] = {"source_desc": description, "file_size": file_size}
    with Recorder(folder / FILE, env, resume=True, **keeping) as recorder:
        env.close()
        summary.damaged, there = recorder.damaged, recorder.seeds
        missing = [seed for seed in seeds if seed not in there]
        summary.already, summary.recorded = len(seeds) - len(missing), len(there)
        on_event(summary, None)
        recorder.expect(missing)
        job = EpisodeJob(cls, scenario, expert, recorder.writer)
        try:
            with closing(play_all(executor, job, missing)) as events:
                for event in events:
                    _note(summary, event, recorder)
                    on_event(summary, event)
        finally:  # an interrupt may come between writing and counting
            summary.recorded = len(recorder)
    return summary


def where_died(event: Event) -> str:
    """Return how a worker died and what it was doing, in words."""
    return f"{event.died} " + (
        "before it could play anything" if event.seed is None else f"at seed {event.seed}"
    )


def _note(summary: Summary, event: Event, recorder: Recorder) -> None:
    if isinstance(event.error, WorkersDied):
        raise event.error
    if event.died is not None:
        summary.deaths.append(where_died(event))
    elif event.error is not None and event.seed is not None:
        summary.failed[event.seed] = event.error
        recorder.give_up(event.seed)
    elif event.result is not None and event.seed is not None:
        played, part = event.result
        recorder.store(event.seed, part)
        summary.played[event.seed] = played
        summary.recorded += 1
        summary.workers.add(event.worker)
