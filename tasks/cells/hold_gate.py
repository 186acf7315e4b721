"""CellHoldGate: one arm holds a sprung gate open, and two hand a bar through."""

from __future__ import annotations

from math import pi

from layouts import Layout, Placement
from tasks import (
    GREEN,
    Area,
    CellTask,
    Cuboid,
    Needs,
    Object,
    State,
    Target,
    inverse,
    is_at_rest,
    register_task,
    transform,
)
from tasks.maths import Array, Floats, maximum

LONG, THICK, RADIUS = 0.19, 0.02, 0.06  # half the bar's length and width, and of the mark (m)
OPENED, SHUT, THROUGH = 1.1, 0.1, -0.2  # of the leaf (rad), and of a bar behind the gate (m)
FINGERS = Needs(fingers=True, opening=2 * THICK)


@register_task("CellHoldGate-v1")
class CellHoldGate(CellTask):
    """Hand the bar through the gate, which a spring shuts, and lay it on the mark behind it.

    The gate stands in the middle, up to 2 cm off along x and 1 cm along y, turned by up to 3°. The
    bar lies before it, x in [0.33, 0.39], y in [0.2, 0.26], turned by up to 11°; the mark lies
    behind it, x in [-0.44, -0.34], y in [-0.2, 0.1] (m).

    Success: the bar rests with its middle within 6 cm of the mark's, let go, and the gate is shut
    to 6°.
    """

    instruction = (
        "Hold the gate open, hand the bar through, and lay it on the mark behind.",
        "One opens the gate and holds it while one hands the bar through it to another.",
        "Bring the bar to the mark on the other side, and let the gate shut behind it.",
    )
    layout = Layout(
        {
            "porter": Placement("panda", (0.56, -0.46, 0.0), rpy=(0.0, 0.0, pi / 2 + 0.5)),
            "giver": Placement("panda_wristcam", (0.5, 0.55, 0.0), rpy=(0.0, 0.0, -0.4)),
            "taker": Placement("franka_panda", (-0.85, 0.0, 0.0)),
        }
    )
    needs = {"*": FINGERS}
    max_episode_steps = 450
    stages = {"is_open": 0.3, "is_handed": 0.5, "is_through": 0.7, "success": 1.0}
    viewpoint = ((0.3, 1.4, 1.0), (0.0, 0.0, 0.1))

    gate = Object(
        "gate",
        kind="kinematic",
        scale=1.15,
        spawn=Area(x=(-0.02, 0.0), y=(-0.01, 0.01), yaw=(-0.05, 0.05)),
    )
    bar = Cuboid(
        (LONG, THICK, THICK),
        GREEN,
        density=300.0,
        spawn=Area(x=(0.33, 0.39), y=(0.2, 0.26), yaw=(-0.2, 0.2)),
    )
    mark = Target(RADIUS, spawn=Area(x=(-0.44, -0.34), y=(-0.2, 0.1)))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: the bar is there, let go, and the gate is shut."""
        leaf = state.joint("gate", "leaf")
        given, taken = (state.is_grasping(arm, "bar") for arm in ("giver", "taker"))
        there = (state.planar_distance("bar", "mark") <= RADIUS) & is_at_rest(state, "bar")
        return {
            "is_open": leaf >= OPENED,
            "is_handed": taken & ~given,
            "is_through": self._before(state) <= THROUGH,
            "success": there & ~given & ~taken & (leaf <= SHUT),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the bar through the gate, and to its mark."""
        far = maximum(self._before(state) - THROUGH, 0.0)
        return [far, state.planar_distance("bar", "mark")]

    def _before(self, state: State) -> Floats:
        """How far the bar's middle is before the gate, (N,) (m)."""
        return transform(inverse(state.pose("gate")), state.position("bar"))[:, 0]
