"""Plays the episodes of several seeds in one task, each as if it were alone.

Who plays an episode is a policy as it was passed, or an expert's plan.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, field, replace
from math import fsum
from time import perf_counter
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray

from robot_layouts.data.actors import EXPERT, is_person
from robot_layouts.data.playing.executor import (
    modules_of,
    random_states,
    seed_all,
    set_random_states,
)
from robot_layouts.data.playing.mode_conversion import Planner
from robot_layouts.data.playing.policies import (
    check_policy,
    close_served,
    find_policy,
    playing,
    waits_of,
)
from robot_layouts.data.playing.scheduler import Event
from robot_layouts.data.playing.served.client import PolicyClient
from robot_layouts.data.playing.shared_policy import SharedPolicy
from robot_layouts.experts import find_expert
from robot_layouts.experts.registry import Expert
from robots import ActionError, DivergedError, TaskError
from tasks import MultiRobotTask, Scenario, TaskEnv
from tasks.arrays import row_of, stacked
from tasks.engine.actions import ActionReader
from tasks.engine.outcome import solved
from tasks.episode import REBUILT, PlayedEpisode, Policy, Score, States, StepResult, open_loop
from tasks.language.stages import STAGE_SCORE

Row = NDArray[np.float32]


class BatchError(TaskError):
    """A batched policy did not return one action for each observation."""


class ChosenAction(NamedTuple):
    """What is carried out in a step of an episode.

    Attributes:
        action: The action, (A,).
        turn: 0 if the policy acted, 1 if another took over.
        correction: What the corrector would have done, (A,), or None.
    """

    action: Row
    turn: int = 0
    correction: Row | None = None


@dataclass
class EpisodePlayer:
    """Who plays the episode of a seed, and what has happened in it.

    Attributes:
        seed: The seed.
        policy: Who acts.
        most: Steps after which the episode ends.
        states: Where the random generators are when it acts.
        reason: Why it can but fail, if that is known.
        blind: Whether the policy ignores observations, as a plan does; then it draws nothing.
        to_the_end: Whether it plays all its steps, those after a success or out of time included.
        takeover: May act in place of the policy: obs → action, or None to let the policy act.
        corrector: Says at every step what it would do: obs → action.
        diverged: What happened when physics diverged, which ends its episode.
        rehearsed: Its episode, if that has happened already, in the rehearsal of its plan; then
            there is nothing left to play.
        choices: The choice of each step so far.
        moments: What each of these steps returned.
    """

    seed: int
    policy: Policy
    most: int
    states: tuple[Any, ...]
    reason: str = ""
    blind: bool = False
    to_the_end: bool = False
    takeover: Policy | None = None
    corrector: Policy | None = None
    diverged: DivergedError | None = None
    rehearsed: PlayedEpisode | None = None
    choices: list[ChosenAction] = field(default_factory=list[ChosenAction])
    moments: list[StepResult] = field(default_factory=list[StepResult])

    @property
    def over(self) -> bool:
        """Whether its episode is over."""
        if len(self.moments) >= self.most or self.diverged is not None:
            return True
        ended = bool(self.moments) and (self.moments[-1].terminated or self.moments[-1].truncated)
        return ended and not self.to_the_end

    @property
    def score(self) -> Score:
        """How its episode went."""
        if self.rehearsed is not None:
            return self.rehearsed.score
        last = self.moments[-1] if self.moments else StepResult(None)
        success = last.success and self.diverged is None
        total = fsum(moment.reward for moment in self.moments)
        reason = "" if success else str(self.diverged or self.reason or last.failure)
        waits = waits_of(self.policy)
        return Score(success, total, len(self.moments), reason, waits, last.stage_score)

    def episode(
        self, states: States, observations: Any, drawn: dict[str, Any] | None
    ) -> PlayedEpisode:
        """Return what happened.

        Args:
            states: Those of its environment, each entry (T + 1, k).
            observations: What was observed there, (T + 1, …), or nested mappings of that, or None.
            drawn: What was varied in its world.

        Raises:
            TaskError: If it took no step.
            DivergedError: If physics diverged in it.
        """
        if self.diverged is not None:
            raise self.diverged
        if not self.moments:
            raise TaskError(self.reason or "an episode needs at least one action")
        corrections = [c.correction for c in self.choices if c.correction is not None]
        return PlayedEpisode.of(
            self.seed,
            [choice.action for choice in self.choices],
            states,
            self.moments,
            drawn=drawn,
            actor=np.array([choice.turn for choice in self.choices], np.uint8),
            corrections=np.stack(corrections) if corrections else None,
            reason=self.score.reason,
            observations=observations,
        )


def grouped(seeds: Sequence[int], size: int) -> dict[int, tuple[int, ...]]:
    """Return which seeds are played at once, by the first of them."""
    return {seeds[i]: tuple(seeds[i : i + size]) for i in range(0, len(seeds), size)}


def one_by_one(event: Event) -> list[Event]:
    """Return an event for each episode if it is of episodes that were played at once."""
    if not isinstance(event.result, dict):
        return [event]
    return [replace(event, seed=seed, result=result) for seed, result in event.result.items()]


def play_together(env: TaskEnv, players: Sequence[EpisodePlayer]) -> None:
    """Play an episode for each player until all are over; see `steps_together`."""
    if acting := _acting(players):
        for _ in steps_together(env, acting):
            pass


def states_together(
    env: TaskEnv,
    players: Sequence[EpisodePlayer],
    on_moment: Callable[[Any], None] = lambda observation: None,
) -> list[States]:
    """Play an episode for each player, as `steps_together` does, and return the states of each.

    Args:
        env: The task.
        players: Who plays.
        on_moment: Called with what `steps_together` yields.

    Returns:
        State dicts of `TaskEnv.get_state_dict`, each entry (T + 1, k) for T steps of its
        player.
    """
    played = iter(_played(env, _acting(players), on_moment))
    return [next(played)[0] if p.rehearsed is None else p.rehearsed.states for p in players]


def record_together(
    env: TaskEnv, players: Sequence[EpisodePlayer], *, observed: bool = False
) -> list[PlayedEpisode]:
    """Play an episode for each player, as `steps_together` does, and keep what happens.

    Args:
        env: The task.
        players: Who plays. With ``observed``, rehearsed episodes are played, too: nothing was
            observed in the rehearsal.
        observed: Whether to keep what the task observes.

    Raises:
        TaskError: Also if a player takes no step.
        DivergedError: Also if there is one player alone.
    """
    acting = players if observed else _acting(players)
    happened = _played(env, acting, observed=observed)
    episodes = [p.episode(*happened[i], env.drawn(i)) for i, p in enumerate(acting)]
    if observed:
        return episodes
    played = iter(episodes)
    return [next(played) if p.rehearsed is None else p.rehearsed for p in players]


def _acting(players: Sequence[EpisodePlayer]) -> list[EpisodePlayer]:
    """Return those whose episodes have not happened yet."""
    return [player for player in players if player.rehearsed is None]


def _played(
    env: TaskEnv,
    players: Sequence[EpisodePlayer],
    on_moment: Callable[[Any], None] = lambda observation: None,
    *,
    observed: bool = False,
) -> list[tuple[States, Any]]:
    """Play, and return the states of each player's environment, and what was observed in it."""
    if not players:
        return []
    seen: list[list[Any]] = [[] for _ in players]
    happening = steps_together(env, players)
    tape = None
    for observation in happening:
        tape = tape or env.begin_tape()
        on_moment(observation)
        env.write_tape(tape)
        for i, player in enumerate(players if observed else ()):
            if len(seen[i]) <= len(player.moments):  # it is not over since the step before
                seen[i].append(row_of(observation, i))
    assert tape is not None  # there is a reset at least
    states = tape.read()
    return [
        (
            {
                kind: {name: rows[: len(player.moments) + 1, i] for name, rows in entries.items()}
                for kind, entries in states.items()
            },
            stacked(seen[i]) if observed else None,
        )
        for i, player in enumerate(players)
    ]


def steps_together(env: TaskEnv, players: Sequence[EpisodePlayer]) -> Generator[Any]:
    """Play an episode for each player, from freshly built worlds, until all are over.

    Every player sees its own environment alone, and draws from generators that are its own, so
    that nothing depends on who plays beside it. A policy that is marked as `batched` is called
    once for all of them. Where physics diverges, the episode of a player that plays alone is over.

    Args:
        env: The task, with at least as many environments as players.
        players: Who plays, one after the other in the environments; what happens is added to
            them.

    Yields:
        What is observed after the reset and after every step, in all environments.

    Raises:
        BatchError: If the actions of a batched policy are not one for each environment.
        ActionError: If an action has the wrong shape or numbers that are not finite.
        DivergedError: If physics diverges and there are several players: the step is lost for all.
    """
    ids = list(range(len(players)))
    observation, _ = env.reset([player.seed for player in players], REBUILT, ids)
    yield observation
    reader = ActionReader(env.layout, 1)
    actions = np.zeros((env.num_envs, env.layout.action_dim), np.float32)
    env.trust(actions)  # what is written there was checked
    while running := [i for i in ids if not players[i].over]:
        choices = _choices(players, running, observation, reader)
        for i, choice in choices.items():
            actions[i] = choice.action
        everywhere = len(running) == env.num_envs
        began = perf_counter()
        try:
            observation, rewards, terminated, truncated, info = env.step(
                actions, None if everywhere else running
            )
        except DivergedError as error:
            if len(players) > 1:
                raise
            players[0].diverged = error
            return
        seconds = (perf_counter() - began) / len(running)
        columns = (rewards, solved(info), terminated, truncated)
        rows = list(zip(*(column.tolist() for column in columns), strict=True))
        stages = info[STAGE_SCORE].tolist() if STAGE_SCORE in info else [None] * env.num_envs
        for i in running:
            reward, success, ended, late = rows[i]
            moment = StepResult(
                None, reward, bool(success), ended, late, seconds, stage_score=stages[i]
            )
            players[i].choices.append(choices[i])
            players[i].moments.append(moment)
        yield observation


def is_batched(policy: object) -> bool:
    """Return whether a policy says that it takes many observations at once, by ``batched``."""
    return getattr(policy, "batched", False) is True


def _choices(
    players: Sequence[EpisodePlayer], running: Sequence[int], observation: Any, reader: ActionReader
) -> Mapping[int, ChosenAction]:
    """Return what is carried out in each environment."""
    at_once: dict[int, Any] = {}
    if is_batched(players[0].policy):
        at_once = _act_at_once(players[0].policy, running, observation)
    choices: dict[int, ChosenAction] = {}
    for i in running:
        player = players[i]
        if player.blind:
            choices[i] = ChosenAction(reader.read(player.policy(None))[0].copy())
        elif at_once and player.takeover is None and player.corrector is None:
            choices[i] = ChosenAction(reader.read(at_once[i])[0].copy())
        else:
            seen = _rows(observation, [i])
            with _own_generators(player, shared=len(players) > 1):
                proposed = at_once[i] if at_once else player.policy(seen)
                choices[i] = _choice(player, proposed, seen, reader)
    return choices


def _choice(player: EpisodePlayer, proposed: Any, seen: Any, reader: ActionReader) -> ChosenAction:
    choice = ChosenAction(reader.read(proposed)[0].copy())
    if player.takeover is not None and (instead := player.takeover(seen)) is not None:
        choice = ChosenAction(_read(instead, reader, "takeover"), 1)
    if player.corrector is not None:
        choice = choice._replace(correction=_read(player.corrector(seen), reader, "corrector"))
    return choice


def _read(action: Any, reader: ActionReader, whose: str) -> Row:
    try:
        return reader.read(action)[0].copy()
    except ActionError as error:
        raise ActionError(f"of the {whose}: {error}") from error


@contextmanager
def _own_generators(player: EpisodePlayer, *, shared: bool) -> Generator[None]:
    """Let the random generators go on where the player's were, if others draw from them, too."""
    if not shared:
        yield
        return
    set_random_states(player.states)
    yield
    player.states = random_states()


def _act_at_once(policy: Policy, running: Sequence[int], observation: Any) -> dict[int, Any]:
    actions = policy(_rows(observation, running))
    try:
        count = len(actions)
    except TypeError:
        raise BatchError(
            f"a batched policy returned {actions!r} for {len(running)} observations; it must"
            " return an action for each"
        ) from None
    if count != len(running):
        raise BatchError(
            f"a batched policy returned {count} actions for {len(running)} observations"
        )
    return dict(zip(running, actions, strict=True))


def _rows(tree: Any, rows: Sequence[int]) -> Any:
    """Return rows of an observation, in memory of their own, as if there were no others."""
    if isinstance(tree, dict):
        return {key: _rows(value, rows) for key, value in tree.items()}
    return tree[torch.tensor(rows)]


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

    def playing(self, task: TaskEnv) -> Cast:
        """Return them as they act in a task; see `robot_layouts.data.playing.policies.playing`."""
        names = ("policy", "takeover", "corrector")
        return replace(self, **{name: playing(getattr(self, name), task) for name in names})


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
    found = check_policy(policy if name is None else find_policy(name))
    return Cast(found), found.name if isinstance(found, SharedPolicy) else name


class Casting:
    """Makes the players of the episodes of one task."""

    def __init__(self, cast: Cast, env: TaskEnv) -> None:
        """Prepare for plans if an expert plays.

        Args:
            cast: Who may act.
            env: Where it is played; experts that plan leave it alone.
        """
        self._cast, self._env = cast.playing(env), env
        self._own: TaskEnv | None = None
        self._planner: Planner | None = None
        if cast.expert is not None:
            if env.num_envs > 1:
                self._own = env.task_class(replace(env.scenario, num_envs=1))
            self._planner = Planner(self._own or env, cast.expert)

    def __call__(self, seed: int) -> EpisodePlayer:
        """Return who plays the episode of a seed; the random generators begin with it."""
        seed_all(seed)
        if self._planner is not None:
            return self._follower(self._planner, seed)
        cast = self._cast
        return EpisodePlayer(
            seed,
            _fresh(cast.policy, seed),
            self._env.max_episode_steps,
            random_states(),
            takeover=_fresh(cast.takeover, seed),
            corrector=_fresh(cast.corrector, seed),
        )

    def close(self) -> None:
        """Let the worlds of its own and the connections to servers go."""
        for member in self._cast.members:
            close_served(member)
        for own in (self._planner, self._own):
            if own is not None:
                own.close()

    def _follower(self, planner: Planner, seed: int) -> EpisodePlayer:
        """Return what carries out the expert's plan; nothing if it finds none."""
        try:
            plan = planner(seed)
        except (TaskError, DivergedError) as error:
            return EpisodePlayer(seed, open_loop(()), 0, random_states(), str(error))
        to_the_end = self._cast.to_the_end
        states, reason = random_states(), planner.reason
        player = EpisodePlayer(seed, open_loop(plan), len(plan), states, reason, True, to_the_end)
        if planner.rehearsed is not None and (to_the_end or _ends_at_last(planner.rehearsed)):
            player.rehearsed = planner.rehearsed
        return player


def _ends_at_last(episode: PlayedEpisode) -> bool:
    """Tell whether no step but the last ended an episode or was out of time."""
    return not (episode.terminated | episode.truncated)[:-1].any()


def _fresh(policy: Any, seed: int) -> Any:
    """Return a copy of a policy as it was passed; people and what is batched are not copied."""
    if isinstance(policy, PolicyClient):
        return policy.episode(seed)
    return policy if is_batched(policy) or is_person(policy) else deepcopy(policy)


@dataclass(frozen=True)
class EpisodesJob:
    """Everything but the seed that decides episodes of one task; can be pickled.

    Attributes:
        task: Class of the task.
        scenario: How to make it.
        cast: Who plays.
        together: Seeds that are played at once, by the first of them.
    """

    task: type[MultiRobotTask]
    scenario: Scenario
    cast: Cast
    together: Mapping[int, tuple[int, ...]]

    @property
    def modules(self) -> tuple[str, ...]:
        """What other machines may need to play it."""
        return modules_of(self.task, *self.cast.members)


AnyJob = TypeVar("AnyJob", bound=EpisodesJob)


class EpisodesPlay(Generic[AnyJob]):
    """Plays the episodes of a job in a worker, in worlds that are built anew for each."""

    def __init__(self, job: AnyJob) -> None:
        """Make the task."""
        torch.set_num_threads(1)  # sums are the same everywhere, and other workers want the cores
        self._job, self._env = job, job.task(job.scenario)
        self._casting = Casting(job.cast, self._env)

    def close(self) -> None:
        """Let the worlds go."""
        self._env.close()
        self._casting.close()
