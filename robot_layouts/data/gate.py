"""``robot-layouts tasks check``: whether the scores of a task prove what they say."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from statistics import median
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.cli import Count, Seed
from robot_layouts.core.commands import print_table
from robot_layouts.core.progress import Progress
from robot_layouts.experts import find_expert
from robot_layouts.experts.touching import ArmWatch
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.simulation.backend import Overlap
from robots import TaskError
from tasks import TaskEnv, get_task_class, make
from tasks.cell_options import CellOptions
from tasks.engine import outcome
from tasks.engine.task import DENSE_MODES
from tasks.episode import REBUILT
from tasks.language.stages import STAGE, STAGE_SCORE

SOLVED = 0.9  # share of episodes that the expert must solve
BLIND = 0.2  # share that a policy may solve that does not look
RISING = 0.9  # rank correlation of an expert's rewards with time
INSIDE = 0.001  # m that bodies may be inside each other at the start; resting they are by less


class Outcome(NamedTuple):
    """What one check of a task found.

    Attributes:
        check: What was looked at.
        found: What was seen.
        needed: What must be seen.
        passed: Whether it was.
    """

    check: str
    found: str
    needed: str
    passed: bool


@dataclass(frozen=True)
class PlayedOnce:
    """What actions did in one episode.

    Attributes:
        success: Whether it ended in success.
        rewards: Of each step, (T,).
        scores: The score of the last stage passed after each step, (T,); 0 if there are none.
        skipped: Stages that success passed although their flags were false.
        touching: Which arms touched, in words; empty if none did.
    """

    success: bool
    rewards: Floats
    scores: Floats
    skipped: tuple[str, ...]
    touching: str


def check_task(
    task: str,
    seeds: int = 20,
    *,
    first: int = 0,
    tell: Callable[[str], None] = lambda what: None,
    **making: Any,
) -> list[Outcome]:
    """Look at whether a task's scores prove what they say.

    Episodes begin with nothing inside anything else. The task's expert solves at least 90 of 100,
    and no two arms touch meanwhile; along its episodes stages are passed one after the other up to
    a score of 1, and the rewards rise (the median of their rank correlations with time is at least
    0.9). Random actions solve none, and a policy that does not look, which carries out what solved
    the episode before, at most 20 of 100.

    Args:
        task: Its id or another of its names.
        seeds: How many episodes are played.
        first: Seed of the first.
        tell: Told what is done, to show progress.
        making: Arguments of `tasks.make`, such as ``robots`` and ``randomization``.

    Raises:
        UnknownNameError: If the task, a place, a robot or a field is unknown.
        TaskError: If the task cannot be made like that or has no expert.
    """
    cls = get_task_class(task)
    expert, dense = find_expert(task), DENSE_MODES[0] in cls.reward_modes
    with closing(make(task, reward_mode=DENSE_MODES[0] if dense else None, **making)) as env:
        gate = _Episodes(env, range(first, first + seeds), tell)
        starts = gate.starts()
        plans = gate.plans(expert)
        solved = {seed: gate.play("expert", seed, plan) for seed, plan in plans.items()}
        blind = [
            gate.play("blind", seed + 1, plan).success
            for seed, plan in plans.items()
            if solved[seed].success
        ]
        random = [gate.play("random", seed).success for seed in gate.seeds]
    won = [played for played in solved.values() if played.success]
    return [
        _start(starts),
        _solved(solved, gate.seeds),
        _touching(solved),
        _stages(won, dict(cls.stages)),
        _reward(won, dense=dense),
        Outcome("random actions solve", f"{sum(random)} of {seeds}", "none", not any(random)),
        Outcome(
            "unseeing, solves", f"{sum(blind)} of {len(blind)}", f"less than {BLIND:.0%}",
            bool(blind) and sum(blind) < BLIND * len(blind),
        ),
    ]  # fmt: skip


class _Episodes:
    """Plays the episodes of a task with one environment."""

    def __init__(self, env: TaskEnv, seeds: range, tell: Callable[[str], None]) -> None:
        self._env, self.seeds, self._tell = env, seeds, tell
        self._watch = ArmWatch(env)

    def starts(self) -> dict[int, list[Overlap]]:
        """Return by seed what is inside something else in the first moment, arms at rest."""
        found: dict[int, list[Overlap]] = {}
        for seed in self.seeds:
            self._env.reset(seed, REBUILT)
            simulation = self._env.simulation
            simulation.rest(simulation.read(), [0])
            simulation.backend.step([0], 1)  # later ones push apart what is inside each other
            found[seed] = [*filter(_is_wrong, simulation.backend.overlaps(0))]
        return found

    def plans(self, expert: Callable[[TaskEnv, int], NDArray[np.float32]]) -> dict[int, Any]:
        """Return by seed what the expert would do; where it finds nothing, the seed is left out."""
        found: dict[int, Any] = {}
        for seed in self.seeds:
            self._tell(f"the expert's plan of seed {seed}")
            try:
                found[seed] = expert(self._env, seed)
            except TaskError as error:
                self._tell(f"no plan of seed {seed}: {error}")
        return found

    def play(self, who: str, seed: int, actions: NDArray[np.float32] | None = None) -> PlayedOnce:
        """Play actions, (T, A), or random ones, until the episode ends or they do."""
        self._tell(f"seed {seed}, {who}")
        env, told, touching = self._env, list[tuple[float, int, float]](), ""
        env.reset(seed, REBUILT)
        if actions is None:
            drawn = np.random.default_rng(seed)
            low, high = env.single_action_space.low, env.single_action_space.high
            actions = drawn.uniform(low, high, (env.max_episode_steps, len(low))).astype(np.float32)
        self._watch.touching()
        success, skipped = False, ()
        for action in actions:
            _, reward, ended, _, info = env.step(action[None])
            before = told[-1][1] if told else 0
            stage, score = info.get(STAGE, 0), info.get(STAGE_SCORE, 0.0)
            told.append((float(reward), int(stage), float(score)))
            touching = touching or ", ".join(
                f"{a} touches {b}" for a, b in self._watch.touching()[:1]
            )
            if success := bool(outcome.solved(info)):
                left = list(env.task.stages)[before:]
                skipped = tuple(name for name in left if not info[name])
            if ended:
                break
        rewards, _, scores = np.array(told).reshape(-1, 3).T
        return PlayedOnce(success, rewards, scores, skipped, touching)


def _is_wrong(overlap: Overlap) -> bool:
    """Tell whether two parts should not be where they begin; robots stand on what they stand on."""
    robots = {overlap.one.robot, overlap.other.robot}
    if None not in robots:
        return len(robots) == 2
    return overlap.depth > INSIDE


def _start(starts: dict[int, list[Overlap]]) -> Outcome:
    wrong = {seed: found for seed, found in starts.items() if found}
    seed = next(iter(wrong), 0)
    words = f"seed {seed}: {max(wrong[seed], key=lambda o: o.depth)}" if wrong else "nothing"
    return Outcome("touches at the start", words, "nothing", not wrong)


def _solved(played: dict[int, PlayedOnce], seeds: range) -> Outcome:
    failed = [str(seed) for seed in seeds if seed not in played or not played[seed].success]
    count = len(seeds) - len(failed)
    words = f"{count} of {len(seeds)}" + (f", not {', '.join(failed)}" if failed else "")
    needed = f"at least {SOLVED:.0%}"
    return Outcome("expert solves", words, needed, count >= SOLVED * len(seeds))


def _touching(solved: dict[int, PlayedOnce]) -> Outcome:
    touched = {seed: played.touching for seed, played in solved.items() if played.touching}
    words = "; ".join(f"seed {seed}: {what}" for seed, what in [*touched.items()][:1]) or "none"
    return Outcome("arms that touch", words, "none", not touched)


def _stages(won: list[PlayedOnce], stages: dict[str, float]) -> Outcome:
    check, needed = "stages", f"all {len(stages)} in order, up to 1" if stages else "some"
    if not stages:
        return Outcome(check, "none are declared", needed, False)
    skipped = [played for played in won if played.skipped]
    falling = [played for played in won if np.diff([0.0, *played.scores]).min() < 0]
    short = [played for played in won if played.scores[-1] != 1.0]
    wrong = {"skipped": skipped, "falling": falling, "short of 1": short}
    words = ", ".join(f"{len(some)} {what}" for what, some in wrong.items() if some)
    return Outcome(check, words or f"in order in {len(won)}", needed, bool(won) and not words)


def _reward(won: list[PlayedOnce], *, dense: bool) -> Outcome:
    check, needed = "reward with time", f"rank correlation from {RISING}"
    if not dense or not won:
        return Outcome(check, "no dense reward" if won else "not seen", needed, False)
    rising = [rank_correlation(np.arange(len(p.rewards)), p.rewards) for p in won]
    found = f"median {median(rising):.2f}, least {min(rising):.2f}"
    return Outcome(check, found, needed, median(rising) >= RISING)


def rank_correlation(a: Any, b: Any) -> float:
    """Return how well two rows of numbers agree in their order, from -1 to 1; 0 if one is flat."""
    one, other = _ranks(np.asarray(a)), _ranks(np.asarray(b))
    if not one.std() or not other.std():
        return 0.0
    return float(np.corrcoef(one, other)[0, 1])


def _ranks(numbers: NDArray[Any]) -> Floats:
    """Return the rank of each number; equal ones share the mean of theirs."""
    _, places, counts = np.unique(numbers, return_inverse=True, return_counts=True)
    return (np.cumsum(counts) - (counts - 1) / 2)[places]


def check(task: str, *, seeds: Count = 20, first: Seed = 0, cell: CellOptions) -> int:
    """Check that the scores of a task prove what they say.

    Nothing touches at the start; the task's expert solves it, and no arms touch; its stages are
    passed in order, and the reward rises; random actions do not solve it, nor does a policy that
    does not look. Exit code: 0 if all of that is so, 1 if not, 2 for bad usage.

    Args:
        task: Task id or another of its names; MODULE:ID for one of your own.
        seeds: How many episodes to play.
        first: Seed of the first.
        cell: Its robots, and what varies.

    Raises:
        RobotLayoutsError: If the task cannot be made, or has no expert.
    """
    so_far = Progress(work=f"check of {task}")
    found = check_task(task, seeds, first=first, tell=so_far.tell, **cell.making())
    rows = [(one.check, one.found, one.needed, "yes" if one.passed else "NO") for one in found]
    print_table(("", "found", "needed", ""), rows)
    missing = [outcome.check for outcome in found if not outcome.passed]
    print(f"{task}: {'not yet: ' + ', '.join(missing) if missing else 'its scores are proofs'}")
    return 1 if missing else 0
