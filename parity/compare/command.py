"""``python -m parity compare``: play tasks beside native ManiSkill and compare every bit."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import NamedTuple

import torch
from rich.console import Console

import tasks
from parity.compare.episodes import (
    Episode,
    find_demonstrations,
    over_range_episodes,
    random_episodes,
    recorded_episodes,
)
from parity.compare.lockstep import HISTORIES, History
from parity.compare.printed import document, sentences, table
from parity.compare.results import RESULTS, record
from parity.compare.runs import Run, play
from parity.compare.task_summary import summarise, summary_table
from robots import CONTROL_MODES, RecordingError, TaskError, closest_match
from robots.common.writing import write_whole
from rollouts.progress import LiveLine
from tasks import MultiRobotTask

TABLE_WIDTH = 180  # columns that a table may take; a narrower terminal wraps it


class _Source(NamedTuple):
    name: str
    control_mode: str
    episodes: list[Episode]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = (
        "Both sides get the same seeds and actions; observations, states, rewards and info are"
        " compared exactly. Exit code: 0 if every difference is exactly zero, 1 if not, 2 for bad"
        " usage."
    )
    add = parser.add_argument
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("--task", action="append", metavar="TASK", help="task id; may be repeated")
    which.add_argument(
        "--all",
        action="store_true",
        help="every task: random and over-range actions and --demos, fresh and reused, and reused"
        " in each further reward mode",
    )
    add("--seeds", type=int, default=10, metavar="N", help="reset seeds 0 … N-1 (10)")
    add("--steps", type=int, default=100, metavar="N", help="steps of a random episode (100)")
    add("--actions", type=Path, metavar="FILE", help="play this .h5 or .npz file instead")
    add("--demos", type=Path, metavar="DIR", help="play the demonstrations below DIR as well")
    add(
        "--history",
        nargs="+",
        choices=HISTORIES,
        help="fresh rebuilds both scenes before every episode, reused only resets them (fresh)",
    )
    add("--reward-mode", nargs="+", metavar="MODE", help="reward modes, or 'all' (the default one)")
    add(
        "--control-mode",
        choices=CONTROL_MODES,
        help=f"a file says itself in which it was recorded ({CONTROL_MODES[0]})",
    )
    add("--num-envs", type=int, default=1, metavar="N", help="environments that play at once (1)")
    add("--json", type=Path, metavar="FILE", help="write the results to FILE")
    add("--record", action="store_true", help="keep the results of --all in parity/results.json")


def run(args: argparse.Namespace) -> int:
    """Run the command; returns 0 if everything is equal, 1 if not.

    Raises:
        RobotLayoutsError: If it could not be compared.
    """
    _check(args)
    torch.set_num_threads(1)  # the tensors are small
    runs = plan(args)
    with LiveLine(sum(run.steps for run in runs)) as line:
        results = play(
            runs, lambda run, count: line.advance(count, f"{run.task} {run.source} {run.history}")
        )
    console = Console()
    console.width = max(console.width, TABLE_WIDTH)
    found = document(results)
    summaries = summarise(found["runs"])
    console.print(summary_table(summaries) if args.all else table(results))
    for sentence in sentences(results):
        console.print(sentence, markup=False, highlight=False, soft_wrap=True)
    if args.json:
        text = json.dumps(found | {"tasks": summaries}, indent=1) + "\n"
        write_whole(args.json, text, RecordingError)
    if args.record:
        write_whole(RESULTS, record(found, summaries), RecordingError)
    return 0 if all(result.equal for result in results) else 1


def plan(args: argparse.Namespace) -> list[Run]:
    """Return the runs that the arguments ask for, with every file read and every name checked."""
    classes = [tasks.get_task_class(name) for name in args.task or tasks.list_clones()]
    demonstrations = find_demonstrations(args.demos) if args.demos else {}
    runs: list[Run] = []
    for cls in classes:
        for source in _sources(cls, args, demonstrations.get(cls.task_id, [])):
            for history, mode in _ways(cls, args):
                runs.append(
                    Run(
                        cls.task_id,
                        source.name,
                        tuple(source.episodes),
                        history,
                        mode,
                        args.num_envs,
                        source.control_mode,
                    )
                )
    return runs


def _ways(cls: type[MultiRobotTask], args: argparse.Namespace) -> list[tuple[History, str]]:
    """Return each history and reward mode to play in.

    Physics knows nothing of the reward mode, so ``--all`` plays both histories in the default one,
    and does not rebuild the scenes in the others.
    """
    if args.all and not (args.history or args.reward_mode):
        default, *others = cls.reward_modes
        return [*((history, default) for history in HISTORIES), *(("reused", m) for m in others)]
    return list(product(args.history or ["fresh"], _reward_modes(cls, args.reward_mode)))


def _sources(
    cls: type[MultiRobotTask], args: argparse.Namespace, demonstrations: Sequence[Path]
) -> list[_Source]:
    if args.actions:
        return [_recorded(cls, args.actions, args.actions.name, args.control_mode)]
    mode = args.control_mode or CONTROL_MODES[0]
    layout = cls.layout.in_control_mode(mode)
    sizes = range(args.seeds), args.steps, layout.action_dim, layout.action_bounds
    drawn = [_Source("random", mode, random_episodes(*sizes))]
    if args.all:
        drawn.append(_Source("over-range", mode, over_range_episodes(*sizes)))
    recorded = [
        _recorded(cls, path, f"{path.parent.name}/{path.name.split('.')[0]}", None)
        for path in demonstrations
    ]
    return [*drawn, *recorded]


def _recorded(cls: type[MultiRobotTask], path: Path, name: str, asked: str | None) -> _Source:
    episodes, mode = recorded_episodes(path, cls, asked)
    if asked not in (None, mode):
        raise TaskError(f"{path} was recorded in {mode}; leave --control-mode {asked} out")
    return _Source(name, mode, episodes)


def _reward_modes(cls: type[MultiRobotTask], asked: Sequence[str] | None) -> tuple[str, ...]:
    if asked is None:
        return cls.reward_modes[:1]
    if "all" in asked:
        return cls.reward_modes
    for mode in asked:
        if mode not in cls.reward_modes:
            match = closest_match(mode, cls.reward_modes)
            raise TaskError(
                f"{cls.task_id} has no reward mode {mode!r}."
                + (f" Did you mean {match!r}?" if match else "")
                + f" Choices: {', '.join(cls.reward_modes)}, all."
            )
    return tuple(dict.fromkeys(asked))


def _check(args: argparse.Namespace) -> None:
    for name in ("seeds", "steps", "num_envs"):
        if getattr(args, name) < 1:
            option = name.replace("_", "-")
            raise TaskError(f"--{option} is {getattr(args, name)}; it must be 1 or more")
    if args.actions and (args.all or len(args.task) > 1 or args.demos):
        raise TaskError("--actions holds the episodes of one task: give one --task, no --demos")
    if args.record and (not args.all or args.history or args.reward_mode or args.control_mode):
        raise TaskError(
            "--record keeps all of --all: give --all, no --history, --reward-mode, --control-mode"
        )
    if args.json and not args.json.absolute().parent.is_dir():
        raise TaskError(f"--json {args.json}: there is no folder {args.json.absolute().parent}")
