"""CellPutAway: one arm opens a drawer and holds it, the other puts a can in."""

from __future__ import annotations

from math import pi

from layouts import face_to_face
from tasks import Area, CellTask, Needs, Object, State, is_at_rest, register_task
from tasks.maths import Array, Floats, maximum

OPENED = 0.12  # of the drawer (m)
ASIDE, LOW = 0.1, 0.12  # of a can in the drawer, from its middle and above the table (m)


@register_task("CellPutAway-v1")
class CellPutAway(CellTask):
    """Open the drawer and put the can into it.

    The drawer stands at the side of the opener, x in [0.27, 0.31]; the can before both, x in
    [-0.1, 0], y in [0.2, 0.3] (m).

    Success: the drawer is open by 12 cm, and the can rests in it, let go.
    """

    instruction = (
        "Open the drawer and put the can into it.",
        "Put the can away in the drawer.",
        "Pull the drawer open, hold it, and lay the can inside.",
    )
    layout = face_to_face({"opener": "panda", "packer": "panda_wristcam"}, spacing=1.4)
    needs = {"*": Needs(fingers=True, opening=0.066)}
    max_episode_steps = 250
    stages = {
        "is_handle_held": 0.2,
        "is_open": 0.4,
        "is_can_held": 0.6,
        "is_inside": 0.8,
        "success": 1.0,
    }
    viewpoint = ((1.2, 0.9, 0.9), (0.1, 0.1, 0.1))

    case = Object("drawer", kind="kinematic", spawn=Area(x=(0.27, 0.31), y=0.2, yaw=-pi / 2))
    can = Object("can", spawn=Area(x=(-0.1, 0.0), y=(0.2, 0.3)))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: open, and the can in it, at rest and let go."""
        opened = state.joint("case", "drawer") >= OPENED
        held, low = state.is_grasping("packer", "can"), state.position("can")[:, 2] <= LOW
        inside = (state.planar_distance("case.drawer", "can") <= ASIDE) & low
        return {
            "is_handle_held": state.is_grasping("opener", "case.drawer"),
            "is_open": opened,
            "is_can_held": held,
            "is_inside": inside,
            "success": opened & inside & ~held & is_at_rest(state, "can"),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of both hands to their things, of the drawer, of the can to the drawer."""
        return [
            state.tcp_distance("opener", "case.drawer"),
            state.tcp_distance("packer", "can"),
            maximum(OPENED - state.joint("case", "drawer"), 0.0),
            state.planar_distance("case.drawer", "can"),
        ]
