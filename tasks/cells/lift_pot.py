"""CellLiftPot: two arms lift a pot by its handles, with a ball in it."""

from __future__ import annotations

from math import cos, pi, radians

from layouts import face_to_face
from tasks import (
    BLUE,
    Ball,
    CellTask,
    EpisodeRandom,
    Needs,
    Object,
    State,
    World,
    register_task,
)
from tasks.maths import Array, Floats, maximum

HEIGHT, LEVEL, IN = 0.15, radians(8), 0.12  # m, rad, m
TURN = radians(15)


@register_task("CellLiftPot-v1")
class CellLiftPot(CellTask):
    """Lift the pot by its two handles, level, with the ball in it.

    The pot stands between the arms, up to 4 cm off along x and 2 cm along y, its handles turned by
    at most 15° from the way between them.

    Success: the pot is 15 cm high and level to 8°, both arms hold it and stand still, and the
    ball is in it.
    """

    instruction = (
        "Lift the pot by its two handles.",
        "Raise the pot together and keep it level.",
        "Take one handle each and lift the pot with the ball in it.",
    )
    layout = face_to_face({"left": "panda", "right": "panda_wristcam"}, spacing=1.4)
    needs = {"*": Needs(fingers=True, opening=0.03)}
    max_episode_steps = 150
    stages = {"is_one_holding": 0.25, "are_both_holding": 0.5, "is_high": 0.8, "success": 1.0}
    viewpoint = ((1.2, 0.3, 0.7), (0.0, 0.0, 0.1))

    pot = Object("pot_two_handles")
    ball = Ball(0.02, BLUE, density=300.0)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand the pot, and lay the ball into it."""
        x, y = rng.uniform_between([-0.04, -0.02], [0.04, 0.02]).tolist()
        world.set_pose("pot", (x, y, 0.0), rng.yaw_quaternion(pi / 2 - TURN, pi / 2 + TURN))
        world.set_pose("ball", (x, y, 0.03))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: high, level, held by both, which stand still, and the ball in it."""
        left, right = state.is_grasping("left", "pot"), state.is_grasping("right", "pot")
        high = left & right & (state.position("pot")[:, 2] >= HEIGHT)
        level = state.rotation("pot")[:, 2, 2] >= cos(LEVEL)
        still = state.is_static("left") & state.is_static("right")
        return {
            "is_one_holding": left | right,
            "are_both_holding": left & right,
            "is_high": high,
            "success": high & level & still & (state.distance("pot", "ball") <= IN),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of both hands to their handles, and of the pot upwards."""
        above = maximum(HEIGHT - state.position("pot")[:, 2], 0.0)
        points = self.pot.descriptor.points
        handles = {arm: points[f"{arm}_handle"].position for arm in self.arms}
        return [*(self.tip_distance(state, a, "pot", at) for a, at in handles.items()), above]
