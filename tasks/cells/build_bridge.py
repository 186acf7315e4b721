"""CellBuildBridge: two arms set up pillars, a third lays a beam across."""

from __future__ import annotations

from layouts import ring
from tasks import (
    BLUE,
    GREEN,
    RED,
    Area,
    CellTask,
    Cuboid,
    Needs,
    State,
    Target,
    is_at_rest,
    register_task,
)
from tasks.maths import Array, Flags, Floats, norm

HALF, TALL, LONG, FLAT = 0.02, 0.04, 0.11, 0.015  # half lengths (m)
NEAR, APART = 0.025, 0.075  # of a pillar from its mark, and of the marks from the middle (m)
MIDDLE = (0.0, -0.08)  # of the bridge (m, world)
TOP = ((*MIDDLE, 2 * TALL + FLAT),)


@register_task("CellBuildBridge-v1")
class CellBuildBridge(CellTask):
    """Build the bridge: the pillars on their marks, then the beam on both.

    Two pillars of 8 cm stand before the arms of their sides, the beam of 22 cm lies before the
    third, each up to 3 cm off along x and y; the pillars are turned at random.

    Success: both pillars stand on their marks, the beam rests on them, and all is let go.
    """

    instruction = (
        "Build the bridge: two pillars, then the beam across.",
        "Set the pillars on their marks and lay the beam on them.",
        "Make a bridge of the three parts.",
    )
    layout = ring({"across": "panda", "right": "panda_wristcam", "left": "panda"}, radius=0.75)
    needs = {"*": Needs(fingers=True, opening=2 * HALF)}
    max_episode_steps = 400
    stages = {"is_one_standing": 0.3, "are_two_standing": 0.6, "is_beam_held": 0.8, "success": 1.0}
    viewpoint = ((0.3, -1.3, 0.9), (0.0, 0.0, 0.1))

    mark_right = Target(NEAR, spawn=Area(x=APART, y=MIDDLE[1]))
    mark_left = Target(NEAR, spawn=Area(x=-APART, y=MIDDLE[1]))
    pillar_right = Cuboid(
        (HALF, HALF, TALL), GREEN, spawn=Area(x=(0.24, 0.3), y=(0.12, 0.18), yaw="any")
    )
    pillar_left = Cuboid(
        (HALF, HALF, TALL), BLUE, spawn=Area(x=(-0.3, -0.24), y=(0.12, 0.18), yaw="any")
    )
    beam = Cuboid((LONG, 0.02, FLAT), RED, spawn=Area(x=(-0.03, 0.03), y=(-0.36, -0.3)))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: the beam rests across both pillars, let go."""
        count = self.count([self._stands(state, side) for side in ("right", "left")])
        held, off = state.is_grasping("across", "beam"), self._off(state)
        across = (norm(off) <= 0.03) & (abs(off[:, 2]) <= 0.006) & is_at_rest(state, "beam")
        return {
            "is_one_standing": count >= 1,
            "are_two_standing": count >= 2,
            "is_beam_held": held,
            "success": (count >= 2) & across & ~held,
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the pillars to their marks, and of the beam to its place."""
        marks = [state.planar_distance(f"pillar_{s}", f"mark_{s}") for s in ("right", "left")]
        return [*marks, norm(self._off(state))]

    def _off(self, state: State) -> Floats:
        return state.position("beam") - state.array(TOP)

    def _stands(self, state: State, side: str) -> Flags:
        pillar = f"pillar_{side}"
        low = state.position(pillar)[:, 2] <= TALL + 0.005
        on = state.planar_distance(pillar, f"mark_{side}") <= NEAR
        return on & low & ~state.is_grasping(side, pillar)
