"""Pairs of native and our environments that tests share, because making them takes a second."""

import functools
import gc
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import pytest

import tasks
from parity.lockstep import EpisodeResult, History, NativeSide, OurSide, compare
from tasks.episode import Episode

TASKS = tasks.list_clones()
NATIVE = [
    pytest.mark.native,
    # mani_skill's own
    pytest.mark.filterwarnings("ignore:__array_wrap__:DeprecationWarning"),
    pytest.mark.filterwarnings("ignore:The 'warn' method:DeprecationWarning"),
]


class Pair(NamedTuple):
    """Both sides of a comparison, always reset and stepped alike."""

    native: NativeSide
    ours: OurSide

    def forget(self) -> None:
        """Rebuild every world, so that neither side remembers what an earlier test did."""
        everything = range(self.native.num_envs)
        for side in self:
            side.reset([0] * self.native.num_envs, everything, rebuild=True)

    @contextmanager
    def rewarding(self, mode: str) -> Generator[None]:
        """Let both sides reward in another mode; making them anew takes a second."""
        sides = [env.unwrapped for env in self.native.envs]
        before, own = [side._reward_mode for side in sides], self.ours.env.reward_mode
        try:
            self.ours.env.reward_mode = mode
            for side in sides:
                side._reward_mode = mode
            yield
        finally:
            self.ours.env.reward_mode = own
            for side, earlier in zip(sides, before, strict=True):
                side._reward_mode = earlier

    def play(self, episodes: Sequence[Episode], history: History = "fresh") -> list[EpisodeResult]:
        """Compare episodes, from a common past."""
        self.forget()
        return list(compare(self.native, self.ours, episodes, history=history))


@functools.cache
def pair(
    task_id: str,
    reward_mode: str | None = None,
    num_envs: int = 1,
    control_mode: str = "pd_joint_delta_pos",
) -> Pair:
    """Return the pair of this process for a task."""
    ours = tasks.make(
        task_id, num_envs=num_envs, reward_mode=reward_mode, control_mode=control_mode
    )
    native = NativeSide(task_id, reward_mode, num_envs, control_mode)
    gc.freeze()  # native collects garbage at every rebuild: 0.2 s, unless told what stays
    return Pair(native, OurSide(ours))


def against_native(task_id: str, ours: tasks.MultiRobotTask) -> Pair:
    """Return a pair of the shared native environment and another environment of ours."""
    return Pair(pair(task_id).native, OurSide(ours))


def complaints(results: Sequence[EpisodeResult]) -> list[str]:
    """Say where episodes differ; nothing if they are equal."""
    assert results, "no episode was played"
    return [f"seed {r.seed} differs {r.first_difference}" for r in results if not r.equal]
