"""``python -m parity bench``: every benchmark, with native ManiSkill in turns with ours."""

from __future__ import annotations

import argparse
import gc
import logging
from collections.abc import Callable, Generator, Sequence
from contextlib import closing, contextmanager
from functools import partial
from typing import Any

from gymnasium.vector import AsyncVectorEnv

import tasks
from measurements.bench import command
from measurements.bench.catalogue import BENCHMARKS
from measurements.bench.command import run_benchmarks, settings_of
from measurements.bench.episodes import timed_resets
from measurements.bench.measurement import BenchmarkError, Measurement, by_series
from measurements.bench.pictures import OBS_MODE, Variant, pictures
from measurements.bench.report import Report, save
from measurements.bench.settings import Benchmark, Settings
from measurements.bench.steps import PHYSICS, Played
from measurements.bench.tables import PICTURE, RECORD
from measurements.bench.vectors import HERE, NATIVE, PROCESSES, vectors
from parity.compare.native_env import make_native, make_native_front, native_action
from robots import TaskError
from robots.common.writing import write_whole
from tasks import MultiRobotTask, get_task_class, list_clones

Variants = dict[tuple[str, str], Callable[[int], float]]


def benchmarks(task_ids: Sequence[str]) -> dict[str, Benchmark]:
    """Return every benchmark; those that native can run are run beside it, on some tasks."""
    beside = {
        "step": Benchmark("a step of one environment", partial(step, task_ids)),
        "reset": Benchmark("a reset of one environment", partial(reset, task_ids)),
        "vector": Benchmark("vectors on two cores", partial(vectors, native=_native_vector)),
        "pictures": Benchmark(
            BENCHMARKS["pictures"].answers,
            partial(pictures, beside=Variant(NATIVE, _native_pictures)),
        ),
    }
    return {**beside, **{name: one for name, one in BENCHMARKS.items() if name not in beside}}


def step(task_ids: Sequence[str], settings: Settings) -> Measurement:
    """Time one environment of tasks."""

    def variants(task_id: str, native: Any, ours: MultiRobotTask) -> Variants:
        played = Played(ours, settings)
        return {
            (HERE, task_id): played.step,
            (NATIVE, task_id): lambda number: _native_steps(native, played, number, settings),
            (PHYSICS, task_id): played.physics,
        }

    return Measurement(
        name="step",
        title="One step with observation, reward and success",
        unit="µs per step",
        variable="task",
        values=tuple(task_ids),
        samples=_beside_native(task_ids, settings, variants),
        floors=(PHYSICS,),
        ratios=((NATIVE, HERE), (HERE, PHYSICS)),
    )


def reset(task_ids: Sequence[str], settings: Settings) -> Measurement:
    """Time resets of one environment of tasks."""

    def variants(task_id: str, native: Any, ours: MultiRobotTask) -> Variants:
        return {
            (HERE, task_id): timed_resets(ours.reset, settings.clock),
            (NATIVE, task_id): timed_resets(lambda seed: native.reset(seed=seed), settings.clock),
        }

    return Measurement(
        name="reset",
        title="A reset of one environment",
        unit="ms per reset",
        variable="task",
        values=tuple(task_ids),
        samples=_beside_native(task_ids, settings, variants),
        ratios=((NATIVE, HERE),),
    )


def _beside_native(
    task_ids: Sequence[str],
    settings: Settings,
    variants: Callable[[str, Any, MultiRobotTask], Variants],
) -> dict[str, list[list[float]]]:
    """Take samples of one task after the other, with native's environment and ours."""
    samples: dict[tuple[str, str], list[float]] = {}
    for task_id in task_ids:
        native = make_native(task_id)
        native.reset(seed=0)
        gc.freeze()  # native collects garbage when it builds a scene; ours is not to count
        both = variants(task_id, native, tasks.make(task_id))
        samples.update(settings.interleave(both, part=1 / len(task_ids)))
        native.close()
        gc.unfreeze()
    return by_series(task_ids, samples)


def _native_steps(native: Any, played: Played, number: int, settings: Settings) -> float:
    """Return the time of one of native's steps, in the motion that ours plays (µs)."""
    actions = [native_action(native, action[0]) for action in played.actions(number)]
    native.reset(seed=number)
    start = settings.clock.now()
    for action in actions:
        native.step(action)
    return (settings.clock.now() - start) / len(actions) * 1e6


@contextmanager
def _native_vector(task_id: str) -> Generator[AsyncVectorEnv | None]:
    """Give Gymnasium's vector over native; None where native has no task, or several robots.

    Its wrapper cannot run these.
    """
    if task_id not in list_clones() or len(get_task_class(task_id).layout) > 1:
        yield None
        return
    with closing(_native_front(task_id, "state")) as env:
        yield env


def _native_pictures(task_id: str) -> AsyncVectorEnv:
    return _native_front(task_id, OBS_MODE)


def _native_front(task_id: str, obs_mode: str) -> AsyncVectorEnv:
    make = [partial(make_native_front, task_id, obs_mode)] * PROCESSES
    return AsyncVectorEnv(make, context="spawn")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    command.add_arguments(parser)
    parser.epilog = f"Benchmarks: {', '.join(benchmarks(()))}. All of them take some minutes."
    parser.add_argument("--record", action="store_true", help=f"keep all of it in {RECORD.name}")


def run(options: argparse.Namespace) -> int:
    """Run the command; returns its exit code.

    Raises:
        RobotLayoutsError: If it makes no sense, or nothing can be recorded.
    """
    logging.disable(logging.WARNING)
    if options.record and (options.only or options.task):
        raise BenchmarkError("a record holds every benchmark; leave out --only and --task")
    settings = settings_of(options)
    if settings.making:
        raise BenchmarkError("native takes no layout and no other robots; leave them out")
    task_ids = settings.tasks if options.task else list_clones()
    _expect_clones(task_ids)
    status, report = run_benchmarks(options, benchmarks(task_ids), settings)
    if options.record and report is not None:
        _keep(report)
    return status


def _expect_clones(task_ids: Sequence[str]) -> None:
    for task_id in task_ids:
        if task_id not in list_clones():
            raise TaskError(f"{task_id} clones no native task, so there is nothing beside it")


def _keep(report: Report) -> None:
    if report.left_out:
        raise BenchmarkError(f"nothing is recorded, as {', '.join(report.left_out)} was left out")
    write_whole(RECORD, report.as_json())
    save(report, PICTURE)
    print(f"{RECORD}: recorded; `robot-layouts parity tables` shows it in docs")
