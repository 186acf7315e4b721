"""``python -m parity sweep``: every task beside native, with rollouts, agreement and clips."""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import platform
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass, replace
from itertools import count
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import torch
from rich.console import Console
from rich.progress import Progress, TimeElapsedColumn

import tasks
from parity.clip import Candidate, Clip, SideBySide
from parity.comparison import EpisodeResult
from parity.episodes import load_episodes, random_episodes, recorded_control_mode
from parity.findings import versions
from parity.inventory import find_files
from parity.replay import agree
from parity.results import ResultsError
from parity.rollout import Source, expert_source, roll_out
from parity.runs import Run, play
from parity.sides import NativeSide, OurSide
from parity.summary import number_text
from robots import CONTROL_MODES, RecordingError, RobotLayoutsError, TaskError
from rollouts.experts import list_experts

SUMMARY, LOG = "summary.json", "sweep.log"
PANEL = 384  # pixels of each of a clip's three pictures
STAGES = ("agreement", "rollout", "clip")
NO_DEMONSTRATION = "there is no demonstration and no expert: random actions show no success"
NO_VIDEO = "left out by --no-video"

Entry = dict[str, Any]  # what summary.json says about one task
Progressed = Callable[[str, str, float], None]  # task, stage, share of it that is done


@dataclass(frozen=True)
class Plan:
    """What to do with one task.

    Attributes:
        task_id: The task.
        demos: Files of recorded episodes; without any, the expert plays, else chance.
        episodes: How many episodes to compare, at most.
        folder: Where its files go.
        video: Whether to film native and make a clip.
    """

    task_id: str
    demos: tuple[str, ...]
    episodes: int
    folder: Path
    video: bool

    @property
    def options(self) -> dict[str, Any]:
        """What a summary remembers of this plan, to tell whether it was carried out."""
        return {"demos": list(self.demos), "episodes": self.episodes, "video": self.video}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        0 if every task was swept and is equal, 1 if not, 2 for bad usage, 130 if interrupted.
    """
    parser = argparse.ArgumentParser(
        prog="python -m parity sweep",
        description="For each task: compare episodes with native, keep a rollout of both sides,"
        f" make a side-by-side clip, and write everything into DIR/{SUMMARY}. A sweep that was"
        " stopped goes on where it was.",
        epilog="Exit code: 0 if everything is equal, 1 if not or a task failed, 2 for bad usage.",
    )
    add = parser.add_argument
    add("--tasks", nargs="+", metavar="TASK", help="task ids (all)")
    add("--demos", type=Path, metavar="DIR", help="play the demonstrations below DIR")
    add("--experts", action="store_true", help="where there is an expert, play it, not --demos")
    add("--episodes", type=int, default=3, metavar="N", help="episodes of each task (3)")
    add("--out", type=Path, default=Path("runs"), metavar="DIR", help="default %(default)s")
    add("--workers", type=int, default=1, metavar="W", help="tasks at a time (1)")
    add("--again", action="store_true", help="sweep tasks again that are done")
    add("--no-video", action="store_true", help="no film of native and no clip")
    args = parser.parse_args(argv)
    try:
        return _run(args)
    except RobotLayoutsError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("stopped; the same command goes on from here", file=sys.stderr)
        return 130


def _run(args: argparse.Namespace) -> int:
    plans = plan(args)
    path = args.out / SUMMARY
    known = {} if args.again and args.tasks is None else read_summary(path)["tasks"]
    waiting = [p for p in plans if args.again or not is_done(known.get(p.task_id), p)]
    found: dict[str, Entry] = dict(known)
    for done in [p for p in plans if p not in waiting]:
        print(f"{line(found[done.task_id])}  (done before)")
    with _bars(waiting) as (show, hide):
        for entry in sweep(waiting, args.workers, show):
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


def plan(args: argparse.Namespace) -> list[Plan]:
    """Return what the arguments ask for, one plan for each task.

    Raises:
        RobotLayoutsError: If a number or a name makes no sense, or there is no such folder.
    """
    for name in ("episodes", "workers"):
        if getattr(args, name) < 1:
            raise TaskError(f"--{name} is {getattr(args, name)}; it must be 1 or more")
    classes = [tasks.get_task_class(name) for name in args.tasks or tasks.list_clones()]
    demos, unreadable = find_files(args.demos) if args.demos else ({}, [])
    for file in unreadable:
        print(f"{file.path} is left out: {file.problem}", file=sys.stderr)
    task_ids = dict.fromkeys(cls.task_id for cls in classes)
    for task_id in list_experts() if args.experts else ():
        demos.pop(task_id, None)
    return [
        Plan(
            task_id,
            tuple(map(str, demos.get(task_id, ()))),
            args.episodes,
            args.out / task_id,
            not args.no_video,
        )
        for task_id in task_ids
    ]


def is_done(entry: Mapping[str, Any] | None, plan: Plan) -> bool:
    """Tell whether a summary's entry is of this very plan, and nothing in it failed."""
    return bool(entry) and entry["error"] is None and entry["options"] == plan.options  # type: ignore[index]


def line(entry: Mapping[str, Any]) -> str:
    """Return what was found about a task in one line."""
    parts = [f"{entry['task']:<22}"]
    if agreement := entry["agreement"]:
        parts.append(
            f"{agreement['equal']}/{agreement['episodes']} episodes equal"
            f" ({entry['source']}), success native {agreement['native_success']},"
            f" here {agreement['our_success']}"
        )
    if rollout := entry["rollout"]:
        parts.append(f"rollout max |Δ| {number_text(rollout['max_difference'])}")
    if clip := entry["clip"]:
        parts.append(f"clip: {clip['differing_frames']} of {clip['frames']} frames differ")
    if entry["error"]:
        parts.append(f"FAILED: {entry['error']}")
    return "  ".join(parts)


# -- the summary ---------------------------------------------------------------------------------


def read_summary(path: Path) -> dict[str, Any]:
    """Return a summary, empty if there is none yet.

    Raises:
        ResultsError: If it cannot be read.
    """
    if not path.exists():
        return {"tasks": {}}
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        for task_id, entry in found["tasks"].items():
            missing = [key for key in blank(task_id, {}) if key not in entry]
            if missing:
                raise ResultsError(
                    f"{path}: {task_id} has no {', '.join(missing)}; remove the file"
                )
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        if isinstance(error, ResultsError):
            raise
        raise ResultsError(
            f"{path} is no summary of a sweep ({error!r}); remove it, or give another --out"
        ) from error
    return found


def write_summary(path: Path, entries: Mapping[str, Entry]) -> None:
    """Write a summary; the file is always whole.

    Raises:
        RecordingError: If it cannot be written.
    """
    text = json.dumps(
        {
            "versions": versions(),
            "machine": platform.machine(),
            "tasks": dict(sorted(entries.items())),
        },
        indent=1,
        ensure_ascii=False,
    )
    partial = path.with_name(f"{path.name}.{os.getpid()}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(text + "\n", encoding="utf-8")
        os.replace(partial, path)
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {error}") from error


def blank(task_id: str, options: Mapping[str, Any]) -> Entry:
    """Return the entry of a task about which nothing is known yet."""
    return {
        "task": task_id,
        "options": dict(options),
        "error": None,
        "equal": False,
        "source": None,
        "agreement": None,
        "rollout": None,
        "clip": None,
        "no_clip": None,
        "seconds": 0.0,
    }


# -- one task ------------------------------------------------------------------------------------


def sweep_task(plan: Plan, progressed: Callable[[str, float], None], into: Entry) -> None:
    """Carry out a plan, stage by stage, and note in ``into`` what each found.

    Raises:
        Exception: Whatever a stage raises; what the stages before it found stays noted.
    """
    runs, into["source"] = _episodes(plan)
    total, done = sum(run.steps for run in runs), 0

    def played(run: Run, steps: int) -> None:
        nonlocal done
        done += steps
        progressed("agreement", done / total)

    results = [result for found in play(runs, played) for result in found.episodes]
    into["agreement"] = agreement(results)
    into["equal"] = all(result.equal for result in results)
    source = _shortest_success(runs, results)
    rolled = done = 0

    def rolled_on(side: str) -> None:
        nonlocal rolled
        rolled += 1
        progressed("rollout", min(1.0, rolled / (2 * len(source.episode.actions) + 2)))

    found = roll_out(plan.task_id, source, plan.folder, video=plan.video, on_step=rolled_on)
    into["rollout"] = {
        "source": source.name,
        "seed": source.episode.seed,
        "steps": len(source.episode.actions),
        "native_success": found.native_success,
        "our_success": found.our_success,
        "max_difference": _number(found.max_difference),
        "arrays": len(found.differences),
    }
    into["equal"] = into["equal"] and found.max_difference == 0
    if not plan.video:
        into["no_clip"] = NO_VIDEO
    elif into["source"] == "random":
        into["no_clip"] = NO_DEMONSTRATION
    else:
        into["clip"] = make_clip(plan, source, lambda share: progressed("clip", share))
        into["equal"] = into["equal"] and into["clip"]["differing_frames"] == 0


def _episodes(plan: Plan) -> tuple[list[Run], str]:
    """Return what to play, and where it comes from: demonstrations, the expert, or chance."""
    cls = tasks.get_task_class(plan.task_id)
    blank = Run(cls.task_id, "", (), "fresh", cls.reward_modes[0])
    if plan.demos:
        runs: list[Run] = []
        left = plan.episodes
        for path in map(Path, plan.demos):
            episodes = load_episodes(path, cls.task_id, cls.layout.action_dim)[:left]
            left -= len(episodes)
            mode = recorded_control_mode(path) or CONTROL_MODES[0]
            if episodes:
                run = replace(blank, source=str(path), episodes=tuple(episodes), control_mode=mode)
                runs.append(run)
        return runs, "demonstrations"
    if plan.task_id in list_experts():
        played = [expert_source(cls, seed).episode for seed in range(plan.episodes)]
        return [replace(blank, source="expert", episodes=tuple(played))], "expert"
    drawn = random_episodes(range(plan.episodes), cls.max_episode_steps, cls.layout.action_dim)
    return [replace(blank, source="random", episodes=tuple(drawn))], "random"


def _shortest_success(runs: Sequence[Run], results: Sequence[EpisodeResult]) -> Source:
    """Return the shortest episode that succeeds on both sides, else the shortest of all."""
    sources = [
        Source(run.source, episode, run.control_mode) for run in runs for episode in run.episodes
    ]

    def rank(number: int) -> tuple[bool, int]:
        result = results[number]
        return not (result.native_success and result.our_success), result.steps

    return sources[min(range(len(sources)), key=rank)]


def agreement(results: Sequence[EpisodeResult]) -> dict[str, Any]:
    """Return what a comparison of episodes found, as plain data."""
    return {
        "episodes": len(results),
        "equal": sum(result.equal for result in results),
        "steps": sum(result.steps for result in results),
        "contact_steps": sum(result.contact_steps for result in results),
        "same_success": sum(map(agree, results)),
        "native_success": sum(result.native_success for result in results),
        "our_success": sum(result.our_success for result in results),
        "max_difference": _number(max(max(r.max_difference.values()) for r in results)),
        "differing": [
            {"seed": r.seed, "where": str(r.first_difference)} for r in results if not r.equal
        ],
    }


def make_clip(plan: Plan, source: Source, progressed: Callable[[float], None]) -> dict[str, Any]:
    """Show an episode side by side in the task's folder; return what was measured."""
    name = "the expert" if source.name == "expert" else Path(source.name).name
    task_id, mode = plan.task_id, source.control_mode
    with (
        closing(tasks.make(task_id, control_mode=mode)) as env,
        closing(NativeSide(task_id, control_mode=mode, picture_size=PANEL)) as native,
    ):
        clip, drawn = Clip(native, OurSide(env), Candidate(source.episode, name)), count(1)
        made = clip.write(plan.folder, lambda: progressed(next(drawn) / clip.frames))
    return asdict(made)


def _number(value: float) -> float | str:
    return value if value < float("inf") else "inf"


# -- processes -----------------------------------------------------------------------------------


@dataclass
class _Worker:
    plan: Plan
    process: BaseProcess
    reports: Connection
    entry: Entry | None = None


def sweep(
    plans: Iterable[Plan],
    workers: int = 1,
    progressed: Progressed = lambda task_id, stage, share: None,
) -> Generator[Entry]:
    """Carry out plans, each in a process of its own, and yield an entry as each is done.

    Whatever happens to a process, the others go on, and its entry says what happened.

    Args:
        plans: What to do.
        workers: How many at a time.
        progressed: Called now and then with task, stage and the share of the stage that is done.
    """
    waiting, running = list(plans), list[_Worker]()
    try:
        while waiting or running:
            while waiting and len(running) < workers:
                running.append(_start(waiting.pop(0)))
            wait([worker.reports for worker in running])
            for worker in list(running):
                if _hear(worker, progressed):
                    continue
                running.remove(worker)
                yield _finished(worker)
    finally:
        for worker in running:
            worker.process.kill()
            worker.process.join()


def _start(plan: Plan) -> _Worker:
    try:
        plan.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"cannot write into {plan.folder}: {error}") from error
    context = multiprocessing.get_context("spawn")  # fork and PhysX's threads do not mix
    reports, send = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(plan, send), daemon=True)
    process.start()
    send.close()  # so that the end of the process is the end of the pipe
    return _Worker(plan, process, reports)


def _hear(worker: _Worker, progressed: Progressed) -> bool:
    """Take in what a worker says; return whether it may say more."""
    try:
        while worker.reports.poll():
            said = worker.reports.recv()
            if isinstance(said, dict):
                worker.entry = said
            else:
                progressed(worker.plan.task_id, *said)
    except EOFError:
        return False
    return True


def _finished(worker: _Worker) -> Entry:
    worker.process.join()
    worker.reports.close()
    if worker.entry is not None:
        return worker.entry
    code = worker.process.exitcode or 0
    how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
    log = worker.plan.folder / LOG
    return {
        **blank(worker.plan.task_id, worker.plan.options),
        "error": f"its process ended with {how}; {log} holds what it said",
    }


def _work(plan: Plan, reports: Connection) -> None:
    """Carry out one plan in this process, and say how it goes."""
    torch.set_num_threads(1)  # the tensors are small
    threading.Thread(target=_end_with_parent, daemon=True).start()
    entry, started = blank(plan.task_id, plan.options), time.monotonic()
    with _output_to(plan.folder / LOG):
        try:
            sweep_task(plan, lambda stage, share: reports.send((stage, share)), entry)
        except (KeyboardInterrupt, BrokenPipeError):  # nobody waits for it any more
            sys.exit(1)
        except RobotLayoutsError as error:
            entry["error"] = str(error)
        except Exception as error:  # one task must not end the sweep of the others
            traceback.print_exc()
            entry["error"] = f"{type(error).__name__}: {error}"
    entry["seconds"] = round(time.monotonic() - started, 1)
    reports.send(entry)


def _end_with_parent() -> None:
    """End this process when the sweep that started it is gone, even killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


@contextmanager
def _output_to(path: Path) -> Generator[None]:
    """Send what this process prints, C libraries included, to a file."""
    with path.open("wb") as file:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        for number in (1, 2):
            os.dup2(file.fileno(), number)
        yield
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
