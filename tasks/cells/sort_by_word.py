"""CellSortByWord: three arms lay their cubes on the pads that the instruction names."""

from __future__ import annotations

from itertools import product
from math import atan2, cos, pi, sin

from layouts import ring
from tasks import (
    BLUE,
    GREEN,
    RED,
    WHITE,
    CellTask,
    Cube,
    Cuboid,
    EpisodeRandom,
    Needs,
    State,
    World,
    register_task,
)
from tasks.maths import Array, Floats

HALF, PAD, THICK, OUT = 0.02, 0.07, 0.004, 0.375  # half edges, half a pad's height, its place (m)
CHOICES = tuple(product(("left", "right"), repeat=3))
RIGHT = tuple(tuple(float(side == "right") for side in choice) for choice in CHOICES)
PHRASES = (
    "Lay the red cube on the {} pad of its arm, the green one on the {}, the blue one on the {}.",
    "Red goes {}, green {} and blue {}.",
    "Each lay your cube on a pad beside you: red {}, green {}, blue {}.",
)


@register_task("CellSortByWord-v1")
class CellSortByWord(CellTask):
    """Lay each cube on the pad to the left or the right of its arm, as the instruction says.

    Each cube lies 28 to 36 cm from the middle before its arm, up to 8 cm aside, turned at random;
    between neighbours lies a pad. Which way cubes go is not observed.

    Success: every cube rests on its pad, let go.
    """

    instruction = tuple(words.format(*choice) for words in PHRASES for choice in CHOICES)
    layout = ring({"red": "panda_wristcam", "green": "franka_panda", "blue": "panda"}, radius=0.75)
    needs = {"*": Needs(fingers=True, opening=2 * HALF)}
    max_episode_steps = 250
    stages = {"is_one_there": 0.3, "are_two_there": 0.6, "success": 1.0}
    viewpoint = ((1.3, -0.75, 1.1), (0.0, 0.0, 0.0))

    pad_red, pad_green, pad_blue = (
        Cuboid((PAD, PAD, THICK), WHITE, kind="kinematic") for _ in range(3)
    )
    cube_red, cube_green, cube_blue = Cube(HALF, RED), Cube(HALF, GREEN), Cube(HALF, BLUE)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay a pad to the right of each arm, and its cube before it."""
        for arm in self.arms:
            x, y = self.before(arm, 1.0)
            ahead = atan2(y, x) + pi / 3
            world.set_pose(f"pad_{arm}", (OUT * cos(ahead), OUT * sin(ahead), THICK))
            self.lay_before(world, rng, arm, f"cube_{arm}", (0.28, -0.08), (0.36, 0.08))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: every cube on its pad, at rest and let go."""
        _, done = self.held_and_left(state, {arm: f"cube_{arm}" for arm in self.arms}, PAD)
        return self.passed(done, 1, 2, 3)

    def ways(self, state: State) -> list[Floats]:
        """Of the cubes to their pads."""
        told, ways = self.told(state, RIGHT), list[Floats]()
        for i, arm in enumerate(self.arms):
            to_right = state.planar_distance(f"cube_{arm}", f"pad_{arm}")
            to_left = state.planar_distance(f"cube_{arm}", f"pad_{self.arms[i - 1]}")
            ways.append(told[:, i] * to_right + (1.0 - told[:, i]) * to_left)
        return ways
