"""What a sweep does with one task, stage by stage: agreement, rollout, clip."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import asdict, replace
from itertools import count
from pathlib import Path
from typing import Any

import tasks
from experts import list_experts
from parity.compare.both_sides import NativeSide, OurSide
from parity.compare.episodes import random_episodes, recorded_episodes
from parity.compare.lockstep import EpisodeResult
from parity.compare.runs import Run, play
from parity.replay.command import agree
from parity.replay.rollout import Source, expert_source, roll_out
from parity.show.clip import Candidate, Clip
from parity.sweep.entries import Entry
from parity.sweep.plan import Plan

PANEL = 384  # pixels of each of a clip's three pictures
STAGES = ("agreement", "rollout", "clip")
NO_DEMONSTRATION = "there is no demonstration and no expert: random actions show no success"
NO_VIDEO = "left out by --no-video"


def sweep_task(plan: Plan, progressed: Callable[[str, float], None], into: Entry) -> None:
    """Carry out a plan, stage by stage, and note in ``into`` what each found.

    Raises:
        Exception: Whatever a stage raises; what the stages before it found stays noted.
    """
    runs, into["source"] = _episodes(plan)
    results = _compare(runs, lambda share: progressed("agreement", share))
    into["agreement"] = agreement(results)
    into["equal"] = all(result.equal for result in results)
    source = _shortest_success(runs, results)
    into["rollout"] = make_rollout(plan, source, lambda share: progressed("rollout", share))
    into["equal"] = into["equal"] and into["rollout"]["max_difference"] == 0
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
            recorded, mode = recorded_episodes(path, cls)
            episodes = recorded[:left]
            left -= len(episodes)
            if episodes:
                run = replace(blank, source=str(path), episodes=tuple(episodes), control_mode=mode)
                runs.append(run)
        return runs, "demonstrations"
    if plan.task_id in list_experts():
        played = [expert_source(cls, seed).episode for seed in range(plan.episodes)]
        return [replace(blank, source="expert", episodes=tuple(played))], "expert"
    drawn = random_episodes(range(plan.episodes), cls.max_episode_steps, cls.layout.action_dim)
    return [replace(blank, source="random", episodes=tuple(drawn))], "random"


def _compare(runs: Sequence[Run], progressed: Callable[[float], None]) -> list[EpisodeResult]:
    total, done = sum(run.steps for run in runs), 0

    def played(run: Run, steps: int) -> None:
        nonlocal done
        done += steps
        progressed(done / total)

    return [result for found in play(runs, played) for result in found.episodes]


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


def make_rollout(plan: Plan, source: Source, progressed: Callable[[float], None]) -> dict[str, Any]:
    """Keep an episode's arrays of both sides in the task's folder; return what was found."""
    length, done = len(source.episode.actions), count(1)
    total = 2 * length + 2

    def rolled_on(side: str) -> None:
        progressed(min(1.0, next(done) / total))

    found = roll_out(plan.task_id, source, plan.folder, video=plan.video, on_step=rolled_on)
    return {
        "source": source.name,
        "seed": source.episode.seed,
        "steps": length,
        "native_success": found.native_success,
        "our_success": found.our_success,
        "max_difference": _number(found.max_difference),
        "arrays": len(found.differences),
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
