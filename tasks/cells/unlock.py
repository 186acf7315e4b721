"""CellUnlock: one arm holds a bolt drawn, one throws the lever behind it, one presses a button."""

from __future__ import annotations

from math import pi

from layouts import Layout, Placement
from tasks import Area, CellTask, Object, State, register_task
from tasks.maths import Array, Floats, maximum

DRAWN, THROWN, PRESSED = 0.045, 0.6, 0.005  # of bolt, lever and cap: on from here (m, rad, m)
# By arm, what its tip works, and where in the frame of that (m)
PLACES = {
    "holder": ("lock.bolt", (0.112, 0.0, 0.12)),
    "thrower": ("lock.lever", (-0.04, 0.0, 0.15)),
    "presser": ("button", (0.0, 0.0, 0.052)),
}


@register_task("CellUnlock-v1")
class CellUnlock(CellTask):
    """Hold the bolt drawn, throw the lever that it locks, and press the button.

    The interlock stands between holder and thrower, its lever's x in [-0.11, -0.03], y in ±5 cm,
    turned by up to 20°; the button before the presser, x in ±14 cm, y in [-0.46, -0.34] (m). A
    spring pushes the bolt back, and the lever only turns while the bolt is drawn.

    Success: the button is pressed by 5 mm while the lever is thrown beyond 0.6 rad.
    """

    instruction = (
        "Hold the bolt drawn, throw the lever, then press the button.",
        "Unlock the lever by its bolt, throw it, and press the button.",
        "Bolt, lever, button: each counts once the one before it is on.",
    )
    layout = Layout(
        {
            "holder": Placement("panda_stick", (0.75, 0.0, 0.0), rpy=(0.0, 0.0, pi)),
            "thrower": Placement("xarm7", (-0.65, 0.0, 0.0)),
            "presser": Placement("ur10", (0.0, -0.8, 0.0), rpy=(0.0, 0.0, pi / 2)),
        }
    )
    max_episode_steps = 120
    stages = {"is_drawn": 0.4, "is_thrown": 0.7, "success": 1.0}
    viewpoint = ((0.7, -1.1, 0.8), (0.0, -0.1, 0.1))

    lock = Object(
        "interlock",
        kind="kinematic",
        spawn=Area(x=(-0.11, -0.03), y=(-0.05, 0.05), yaw=(-0.35, 0.35)),
    )
    button = Object("button", kind="kinematic", spawn=Area(x=(-0.14, 0.14), y=(-0.46, -0.34)))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: the lever is thrown, and the button pressed."""
        thrown = state.joint("lock", "lever") >= THROWN
        return {
            "is_drawn": state.joint("lock", "bolt") >= DRAWN,
            "is_thrown": thrown,
            "success": thrown & (state.joint("button", "cap") >= PRESSED),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the tips to what they work, and of bolt and lever until they are on."""
        tips = [self.tip_distance(state, arm, part, point) for arm, (part, point) in PLACES.items()]
        lever = 0.2 * maximum(THROWN - state.joint("lock", "lever"), 0.0)
        return [*tips, maximum(DRAWN - state.joint("lock", "bolt"), 0.0), lever]
