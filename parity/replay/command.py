"""``python -m parity replay``: recorded actions on both sides, episode by episode."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import torch
from rich import box
from rich.console import Console
from rich.table import Table

import tasks
from parity.compare.episodes import recorded_episodes
from parity.compare.lockstep import EpisodeResult
from parity.compare.runs import Run, RunResult, play
from robots import TaskError
from rollouts.playing.executor import ProcessExecutor
from rollouts.playing.replay import find_official, task_for
from rollouts.progress import LiveLine
from rollouts.reading.recording import Recording, TrajectoryError
from rollouts.recording.record import FILE, record
from tasks import MultiRobotTask


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = (
        "Both sides begin with a reset by the recorded seed that rebuilds the world, and everything"
        " is compared exactly. Exit code: 0 if every episode agrees to the last bit, 1 if not, 2"
        " for bad usage."
    )
    add = parser.add_argument
    add("--task", required=True, help="task id or another of its names, such as pick_cube")
    add("--episodes", type=int, default=25, metavar="N", help="play the first N episodes (25)")
    add(
        "--demo",
        type=Path,
        metavar="FILE",
        help="recording to play (.h5 or .npz); else the task's official one in $MS_ASSET_DIR/demos,"
        " else N episodes by its expert, recorded into --out first",
    )
    add(
        "--out",
        type=Path,
        default=Path("runs"),
        metavar="DIR",
        help="folder for recorded episodes (%(default)s)",
    )


def run(args: argparse.Namespace) -> int:
    """Run the command; returns 0 if everything is equal, 1 if not.

    Raises:
        RobotLayoutsError: If it could not be compared.
    """
    if args.episodes < 1:
        raise TaskError(f"--episodes is {args.episodes}; it must be 1 or more")
    torch.set_num_threads(1)
    cls = tasks.get_task_class(args.task)
    path = args.demo or _find(cls, args.episodes, args.out)
    run = _run(cls, path, args.episodes)
    with LiveLine(run.steps) as line:
        (result,) = play([run], lambda _, count: line.advance(count, cls.task_id))
    console = Console(markup=False, highlight=False)
    console.print(f"{cls.task_id}, {run.control_mode}, {path}", soft_wrap=True)
    console.print(table(result))
    for sentence in sentences(result):
        console.print(sentence, soft_wrap=True)
    return 0 if result.equal else 1


def _find(cls: type[MultiRobotTask], episodes: int, out: Path) -> Path:
    """Return the task's official recording, or one that its expert makes now."""
    try:
        return find_official(cls.task_id)
    except TrajectoryError:
        folder = out / cls.task_id / "recorded"
    print(f"{cls.task_id}: {episodes} episodes are recorded into {folder}", file=sys.stderr)
    record(cls.task_id, range(episodes), folder, ProcessExecutor(1))
    return folder / FILE


def _run(cls: type[MultiRobotTask], path: Path, count: int) -> Run:
    episodes, mode = recorded_episodes(path, cls)
    if path.suffix == ".h5":
        with Recording(path) as file:
            # Native has the layout of the task alone; a file of another one is refused.
            task_for(file, layout=cls.layout).close()
    return Run(
        cls.task_id,
        path.name,
        tuple(episodes[:count]),
        "fresh",
        cls.reward_modes[0],
        control_mode=mode,
    )


def table(result: RunResult) -> Table:
    """Return one row per episode: success on both sides, and where they part."""
    rows = Table(box=box.SIMPLE_HEAD)
    for name in ("episode", "seed", "steps", "contact steps"):
        rows.add_column(name, justify="right")
    for name in ("native", "ours", "agree", "first difference"):
        rows.add_column(name)
    for number, episode in enumerate(result.episodes):
        rows.add_row(
            *map(str, (number, episode.seed, episode.steps, episode.contact_steps)),
            _word(episode.native_success),
            _word(episode.our_success),
            "yes" if agree(episode) else "NO",
            str(episode.first_difference or "none"),
        )
    return rows


def agree(episode: EpisodeResult) -> bool:
    """Return whether both sides succeeded, or neither."""
    return episode.native_success == episode.our_success


def sentences(result: RunResult) -> list[str]:
    """Return the totals."""
    episodes, count = result.episodes, len(result.episodes)
    agreeing, equal = sum(map(agree, episodes)), sum(episode.equal for episode in episodes)
    native, ours, both = result.successes
    return [
        f"Agreement {agreeing} of {count} episodes ({agreeing / count:.0%}); success in native"
        f" {native}, here {ours}, both {both}.",
        f"Equal to the last bit: {equal} of {count} episodes, {result.run.steps} steps.",
    ]


def _word(success: bool) -> str:
    return "success" if success else "failure"
