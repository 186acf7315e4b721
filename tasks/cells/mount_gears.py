"""CellMountGears: three arms put their gears on the shafts between them and their neighbours."""

from __future__ import annotations

from math import atan2, cos, pi, sin

from layouts import ring
from tasks import (
    CellTask,
    EpisodeRandom,
    Needs,
    Object,
    State,
    World,
    register_task,
)
from tasks.maths import Array, Floats, norm

OUT, OFF, TURN = 0.2, 0.02, 0.3  # of the shafts from the middle, at random (m), and turned (rad)
ON = 0.01  # of a gear from its seat (m)


@register_task("CellMountGears-v1")
class CellMountGears(CellTask):
    """Put each gear on the shaft to the right of its arm.

    Each gear lies 28 to 36 cm from the middle before its arm, up to 8 cm aside, turned at random;
    the shafts stand 20 cm from the middle between neighbours, up to 2 cm off along x and y.

    Success: every gear rests on the seat of its shaft, let go.
    """

    instruction = (
        "Put every gear on the shaft to the right of its arm.",
        "Mount the three gears on the three shafts, each arm to its right.",
        "Each take your gear and slide it down the shaft at your right.",
    )
    layout = ring(
        {"first": "panda_wristcam", "second": "franka_panda", "third": "panda"}, radius=0.75
    )
    needs = {"*": Needs(fingers=True, opening=0.04)}
    max_episode_steps = 250
    stages = {"is_one_held": 0.1, "is_one_on": 0.4, "are_two_on": 0.7, "success": 1.0}
    viewpoint = ((1.1, -0.65, 0.9), (0.0, 0.0, 0.0))

    shaft_first = shaft_second = shaft_third = Object("shaft", scale=0.8, kind="kinematic")
    gear_first = gear_second = gear_third = Object("gear")

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand a shaft to the right of each arm, and lay its gear before it."""
        for arm in self.arms:
            x, y = self.before(arm, 1.0)
            ahead = atan2(y, x) + pi / 3
            off_x, off_y = rng.uniform_between([-OFF, -OFF], [OFF, OFF]).tolist()
            place = (OUT * cos(ahead) + off_x, OUT * sin(ahead) + off_y, 0.0)
            world.set_pose(f"shaft_{arm}", place, rng.yaw_quaternion(-TURN, TURN))
            self.lay_before(world, rng, arm, f"gear_{arm}", (0.28, -0.08), (0.36, 0.08))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: every gear on its shaft, at rest and let go."""
        held, on = self.held_and_left(state, {a: f"gear_{a}" for a in self.arms}, ON)
        return {"is_one_held": held >= 1, **self.passed(on, 1, 2, 3)}

    def ways(self, state: State) -> list[Floats]:
        """Of the gears to their seats."""
        seat = state.array((self.shaft_first.descriptor.points["seat"].position,))
        return [
            norm(state.position(f"shaft_{arm}") + seat - state.position(f"gear_{arm}"))
            for arm in self.arms
        ]
