"""Worlds for benchmarks: any number of robots in a ring, any number of cubes that touch."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle, islice
from typing import ClassVar

import numpy as np

from layouts import Layout, ring, single
from robot_layouts.simulation import PhysicsSettings, State, World, add_table
from robot_layouts.simulation.maths import Array
from tasks import EpisodeRandom, MultiRobotTask, TaskEnv
from tasks.engine.task import Info
from tasks.language.props import BLUE, add_cube, add_wide_table

MOST_ROBOTS = 8
RADIUS = 1.0  # m; eight Pandas in their rest poses stay clear of each other

HALF_SIZE = 0.02  # of a cube (m)
CORNER = (0.3, -0.06)  # of the pile (m); out of the arm's reach
WIDTH, DEPTH = 4, 4  # cubes of a full layer of the pile


class _NothingToDo(MultiRobotTask):
    """Never succeeds."""

    max_episode_steps = 100

    def evaluate(self, state: State) -> dict[str, Array]:
        """Never succeed."""
        return {"success": np.zeros(self.num_envs, bool)}


class Crowd(_NothingToDo):
    """Robots in a ring on a table, observed with their TCPs."""

    layout = ring({"robot0": "panda"}, radius=RADIUS)
    robot_counts: ClassVar[range | None] = range(1, MOST_ROBOTS + 1)
    physics = PhysicsSettings()

    def build(self, world: World) -> None:
        """Add the table."""
        add_wide_table(world)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Place nothing."""

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """Every TCP."""
        return {f"{robot}_tcp_pose": state.tcp_pose(robot) for robot in self.layout}


class Pile(_NothingToDo):
    """A Panda, a cube that it could grasp, and a pile of cubes that touch and never sleep."""

    layout = single({"arm": "panda"})
    physics = PhysicsSettings(sleep_threshold=0.0)
    cubes: ClassVar[int] = 0

    def build(self, world: World) -> None:
        """Add the table, the cube and the pile."""
        add_table(world)
        add_cube(world, "cube", HALF_SIZE, (0.0, 0.0, HALF_SIZE))
        for i, position in enumerate(pile(self.cubes)):
            add_cube(world, f"pile{i}", HALF_SIZE, position, BLUE)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Put every cube to its place."""
        world.set_pose("cube", (0.0, 0.0, HALF_SIZE))
        for i, position in enumerate(pile(self.cubes)):
            world.set_pose(f"pile{i}", position)

    def evaluate(self, state: State) -> dict[str, Array]:
        """Look for a grasp, as most tasks do."""
        return {**super().evaluate(state), "is_grasped": state.is_grasping("arm", "cube")}

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCP and cubes."""
        cubes = ("cube", *(f"pile{i}" for i in range(self.cubes)))
        return {
            "tcp_pose": state.tcp_pose("arm"),
            **{f"{name}_pose": state.pose(name) for name in cubes},
        }

    def touching(self) -> int:
        """Return how many pairs of bodies touch or are about to, in the first environment."""
        return int(self.simulation.backend.contact_counts()[0])


def crowd(count: int, kinds: Sequence[str]) -> Layout:
    """Return a ring of ``count`` robots of some kinds in turn."""
    robots = {f"robot{i}": kind for i, kind in enumerate(islice(cycle(kinds), count))}
    return ring(robots, radius=RADIUS)


def make_crowd(count: int, kinds: Sequence[str]) -> TaskEnv:
    """Make a ring of robots; it is not checked for collisions."""
    scenario = Crowd.scenario
    scenario.layout, scenario.check_layout = crowd(count, kinds), False
    return Crowd(scenario)


def make_pile(cubes: int) -> TaskEnv:
    """Make a pile of ``cubes`` cubes."""
    cls: type[Pile] = type("Pile", (Pile,), {"cubes": cubes, "__doc__": Pile.__doc__})
    return cls(cls.scenario)


def pile(cubes: int) -> list[tuple[float, float, float]]:
    """Return where the cubes of a pile are (m): layer on layer, side by side."""
    edge, (x, y) = 2 * HALF_SIZE, CORNER
    return [
        (
            x + edge * (i % DEPTH),
            y + edge * (i // DEPTH % WIDTH),
            HALF_SIZE + edge * (i // (DEPTH * WIDTH)),
        )
        for i in range(cubes)
    ]
