"""``python -m tasks bench``: what one step costs with one robot, two, and so on, in a ring."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle, islice
from time import perf_counter
from typing import ClassVar

import numpy as np
import torch
from rich import box
from rich.table import Table

from layouts import Layout, ring
from simulation import PhysicsSettings, State, World
from simulation.arrays import Array
from tasks.props import add_wide_table
from tasks.randomness import EpisodeRandom
from tasks.task import Info, MultiRobotTask

MOST_ROBOTS = 8
RADIUS = 1.0  # m; eight Pandas in their rest poses stay clear of each other
BLOCK = 50  # steps timed in one go, then it is the next number of robots' turn


@dataclass(frozen=True)
class StepCost:
    """What a step costs.

    Attributes:
        robots: Number of robots.
        step: Median over blocks of a whole step (µs).
        physics: Median over blocks of its physics alone (µs).
    """

    robots: int
    step: float
    physics: float


class Crowd(MultiRobotTask):
    """Robots in a ring on a table, with nothing to do, observed with their TCPs."""

    layout = ring({"robot0": "panda"}, radius=RADIUS)
    robot_counts: ClassVar[range | None] = range(1, MOST_ROBOTS + 1)
    physics = PhysicsSettings()
    max_episode_steps = BLOCK

    def build(self, world: World) -> None:
        """Add the table."""
        add_wide_table(world)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Place nothing."""

    def evaluate(self, state: State) -> dict[str, Array]:
        """Never succeed."""
        return {"success": np.zeros(self.num_envs, bool)}

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """Every TCP."""
        return {f"{robot}_tcp_pose": state.tcp_pose(robot) for robot in self.layout}


def crowd(count: int, kinds: Sequence[str]) -> Layout:
    """Return a ring of ``count`` robots of some kinds in turn."""
    robots = {f"robot{i}": kind for i, kind in enumerate(islice(cycle(kinds), count))}
    return ring(robots, radius=RADIUS)


def measure(counts: Sequence[int], kinds: Sequence[str], blocks: int) -> list[StepCost]:
    """Time random actions, one block of each number of robots after the other.

    Args:
        counts: Numbers of robots.
        kinds: Robots by name, in turn.
        blocks: Timed blocks of each.
    """
    scenario = Crowd.scenario
    scenario.check_layout = False
    envs: list[MultiRobotTask] = []
    for count in counts:
        scenario.layout = crowd(count, kinds)
        envs.append(Crowd(scenario))
    times = [(list[float](), list[float]()) for _ in counts]
    rng = np.random.RandomState(0)
    for block in range(blocks + 1):
        for env, (steps, physics) in zip(envs, times, strict=True):
            numbers = rng.uniform(-1, 1, (BLOCK, *env.action_space.shape)).astype(np.float32)
            step, alone = _time(env, numbers, block)
            if block > 0:  # the first one warms up
                steps.append(step)
                physics.append(alone)
    return [
        StepCost(count, statistics.median(steps), statistics.median(physics))
        for count, (steps, physics) in zip(counts, times, strict=True)
    ]


def _time(env: MultiRobotTask, numbers: np.ndarray, seed: int) -> tuple[float, float]:
    """Return the time of a step, and of the physics of the same motion alone (µs)."""
    actions = [torch.from_numpy(action) for action in numbers]
    env.reset(seed)
    start = perf_counter()
    for action in actions:
        env.step(action)
    step = perf_counter() - start
    env.reset(seed)
    physics = sum(env.simulation.timed_step(action) for action in numbers)
    return step / len(actions) * 1e6, physics / len(actions) * 1e6


def cost_table(costs: Sequence[StepCost]) -> Table:
    """Return one row per number of robots."""
    rows = Table(
        title="One step (µs, medians)",
        title_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
    )
    for column in ("robots", "step", "physics", "step per robot"):
        rows.add_column(column, justify="right", no_wrap=True)
    for cost in costs:
        numbers = (cost.step, cost.physics, cost.step / cost.robots)
        rows.add_row(str(cost.robots), *(f"{number:.0f}" for number in numbers))
    return rows
