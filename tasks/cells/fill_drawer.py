"""CellFillDrawer: one arm opens a drawer, one fills it, and one without a gripper shuts it."""

from __future__ import annotations

from math import pi

from layouts import Layout, Placement
from tasks import BLUE, Area, CellTask, Cube, Needs, Object, State, register_task
from tasks.maths import Array, Floats

HALF, OPENED, SHUT = 0.02, 0.12, 0.015  # of the cube and of the drawer (m)
LOW, HIGH = (-0.12, -0.13, 0.0), (0.12, 0.13, 0.09)  # of a cube in the drawer, in its frame (m)
FINGERS = Needs(fingers=True, opening=2 * HALF)


@register_task("CellFillDrawer-v1")
class CellFillDrawer(CellTask):
    """Open the drawer, put the cube into it, and shut it again.

    The drawer stands before the opener, its front towards it, x in [-0.03, 0.03], y in [0.1, 0.14]
    (m); the cube lies before the filler, x in [0.34, 0.4], y in [-0.05, 0.05], turned at random.

    Success: the cube is in the drawer, let go, and the drawer is shut to 1.5 cm.
    """

    instruction = (
        "Open the drawer, put the cube into it, and shut it.",
        "One pulls the drawer open, one lays the cube in, one pushes it shut.",
        "Put the cube away in the drawer, which is shut before and after.",
    )
    layout = Layout(
        {
            "opener": Placement("panda", (0.0, -0.8, 0.0), rpy=(0.0, 0.0, pi / 2)),
            "filler": Placement("franka_panda", (0.8, 0.0, 0.0), rpy=(0.0, 0.0, pi)),
            "shutter": Placement("ur10", (-0.8, 0.0, 0.0)),
        }
    )
    needs = {"opener": FINGERS, "filler": FINGERS, "shutter": Needs(reach=0.95)}
    max_episode_steps = 250
    stages = {"is_open": 0.3, "is_inside": 0.7, "success": 1.0}
    viewpoint = ((1.2, -0.8, 1.1), (0.0, 0.0, 0.1))

    case = Object(
        "drawer", kind="kinematic", spawn=Area(x=(-0.03, 0.03), y=(0.1, 0.14), yaw=-pi / 2)
    )
    cube = Cube(HALF, BLUE, spawn=Area(x=(0.34, 0.4), y=(-0.05, 0.05), yaw="any"))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: in it, let go, and it is shut."""
        drawer, held = state.joint("case", "drawer"), state.is_grasping("filler", "cube")
        inside = self.is_within(state, "cube", "case.drawer", LOW, HIGH) & ~held
        return {
            "is_open": drawer >= OPENED,
            "is_inside": inside,
            "success": inside & (drawer <= SHUT),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the cube to the case, and of the opener and the shutter to the drawer."""
        tips = [state.tcp_distance(arm, "case.drawer") for arm in ("opener", "shutter")]
        return [state.planar_distance("cube", "case"), *tips]
