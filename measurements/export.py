"""``python -m measurements.export``: what exporting pictures costs beside drawing them.

Episodes of random actions are recorded. They are then drawn and nothing else, which is measured
call by call, and exported by one process in every form. Both are given per episode and camera, as
time that passes and as processor time, which includes that of ffmpeg. Numbers are medians over
episodes; the first is left out, in which meshes are loaded.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import tasks
from robots.common.commands import exit_code, start
from robots.common.writing import write_whole
from rollouts.export.columns import ColumnReader
from rollouts.export.dataset import Export, export
from rollouts.export.options import FORMATS
from rollouts.export.shots import choose_shots
from rollouts.progress import LiveLine
from rollouts.reading.recorded_task import task_for
from rollouts.reading.recording import Recording
from rollouts.recording.recorder import Recorder
from simulation.rendering.pictures import Observers
from tasks.episode import moments, open_loop, play

FORMS: Mapping[str, Mapping[str, Any]] = {
    "lerobot, videos": {"format": FORMATS[0]},
    "lerobot, images": {"format": FORMATS[0], "images": True},
    "robomimic": {"format": FORMATS[1]},
}
ALLOWED = 1.15  # of the time that drawing alone takes


@dataclass(frozen=True)
class Cost:
    """What an episode takes, of one camera (s).

    Attributes:
        passed: Time that passes.
        processor: Time of processors.
    """

    passed: float
    processor: float


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        0 if every form costs at most 1.15 × the processor time of drawing alone, else 1.
    """
    parser = argparse.ArgumentParser(prog="python -m measurements.export", description=__doc__)
    add = parser.add_argument
    add("--task", default="TwoRobotPickCube-v1", help="task id (%(default)s)")
    add("--robot", default="panda_wristcam", help="at every place (%(default)s)")
    add("--cameras", nargs="+", default=["all"], metavar="NAME", help="by place (all)")
    add("--episodes", type=int, default=4, metavar="N", help="besides the first (%(default)s)")
    add("--steps", type=int, default=50, metavar="T", help="of an episode (%(default)s)")
    add("--out", type=Path, metavar="FILE", help="write the numbers as json, too")
    options = parser.parse_args(arguments)
    return exit_code(lambda: _run(options))


def _run(options: argparse.Namespace) -> int:
    with TemporaryDirectory() as folder, LiveLine(len(FORMS) + 1, "measurements") as line:
        recording = _record(Path(folder) / "recording.h5", options)
        line.update(0, "drawing alone")
        cameras, alone = drawing_alone(recording, options.cameras)
        found: dict[str, Cost] = {}
        for number, (name, form) in enumerate(FORMS.items(), 1):
            line.update(number, name)
            out = Path(folder) / str(number)
            wanted = Export(
                recording, out=out, cameras=options.cameras, include_failures=True, **form
            )
            found[name] = exporting(wanted, options.episodes + 1, cameras)
    Console().print(_table(alone, found, options.steps))
    if options.out:
        costs = {"drawing alone": alone, **found}
        text = json.dumps({name: vars(cost) for name, cost in costs.items()}, indent=1)
        write_whole(options.out, text + "\n")
    return int(any(cost.processor > ALLOWED * alone.processor for cost in found.values()))


def drawing_alone(recording: Path, names: Sequence[str]) -> tuple[int, Cost]:
    """Return the number of cameras, and what drawing every step of an episode takes.

    Args:
        recording: The recording.
        names: The cameras, by place.
    """
    costs: list[Cost] = []
    with Recording(recording) as file:
        task = task_for(file, pictures=True)
        reader, shots = ColumnReader(task), choose_shots(task, names)
        for trajectory in file:
            columns = reader.read(trajectory)
            happening = moments(
                task, columns.seed or 0, open_loop(columns.actions), len(columns) - 1
            )
            next(happening)
            observers = Observers(task.simulation, shots.cameras, shots.textures)
            passed, processor = 0.0, 0.0
            for _ in range(len(columns)):
                cost = _cost(lambda observers=observers: observers.look(0))
                passed, processor = passed + cost.passed, processor + cost.processor
                next(happening, None)
            costs.append(Cost(passed, processor))
        task.close()
    return len(shots.cameras), _median(costs[1:], len(shots.cameras))


def exporting(wanted: Export, episodes: int, cameras: int) -> Cost:
    """Return what exporting an episode takes, all in all.

    Args:
        wanted: The export.
        episodes: Of the recording.
        cameras: How many are drawn.
    """
    marks: list[Cost] = []

    def note(done: float, total: int) -> None:
        if done == len(marks) + 1:
            marks.append(Cost(time.perf_counter(), time.process_time()))

    before = _of_children()
    export(wanted, note)
    children = (_of_children() - before) / episodes
    costs = [
        Cost(end.passed - begin.passed, end.processor - begin.processor + children)
        for begin, end in zip(marks, marks[1:], strict=False)
    ]
    return _median(costs, cameras)  # the first episode has no mark before it


def _record(path: Path, options: argparse.Namespace) -> Path:
    places, robot = tasks.get_task_class(options.task).layout.places, str(options.robot)
    robots = {place: robot for place in places}
    task, rng = tasks.make(options.task, robots=robots, obs_mode="none"), np.random.default_rng(0)
    with Recorder(path, task) as recorder:
        for seed in range(options.episodes + 1):
            shape = options.steps, task.layout.action_dim
            recorder.add(play(task, seed, rng.uniform(-0.5, 0.5, shape).astype(np.float32)))
    task.close()
    return path


def _cost(work: Callable[[], object]) -> Cost:
    passed, processor = time.perf_counter(), time.process_time()
    work()
    return Cost(time.perf_counter() - passed, time.process_time() - processor)


def _of_children() -> float:
    """Return the processor time of processes that were started here and have ended (s)."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _median(costs: Sequence[Cost], cameras: int) -> Cost:
    return Cost(
        median(cost.passed for cost in costs) / cameras,
        median(cost.processor for cost in costs) / cameras,
    )


def _table(alone: Cost, found: Mapping[str, Cost], steps: int) -> Table:
    rows = Table(title=f"Per episode of {steps} steps and camera")
    for column in ("", "passed (s)", "processor (s)", "× passed", "× processor"):
        rows.add_column(column, justify="right" if column else "left")
    for name, cost in {"drawing alone": alone, **found}.items():
        rows.add_row(
            name,
            f"{cost.passed:.3f}",
            f"{cost.processor:.3f}",
            f"{cost.passed / alone.passed:.3f}",
            f"{cost.processor / alone.processor:.3f}",
        )
    return rows


if __name__ == "__main__":
    start(main)
