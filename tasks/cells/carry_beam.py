"""CellCarryBeam: two arms carry a beam over onto two rests, which a third has cleared."""

from __future__ import annotations

from layouts import around_table
from tasks import (
    BLUE,
    WHITE,
    Area,
    CellTask,
    Cube,
    Cuboid,
    EpisodeRandom,
    Needs,
    State,
    Target,
    World,
    is_at_rest,
    register_task,
)
from tasks.maths import Array, Floats, norm

HALF, LONG, THICK = 0.02, 0.25, 0.018  # half lengths of cube and beam (m)
REST = (0.03, 0.04, 0.03)  # half lengths of a rest (m)
RESTS = {"left": (-0.13, 0.1), "right": (0.13, 0.1)}  # m
PLACE = (0.0, 0.1, 2 * REST[2] + THICK)  # of the beam on both (m)
NEAR, LOW, RADIUS, HIGH = 0.03, 0.008, 0.06, 0.1  # m
LIFTERS = ("west", "east")


@register_task("CellCarryBeam-v1")
class CellCarryBeam(CellTask):
    """Clear the rests, then carry the beam over and lay it on both.

    A cube lies on one of the two rests, drawn, up to 1 cm off along x and y, turned at random; the
    beam of 50 cm at y in [-0.24, -0.18] (m), up to 2 cm off along x and turned by up to 6°.

    Success: the cube lies on the mark, the beam on both rests, within 3 cm, let go.
    """

    instruction = (
        "Clear the rests, then lay the beam on both.",
        "Put the cube on the mark and carry the beam onto the two rests.",
        "One takes the cube away, two bring the beam.",
    )
    layout = around_table(
        {"north": "panda", "east": "franka_panda", "west": "panda_wristcam"},
        edges=("north", "east", "west"),
        table=(1.84, 1.7),
    )
    needs = {"*": Needs(fingers=True, opening=2 * HALF)}
    max_episode_steps = 300
    stages = {"is_cleared": 0.3, "are_both_holding": 0.5, "is_high": 0.7, "success": 1.0}
    viewpoint = ((1.0, 1.1, 0.9), (0.0, 0.0, 0.1))

    mark = Target(RADIUS, spawn=Area(y=0.3))
    rest_left = rest_right = Cuboid(REST, WHITE, kind="kinematic")
    cube = Cube(HALF, BLUE)
    beam = Cuboid(
        (LONG, THICK, THICK),
        density=400.0,
        spawn=Area(x=(-0.02, 0.02), y=(-0.24, -0.18), yaw=(-0.1, 0.1)),
    )

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand the rests, and lay the cube on one of them."""
        super().sample(world, rng)
        for side, place in RESTS.items():
            world.set_pose(f"rest_{side}", (*place, REST[2]))
        x, y = RESTS["left" if rng.uniform(1).item() < 0.5 else "right"]
        x, y = rng.uniform_between([x - 0.01, y - 0.01], [x + 0.01, y + 0.01]).tolist()
        world.set_pose("cube", (x, y, 2 * REST[2] + HALF), rng.yaw_quaternion())

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: cleared, and the beam on both rests, at rest and let go."""
        held = self.count([state.is_grasping(arm, "beam") for arm in LIFTERS])
        cleared = (state.planar_distance("cube", "mark") <= RADIUS) & is_at_rest(state, "cube")
        off = state.position("beam") - state.array((PLACE,))
        on = (norm(off) <= NEAR) & (abs(off[:, 2]) <= LOW) & is_at_rest(state, "beam")
        return {
            "is_cleared": cleared & ~state.is_grasping("north", "cube"),
            "are_both_holding": held >= 2,
            "is_high": (held >= 2) & (state.position("beam")[:, 2] >= HIGH),
            "success": cleared & on & (held < 1),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the cube to the mark, of the hands to the beam, and of this to the rests."""
        hands = [state.tcp_distance(arm, "beam") for arm in LIFTERS]
        beam = norm(state.position("beam") - state.array((PLACE,)))
        return [state.planar_distance("cube", "mark"), *hands, beam]
