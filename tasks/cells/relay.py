"""CellRelay: two tips push a block on by turns, around a corner, and a gripper packs it."""

from __future__ import annotations

from math import pi

from layouts import Layout, Placement
from tasks import (
    RED,
    Area,
    CellTask,
    Cube,
    Needs,
    Object,
    State,
    Target,
    register_task,
)
from tasks.maths import Array, Floats

HALF, RADIUS = 0.02, 0.1  # of block and marks (m)
LOW, HIGH = (-0.076, -0.056, 0.0), (0.076, 0.056, 0.07)  # of a block in the box, in its frame (m)


@register_task("CellRelay-v1")
class CellRelay(CellTask):
    """Push the block onto the corner, from there onto the end, and pack it into the box.

    The block lies before the first arm, x in [-0.4, -0.34], y in [-0.06, 0.06], turned at random;
    the corner is at x and y in [-0.02, 0.02], the end at x in [-0.04, 0.04], y in [0.26, 0.3]; the
    box stands beside the packer, x in [0.26, 0.3], y in [0.4, 0.44] (m). The block is at a mark
    within 10 cm of it.

    Success: the block is in the box, let go.
    """

    instruction = (
        "Push the block onto the first mark, then onto the second, and pack it into the box.",
        "Relay the block: the first pushes it to the corner, the second on, the third packs it.",
        "Pass the block on around the corner and put it into the box.",
    )
    layout = Layout(
        {
            "first": Placement("xarm7", (-0.75, 0.0, 0.0)),
            "second": Placement("ur10", (0.0, -0.8, 0.0), rpy=(0.0, 0.0, pi / 2)),
            "packer": Placement("panda", (0.0, 0.8, 0.0), rpy=(0.0, 0.0, -pi / 2)),
        }
    )
    needs = {"second": Needs(reach=1.1), "packer": Needs(fingers=True, opening=2 * HALF)}
    max_episode_steps = 400
    stages = {"is_at_corner": 0.3, "is_at_end": 0.6, "is_held": 0.8, "success": 1.0}
    viewpoint = ((1.2, 0.6, 1.1), (0.0, 0.0, 0.0))

    corner = Target(RADIUS, spawn=Area(x=(-0.02, 0.02), y=(-0.02, 0.02)))
    end = Target(RADIUS, spawn=Area(x=(-0.04, 0.04), y=(0.26, 0.3)))
    box = Object("box", kind="kinematic", spawn=Area(x=(0.26, 0.3), y=(0.4, 0.44)))
    block = Cube(HALF, RED, spawn=Area(x=(-0.4, -0.34), y=(-0.06, 0.06), yaw="any"))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: it is in the box, let go."""
        held = state.is_grasping("packer", "block")
        return {
            "is_at_corner": state.planar_distance("block", "corner") <= RADIUS,
            "is_at_end": state.planar_distance("block", "end") <= RADIUS,
            "is_held": held,
            "success": self.is_within(state, "block", "box", LOW, HIGH) & ~held,
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the block to the box, along x and along y."""
        way = abs(state.offset("block", "box"))
        return [way[:, 0], way[:, 1]]
