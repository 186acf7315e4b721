"""One comparison of a task: what to play and how, and what came of it."""

from __future__ import annotations

import gc
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import tasks
from parity.compare.both_sides import NativeSide, OurSide
from parity.compare.lockstep import EpisodeResult, FirstDifference, History, compare
from parity.compare.snapshot import QUANTITIES
from robots import CONTROL_MODES
from tasks.episode import Episode


@dataclass(frozen=True)
class Run:
    """Episodes of one task, played one way.

    Attributes:
        task: Task id.
        source: Where the actions come from, in a few words.
        episodes: What to play.
        history: ``"fresh"`` or ``"reused"``.
        reward_mode: Reward mode of both sides.
        num_envs: How many environments play at once.
        control_mode: Control mode of both sides.
    """

    task: str
    source: str
    episodes: tuple[Episode, ...]
    history: History
    reward_mode: str
    num_envs: int = 1
    control_mode: str = CONTROL_MODES[0]

    @property
    def steps(self) -> int:
        """Control steps of all episodes together."""
        return sum(len(episode.actions) for episode in self.episodes)


@dataclass(frozen=True)
class RunResult:
    """What a run found.

    Attributes:
        run: What was played.
        episodes: What the comparison of each episode found, in order.
    """

    run: Run
    episodes: tuple[EpisodeResult, ...]

    @property
    def equal(self) -> bool:
        """Whether at least one episode was played and nothing differs in any."""
        return bool(self.episodes) and all(episode.equal for episode in self.episodes)

    @property
    def contact_steps(self) -> int:
        """Steps in which a robot was touching a movable object."""
        return sum(episode.contact_steps for episode in self.episodes)

    @property
    def max_difference(self) -> dict[str, float]:
        """Largest |Δ| by quantity over all episodes."""
        return {
            quantity: max((e.max_difference[quantity] for e in self.episodes), default=0.0)
            for quantity in QUANTITIES
        }

    @property
    def differing(self) -> tuple[tuple[EpisodeResult, FirstDifference], ...]:
        """The episodes that differ, each with where it does first."""
        return tuple((e, e.first_difference) for e in self.episodes if e.first_difference)

    @property
    def successes(self) -> tuple[int, int, int]:
        """Number of episodes in which native, our side, and both succeeded."""
        return (
            sum(episode.native_success for episode in self.episodes),
            sum(episode.our_success for episode in self.episodes),
            sum(episode.native_success and episode.our_success for episode in self.episodes),
        )


def play(runs: Sequence[Run], on_step: Callable[[Run, int], None]) -> list[RunResult]:
    """Play runs one after the other, each with environments of its own.

    Args:
        runs: What to play.
        on_step: Called after every step with the run and how many episodes it advanced.

    Raises:
        RobotLayoutsError: If a side cannot be made or an action does not fit.
    """
    return [_play_one(run, on_step) for run in runs]


def _play_one(run: Run, on_step: Callable[[Run, int], None]) -> RunResult:
    env = tasks.make(
        run.task,
        num_envs=run.num_envs,
        reward_mode=run.reward_mode,
        control_mode=run.control_mode,
    )
    native = NativeSide(env.task_id, run.reward_mode, run.num_envs, run.control_mode)
    gc.freeze()  # native collects garbage at each rebuild, in 0.2 s unless frozen
    try:
        found = compare(
            native,
            OurSide(env),
            run.episodes,
            history=run.history,
            on_step=lambda count: on_step(run, count),
        )
        return RunResult(run, tuple(found))
    finally:
        gc.unfreeze()
        env.close()
        native.close()
