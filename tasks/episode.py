"""Plays episodes of a task with one environment, and keeps what happened in them."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import fsum
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots import TaskError
from tasks import TaskEnv
from tasks.arrays import row_of, stacked
from tasks.engine.outcome import solved
from tasks.language.stages import STAGE_SCORE

States = dict[str, dict[str, NDArray[np.float32]]]

Policy = Callable[[Any], Any]
"""``policy(obs)`` returns an action; both as `TaskEnv.step` has them, of 1 environment."""

REBUILT: dict[str, Any] = {"reconfigure": True}  # reset option: nothing of the past stays in PhysX


@dataclass(frozen=True)
class Episode:
    """What an episode of T steps follows from.

    Attributes:
        seed: Seed of its reset.
        actions: Flat actions, shape (T, A).
    """

    seed: int
    actions: NDArray[np.float32]


@dataclass(frozen=True)
class Score:
    """How an episode went.

    Attributes:
        success: Whether its last step was a success.
        total: Sum of its rewards.
        steps: Its control steps.
        reason: Why it failed, in words, if that is known; of an expert, it is.
        waits: How long each answer of its policy's server took (s); empty if none serves it.
        stage_score: That of the last stage it passed, 0 to 1; None of a task without stages, or if
            it took no step.
    """

    success: bool
    total: float
    steps: int
    reason: str = field(default="", compare=False)
    waits: tuple[float, ...] = field(default=(), compare=False)
    stage_score: float | None = None


@dataclass(frozen=True)
class PlayedEpisode(Episode):
    """An episode and what happened in it.

    Attributes:
        states: State dict of `TaskEnv.get_state_dict`, each entry (T + 1, k), the first
            row being the state after the reset, which rebuilt the world.
        rewards: Shape (T,).
        success: Shape (T,).
        terminated: Shape (T,).
        truncated: Shape (T,).
        seconds: Time that the steps took, without reading the states (s).
        source: Who acted, as plain data that json can hold; None if unknown.
        drawn: What was varied in its world, likewise; None if nothing was.
        actor: Who acted at each step where several did, (T,) uint8: the number of one of the
            ``"actors"`` of ``source``; else None.
        corrections: What a corrector would have done at each step, (T, A), or None.
        reason: Why it failed; empty if it did not, or if that is unknown. Experts give a reason.
        observations: What was observed after the reset and every step, (T + 1, …), or nested
            mappings of that; None if it was not kept.
        stage_score: See `Score`.
    """

    states: States
    rewards: NDArray[np.float32]
    success: NDArray[np.bool_]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    seconds: float
    source: Mapping[str, Any] | None = None
    drawn: Mapping[str, Any] | None = None
    actor: NDArray[np.uint8] | None = None
    corrections: NDArray[np.float32] | None = None
    reason: str = ""
    observations: Any = None
    stage_score: float | None = None

    @classmethod
    def of(
        cls,
        seed: int,
        actions: Sequence[NDArray[np.float32]],
        states: States,
        moments: Sequence[StepResult],
        **others: Any,
    ) -> PlayedEpisode:
        """Return the episode of T steps, T of 1 or more.

        Args:
            seed: Seed of its reset.
            actions: The action of each step, (A,).
            states: See above.
            moments: What each step returned.
            **others: Other fields.
        """
        return cls(
            seed=seed,
            actions=np.stack(actions),
            states=states,
            rewards=np.array([moment.reward for moment in moments], np.float32),
            success=np.array([moment.success for moment in moments]),
            terminated=np.array([moment.terminated for moment in moments]),
            truncated=np.array([moment.truncated for moment in moments]),
            seconds=fsum(moment.seconds for moment in moments),
            stage_score=moments[-1].stage_score,
            **others,
        )

    @property
    def solved(self) -> bool:
        """Whether the last step ended in success."""
        return bool(self.success[-1])

    @property
    def score(self) -> Score:
        """How it went."""
        total = fsum(self.rewards.tolist())
        steps, stage = len(self.actions), self.stage_score
        return Score(self.solved, total, steps, self.reason, stage_score=stage)


class StepResult(NamedTuple):
    """What a reset or a step returned, of one environment.

    Attributes:
        observation: As the task gives it.
        reward: 0 after the reset, as are those below.
        success: Whether the task is solved.
        terminated: Whether the episode ended.
        truncated: Whether its time was over.
        seconds: Time that the step took (s).
        elapsed: Control steps since the reset.
        stage_score: That of the last stage passed; None of a task without stages.
    """

    observation: Any
    reward: float = 0.0
    success: bool = False
    terminated: bool = False
    truncated: bool = False
    seconds: float = 0.0
    elapsed: int = 0
    stage_score: float | None = None

    @property
    def failure(self) -> str:
        """In words that the task says that the episode is lost; empty if it does not."""
        return "the task counts it as failed" if self.terminated and not self.success else ""


def moments(
    task: TaskEnv,
    seed: int,
    policy: Policy,
    most: int,
    *,
    start: Mapping[str, Mapping[str, Any]] | None = None,
) -> Generator[StepResult]:
    """Begin an episode in a freshly built world, then take a step whenever asked for one.

    Args:
        task: A task with one environment.
        seed: Seed of the reset.
        policy: Who acts; see `open_loop` for actions that are known.
        most: Steps after which this ends; the caller may end it before.
        start: State to begin from instead of the one after the reset; see
            `TaskEnv.set_state_dict`, which is not exact.

    Yields:
        What the reset returned, then what each step did.

    Raises:
        TaskError: If the task has several environments.
        ActionError: If an action has the wrong shape or numbers that are not finite.
    """
    if task.num_envs != 1:
        raise TaskError(f"an episode is played in 1 environment; the task has {task.num_envs}")
    observation, _ = task.reset(seed, options=REBUILT)
    if start is not None:
        task.set_state_dict(start)
    yield StepResult(observation)
    for _ in range(most):
        moment = take_step(task, policy(observation))
        observation = moment.observation
        yield moment


def take_step(task: TaskEnv, action: Any) -> StepResult:
    """Take a control step in a task with one environment, and return what it returned.

    Raises:
        ActionError: If the action has the wrong shape or numbers that are not finite.
    """
    began = perf_counter()
    observation, reward, terminated, truncated, info = task.step(action)
    seconds = perf_counter() - began
    success, over, late = bool(solved(info)), bool(terminated), bool(truncated)
    elapsed = int(info["elapsed_steps"])
    stage = info[STAGE_SCORE].item() if STAGE_SCORE in info else None
    return StepResult(observation, reward.item(), success, over, late, seconds, elapsed, stage)


def open_loop(actions: Iterable[Any]) -> Policy:
    """Return a policy that carries out actions, whatever it observes."""
    left = iter(actions)
    return lambda observation: next(left)


class EpisodeTape:
    """Keeps everything that happens in an episode of a task with one environment."""

    def __init__(self, task: TaskEnv, seed: int) -> None:
        """Begin with the present state, that after the reset with a seed."""
        self._task, self._seed, self._states = task, seed, task.begin_tape()
        self._actions: list[NDArray[np.float32]] = []
        self._moments: list[StepResult] = []
        task.write_tape(self._states)

    def add(self, action: Any, moment: StepResult) -> None:
        """Add a step that was just taken: its action, (A,), and what it returned."""
        self._actions.append(np.array(action, np.float32))
        self._moments.append(moment._replace(observation=None))
        self._task.write_tape(self._states)

    @property
    def unbroken(self) -> bool:
        """Whether it has every step since the reset, and no state was set in between."""
        elapsed = [moment.elapsed for moment in self._moments]
        return elapsed == [*range(1, len(elapsed) + 1)] and not self._task.state_was_set

    def read(self) -> PlayedEpisode:
        """Return the episode of T steps, T of 1 or more."""
        states = {
            kind: {name: rows[:, 0] for name, rows in entries.items()}
            for kind, entries in self._states.read().items()
        }
        drawn = self._task.drawn()
        return PlayedEpisode.of(self._seed, self._actions, states, self._moments, drawn=drawn)


def play(
    task: TaskEnv,
    seed: int,
    actions: NDArray[np.float32],
    watch: Callable[[], None] = lambda: None,
    *,
    start: Mapping[str, Mapping[str, Any]] | None = None,
    observed: bool = False,
) -> PlayedEpisode:
    """Play actions in a freshly built world, and keep everything that happens.

    Args:
        task: A task with one environment.
        seed: Seed of the reset.
        actions: Shape (T, A) with T of 1 or more.
        watch: Called after the reset and after every step.
        start: State to begin from instead of the one after the reset; see `moments`.
        observed: Whether to keep what the task observes; not with a ``start``.

    Raises:
        TaskError: If the task has several environments, or there are no actions.
        ActionError: If an action has the wrong shape or numbers that are not finite.
    """
    if task.num_envs == 1 and not len(actions):
        raise TaskError("an episode needs at least one action")
    happening = moments(task, seed, open_loop(actions), len(actions), start=start)
    seen = [next(happening).observation]
    tape = EpisodeTape(task, seed)
    watch()
    for action, moment in zip(actions, happening, strict=True):
        tape.add(action, moment)
        if observed:
            seen.append(moment.observation)
        watch()
    if not observed:
        return tape.read()
    return replace(tape.read(), observations=stacked([row_of(each, 0) for each in seen]))
