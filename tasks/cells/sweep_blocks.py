"""CellSweepBlocks: two arms sweep blocks together with brooms, two without fingers push theirs."""

from __future__ import annotations

from layouts import ring
from tasks import (
    BLUE,
    RED,
    Box,
    CellTask,
    Compound,
    Cube,
    EpisodeRandom,
    Needs,
    State,
    Target,
    World,
    is_at_rest,
    register_task,
)
from tasks.maths import Array, Floats

HALF, RADIUS = 0.02, 0.22  # of blocks and of the mark (m)
HEAD, STICK = (0.014, 0.1, 0.03), (0.014, 0.016, 0.05)  # of a broom, half lengths (m)
SWEEPERS, PUSHERS = ("south", "north"), ("east", "west")
SIDES = {"left": -0.05, "right": 0.05}  # about where a sweeper's blocks lie (m aside)
BLOCKS = tuple(f"{arm}_{side}" for arm in SWEEPERS for side in SIDES) + PUSHERS
BROOM = (
    Box(half_size=HEAD, density=400.0, color=BLUE),
    Box(half_size=STICK, position=(0.0, 0.0, HEAD[2] + STICK[2]), density=400.0, color=BLUE),
)


@register_task("CellSweepBlocks-v1")
class CellSweepBlocks(CellTask):
    """Bring all blocks onto the mark: two arms sweep theirs with brooms, two push theirs.

    A broom stands 44 to 46 cm from the middle before each sweeper, two blocks 31 to 36 cm, one 3 to
    7 cm to each side; a block before each pusher, 32 to 38 cm, up to 5 cm aside. All are turned.

    Success: all six are within 22 cm of the middle and at rest.
    """

    instruction = (
        "Sweep all blocks onto the mark in the middle.",
        "Take the brooms and sweep the blocks together; the others push theirs.",
        "Clear the table: every block onto the mark.",
    )
    layout = ring(
        {"south": "panda", "east": "ur10", "north": "franka_panda", "west": "panda_stick"},
        radius=0.85,
    )
    needs = {arm: Needs(fingers=True, opening=2 * STICK[0]) for arm in SWEEPERS}
    max_episode_steps = 250
    stages = {"is_broom_held": 0.1, "is_one_in": 0.3, "are_four_in": 0.7, "success": 1.0}
    viewpoint = ((1.2, 1.0, 1.0), (0.0, 0.0, 0.0))

    mark = Target(RADIUS)
    broom_south = broom_north = Compound(BROOM, HEAD[2])
    block_south_left = block_south_right = Cube(HALF, RED)
    block_north_left = block_north_right = Cube(HALF, RED)
    block_east = block_west = Cube(HALF, BLUE)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand a broom and lay two blocks before each sweeper, a block before each pusher."""
        world.set_pose("mark", (0.0, 0.0, self.mark.height), self.mark.lying)
        for arm in SWEEPERS:
            low, high = (0.44, -0.02), (0.46, 0.02)
            self.lay_before(world, rng, arm, f"broom_{arm}", low, high, (-0.1, 0.1))
            for side, at in SIDES.items():
                low, high = (0.31, at - 0.02), (0.36, at + 0.02)
                self.lay_before(world, rng, arm, f"block_{arm}_{side}", low, high)
        for arm in PUSHERS:
            self.lay_before(world, rng, arm, f"block_{arm}", (0.32, -0.05), (0.38, 0.05))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: all are on the mark, at rest."""
        held = self.count([state.is_grasping(arm, f"broom_{arm}") for arm in SWEEPERS])
        count = self.count([way <= RADIUS for way in self.ways(state)])
        rest = self.count([is_at_rest(state, f"block_{block}") for block in BLOCKS])
        return {
            "is_broom_held": held >= 1,
            "is_one_in": count >= 1,
            "are_four_in": count >= 4,
            "success": (count >= 6) & (rest >= 6),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the blocks to the middle."""
        return [state.planar_distance(f"block_{block}", "mark") for block in BLOCKS]
