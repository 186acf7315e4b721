"""CellGatherBlocks: four arms of different makes push their blocks into the middle."""

from __future__ import annotations

from layouts import ring
from tasks import (
    BLUE,
    GREEN,
    RED,
    WHITE,
    CellTask,
    Cube,
    EpisodeRandom,
    State,
    Target,
    World,
    is_at_rest,
    register_task,
)
from tasks.maths import Array, Floats

HALF, RADIUS = 0.025, 0.2  # of blocks and of the mark (m)
AREA = ([0.32, -0.06], [0.38, 0.06])  # from the middle towards an arm, and aside (m)
SIDES = {"south": (0.0, -1.0), "east": (1.0, 0.0), "north": (0.0, 1.0), "west": (-1.0, 0.0)}


@register_task("CellGatherBlocks-v1")
class CellGatherBlocks(CellTask):
    """Push all blocks onto the mark in the middle, each arm the one before it.

    The blocks lie 32 to 38 cm from the middle, up to 6 cm aside, turned at random.

    Success: all four are within 20 cm of the middle and at rest.
    """

    instruction = (
        "Push all blocks onto the mark in the middle.",
        "Gather the four blocks on the mark.",
        "Each push the block before you to the middle.",
    )
    layout = ring(
        {"south": "xarm7", "east": "panda_stick", "north": "panda", "west": "panda_stick"},
        radius=0.9,
    )
    max_episode_steps = 300
    stages = {"is_one_in": 0.25, "are_two_in": 0.5, "are_three_in": 0.75, "success": 1.0}
    viewpoint = ((1.2, 1.0, 1.0), (0.0, 0.0, 0.0))

    mark = Target(RADIUS)
    block_south, block_east = Cube(HALF, RED), Cube(HALF, GREEN)
    block_north, block_west = Cube(HALF, BLUE), Cube(HALF, WHITE)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay a block before each arm."""
        world.set_pose("mark", (0.0, 0.0, self.mark.height), self.mark.lying)
        for arm, (x, y) in SIDES.items():
            out, aside = rng.uniform_between(*AREA).tolist()
            place = (out * x - aside * y, out * y + aside * x, HALF)
            world.set_pose(f"block_{arm}", place, rng.yaw_quaternion())

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: all are on the mark, at rest."""
        blocks = [f"block_{arm}" for arm in SIDES]
        count = self.count([state.planar_distance(b, "mark") <= RADIUS for b in blocks])
        rests = self.count([is_at_rest(state, block) for block in blocks])
        return {
            "is_one_in": count >= 1,
            "are_two_in": count >= 2,
            "are_three_in": count >= 3,
            "success": (count >= 4) & (rests >= 4),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the blocks to the middle."""
        return [state.planar_distance(f"block_{arm}", "mark") for arm in SIDES]
