"""``python -m parity render``: native and ours side by side, drawn in native's own scene."""

from __future__ import annotations

import argparse
import gc
from collections.abc import Sequence
from contextlib import closing
from functools import partial
from pathlib import Path

import torch
from rich.console import Console

import tasks
from experts import find_expert
from parity.compare.both_sides import NativeSide, OurSide
from parity.compare.episodes import load_episodes, recorded_control_mode
from parity.show.clip import Candidate, Clip, ClipOptions, SideBySide, choose
from robots import CONTROL_MODES, MissingPackageError, RecordingError, TaskError
from rollouts.progress import LiveLine
from rollouts.video import package_problem
from tasks import MultiRobotTask
from tasks.episode import Episode

SIZES = (192, 1024)  # smallest and largest panel (pixels)
EXPERT_EPISODES = 5  # to choose from


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = (
        "Shows native | ours | their amplified difference, all drawn in native's own scene, so that"
        " only the physics state differs. Writes DIR/TASK/side_by_side.mp4, .png (a contact sheet)"
        " and .json. Exit code: 0 if both sides succeed and nothing differs, 1 if not, 2 if there"
        " is nothing to show."
    )
    add = parser.add_argument
    add("--task", required=True, metavar="TASK", help="task id")
    add("--demo", type=Path, metavar="FILE", help="recorded episodes, .h5 or .npz (the expert's)")
    add(
        "--out", type=Path, default=Path("runs"), metavar="DIR", help="folder of the results (runs)"
    )
    add(
        "--rank-by",
        choices=("order", "agreement"),
        default="order",
        help="which episode to show: the first, or the one in which both sides succeed and differ"
        " least, the shortest of these (order)",
    )
    add(
        "--episodes",
        type=int,
        metavar="N",
        help="episodes to choose from (every one of FILE; 5 of the expert's)",
    )
    add("--seed", type=int, metavar="S", help="the episode of this seed, or the expert's first (0)")
    add(
        "--truncate-buffer",
        type=int,
        default=10,
        metavar="N",
        help="end the clip N frames after the success; -1 shows every step (10)",
    )
    add("--diff-gain", type=float, default=8.0, metavar="X", help="amplify the difference (8)")
    add("--size", type=int, default=384, metavar="PIXELS", help="width of a panel (384)")


def run(args: argparse.Namespace) -> int:
    """Run the command; returns 0 if both sides succeed and nothing differs, 1 if not.

    Raises:
        RobotLayoutsError: If it could not be shown.
    """
    _check(args)
    torch.set_num_threads(1)  # the tensors are small
    task_id = tasks.get_task_class(args.task).task_id
    mode = (recorded_control_mode(args.demo) if args.demo else None) or CONTROL_MODES[0]
    with closing(tasks.make(task_id, control_mode=mode)) as env:
        recorded = _recorded(args, env) if args.demo else None
        with closing(NativeSide(task_id, control_mode=mode, picture_size=args.size)) as native:
            folder = _made_folder(args.out / task_id)
            candidates = recorded or _planned(args, env)
            gc.freeze()  # native collects garbage at each rebuild, in 0.2 s unless frozen
            try:
                made = _show(args, native, OurSide(env), candidates, folder)
            finally:
                gc.unfreeze()
    _report(made, folder)
    return 0 if made.verified else 1


def _recorded(args: argparse.Namespace, env: MultiRobotTask) -> list[Candidate]:
    recorded = load_episodes(args.demo, env.task_id, env.layout.action_dim)
    name = f"{args.demo.absolute().parent.name}/{args.demo.name.split('.')[0]}"
    found = [
        Candidate(episode, f"{name} episode {number}")
        for number, episode in enumerate(recorded)
        if args.seed in (None, episode.seed)
    ]
    if not found:
        seeds = ", ".join(str(episode.seed) for episode in recorded)
        raise TaskError(f"{args.demo} has no episode of seed {args.seed}; its seeds: {seeds}")
    return found[: args.episodes] if _chooses(args) else found[:1]


def _planned(args: argparse.Namespace, env: MultiRobotTask) -> list[Candidate]:
    expert, first = find_expert(env.task_id), args.seed or 0
    count = (args.episodes or EXPERT_EPISODES) if _chooses(args) else 1
    planned: list[Candidate] = []
    with Console(stderr=True).status("") as status:
        for seed in range(first, first + count):
            status.update(f"planning {env.task_id}, seed {seed}")
            planned.append(Candidate(Episode(seed, expert(env, seed)), "the expert"))
    return planned


def _chooses(args: argparse.Namespace) -> bool:
    return args.rank_by == "agreement"


def _show(
    args: argparse.Namespace,
    native: NativeSide,
    ours: OurSide,
    candidates: Sequence[Candidate],
    folder: Path,
) -> SideBySide:
    task, options = ours.env.task_id, _options(args)
    chosen = candidates[0]
    if len(candidates) > 1:
        with LiveLine(sum(len(c.episode.actions) for c in candidates)) as line:
            step = partial(line.advance, 1, f"playing {task}")
            chosen = choose(native, ours, candidates, options.buffer, step)
    clip = Clip(native, ours, chosen, options)
    with LiveLine(clip.frames, "frames") as line:
        return clip.write(folder, partial(line.advance, 1, f"drawing {task}"))


def _options(args: argparse.Namespace) -> ClipOptions:
    return ClipOptions(None if args.truncate_buffer < 0 else args.truncate_buffer, args.diff_gain)


def _report(made: SideBySide, folder: Path) -> None:
    console = Console()
    for line in (
        f"{made.task}, seed {made.seed}, {made.source}",
        *made.sentences(),
        f"native drawn from its state and seen live: {made.live_difference:.4f} of 255 apart",
        f"clip   {folder / made.clip}",
        f"sheet  {folder / made.sheet}",
    ):
        console.print(line, markup=False, highlight=False, soft_wrap=True)


def _check(args: argparse.Namespace) -> None:
    if (problem := package_problem()) is not None:
        raise MissingPackageError(f"no clip can be made here: {problem}")
    if args.episodes is not None and args.episodes < 1:
        raise TaskError(f"--episodes is {args.episodes}; it must be 1 or more")
    if args.episodes is not None and args.rank_by != "agreement":
        raise TaskError("--episodes says among how many to choose: give --rank-by agreement too")
    if not 0 < args.diff_gain <= 255:
        raise TaskError(f"--diff-gain is {args.diff_gain:g}; it must be above 0, at most 255")
    if args.seed is not None and args.seed < 0:
        raise TaskError(f"--seed is {args.seed}; it must be 0 or more")
    if args.truncate_buffer < -1:
        raise TaskError(f"--truncate-buffer is {args.truncate_buffer}; it must be -1 or more")
    smallest, largest = SIZES
    if not smallest <= args.size <= largest or args.size % 16:
        raise TaskError(
            f"--size is {args.size}; it must be a multiple of 16 from {smallest} to {largest}"
        )


def _made_folder(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"cannot write to {folder}: {error.strerror}") from error
    return folder
