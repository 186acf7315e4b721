"""CellMovePot: two arms carry a pot with a ball in it onto a mark, which a third has cleared."""

from __future__ import annotations

from math import radians

from layouts import around_table
from tasks import (
    BLUE,
    Area,
    Ball,
    CellTask,
    Cube,
    EpisodeRandom,
    Needs,
    Object,
    State,
    Target,
    World,
    is_at_rest,
    register_task,
)
from tasks.maths import Array, Floats

HALF, RADIUS, NEAR, IN = 0.025, 0.1, 0.03, 0.12  # of block, marks, pot off its mark, ball in it (m)
HIGH, LOW, TURN = 0.08, 0.01, radians(8)  # m, m, rad
LIFTERS = ("west", "east")


@register_task("CellMovePot-v1")
class CellMovePot(CellTask):
    """Push the block off the mark, carry the pot over without losing the ball, and set it down.

    The pot stands between its lifters, x in [-0.02, 0.02], y in [-0.2, -0.16] (m), turned by up to
    8°; the block lies on the mark, up to 2 cm off along x and y, turned at random.

    Success: the pot stands within 3 cm of the mark, let go, the ball in it, the block on the other.
    """

    instruction = (
        "Push the block off the mark and move the pot there, without spilling the ball.",
        "Make room, then carry the pot onto the mark by its two handles.",
        "Block to the back, pot to its mark, ball in the pot.",
    )
    layout = around_table(
        {"north": "panda_stick", "east": "franka_panda", "west": "panda_wristcam"},
        edges=("north", "east", "west"),
        table=(1.8, 1.7),
    )
    needs = {arm: Needs(fingers=True, opening=0.03) for arm in LIFTERS}
    max_episode_steps = 300
    stages = {"is_cleared": 0.3, "are_both_holding": 0.5, "is_high": 0.7, "success": 1.0}
    viewpoint = ((1.0, 1.1, 0.9), (0.0, 0.0, 0.1))

    mark = Target(NEAR + 0.03, spawn=Area(y=0.13))
    corner = Target(RADIUS, spawn=Area(y=0.36))
    pot = Object("pot_two_handles")
    ball = Ball(0.02, density=300.0)
    block = Cube(HALF, BLUE, spawn=Area(x=(-0.02, 0.02), y=(0.11, 0.15), yaw="any"))

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand the pot, and lay the ball into it."""
        super().sample(world, rng)
        x, y = rng.uniform_between([-0.02, -0.2], [0.02, -0.16]).tolist()
        world.set_pose("pot", (x, y, 0.0), rng.yaw_quaternion(-TURN, TURN))
        world.set_pose("ball", (x, y, 0.03))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: the pot on its mark, let go, the ball in it, and the block on the other."""
        held = self.count([state.is_grasping(arm, "pot") for arm in LIFTERS])
        cleared = (state.planar_distance("block", "corner") <= RADIUS) & is_at_rest(state, "block")
        height = state.position("pot")[:, 2]
        there = (state.planar_distance("pot", "mark") <= NEAR) & (height <= LOW)
        return {
            "is_cleared": cleared,
            "are_both_holding": held >= 2,
            "is_high": (held >= 2) & (height >= HIGH),
            "success": cleared & there & (held < 1) & (state.distance("pot", "ball") <= IN),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the block to its mark, of the hands to the pot, and of this to its mark."""
        hands = [state.tcp_distance(arm, "pot") for arm in LIFTERS]
        pairs = (("block", "corner"), ("pot", "mark"))
        return [*hands, *(state.planar_distance(*pair) for pair in pairs)]
