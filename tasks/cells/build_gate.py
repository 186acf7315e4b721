"""CellBuildGate: two arms set up pillars, a third lays a beam across, a fourth a cap on top."""

from __future__ import annotations

from layouts import ring
from tasks import (
    BLUE,
    GREEN,
    RED,
    WHITE,
    Area,
    CellTask,
    Cuboid,
    EpisodeRandom,
    Needs,
    State,
    Target,
    World,
    register_task,
)
from tasks.maths import Array, Floats, norm

HALF, TALL, LONG, FLAT = 0.02, 0.04, 0.11, 0.015  # half lengths (m)
PILLAR = (HALF, HALF, TALL)
APART = 0.075  # of pillars from the middle (m)
PARTS = {"east": "pillar_east", "west": "pillar_west", "south": "beam", "north": "cap"}
PLACES = {  # of the parts in the gate (m, world)
    "east": (APART, 0.0, TALL),
    "west": (-APART, 0.0, TALL),
    "south": (0.0, 0.0, 2 * TALL + FLAT),
    "north": (0.0, 0.0, 2 * TALL + 3 * FLAT),
}
NEAR, SLOW = 0.025, 0.03  # of a part, from its place (m), and at rest there (m/s)


@register_task("CellBuildGate-v1")
class CellBuildGate(CellTask):
    """Build the gate: two pillars on their marks, a beam across, and a cap on its middle.

    All lie 28 to 34 cm from the middle before their arms: the pillars, 8 cm high, and the cap up to
    6 cm aside and turned at random, the beam of 22 cm up to 3 cm aside.

    Success: every part rests in its place, to within 2.5 cm, let go.
    """

    instruction = (
        "Build the gate: two pillars, a beam across them, and a cap on top.",
        "Set up both pillars, then lay the beam on them and the cap on the beam.",
        "Make a gate of the four parts.",
    )
    layout = ring(
        {"south": "panda", "east": "panda_wristcam", "north": "panda", "west": "franka_panda"},
        radius=0.78,
    )
    needs = {"*": Needs(fingers=True, opening=2 * HALF)}
    max_episode_steps = 400
    stages = {"is_one_standing": 0.2, "are_two_standing": 0.4, "is_beam_laid": 0.8, "success": 1.0}
    viewpoint = ((1.2, -0.9, 0.9), (0.0, 0.0, 0.1))

    mark_east, mark_west = Target(0.03, spawn=Area(x=APART)), Target(0.03, spawn=Area(x=-APART))
    beam = Cuboid((LONG, HALF, FLAT), RED, spawn=Area(x=(-0.03, 0.03), y=(-0.34, -0.28)))
    pillar_east, pillar_west = Cuboid(PILLAR, GREEN), Cuboid(PILLAR, BLUE)
    cap = Cuboid((HALF, HALF, FLAT), WHITE)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the beam, and the other parts before their arms."""
        super().sample(world, rng)
        for arm in ("east", "north", "west"):
            self.lay_before(world, rng, arm, PARTS[arm], (0.28, -0.06), (0.34, 0.06))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: all parts rest in their places, let go."""
        east, west, beam, cap = (
            (way <= NEAR)
            & (state.speed(part) <= SLOW / state.scale)
            & ~state.is_grasping(arm, part)
            for (arm, part), way in zip(PARTS.items(), self.ways(state), strict=True)
        )
        laid = east & west & beam
        return {
            "is_one_standing": east | west,
            "are_two_standing": east & west,
            "is_beam_laid": laid,
            "success": laid & cap,
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the parts to their places."""
        return [norm(state.position(PARTS[a]) - state.array((at,))) for a, at in PLACES.items()]
