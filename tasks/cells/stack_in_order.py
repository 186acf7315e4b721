"""CellStackInOrder: three arms of three makes build a tower in the order that is asked for."""

from __future__ import annotations

from itertools import permutations
from typing import Any

from layouts import ring
from tasks import (
    BLUE,
    GREEN,
    RED,
    CellTask,
    Cube,
    EpisodeRandom,
    Needs,
    State,
    Target,
    World,
    register_task,
)
from tasks.maths import Array, Floats, norm

HALF, NEAR = 0.02, 0.025  # of cubes, and of a cube from its place in the tower (m)
SLOW = 0.03  # of cubes that rest (m/s); in a tower they tremble at half of that
COLOURS = ("red", "green", "blue")
ORDERS = tuple(permutations(COLOURS))  # from the bottom up
HEIGHTS = {arm: tuple(HALF * (2 * o.index(arm) + 1) for o in ORDERS) for arm in COLOURS}
PHRASES = (
    "Stack the cubes: {} at the bottom, then {}, {} on top.",
    "Build a tower on the mark, from the bottom up {}, {} and {}.",
    "First {}, {} upon it, and {} last.",
)


@register_task("CellStackInOrder-v1")
class CellStackInOrder(CellTask):
    """Stack the three cubes on the mark in the order that the instruction names.

    The mark is up to 4 cm off the middle along x and y; each cube lies 25 to 32 cm from the middle
    before its arm, up to 8 cm aside, turned at random. The order is not observed.

    Success: every cube rests within 2.5 cm of its place in the tower, let go.
    """

    instruction = tuple(words.format(*order) for words in PHRASES for order in ORDERS)
    layout = ring({"red": "panda", "green": "panda_wristcam", "blue": "franka_panda"}, radius=0.75)
    needs = {"*": Needs(fingers=True, opening=2 * HALF)}
    max_episode_steps = 300
    stages = {"is_one_held": 0.1, "is_one_placed": 0.4, "are_two_placed": 0.7, "success": 1.0}
    viewpoint = ((1.2, -0.7, 0.9), (0.0, 0.0, 0.05))

    mark = Target(0.06)
    cube_red, cube_green, cube_blue = Cube(HALF, RED), Cube(HALF, GREEN), Cube(HALF, BLUE)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the mark down, and a cube before each arm."""
        x, y = rng.uniform_between([-0.04, -0.04], [0.04, 0.04]).tolist()
        world.set_pose("mark", (x, y, self.mark.height), self.mark.lying)
        for arm in self.arms:
            self.lay_before(world, rng, arm, f"cube_{arm}", (0.25, -0.08), (0.32, 0.08))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: all are in their places, at rest and let go."""
        held = [state.is_grasping(arm, f"cube_{arm}") for arm in self.arms]
        slow = [state.speed(f"cube_{arm}") <= SLOW / state.scale for arm in self.arms]
        near = [way <= NEAR for way in self.ways(state)]
        placed = self.count([n & s & ~h for n, s, h in zip(near, slow, held, strict=True)])
        return {"is_one_held": self.count(held) >= 1, **self.passed(placed, 1, 2, 3)}

    def ways(self, state: State) -> list[Floats]:
        """Of the cubes to their places in the tower."""
        mark = state.position("mark")
        up: Any = state.array((0.0, 0.0, 1.0))
        ways = list[Floats]()
        for arm in self.arms:
            height = self.told(state, HEIGHTS[arm])[:, None]
            ways.append(norm(mark + height * up - state.position(f"cube_{arm}")))
        return ways
