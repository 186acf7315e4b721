"""Records episodes that an expert plays, in worker processes, and goes on where it stopped."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

import tasks
from robots import CONTROL_MODES, RecordingError
from rollouts.conversion import as_positions
from rollouts.episode import play
from rollouts.executor import Event, Executor
from rollouts.experts import find_expert
from rollouts.experts.registry import Expert
from rollouts.parts import PartWriter
from rollouts.recorder import Recorder
from tasks import MultiRobotTask, Scenario

FILE = "trajectory.h5"
DELTAS = CONTROL_MODES[0]


@dataclass(frozen=True)
class Played:
    """What is told of a recorded episode.

    Attributes:
        success: Whether it ended in success.
        steps: Its control steps.
    """

    success: bool
    steps: int


@dataclass(frozen=True)
class EpisodeJob:
    """Everything but the seed that decides an episode, and where it goes; can be pickled.

    Attributes:
        task: Class of the task.
        scenario: How to make it.
        expert: Who plays.
        writer: Where finished episodes go.
        parent: Process that gathers them; a worker that outlives it writes nothing.
    """

    task: type[MultiRobotTask]
    scenario: Scenario
    expert: Expert
    writer: PartWriter
    parent: int

    def __call__(self) -> Callable[[int], Played]:
        """Make the task in a worker, and return what plays and records the episode of a seed."""
        torch.set_num_threads(1)  # the tensors are small, and other workers want the cores
        env = planned = self.task(self.scenario)
        if self.scenario.control_mode != DELTAS:
            planned = self.task(replace(self.scenario, control_mode=DELTAS))

        def record(seed: int) -> Played:
            episode = play(env, seed, self._plan(planned, seed))
            if os.getppid() != self.parent:
                raise RecordingError("the process that gathers the episodes is gone")
            self.writer.write(episode)
            return Played(episode.solved, len(episode.actions))

        return record

    def _plan(self, planned: MultiRobotTask, seed: int) -> NDArray[np.float32]:
        """Let the expert plan in deltas, which all experts speak, and convert if need be."""
        actions = self.expert(planned, seed)
        if self.scenario.control_mode == DELTAS:
            return actions
        return as_positions(planned, seed, actions)


@dataclass
class Summary:
    """What came of a recording.

    Attributes:
        recorded: Episodes in the file in the end.
        already: How many of those asked for were there before.
        played: Episodes played this time, by seed.
        failed: Why an episode could not be played, by seed.
        deaths: Workers that died, in words.
    """

    recorded: int = 0
    already: int = 0
    played: dict[int, Played] = field(default_factory=dict[int, Played])
    failed: dict[int, Exception] = field(default_factory=dict[int, Exception])
    deaths: list[str] = field(default_factory=list[str])


def record(
    task_id: str,
    seeds: Sequence[int],
    folder: Path,
    executor: Executor,
    *,
    control_mode: str = DELTAS,
    on_event: Callable[[Summary, Event | None], None] = lambda summary, event: None,
) -> Summary:
    """Record the episodes of some seeds; those that are in the folder already are kept.

    Args:
        task_id: The task.
        seeds: Which episodes.
        folder: Where ``trajectory.h5`` and ``trajectory.json`` are written.
        executor: Who plays.
        control_mode: Control mode of the recorded actions.
        on_event: Called once at the start without an event, and after every event.

    Raises:
        UnknownNameError: If there is no such task.
        TaskError: If the task has no expert.
        RecordingError: If the folder cannot be written or holds a recording of something else;
            the finished episodes are kept.
        WorkerError: If workers cannot be started or die again and again; they are kept, too.
        KeyboardInterrupt: If interrupted; they are kept, too.
    """
    cls, expert = tasks.get_task_class(task_id), find_expert(task_id)
    scenario = cls.scenario
    scenario.control_mode = control_mode
    description = f"{getattr(expert, '__module__', '')}:{getattr(expert, '__qualname__', expert)}"
    env = cls(scenario)
    summary = Summary()
    with Recorder(folder / FILE, env, resume=True, source_desc=description) as recorder:
        env.close()
        there = recorder.seeds
        missing = [seed for seed in seeds if seed not in there]
        summary.already, summary.recorded = len(seeds) - len(missing), len(there)
        on_event(summary, None)
        job = EpisodeJob(cls, scenario, expert, recorder.writer, os.getpid())
        try:
            with closing(executor.run(job, missing)) as events:
                for event in events:
                    _note(summary, event)
                    on_event(summary, event)
        finally:  # workers may have written more than they came to tell
            summary.recorded = len(recorder)
    return summary


def where_died(event: Event) -> str:
    """Return how a worker died and what it was doing, in words."""
    return f"{event.died} " + (
        "before it could play anything" if event.seed is None else f"at seed {event.seed}"
    )


def _note(summary: Summary, event: Event) -> None:
    if isinstance(event.error, RecordingError):
        raise event.error
    if event.died is not None or event.seed is None:
        summary.deaths.append(where_died(event))
    elif event.error is not None:
        summary.failed[event.seed] = event.error
    else:
        summary.played[event.seed] = event.result
        summary.recorded += 1
