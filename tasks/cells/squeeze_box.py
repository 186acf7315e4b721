"""CellSqueezeBox: two tips lift a box by pressing from both sides; a third pushes a plinth in."""

from __future__ import annotations

from math import cos, pi, radians

from layouts import Layout, Placement
from tasks import (
    BLUE,
    RED,
    Area,
    CellTask,
    Cuboid,
    Friction,
    Needs,
    State,
    is_at_rest,
    register_task,
)
from tasks.maths import Array, Floats, maximum

BOX, PLINTH = (0.1, 0.07, 0.06), (0.05, 0.11, 0.025)  # half lengths (m)
AT, FREE = 0.16, 0.17  # of tips from the box's middle that are at it, and that have let go (m)
HIGH, ON, LEVEL = 0.06, 0.04, radians(8)  # of the box over the table, off the plinth (m), and rad
PRESSERS = ("west", "east")
RAISED = (0.0, 0.3, 0.0, -2.0, 0.0, 2.3, pi / 4, 0.04, 0.04)  # rad, m; tips begin over the box


@register_task("CellSqueezeBox-v1")
class CellSqueezeBox(CellTask):
    """Lift the box between two tips, push the plinth beneath it, and set it down on that.

    The box stands in the middle, up to 2 cm off along x and 3 cm along y, turned by up to 6°; the
    plinth lies before the pusher, x in [-0.1, 0.1], y in [-0.4, -0.34] (m), turned by up to 6°. The
    tips begin above the box.

    Success: the box rests on the plinth, within 4 cm of its middle, level to 8°, and both tips are
    17 cm from its middle.
    """

    instruction = (
        "Lift the box from both sides, push the plinth beneath it, and set it down.",
        "Squeeze the box between you and raise it until the plinth is under it, then lower it.",
        "Two hold the box up by its sides, one brings the plinth; the box belongs on top.",
    )
    layout = Layout(
        {
            "west": Placement("panda", (-0.7, 0.0, 0.0), qpos=RAISED),
            "east": Placement("franka_panda", (0.7, 0.0, 0.0), rpy=(0.0, 0.0, pi), qpos=RAISED),
            "pusher": Placement("ur10", (0.0, -1.1, 0.0), rpy=(0.0, 0.0, pi / 2)),
        }
    )
    needs = {"pusher": Needs(reach=1.05)}
    max_episode_steps = 300
    stages = {"are_both_at": 0.2, "is_lifted": 0.4, "is_plinth_under": 0.7, "success": 1.0}
    viewpoint = ((1.0, 1.1, 0.9), (0.0, 0.0, 0.1))

    box = Cuboid(
        BOX,
        RED,
        density=60.0,
        friction=Friction(1.0, 1.0),
        spawn=Area(x=(-0.02, 0.02), y=(-0.03, 0.03), yaw=(-0.1, 0.1)),
    )
    plinth = Cuboid(
        PLINTH,
        BLUE,
        density=300.0,
        spawn=Area(x=(-0.1, 0.1), y=(-0.4, -0.34), yaw=(-0.1, 0.1)),
    )

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: on it, level, at rest, let go."""
        tips = [state.tcp_distance(arm, "box") for arm in PRESSERS]
        beside = [abs(state.tcp_offset(arm, "box")[:, 2]) <= BOX[2] for arm in PRESSERS]
        at = [low & (tip <= AT) for low, tip in zip(beside, tips, strict=True)]
        height = state.position("box")[:, 2] - BOX[2]
        level = state.rotation("box")[:, 2, 2] >= cos(LEVEL)
        lifted, under = level & (height >= HIGH), state.planar_distance("box", "plinth") <= ON
        on = level & under & (abs(height - 2 * PLINTH[2]) <= 0.008)
        return {
            "are_both_at": self.count(at) >= 2,
            "is_lifted": lifted,
            "is_plinth_under": lifted & under,
            "success": on & is_at_rest(state, "box") & (self.count([t > FREE for t in tips]) >= 2),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the tips to the box, of that to its height, and of the plinth to it."""
        tips = [maximum(state.tcp_distance(arm, "box") - AT, 0.0) for arm in PRESSERS]
        height = abs(state.position("box")[:, 2] - BOX[2] - 2 * PLINTH[2])
        return [*tips, height, state.planar_distance("box", "plinth")]
