"""CellHangBrackets: two arms put brackets on the same two pegs, back to back, a third a bar."""

from __future__ import annotations

from math import pi

from layouts import ring
from tasks import (
    BLUE,
    GREEN,
    RED,
    WHITE,
    Box,
    CellTask,
    Color,
    Compound,
    Cylinder,
    EpisodeRandom,
    Needs,
    State,
    World,
    register_task,
)
from tasks.maths import Array, Floats, norm

APART, PEG, HOLE, LONG, THICK, BASE = 0.045, 0.008, 0.012, 0.075, 0.008, 0.012  # m; halves, heights
EDGE, SLIM, TAB = 0.045, 0.025, 0.012  # of plates, from the pegs; of what they are held by (m)
OFF, ON, LIGHT = 0.03, 0.0075, 300.0  # of the stand, of a part from its seat (m); density (kg/m³)
UPRIGHT = (0.5**0.5, 0.0, -(0.5**0.5), 0.0)
PARTS = {"first": "red", "second": "blue", "third": "bar"}
GRIPS = {"red": (EDGE - TAB / 2, 0.05), "blue": (EDGE - TAB / 2, 0.05), "bar": (0.0, 0.09)}  # y, z
PEGS = [
    Cylinder(PEG, 0.025, position=(x, 0.0, BASE + 0.025), quaternion=UPRIGHT)
    for x in (-APART, APART)
]


def plate(edge: float, color: Color, aside: float, high: float) -> Compound:
    """Return a plate with two holes up to an edge (m), and what it is held by, so far and high."""
    z, end = THICK / 2, (LONG - APART - HOLE) / 2
    boxes = [
        ((APART - HOLE, HOLE, z), (0.0, 0.0, z)),
        *(((end, HOLE, z), (x, 0.0, z)) for x in (end - LONG, LONG - end)),
        ((LONG, (SLIM - HOLE) / 2, z), (0.0, -(SLIM + HOLE) / 2, z)),
        ((LONG, (edge - HOLE) / 2, z), (0.0, (edge + HOLE) / 2, z)),
        ((0.03, TAB / 2, (high - THICK) / 2), (0.0, aside, (high + THICK) / 2)),
    ]
    return Compound(tuple(Box(size, position=at, density=LIGHT, color=color) for size, at in boxes))


@register_task("CellHangBrackets-v1")
class CellHangBrackets(CellTask):
    """Hang the red bracket, then the blue one back to back with it, then the bar on the two pegs.

    The stand with the pegs is up to 3 cm off the middle along x and y, turned at random; the parts
    lie 28 to 34 cm from the middle before their arms, up to 6 cm aside, turned at random.

    Success: all three rest on the pegs, one on the other, let go.
    """

    instruction = (
        "Hang the red bracket on the pegs, the blue one back to back with it, and the bar on both.",
        "Assemble the three parts on the two pegs: red first, then blue, the green bar last.",
        "Over the pegs with them: red bracket, blue bracket, and the bar between their backs.",
    )
    layout = ring(
        {"first": "panda", "second": "franka_panda", "third": "panda_wristcam"}, radius=0.75
    )
    needs = {"*": Needs(fingers=True, opening=0.04)}
    max_episode_steps = 400
    stages = {"is_one_held": 0.1, "is_one_on": 0.4, "are_two_on": 0.7, "success": 1.0}
    viewpoint = ((0.75, -0.45, 0.65), (-0.05, 0.05, 0.05))

    base = Box((0.085, 0.035, BASE / 2), position=(0.0, 0.0, BASE / 2), color=WHITE)
    pegs = Compound((base, *PEGS), kind="kinematic")
    red, blue = (plate(EDGE, color, EDGE - TAB / 2, 0.065) for color in (RED, BLUE))
    bar = plate(SLIM, GREEN, 0.0, 0.105)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand the pegs in the middle, and lay a part before each arm."""
        x, y = rng.uniform_between([-OFF, -OFF], [OFF, OFF]).tolist()
        world.set_pose("pegs", (x, y, 0.0), rng.yaw_quaternion(-pi, pi))
        for arm, part in PARTS.items():
            self.lay_before(world, rng, arm, part, (0.28, -0.06), (0.34, 0.06))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: each part on its seat, at rest and let go."""
        held, on = self.held_and_left(state, PARTS, ON)
        return {"is_one_held": held >= 1, **self.passed(on, 1, 2, 3)}

    def ways(self, state: State) -> list[Floats]:
        """Of the parts to their seats."""
        pegs = state.position("pegs")
        return [
            norm(pegs + state.array((0.0, 0.0, BASE + i * THICK))[None] - state.position(part))
            for i, part in enumerate(PARTS.values())
        ]
