"""CellCrossOver: four arms in two pairs bring their cubes across to their neighbours' sides."""

from __future__ import annotations

from math import pi

from layouts import Layout, Placement
from tasks import BLUE, RED, Area, CellTask, Cube, Needs, State, Target, register_task
from tasks.maths import Array, Floats

HALF, RADIUS = 0.02, 0.05  # of cubes and marks (m)
WEST, EAST = (-0.32, -0.22), (0.22, 0.32)  # x of what lies before these arms (m)
BACK, FRONT = (0.44, 0.48), (0.26, 0.32)  # distances of marks and cubes from the middle line (m)


def across(y: tuple[float, float]) -> tuple[float, float]:
    """Return the same distances on the other side of the table."""
    return -y[1], -y[0]


@register_task("CellCrossOver-v1")
class CellCrossOver(CellTask):
    """Bring each cube over to the mark before the neighbour, who brings one the other way.

    Neighbours stand side by side, one pair on each side of the table. A cube lies before each arm,
    behind it the mark of its neighbour's cube: x in ±[0.22, 0.32], and y in ±[0.26, 0.32] and
    ±[0.44, 0.48] (m); cubes are turned at random.

    Success: every cube rests within 5 cm of its mark, let go.
    """

    instruction = (
        "Cross over: bring each cube to the mark before your neighbour.",
        "Neighbours exchange sides: your cube belongs on the mark before the arm beside you.",
        "Carry the cubes past each other to the other side.",
    )
    layout = Layout(
        {
            "southwest": Placement("panda", (-0.28, -0.8, 0.0), rpy=(0.0, 0.0, pi / 2)),
            "southeast": Placement("franka_panda", (0.28, -0.8, 0.0), rpy=(0.0, 0.0, pi / 2)),
            "northeast": Placement("panda_wristcam", (0.28, 0.8, 0.0), rpy=(0.0, 0.0, -pi / 2)),
            "northwest": Placement("panda", (-0.28, 0.8, 0.0), rpy=(0.0, 0.0, -pi / 2)),
        }
    )
    needs = {"*": Needs(fingers=True, opening=2 * HALF)}
    max_episode_steps = 300
    stages = {"is_one_held": 0.1, "is_one_across": 0.4, "are_three_across": 0.8, "success": 1.0}
    viewpoint = ((1.3, 0.0, 1.3), (0.0, 0.0, 0.0))

    mark_southwest = Target(RADIUS, spawn=Area(x=EAST, y=across(BACK)))
    mark_southeast = Target(RADIUS, spawn=Area(x=WEST, y=across(BACK)))
    mark_northeast = Target(RADIUS, spawn=Area(x=WEST, y=BACK))
    mark_northwest = Target(RADIUS, spawn=Area(x=EAST, y=BACK))
    cube_southwest = Cube(HALF, RED, spawn=Area(x=WEST, y=across(FRONT), yaw="any"))
    cube_southeast = Cube(HALF, BLUE, spawn=Area(x=EAST, y=across(FRONT), yaw="any"))
    cube_northeast = Cube(HALF, RED, spawn=Area(x=EAST, y=FRONT, yaw="any"))
    cube_northwest = Cube(HALF, BLUE, spawn=Area(x=WEST, y=FRONT, yaw="any"))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: every cube is across, at rest and let go."""
        held, count = self.held_and_left(state, {a: f"cube_{a}" for a in self.arms}, RADIUS)
        return {"is_one_held": held >= 1, **self.passed(count, 1, 3, 4)}

    def ways(self, state: State) -> list[Floats]:
        """Of the cubes to their marks."""
        return [state.planar_distance(f"cube_{arm}", f"mark_{arm}") for arm in self.arms]
