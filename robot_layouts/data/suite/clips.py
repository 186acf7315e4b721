"""Films the episodes of a suite's runs that went worst, those of one seed side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from statistics import mean

import torch

from robot_layouts.data.actors import EXPERT
from robot_layouts.data.dataset.contents import film_one
from robot_layouts.data.playing.evaluation_job import trace_of
from robot_layouts.data.playing.together import Casting, cast_of, record_together
from robot_layouts.data.receipts.provenance import make_again
from robot_layouts.data.receipts.receipt import EpisodeReceipt, Receipt
from robot_layouts.data.suite.run import SuiteRun
from robot_layouts.data.suite.suite import Case
from robots import RobotLayoutsError
from tasks import get_task_class
from tasks.registry import make_scenario


@dataclass(frozen=True)
class RunClip:
    """How one run's policy played an episode.

    Attributes:
        words: Whose it is and how it ended.
        film: An mp4 file's bytes, and those of a jpeg of the last picture; None if there is none.
    """

    words: str
    film: tuple[bytes, bytes] | None


@dataclass(frozen=True)
class WorstSeed:
    """An episode that went badly.

    Attributes:
        case: The case's name.
        seed: The seed.
        clips: One for each run that played it.
    """

    case: str
    seed: int
    clips: tuple[RunClip, ...]


def worst_seeds(runs: Sequence[SuiteRun], count: int) -> list[tuple[Case, int]]:
    """Return the cases and seeds at which most runs failed, at most so many.

    Among seeds of a case at which as many failed, the first are those at which they came least far,
    and earned least; the worst of each case come before the second of any.
    """
    ranked: list[tuple[float, int, Case, int]] = []
    for case in runs[0].suite.cases:
        failed = sorted(_failures(case, runs))
        ranked += [(bad[0], rank, case, bad[-1]) for rank, bad in enumerate(failed)]
    ranked.sort(key=lambda found: found[:2])
    return [(case, seed) for _, _, case, seed in ranked[:count]]


def _failures(case: Case, runs: Sequence[SuiteRun]) -> Iterator[tuple[float, float, float, int]]:
    """Yield minus the share of runs that failed, how far they came, their return, and the seed."""
    receipts = [run.receipts[case.name] for run in runs if case.name in run.receipts]
    by_seed: dict[int, list[EpisodeReceipt]] = {}
    for receipt in receipts:
        for episode in receipt.episodes:
            by_seed.setdefault(episode.seed, []).append(episode)
    for seed, played in by_seed.items():
        failed = mean(not episode.success for episode in played)
        if failed:
            far = mean(episode.stage_score or 0.0 for episode in played)
            yield -failed, far, mean(episode.total for episode in played), seed


def film_worst(
    runs: Sequence[SuiteRun], count: int, progress: Callable[[str], None] = lambda what: None
) -> Iterator[WorstSeed]:
    """Yield films of the worst seeds of runs of one suite; needs a driver and imageio.

    Every episode is played again, and shown only if its states are those of its receipt.

    Args:
        runs: The runs. Policies that are no experts are imported.
        count: How many seeds.
        progress: Called before each with what is filmed.
    """
    torch.set_num_threads(1)  # as where it was played
    for case, seed in worst_seeds(runs, count):
        progress(f"filming {case.name}, seed {seed}")
        clips = [_clip(run, case, seed) for run in runs if case.name in run.receipts]
        yield WorstSeed(case.name, seed, tuple(clips))


def _clip(run: SuiteRun, case: Case, seed: int) -> RunClip:
    receipt = run.receipts[case.name]
    episode = next(one for one in receipt.episodes if one.seed == seed)
    ended = "success" if episode.success else episode.reason or "no success"
    words = f"{run.folder.name}: {ended}, {episode.steps} steps"
    try:
        film = _film(receipt, case, episode)
    except RobotLayoutsError as error:  # an expert that found no way, say
        return RunClip(f"{words}; not filmed: {error}", None)
    return RunClip(words if film else f"{words}; not filmed: it is another episode here", film)


@torch.no_grad()
def _film(receipt: Receipt, case: Case, episode: EpisodeReceipt) -> tuple[bytes, bytes] | None:
    """Return the film of an episode that was played before; None if this is another one."""
    cls, policy = get_task_class(case.task), receipt.policy
    cast, _ = cast_of(EXPERT if policy["kind"] == EXPERT else policy["name"], cls)
    making = make_again(receipt.making, receipt.environment.get("guessed", {}), cls, {})
    scenario = make_scenario(cls, **making)
    scenario.render_mode = "rgb_array"
    with closing(cls(scenario)) as env, closing(Casting(cast, env)) as casting:
        player = casting(episode.seed)
        player.most = min(player.most, episode.steps + 1)
        (played,) = record_together(env, [player])
        if trace_of(played.states).states != episode.states:
            return None
        return film_one(env, played)
