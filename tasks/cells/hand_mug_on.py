"""CellHandMugOn: a mug is handed on over a spot, and stood on a trivet that a tip pushes near."""

from __future__ import annotations

from math import cos, pi, radians

from layouts import Layout, Placement
from tasks import (
    DARK_BLUE,
    Area,
    CellTask,
    Cuboid,
    Needs,
    Object,
    State,
    Target,
    is_at_rest,
    register_task,
)
from tasks.maths import Array, Floats

WIDE, THICK = 0.07, 0.015  # half the trivet's width and height (m)
RADIUS, ON, UPRIGHT = 0.07, 0.035, radians(5)  # of the marks, off the trivet's middle (m), and rad


@register_task("CellHandMugOn-v1")
class CellHandMugOn(CellTask):
    """Hand the mug on by the spot, and stand it on the trivet, which is pushed onto the mark.

    The mug stands before the giver, x in [-0.26, -0.14], y in [-0.42, -0.26], turned at random; the
    trivet lies before the pusher, x in [-0.06, 0.06], y in [0.58, 0.64], turned at random; the mark
    is at x in [0.08, 0.16], y in [0.4, 0.46] (m). The taker reaches the spot, but not the mug.

    Success: the mug stands on the trivet, upright to 5°, within 3.5 cm of its middle and let go,
    and the trivet lies within 7 cm of the mark.
    """

    instruction = (
        "Hand the mug on and stand it on the trivet, which is pushed onto the mark.",
        "One brings the mug to the spot, one stands it on the trivet, which the third pushes near.",
        "Pass the mug on, push the trivet onto its mark, and put the mug on it.",
    )
    layout = Layout(
        {
            "giver": Placement("panda", (-0.65, -0.25, 0.0)),
            "taker": Placement("franka_panda", (0.6, 0.2, 0.0), rpy=(0.0, 0.0, pi)),
            "pusher": Placement("ur10", (0.0, 1.2, 0.0), rpy=(0.0, 0.0, -pi / 2)),
        }
    )
    needs = {arm: Needs(fingers=True, opening=0.03) for arm in ("giver", "taker")}
    max_episode_steps = 300
    stages = {"is_taken": 0.2, "is_handed_on": 0.5, "is_near": 0.7, "success": 1.0}
    viewpoint = ((1.1, 1.0, 1.0), (0.0, 0.1, 0.0))

    spot = Target(RADIUS, spawn=Area(x=0.0, y=-0.04))
    mark = Target(RADIUS, spawn=Area(x=(0.08, 0.16), y=(0.4, 0.46)))
    trivet = Cuboid(
        (WIDE, WIDE, THICK),
        DARK_BLUE,
        density=600.0,
        spawn=Area(x=(-0.06, 0.06), y=(0.58, 0.64), yaw="any"),
    )
    mug = Object("mug", spawn=Area(x=(-0.26, -0.14), y=(-0.42, -0.26), yaw="any"))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: it stands on the trivet, let go, and that is on the mark."""
        given, taken = (state.is_grasping(arm, "mug") for arm in ("giver", "taker"))
        upright = state.rotation("mug")[:, 2, 2] >= cos(UPRIGHT)
        stands = upright & is_at_rest(state, "mug") & ~given & ~taken
        over = state.offset("trivet", "mug")[:, 2]
        on = stands & (state.planar_distance("mug", "trivet") <= ON) & (abs(over - THICK) <= 0.005)
        near = state.planar_distance("trivet", "mark") <= RADIUS
        return {
            "is_taken": given,
            "is_handed_on": stands & (state.planar_distance("mug", "spot") <= RADIUS),
            "is_near": near & taken,
            "success": near & on,
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the mug to the trivet and to the taker's hand, and of the trivet to its mark."""
        ways = (state.planar_distance(*pair) for pair in (("mug", "trivet"), ("trivet", "mark")))
        return [state.tcp_distance("taker", "mug"), *ways]
