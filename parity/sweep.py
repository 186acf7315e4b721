"""``python -m parity sweep``: every task beside native, with rollouts, agreement and clips."""

from __future__ import annotations

import json
import multiprocessing
import platform
import time
import traceback
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import torch
from tqdm import tqdm

import tasks
from parity.episodes import (
    Source,
    expert_source,
    find_demonstrations,
    random_episodes,
    recorded_source,
)
from parity.lockstep import EpisodeResult, Run, play
from parity.render import is_verified, make_clip
from parity.results import ResultsError, as_json, number_text, versions
from parity.rollout import roll_out
from robot_layouts.core.writing import write_whole
from robot_layouts.experts import list_experts
from robots import TaskError

SUMMARY, LOG = "summary.json", "sweep.log"
NO_DEMONSTRATION = "there is no demonstration and no expert: random actions show no success"

Entry = dict[str, Any]
"""What ``summary.json`` says about one task."""


@dataclass(frozen=True)
class Plan:
    """What to do with one task.

    Attributes:
        demos: Files of recorded episodes; without any, the expert plays, else chance.
        episodes: How many episodes to compare, at most.
        video: Whether to film native and make a clip.
    """

    demos: tuple[str, ...]
    episodes: int
    video: bool


def sweep(
    *,
    tasks: tuple[str, ...] = (),
    demos: Path | None = None,
    experts: bool = False,
    episodes: int = 3,
    out: Path = Path("runs"),
    workers: int = 1,
    again: bool = False,
    no_video: bool = False,
) -> int:
    """Compare episodes of every task with native, keep a rollout of both sides, and make a clip.

    What was found stands in OUT/summary.json. A sweep that was stopped goes on where it was. Exit
    code: 0 if everything is equal, 1 if not or a task failed.

    Args:
        tasks: Task ids (all clones).
        demos: Play the demonstrations below this folder.
        experts: Where there is an expert, play it, not --demos.
        episodes: Episodes of each task.
        out: The files of a task go into OUT/TASK.
        workers: Tasks at a time.
        again: Sweep tasks again that are done.
        no_video: No film of native and no clip.

    Raises:
        RobotLayoutsError: If the arguments are invalid.
    """
    for name, value in (("episodes", episodes), ("workers", workers)):
        if value < 1:
            raise TaskError(f"--{name} is {value}; it must be 1 or more")
    known = read_summary(out / SUMMARY)["tasks"]
    plans = _plans(tasks, demos if demos else None, experts, Plan((), episodes, not no_video))
    waiting = {
        task_id: plan
        for task_id, plan in plans.items()
        if again or not _is_done(known.get(task_id), plan)
    }
    context = multiprocessing.get_context("spawn")
    # A process for each task, so that one that dies or leaks takes nothing with it.
    with context.Pool(min(workers, max(1, len(waiting))), maxtasksperchild=1) as pool:
        work = [(task_id, plan, out / task_id) for task_id, plan in waiting.items()]
        swept = pool.imap_unordered(_sweep_one, work)
        for entry in tqdm(swept, total=len(work), unit="tasks", disable=None):
            known[entry["task"]] = entry
            write_summary(out / SUMMARY, known)
            tqdm.write(line(entry))
    entries = [known[task_id] for task_id in plans]
    good = sum(entry["error"] is None and entry["equal"] for entry in entries)
    verified = sum(is_verified(entry["clip"]) for entry in entries)
    print(
        f"{good} of {len(entries)} tasks swept and equal to native, {verified} with a clip in which"
        f" both succeed and no pixel differs. Written to {out / SUMMARY}"
    )
    return 0 if good == len(entries) else 1


def _plans(
    names: Sequence[str], demos: Path | None, experts: bool, common: Plan
) -> dict[str, Plan]:
    files = find_demonstrations(demos) if demos else {}
    for task_id in list_experts() if experts else ():
        files.pop(task_id, None)
    classes = [tasks.get_task_class(name) for name in names or tasks.list_clones()]
    return {
        cls.task_id: replace(common, demos=tuple(map(str, files.get(cls.task_id, ()))))
        for cls in classes
    }


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
            if missing := blank(task_id).keys() - entry.keys():
                raise KeyError(f"{task_id} has no {', '.join(sorted(missing))}")
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise ResultsError(
            f"{path} is no summary of a sweep ({error!r}); remove it, or give another --out"
        ) from error
    return found


def write_summary(path: Path, entries: dict[str, Entry]) -> None:
    """Write a summary; the file is always whole.

    Raises:
        UnwritableFileError: If it cannot be written.
    """
    by_name = dict(sorted(entries.items()))
    about = {"versions": versions(), "machine": platform.machine(), "tasks": by_name}
    write_whole(path, json.dumps(about, indent=1, ensure_ascii=False) + "\n")


def blank(task_id: str) -> Entry:
    """Return the entry of a task about which nothing is known yet."""
    return {
        "task": task_id,
        "options": {},
        "error": None,
        "equal": False,
        "source": None,
        "agreement": None,
        "rollout": None,
        "clip": None,
        "no_clip": None,
        "seconds": 0.0,
    }


def _is_done(entry: Entry | None, plan: Plan) -> bool:
    """Tell whether an entry is of this very plan, and nothing in it failed."""
    if entry is None or entry["error"] is not None:
        return False
    return entry["options"] == {**asdict(plan), "demos": list(plan.demos)}


def line(entry: Entry) -> str:
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


def _sweep_one(work: tuple[str, Plan, Path]) -> Entry:
    """Carry out a plan in a process of its own; whatever fails is in the entry."""
    task_id, plan, folder = work
    torch.set_num_threads(1)  # the tensors are small
    folder.mkdir(parents=True, exist_ok=True)
    started = time.monotonic()
    entry = blank(task_id) | {"options": {**asdict(plan), "demos": list(plan.demos)}}
    with (folder / LOG).open("w") as log, redirect_stdout(log), redirect_stderr(log):
        try:
            sweep_task(task_id, plan, folder, entry)
        except Exception as error:  # one task must not end the sweep of the others
            traceback.print_exc()
            entry["error"] = f"{type(error).__name__}: {error}"
            entry["equal"] = False
    return entry | {"seconds": round(time.monotonic() - started, 1)}


def sweep_task(task_id: str, plan: Plan, folder: Path, entry: Entry) -> None:
    """Carry out a plan: agreement, rollout, clip; note in the entry what each found.

    Raises:
        Exception: Whatever a stage raises; what the stages before it found stays noted.
    """
    entry["source"], sources = _sources(task_id, plan)
    mode = tasks.get_task_class(task_id).reward_modes[0]
    runs = [
        Run(task_id, source.name, source.episodes, "fresh", mode, control_mode=source.control_mode)
        for source in sources
    ]
    results = [one for found in play(runs, lambda *_: None) for one in found.episodes]
    entry["agreement"] = agreement(results)
    entry["equal"] = all(result.equal for result in results)
    source = _shortest_success(sources, results)
    largest = max(roll_out(task_id, source, folder, video=plan.video).values())
    entry["rollout"] = {
        "source": source.name,
        "seed": source.episodes[0].seed,
        "steps": len(source.episodes[0].actions),
        "max_difference": as_json(largest),
    }
    entry["equal"] = entry["equal"] and largest == 0
    if not plan.video:
        entry["no_clip"] = "left out by --no-video"
    elif entry["source"] == "random":
        entry["no_clip"] = NO_DEMONSTRATION
    else:
        entry["clip"] = make_clip(task_id, source, folder)
        entry["equal"] = entry["equal"] and entry["clip"]["differing_frames"] == 0


def _sources(task_id: str, plan: Plan) -> tuple[str, list[Source]]:
    """Return where episodes come from, and what to play: demonstrations, the expert, or chance."""
    cls = tasks.get_task_class(task_id)
    if plan.demos:
        found, left = list[Source](), plan.episodes
        for path in map(Path, plan.demos):
            source = recorded_source(path, cls)
            found.append(replace(source, episodes=source.episodes[:left]))
            left -= len(found[-1].episodes)
        return "demonstrations", [source for source in found if source.episodes]
    if task_id in list_experts():
        return "expert", [expert_source(cls, range(plan.episodes))]
    drawn = random_episodes(range(plan.episodes), cls.max_episode_steps, cls.layout.action_dim)
    return "random", [Source("random", tuple(drawn))]


def _shortest_success(sources: Sequence[Source], results: Sequence[EpisodeResult]) -> Source:
    """Return the shortest episode that succeeds on both sides, else the shortest of all."""
    single = [replace(source, episodes=(one,)) for source in sources for one in source.episodes]

    def rank(number: int) -> tuple[bool, int]:
        result = results[number]
        return not (result.native_success and result.our_success), result.steps

    return single[min(range(len(single)), key=rank)]


def agreement(results: Sequence[EpisodeResult]) -> dict[str, Any]:
    """Return what a comparison of episodes found, as plain data."""
    return {
        "episodes": len(results),
        "equal": sum(result.equal for result in results),
        "steps": sum(result.steps for result in results),
        "contact_steps": sum(result.contact_steps for result in results),
        "same_success": sum(result.agrees for result in results),
        "native_success": sum(result.native_success for result in results),
        "our_success": sum(result.our_success for result in results),
        "max_difference": as_json(max(max(r.max_difference.values()) for r in results)),
        "differing": [
            {"seed": r.seed, "where": str(r.first_difference)} for r in results if not r.equal
        ],
    }
