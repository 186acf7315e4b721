"""What happens around steps: resets, recordings, and the check of a layout."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from numpy import float32
from numpy.typing import NDArray
from torch import from_numpy

import tasks
from measurements.bench.measurement import Measurement, by_series
from measurements.bench.settings import Clock, Settings
from measurements.bench.steps import random_actions, width
from measurements.bench.worlds import crowd
from rollouts.recording.recorder import Recorder
from tasks import MultiRobotTask
from tasks.episode import REBUILT, play

RESETS = 5  # of a sample
STEPPED, RECORDED = "stepped", "recorded"
EPISODE_STEPS = 60

Sample = Callable[[int], float]


def reset(settings: Settings) -> Measurement:
    """Time resets of one environment, as they are and with the world built anew."""
    variants: dict[tuple[str, str], Sample] = {}
    for task_id in settings.tasks:
        env = tasks.make(task_id, **settings.making)
        variants["reset", task_id] = timed_resets(env.reset, settings.clock)
        again = timed_resets(lambda seed, env=env: env.reset(seed, options=REBUILT), settings.clock)
        variants["world built anew", task_id] = again
    return Measurement(
        name="reset",
        title="A reset of one environment, by task",
        unit="ms per reset",
        variable="task",
        values=settings.tasks,
        samples=by_series(settings.tasks, settings.interleave(variants)),
    )


def timed_resets(reset_to: Callable[[int], object], clock: Clock) -> Sample:
    """Return what times some resets to seeds, and tells the time of one (ms)."""

    def sample(number: int) -> float:
        start = clock.now()
        for seed in range(number * RESETS, (number + 1) * RESETS):
            reset_to(seed)
        return (clock.now() - start) / RESETS * 1e3

    return sample


def recording(settings: Settings) -> Measurement:
    """Time episodes of random actions that are recorded, and ones that are only stepped."""
    variants: dict[tuple[str, str], Sample] = {}
    for task_id in settings.tasks:
        env = tasks.make(task_id, **settings.making)
        variants[STEPPED, task_id] = _timed_episodes(env, settings, _step)
        variants[RECORDED, task_id] = _timed_episodes(env, settings, _record)
    return Measurement(
        name="recording",
        title=f"An episode of a reset and {EPISODE_STEPS} steps, recorded or not",
        unit="ms per episode",
        variable="task",
        values=settings.tasks,
        samples=by_series(
            settings.tasks, settings.interleave(variants, rounds=min(settings.rounds, 5))
        ),
        ratios=((RECORDED, STEPPED),),
    )


def validation(settings: Settings) -> Measurement:
    """Time the check of a layout whose robots were loaded before."""
    layouts = {count: crowd(count, settings.kinds) for count in settings.checked}

    def seconds(count: int) -> Sample:
        def sample(number: int) -> float:
            start = settings.clock.now()
            layouts[count].validate()
            return (settings.clock.now() - start) * 1e3

        return sample

    variants = {("layout.validate()", count): seconds(count) for count in layouts}
    return Measurement(
        name="validation",
        title=f"layout.validate() of a ring of {' + '.join(settings.kinds)}",
        unit="ms per check",
        variable="robots",
        values=settings.checked,
        samples=by_series(settings.checked, settings.interleave(variants)),
    )


Play = Callable[[MultiRobotTask, list[NDArray[float32]]], None]


def _timed_episodes(env: MultiRobotTask, settings: Settings, play_all: Play) -> Sample:
    """Return what plays some episodes and tells the time of one (ms)."""

    def sample(number: int) -> float:
        drawn = random_actions(number, settings.episodes * EPISODE_STEPS, 1, width(env))
        episodes = list(drawn.reshape(settings.episodes, EPISODE_STEPS, -1))
        start = settings.clock.now()
        play_all(env, episodes)
        return (settings.clock.now() - start) / settings.episodes * 1e3

    return sample


def _step(env: MultiRobotTask, episodes: list[NDArray[float32]]) -> None:
    for seed, actions in enumerate(episodes):
        env.reset(seed, options=REBUILT)
        for action in actions:
            env.step(from_numpy(action))


def _record(env: MultiRobotTask, episodes: list[NDArray[float32]]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        with Recorder(Path(folder) / "trajectory.h5", env) as recorder:
            for seed, actions in enumerate(episodes):
                recorder.add(play(env, seed, actions))
