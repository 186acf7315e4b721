"""``python -m parity sweep``: every task beside native, with rollouts, agreement and clips."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import Progress, TimeElapsedColumn

from parity.show.clip import SideBySide
from parity.sweep.entries import SUMMARY, Entry, is_done, line, read_summary, write_summary
from parity.sweep.plan import Plan, plan
from parity.sweep.processes import STAGE_SECONDS, Progressed, sweep
from parity.sweep.stages import STAGES
from rollouts.playing.executor import Executor


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.epilog = (
        "For each task: compares episodes with native, keeps a rollout of both sides, makes a"
        f" side-by-side clip, and writes everything into DIR/{SUMMARY}. A sweep that was stopped"
        " goes on where it was. Exit code: 0 if everything is equal, 1 if not or a task failed, 2"
        " for bad usage."
    )
    add = parser.add_argument
    add("--tasks", nargs="+", metavar="TASK", help="task ids (all)")
    add("--demos", type=Path, metavar="DIR", help="play the demonstrations below DIR")
    add("--experts", action="store_true", help="where there is an expert, play it, not --demos")
    add("--episodes", type=int, default=3, metavar="N", help="episodes of each task (3)")
    add("--out", type=Path, default=Path("runs"), metavar="DIR", help="folder (%(default)s)")
    add("--workers", type=int, default=1, metavar="W", help="tasks at a time (1)")
    add("--ray", metavar="ADDRESS", help="sweep on a Ray cluster whose machines share all DIRs")
    add("--again", action="store_true", help="sweep tasks again that are done")
    add("--no-video", action="store_true", help="no film of native and no clip")


def run(args: argparse.Namespace) -> int:
    """Run the command.

    Returns:
        0 if every task was swept and is equal, 1 if not, 130 if interrupted.

    Raises:
        RobotLayoutsError: If the arguments make no sense.
    """
    try:
        return _run(args)
    except KeyboardInterrupt:
        print("stopped; the same command goes on from here", file=sys.stderr)
        return 130


def _run(args: argparse.Namespace) -> int:
    if args.ray is not None:  # whose workers are in folders of their own
        args.out, args.demos = args.out.absolute(), args.demos and args.demos.absolute()
    plans = plan(args)
    path = args.out / SUMMARY
    known = {} if args.again and args.tasks is None else read_summary(path)["tasks"]
    waiting = [p for p in plans if args.again or not is_done(known.get(p.task_id), p)]
    found: dict[str, Entry] = dict(known)
    for done in [p for p in plans if p not in waiting]:
        print(f"{line(found[done.task_id])}  (done before)")
    with _bars(waiting) as (show, hide):
        for entry in sweep(waiting, args.workers, show, executor=_cluster(args)):
            found[entry["task"]] = entry
            write_summary(path, found)
            hide(entry["task"])
            print(line(entry), flush=True)
    entries = [found[p.task_id] for p in plans]
    good = sum(entry["error"] is None and entry["equal"] for entry in entries)
    verified = sum(bool(e["clip"]) and SideBySide(**e["clip"]).verified for e in entries)
    print(
        f"{good} of {len(entries)} tasks swept and equal to native, {verified} with a clip in which"
        f" both succeed and no pixel differs. Written to {path}"
    )
    return 0 if good == len(entries) else 1


def _cluster(args: argparse.Namespace) -> Executor | None:
    if args.ray is None:
        return None
    from rollouts.playing.ray_executor import RayExecutor

    return RayExecutor(
        args.ray, args.workers, attempts=1, fresh=True, episode_timeout=STAGE_SECONDS
    )


@contextmanager
def _bars(plans: Sequence[Plan]) -> Generator[tuple[Progressed, Callable[[str], None]]]:
    """Show how far the sweep is, and every task that runs, where someone watches.

    Yields:
        What to call with task, stage and its share that is done, and what to call with a task
        that is over.
    """
    watched = sys.stderr.isatty()
    with Progress(
        *Progress.get_default_columns(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        disable=not watched,
        redirect_stdout=sys.stdout.isatty(),  # else the lines would go to stderr
    ) as progress:
        everything = progress.add_task("sweep", total=len(plans))
        bars = {
            p.task_id: progress.add_task(p.task_id, total=len(STAGES), visible=False) for p in plans
        }

        def show(task_id: str, stage: str, share: float) -> None:
            completed = STAGES.index(stage) + share
            text = f"{task_id} {stage}"
            progress.update(bars[task_id], completed=completed, description=text, visible=True)

        def hide(task_id: str) -> None:
            progress.remove_task(bars[task_id])
            progress.advance(everything)

        yield show, hide
