"""CellPutAndClose: a gripper puts a cube into an open drawer, an arm without one shuts it."""

from __future__ import annotations

from math import pi

from layouts import face_to_face
from tasks import BLUE, Area, CellTask, Cube, Needs, Object, State, register_task
from tasks.maths import Array, Floats

SHUT, ASIDE, LOW = 0.015, 0.11, 0.1  # m; of the drawer, of a cube in it, above the table


@register_task("CellPutAndClose-v1")
class CellPutAndClose(CellTask):
    """Put the cube into the drawer and close it.

    The drawer, open by 11 to 13 cm, stands at x in [0.18, 0.22], its front towards the closer; the
    cube lies before the packer, x in [-0.15, -0.05], y in [-0.3, -0.2] (m), turned at random.

    Success: the cube is in the drawer, let go, and the drawer is shut to 1.5 cm.
    """

    instruction = (
        "Put the cube into the drawer and close it.",
        "Lay the cube in the drawer, then push the drawer shut.",
        "Put the cube away and shut the drawer.",
    )
    layout = face_to_face({"packer": "panda", "closer": "xarm7"}, spacing=1.4)
    needs = {"packer": Needs(fingers=True, opening=0.04)}
    max_episode_steps = 300
    stages = {"is_held": 0.25, "is_inside": 0.6, "success": 1.0}
    viewpoint = ((1.2, 0.9, 0.9), (0.1, 0.0, 0.1))

    case = Object(
        "drawer",
        kind="kinematic",
        spawn=Area(x=(0.18, 0.22), y=-0.12, yaw=pi / 2),
        joints={"drawer": (0.11, 0.13)},
    )
    cube = Cube(0.02, BLUE, spawn=Area(x=(-0.15, -0.05), y=(-0.3, -0.2), yaw="any"))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: in it, let go, and shut."""
        held, low = state.is_grasping("packer", "cube"), state.position("cube")[:, 2] <= LOW
        inside = (state.planar_distance("case.drawer", "cube") <= ASIDE) & low & ~held
        shut = state.joint("case", "drawer") <= SHUT
        return {"is_held": held, "is_inside": inside, "success": inside & shut}

    def ways(self, state: State) -> list[Floats]:
        """Of the cube to the drawer, of the closer to it, and of the drawer."""
        return [
            state.planar_distance("case.drawer", "cube"),
            state.tcp_distance("closer", "case.drawer"),
            state.joint("case", "drawer"),
        ]
