"""CellTakeSides: four arms of different makes push their blocks to the sides they are told."""

from __future__ import annotations

from layouts import ring
from tasks import (
    BLUE,
    CellTask,
    Cube,
    EpisodeRandom,
    State,
    Target,
    World,
    is_at_rest,
    register_task,
)
from tasks.maths import Array, Floats, norm

PHRASES = (
    "Push the blocks, first to fourth, to these sides: {}, {}, {}, {}.",
    "Blocks to their marks: {}, {}, {} and {}.",
    "The first block goes {}, the second {}, the third {}, the fourth {}.",
)
L, R = "left", "right"
SIDES = ((L, R, R, L), (R, R, L, L), (R, L, R, R), (L, L, R, R), (R, L, L, R))
LEFT = tuple(tuple(float(side == L) for side in sides) for sides in SIDES)
HALF, RADIUS, OUT, ASIDE = 0.025, 0.09, 0.36, 0.14  # of blocks, and of marks (m)


@register_task("CellTakeSides-v1")
class CellTakeSides(CellTask):
    """Push every block onto the mark at the side that the instruction says, seen from its arm.

    The blocks lie 44 to 48 cm from the middle before their arms, up to 3 cm aside, turned at
    random; a mark lies to each side, 36 cm from the middle. The sides are not observed.

    Success: all are within 9 cm of the middles of their marks and at rest.
    """

    instruction = tuple(words.format(*sides) for words in PHRASES for sides in SIDES)
    layout = ring(
        {"first": "ur10", "second": "panda_stick", "third": "xarm7", "fourth": "panda"}, radius=0.9
    )
    max_episode_steps = 200
    stages = {"is_one_there": 0.3, "are_three_there": 0.7, "success": 1.0}
    viewpoint = ((1.2, 1.0, 1.0), (0.0, 0.0, 0.0))

    block_first = block_second = block_third = block_fourth = Cube(HALF, BLUE)
    left_first = left_second = left_third = left_fourth = Target(RADIUS)
    right_first = right_second = right_third = right_fourth = Target(RADIUS)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the marks down, and a block before each arm."""
        for arm in self.arms:
            for side, aside in ((L, ASIDE), (R, -ASIDE)):  # of the arm, which looks inwards
                at = (OUT, aside)
                self.lay_before(world, rng, arm, f"{side}_{arm}", at, at)
            self.lay_before(world, rng, arm, f"block_{arm}", (0.44, -0.03), (0.48, 0.03))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: all are on their marks, at rest."""
        ways = zip(self.arms, self.ways(state), strict=True)
        on = [(way <= RADIUS) & is_at_rest(state, f"block_{arm}") for arm, way in ways]
        count = self.count(on)
        return {"is_one_there": count >= 1, "are_three_there": count >= 3, "success": count >= 4}

    def ways(self, state: State) -> list[Floats]:
        """Of the blocks to their marks."""
        told, ways = self.told(state, LEFT), list[Floats]()
        for i, arm in enumerate(self.arms):
            left = told[:, i : i + 1]
            one, other = state.position(f"left_{arm}"), state.position(f"right_{arm}")
            mark = left * one + (1.0 - left) * other
            ways.append(norm((state.position(f"block_{arm}") - mark)[:, :2]))
        return ways
