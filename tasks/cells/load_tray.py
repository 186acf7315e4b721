"""CellLoadTray: two arms hold a tray up, level, and a third lays a cube on it."""

from __future__ import annotations

from math import cos, radians

from layouts import around_table
from tasks import GREEN, Area, CellTask, Cube, Needs, Object, State, is_at_rest, register_task
from tasks.maths import Array, Floats, maximum

HALF, HEIGHT, LEVEL, TURN = 0.02, 0.07, radians(8), radians(8)  # m, m, rad, rad
LOW, HIGH = (-0.15, -0.1, 0.0), (0.15, 0.1, 0.06)  # corners of the tray, in its frame (m)
LIFTERS = ("west", "east")


@register_task("CellLoadTray-v1")
class CellLoadTray(CellTask):
    """Hold the tray up by its two handles, and lay the cube on it.

    The tray lies between the lifters, up to 2 cm off along x and y and turned by up to 8°; the cube
    before the loader, x in [-0.1, 0.1], y in [-0.46, -0.4] (m), turned at random.

    Success: the tray is 7 cm high and level to 8°, both lifters hold it, and the cube rests on it,
    let go.
    """

    instruction = (
        "Hold the tray up and lay the cube on it.",
        "Two raise the tray, the third puts the cube on it.",
        "Lift the tray by its handles, then load it with the cube.",
    )
    layout = around_table(
        {"loader": "panda", "east": "franka_panda", "west": "panda_wristcam"},
        edges=("south", "east", "west"),
        table=(1.84, 1.7),
    )
    needs = {"*": Needs(fingers=True, opening=2 * HALF)}
    max_episode_steps = 250
    stages = {"is_one_holding": 0.2, "are_both_holding": 0.4, "is_high": 0.6, "success": 1.0}
    viewpoint = ((1.0, -1.1, 0.9), (0.0, -0.1, 0.1))

    tray = Object("tray", spawn=Area(x=(-0.02, 0.02), y=(-0.14, -0.1), yaw=(-TURN, TURN)))
    cube = Cube(HALF, GREEN, spawn=Area(x=(-0.1, 0.1), y=(-0.46, -0.4), yaw="any"))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: high, level, held by both, and the cube on it."""
        held = self.count([state.is_grasping(arm, "tray") for arm in LIFTERS])
        high = (held >= 2) & (state.position("tray")[:, 2] >= HEIGHT)
        level = state.rotation("tray")[:, 2, 2] >= cos(LEVEL)
        on = self.is_within(state, "cube", "tray", LOW, HIGH) & is_at_rest(state, "cube")
        return {
            "is_one_holding": held >= 1,
            "are_both_holding": held >= 2,
            "is_high": high,
            "success": high & level & on & ~state.is_grasping("loader", "cube"),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the lifters' hands to the tray, of the tray upwards, and of the cube to it."""
        hands = [state.tcp_distance(arm, "tray") for arm in LIFTERS]
        above = maximum(HEIGHT - state.position("tray")[:, 2], 0.0)
        return [*hands, above, state.distance("cube", "tray")]
