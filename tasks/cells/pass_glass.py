"""CellPassGlass: a cup with two balls in it is passed on over a spot, served, and rung for."""

from __future__ import annotations

from math import cos, pi, radians

from layouts import Layout, Placement
from tasks import (
    BLUE,
    Area,
    Ball,
    CellTask,
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

RADIUS, NEAR, UPRIGHT, PRESSED = 0.011, 0.05, radians(5), 0.005  # m, m, rad, m
LOW, HIGH = (-0.036, -0.036, 0.0), (0.036, 0.036, 0.1)  # of a ball in the cup, in its frame (m)
BALLS = {"ball_one": -0.0115, "ball_two": 0.0115}  # where they begin, along x from the cup (m)


@register_task("CellPassGlass-v1")
class CellPassGlass(CellTask):
    """Pass the cup on by the spot without losing a ball, stand it on the mark, and ring.

    The cup, with two balls in it, stands before the giver, x in [-0.26, -0.14], y in
    [-0.42, -0.26], the bell before the ringer, x in [-0.16, -0.04], y in [0.52, 0.6]; the mark is
    at x in [0.1, 0.18], y in [0.34, 0.42] (m). The taker reaches the spot, but not the cup.

    Success: the cup stands on the mark, upright to 5°, within 5 cm and let go, both balls are in
    it, and the bell is pressed by 5 mm.
    """

    instruction = (
        "Pass the full cup on to the mark without losing a ball, then ring.",
        "One brings the cup to the spot, one stands it on the mark, one rings; spill nothing.",
        "Serve the cup with both balls in it, by way of the spot, and ring the bell.",
    )
    layout = Layout(
        {
            "giver": Placement("panda_wristcam", (-0.65, -0.25, 0.0)),
            "taker": Placement("franka_panda", (0.6, 0.2, 0.0), rpy=(0.0, 0.0, pi)),
            "ringer": Placement("xarm7", (-0.1, 1.05, 0.0), rpy=(0.0, 0.0, -pi / 2)),
        }
    )
    needs = {arm: Needs(fingers=True, opening=0.03) for arm in ("giver", "taker")}
    max_episode_steps = 300
    stages = {"is_taken": 0.2, "is_passed": 0.5, "is_served": 0.8, "success": 1.0}
    viewpoint = ((1.1, 1.0, 1.0), (0.0, 0.1, 0.0))

    spot = Target(NEAR, spawn=Area(x=0.0, y=-0.04))
    mark = Target(NEAR, spawn=Area(x=(0.1, 0.18), y=(0.34, 0.42)))
    cup = Object("cup")
    ball_one, ball_two = Ball(RADIUS, BLUE), Ball(RADIUS, BLUE)
    bell = Object("button", kind="kinematic", spawn=Area(x=(-0.16, -0.04), y=(0.52, 0.6)))

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand the cup before the giver, and put the balls into it."""
        super().sample(world, rng)
        x, y = rng.uniform_between([-0.26, -0.42], [-0.14, -0.26]).tolist()
        world.set_pose("cup", (x, y, 0.0))
        for ball, off in BALLS.items():
            world.set_pose(ball, (x + off, y, RADIUS + 0.005))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: served, with all that was in it, and rung."""
        given, taken = (state.is_grasping(arm, "cup") for arm in ("giver", "taker"))
        full = self.count([self.is_within(state, b, "cup", LOW, HIGH) for b in BALLS]) >= 2
        upright = state.rotation("cup")[:, 2, 2] >= cos(UPRIGHT)
        stands = full & upright & is_at_rest(state, "cup") & ~given & ~taken
        spot, mark = (state.planar_distance("cup", place) <= NEAR for place in ("spot", "mark"))
        return {
            "is_taken": given & full,
            "is_passed": stands & spot,
            "is_served": stands & mark,
            "success": stands & mark & (state.joint("bell", "cap") >= PRESSED),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the cup to the mark and to the taker's hand, and of the ringer's tip to the bell."""
        hands = [state.tcp_distance(*pair) for pair in (("taker", "cup"), ("ringer", "bell"))]
        return [state.planar_distance("cup", "mark"), *hands]
