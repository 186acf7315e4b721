"""``python -m parity replay``: recorded actions on both sides, episode by episode."""

from __future__ import annotations

import sys
from pathlib import Path

import torch
from rich import box
from rich.console import Console
from rich.table import Table
from tqdm import tqdm

import tasks
from parity.episodes import recorded_source
from parity.lockstep import Run, RunResult, play
from robot_layouts.data.playing.replay import find_official
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import FILE, Recording
from robot_layouts.data.recording.record import record
from robots import TaskError


def replay(
    *, task: str, episodes: int = 25, demo: Path | None = None, out: Path = Path("runs")
) -> int:
    """Play recorded actions in native and here, from resets by the recorded seeds.

    Exit code: 0 if every episode agrees to the last bit, 1 if not.

    Args:
        task: Task id or another of its names, such as pick_cube.
        episodes: Play the first N episodes.
        demo: Recording to play (.h5); else the task's official one in $MS_ASSET_DIR/demos,
            else N episodes by its expert, recorded into --out first.
        out: Folder for recorded episodes.

    Raises:
        RobotLayoutsError: If it could not be compared.
    """
    if episodes < 1:
        raise TaskError(f"--episodes is {episodes}; it must be 1 or more")
    torch.set_num_threads(1)
    cls = tasks.get_task_class(task)
    path = demo
    if path is None:
        try:
            path = find_official(cls.task_id)
        except TrajectoryError:
            folder = out / cls.task_id / "recorded"
            print(f"{episodes} episodes are recorded into {folder}", file=sys.stderr)
            record(cls.task_id, range(episodes), folder, workers=1)
            path = folder / FILE
    source = recorded_source(path, cls)
    if path.suffix == ".h5":
        with Recording(path) as file:
            # Native has the layout of the task alone; a file of another one is refused.
            task_for(file, layout=cls.layout).close()
    played, mode = source.episodes[:episodes], source.control_mode
    run = Run(cls.task_id, path.name, played, "fresh", cls.reward_modes[0], control_mode=mode)
    with tqdm(total=run.steps, desc=cls.task_id, unit="steps", disable=None) as bar:
        (result,) = play([run], lambda _, count: bar.update(count))
    console = Console(markup=False, highlight=False, soft_wrap=True)
    console.print(f"{cls.task_id}, {mode}, {path}")
    console.print(episode_table(result), soft_wrap=False)
    console.print(verdict(result))
    return 0 if result.equal else 1


def episode_table(result: RunResult) -> Table:
    """Return one row per episode: success on both sides, and where they part."""
    rows = Table(box=box.SIMPLE_HEAD)
    for name in ("episode", "seed", "steps", "contact steps"):
        rows.add_column(name, justify="right")
    for name in ("native", "ours", "agree", "first difference"):
        rows.add_column(name)
    for number, episode in enumerate(result.episodes):
        rows.add_row(
            *map(str, (number, episode.seed, episode.steps, episode.contact_steps)),
            "success" if episode.native_success else "failure",
            "success" if episode.our_success else "failure",
            "yes" if episode.agrees else "NO",
            str(episode.first_difference or "none"),
        )
    return rows


def verdict(result: RunResult) -> str:
    """Return the totals, in two lines."""
    episodes, count = result.episodes, len(result.episodes)
    agreeing, equal = sum(e.agrees for e in episodes), sum(e.equal for e in episodes)
    native, ours, both = result.successes
    return (
        f"Agreement {agreeing} of {count} episodes ({agreeing / count:.0%}); success in native"
        f" {native}, here {ours}, both {both}.\n"
        f"Equal to the last bit: {equal} of {count} episodes, {result.run.steps} steps."
    )
