"""Who plays the episode of a seed: a policy as it was passed, or an expert's plan."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

from robot_layouts.data.playing.plan_conversion import Planner
from robot_layouts.data.playing.randomness import random_states, seed_all
from robot_layouts.data.playing.together import Player, is_batched
from robot_layouts.data.sources.actors import is_person
from robot_layouts.data.sources.policies import EXPERT, check_policy, find_policy
from robot_layouts.experts import find_expert
from robot_layouts.experts.registry import Expert
from robots import TaskError
from tasks import MultiRobotTask, TaskEnv
from tasks.episode import PlayedEpisode, Policy, open_loop


@dataclass(frozen=True)
class Cast:
    """Who may act in episodes; can be pickled if they can.

    Attributes:
        policy: Who plays, a `Policy`; None if the expert does.
        expert: An expert, or None.
        takeover: May act in place of the policy, or None.
        corrector: Says what it would do, or None.
        to_the_end: Whether an expert's plan is carried out to its end, whatever happens.
    """

    policy: Any = None
    expert: Expert | None = None
    takeover: Any = None
    corrector: Any = None
    to_the_end: bool = False

    @property
    def members(self) -> tuple[Any, ...]:
        """All of them."""
        return self.policy, self.expert, self.takeover, self.corrector


def cast_of(policy: Policy | str, task: type[MultiRobotTask]) -> tuple[Cast, str | None]:
    """Return who plays, and by which name ``module:name`` that was imported, if it was.

    Args:
        policy: A policy, the name of one, or the word ``"expert"``.
        task: What is played.

    Raises:
        TaskError: If that is not a policy, or the task has no expert.
    """
    name = policy if isinstance(policy, str) else None
    if name == EXPERT:
        return Cast(expert=find_expert(task.task_id)), None
    return Cast(check_policy(policy if name is None else find_policy(name))), name


class Casting:
    """Makes the players of the episodes of one task."""

    def __init__(self, cast: Cast, env: TaskEnv) -> None:
        """Prepare for plans if an expert plays.

        Args:
            cast: Who may act.
            env: Where it is played; experts that plan leave it alone.
        """
        self._cast, self._env = cast, env
        self._own: TaskEnv | None = None
        self._planner: Planner | None = None
        if cast.expert is not None:
            if env.num_envs > 1:
                self._own = env.task_class(replace(env.scenario, num_envs=1))
            self._planner = Planner(self._own or env, cast.expert)

    def __call__(self, seed: int) -> Player:
        """Return who plays the episode of a seed; the random generators begin with it."""
        seed_all(seed)
        if self._planner is not None:
            return self._follower(self._planner, seed)
        cast = self._cast
        return Player(
            seed,
            _fresh(cast.policy),
            self._env.max_episode_steps,
            random_states(),
            takeover=_fresh(cast.takeover),
            corrector=_fresh(cast.corrector),
        )

    def close(self) -> None:
        """Let the worlds of its own go."""
        for own in (self._planner, self._own):
            if own is not None:
                own.close()

    def _follower(self, planner: Planner, seed: int) -> Player:
        """Return what carries out the expert's plan; nothing if it finds none."""
        try:
            plan = planner(seed)
        except TaskError as error:
            return Player(seed, open_loop(()), 0, random_states(), str(error))
        to_the_end = self._cast.to_the_end
        states, reason = random_states(), planner.reason
        player = Player(seed, open_loop(plan), len(plan), states, reason, True, to_the_end)
        if planner.rehearsed is not None and (to_the_end or _ends_at_last(planner.rehearsed)):
            player.rehearsed = planner.rehearsed
        return player


def _ends_at_last(episode: PlayedEpisode) -> bool:
    """Tell whether no step but the last ended an episode or was out of time."""
    return not (episode.terminated | episode.truncated)[:-1].any()


def _fresh(policy: Any) -> Any:
    """Return a copy of a policy as it was passed; people and what is batched are not copied."""
    return policy if is_batched(policy) or is_person(policy) else deepcopy(policy)
