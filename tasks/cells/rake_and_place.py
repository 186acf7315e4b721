"""CellRakeAndPlace: one arm pulls two blocks near with a rake, two others put them into boxes."""

from __future__ import annotations

from math import pi

from layouts import Layout, Placement
from tasks import (
    BLUE,
    GREEN,
    RED,
    WHITE,
    Area,
    Box,
    CellTask,
    Compound,
    Cube,
    Cuboid,
    Needs,
    Object,
    State,
    register_task,
)
from tasks.maths import Array, Floats, maximum

HALF, LONG, HIGH_UP = 0.02, 0.5, 0.07  # of blocks, of the rake from its grip on, where that is (m)
GRIP, SHAFT, HEAD = (0.07, 0.012, 0.045), (LONG / 2, 0.012, 0.01), (0.01, 0.14, 0.035)  # half (m)
NEAR = 0.1  # y of blocks that placers reach (m)
LOW, HIGH = (-0.08, -0.06, 0.0), (0.08, 0.06, 0.06)  # of a block in a box, in its frame (m)
PLACERS = ("left", "right")
RAKE = (
    Box(half_size=GRIP, position=(-0.05, 0.0, GRIP[2]), density=900.0, color=GREEN),
    Box(half_size=SHAFT, position=(LONG / 2, 0.0, 0.06), density=100.0, color=GREEN),
    Box(half_size=HEAD, position=(LONG, 0.0, HEAD[2]), density=100.0, color=GREEN),
)


@register_task("CellRakeAndPlace-v1")
class CellRakeAndPlace(CellTask):
    """Pull the two blocks near with the rake, and put each into the box of its side.

    The blocks lie on a ledge out of reach, x in ±[0.05, 0.1], y in [0.29, 0.34], turned at random;
    the rake before the puller, x in [-0.02, 0.02], y in [-0.43, -0.41], pointing at them to 4°; the
    boxes x in ±[0.3, 0.4], y in [-0.56, -0.46] (m).

    Success: both blocks are in their boxes, let go.
    """

    instruction = (
        "Pull the blocks near with the rake and put each into the box of its side.",
        "One rakes the two far blocks in, the others put them into their boxes.",
        "Use the rake: the red block belongs in the left box, the blue one in the right.",
    )
    layout = Layout(
        {
            "puller": Placement("panda", (0.0, -0.75, 0.0), rpy=(0.0, 0.0, pi / 2)),
            "right": Placement("franka_panda", (0.62, -0.3, 0.0), rpy=(0.0, 0.0, 2 * pi / 3)),
            "left": Placement("panda_wristcam", (-0.62, -0.3, 0.0), rpy=(0.0, 0.0, pi / 3)),
        }
    )
    needs = {"*": Needs(fingers=True, opening=2 * HALF)}
    max_episode_steps = 400
    stages = {"is_rake_held": 0.1, "are_near": 0.4, "is_one_in": 0.7, "success": 1.0}
    viewpoint = ((1.2, 0.5, 1.0), (0.0, -0.1, 0.0))

    ledge = Cuboid((0.25, 0.22, 0.02), WHITE, kind="static", start=(0.0, 0.22, -0.02))
    rake = Compound(
        RAKE, spawn=Area(x=(-0.02, 0.02), y=(-0.43, -0.41), yaw=(pi / 2 - 0.07, pi / 2 + 0.07))
    )
    block_left = Cube(HALF, RED, spawn=Area(x=(-0.1, -0.05), y=(0.29, 0.34), yaw="any"))
    block_right = Cube(HALF, BLUE, spawn=Area(x=(0.05, 0.1), y=(0.29, 0.34), yaw="any"))
    box_left = Object("box", spawn=Area(x=(-0.4, -0.3), y=(-0.56, -0.46)))
    box_right = Object("box", spawn=Area(x=(0.3, 0.4), y=(-0.56, -0.46)))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: both are in, let go."""
        near = [state.position(f"block_{arm}")[:, 1] <= NEAR for arm in PLACERS]
        inside = self.count(
            self.is_left_in(state, arm, f"block_{arm}", f"box_{arm}", LOW, HIGH) for arm in PLACERS
        )
        return {
            "is_rake_held": state.is_grasping("puller", "rake"),
            "are_near": self.count(near) >= 2,
            "is_one_in": inside >= 1,
            "success": inside >= 2,
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the blocks out of the far reach, and to their boxes."""
        far = [maximum(state.position(f"block_{arm}")[:, 1] - NEAR, 0.0) for arm in PLACERS]
        left = [state.planar_distance(f"block_{arm}", f"box_{arm}") for arm in PLACERS]
        return [*far, *left]
