"""Compares simulators: the same episodes and actions in both, how far they drift apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.cli import Count, Seed
from robot_layouts.core.commands import print_table, printable
from robot_layouts.core.progress import Progress
from robot_layouts.experts import find_expert
from robot_layouts.simulation.backend import CLONING, SIMULATORS
from robots import TaskError
from tasks import TaskEnv, make
from tasks.cell_options import RecordedCell, Simulator
from tasks.engine import outcome
from tasks.episode import REBUILT

SEEN = 1e-3  # m; what is less far apart counts as at the same place


@dataclass(frozen=True)
class Compared:
    """The same actions of an episode in several simulators.

    Attributes:
        seed: Seed of the episode.
        steps: Its control steps.
        solved: Whether it was solved at some step, by simulator.
        apart: How far the body or tool centre point that drifted farthest was apart (m).
        what: That body or arm.
        since: First step after which anything was 1 mm apart, or None.
    """

    seed: int
    steps: int
    solved: Mapping[str, bool]
    apart: float
    what: str
    since: int | None


def compare(envs: Mapping[str, TaskEnv], seed: int, actions: NDArray[np.float32]) -> Compared:
    """Play the same actions in the same task in two simulators, step by step.

    Args:
        envs: The task by simulator, each of one environment.
        seed: Seed of the episode.
        actions: What to do, (T, A).
    """
    solved = dict.fromkeys(envs, False)
    for env in envs.values():
        env.reset(seed, options=REBUILT)
    apart, what, since = 0.0, "", None
    for step, action in enumerate(actions, 1):
        places = list[dict[str, NDArray[np.float32]]]()
        for name, env in envs.items():
            info = env.step(action[None])[-1]
            solved[name] |= bool(outcome.solved(info)[0])
            places.append(_places(env))
        first, second = places
        ways = {name: float(np.linalg.norm(first[name] - second[name])) for name in first}
        farthest = max(ways, key=ways.__getitem__)
        if ways[farthest] > SEEN and since is None:
            since = step
        if ways[farthest] > apart:
            apart, what = ways[farthest], farthest
    return Compared(seed, len(actions), solved, apart, what, since)


def _places(env: TaskEnv) -> dict[str, NDArray[np.float32]]:
    """Return where bodies and tool centre points are, each (3,) (m)."""
    state, layout = env.simulation.read(), env.layout
    bodies = {name: state.position(name)[0] for name in env.simulation.worlds[0].bodies}
    return {**bodies, **{arm: state.tcp_position(arm)[0] for arm in layout.arms}}


def compare_command(
    task: str,
    *,
    episodes: Count = 10,
    seed: Seed = 0,
    planned_in: Simulator = CLONING,
    random: bool = False,
    cell: RecordedCell,
) -> int:
    """Play the same actions in both simulators, and say how far they drift apart.

    The actions are those of the task's expert, planned in one of them. An episode ends with its
    actions. Exit code: 0 if both were tried, 2 for bad usage.

    Args:
        task: Task id; MODULE:ID for one of your own.
        episodes: Number of episodes.
        seed: Seeds S … S + N - 1.
        planned_in: Simulator in which the expert plans.
        random: Act at random instead.
        cell: The task's robots.

    Raises:
        RobotLayoutsError: If the task cannot be made, or has no expert.
    """
    making: dict[str, Any] = {"obs_mode": "none", **cell.making()}
    envs = {name: make(task, simulator=name, **making) for name in SIMULATORS}
    found, line = list[Compared](), Progress(episodes, "episodes")
    with line:
        for number in range(seed, seed + episodes):
            planner = envs[planned_in]
            actions = _at_random(planner, number) if random else _planned(planner, task, number)
            if actions is not None:
                found.append(compare(envs, number, actions))
            line.update(number - seed + 1, "comparing")
    for env in envs.values():
        env.close()
    heads = ("seed", "steps", *SIMULATORS, "farthest apart", "", "1 mm after")
    print_table(heads, map(_row, found))
    for name in SIMULATORS:
        print(printable(f"{name}: {sum(c.solved[name] for c in found)} of {len(found)} solved"))
    return 0


def _planned(env: TaskEnv, task: str, seed: int) -> NDArray[np.float32] | None:
    try:
        return np.asarray(find_expert(task)(env, seed))
    except TaskError as error:
        print(printable(f"seed {seed}: {error}"))
        return None


def _at_random(env: TaskEnv, seed: int) -> NDArray[np.float32]:
    space, steps = env.single_action_space, env.max_episode_steps
    random = np.random.default_rng(seed)
    return random.uniform(space.low, space.high, (steps, *space.shape)).astype(np.float32)


def _row(compared: Compared) -> tuple[str, ...]:
    after = "never" if compared.since is None else f"step {compared.since}"
    solved = ["yes" if compared.solved[name] else "no" for name in SIMULATORS]
    apart = f"{compared.apart * 1e3:.1f} mm"
    return str(compared.seed), str(compared.steps), *solved, apart, compared.what, after
