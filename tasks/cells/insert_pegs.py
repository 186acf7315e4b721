"""CellInsertPegs: one arm holds a yoke with two sockets up, two others insert a peg each."""

from __future__ import annotations

from math import cos, radians

from layouts import ring
from tasks import (
    BLUE,
    RED,
    Box,
    CellTask,
    Compound,
    Cuboid,
    EpisodeRandom,
    Needs,
    State,
    World,
    register_task,
)
from tasks.maths import Array, Floats, maximum

HALF, TALL = 0.012, 0.05  # of pegs (m)
HOLE, RIM, DEEP, FLOOR = 0.016, 0.03, 0.05, 0.006  # of sockets: half, half, and heights (m)
OUT, HELD = 0.2, 0.035  # of sockets from the yoke's middle, and how high that is held (m)
HEIGHT, LEVEL, TURN = 0.08, radians(15), 0.3  # of the yoke when it is up (m, rad), and at first
NEAR, IN = 0.01, FLOOR + TALL + 0.01  # of a peg in its socket, aside, and at most upwards (m)
SIDES = {"left": -OUT, "right": OUT}  # where the sockets are along the yoke's y axis (m)


def part(x: float, y: float, z: float, half_size: tuple[float, float, float]) -> Box:
    """Return a part of the yoke."""
    return Box(half_size=half_size, position=(x, y, z), density=300.0, color=(0.5, 0.5, 0.5, 1.0))


def socket(y: float) -> tuple[Box, ...]:
    """Return a socket at a place along the yoke."""
    wall, at, high = (RIM - HOLE) / 2, (RIM + HOLE) / 2, DEEP / 2
    return (
        part(0.0, y, FLOOR / 2, (HOLE, HOLE, FLOOR / 2)),
        *(part(side * at, y, high, (wall, RIM, high)) for side in (-1, 1)),
        *(part(0.0, y + side * at, high, (HOLE, wall, high)) for side in (-1, 1)),
    )


YOKE = (
    *socket(-OUT),
    *socket(OUT),
    part(0.0, 0.0, HELD, (0.01, OUT - RIM, DEEP - HELD)),
)


@register_task("CellInsertPegs-v1")
class CellInsertPegs(CellTask):
    """Hold the yoke up, and insert a peg into each of its sockets.

    The yoke lies 4 to 12 cm from the middle towards the holder, up to 5 cm aside, across its way to
    17°; the pegs stand 34 to 42 cm from the middle before their arms, up to 8 cm aside, turned at
    random. A socket is 4 mm wider than its peg on each side.

    Success: both pegs are down in their sockets, let go, while the holder holds the yoke 8 cm high,
    level to 15°.
    """

    instruction = (
        "Hold the yoke up and insert a peg into each of its sockets.",
        "One lifts the grey yoke and holds it, two put their pegs into it.",
        "Insert the red peg and the blue one at the two ends of the yoke while it is held.",
    )
    layout = ring(
        {"holder": "panda_wristcam", "right": "franka_panda", "left": "panda"}, radius=0.78
    )
    needs = {"*": Needs(fingers=True, opening=0.04)}
    max_episode_steps = 250
    stages = {"is_held": 0.15, "is_up": 0.4, "is_one_in": 0.7, "success": 1.0}
    viewpoint = ((0.9, -0.9, 0.8), (0.0, 0.0, 0.1))

    yoke = Compound(YOKE)
    peg_left = Cuboid((HALF, HALF, TALL), RED, density=300.0)
    peg_right = Cuboid((HALF, HALF, TALL), BLUE, density=300.0)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the yoke before the holder, and stand a peg before each of the others."""
        self.lay_before(world, rng, "holder", "yoke", (0.04, -0.05), (0.12, 0.05), (-TURN, TURN))
        for arm in SIDES:
            self.lay_before(world, rng, arm, f"peg_{arm}", (0.34, -0.08), (0.42, 0.08))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: held high and level, both pegs in it, let go."""
        held = state.is_grasping("holder", "yoke")
        level = state.rotation("yoke")[:, 2, 2] >= cos(LEVEL)
        up = held & level & (state.position("yoke")[:, 2] >= HEIGHT)
        inside = self.count(
            self.is_left_in(
                state, arm, f"peg_{arm}", "yoke", (-NEAR, y - NEAR, 0), (NEAR, y + NEAR, IN)
            )
            for arm, y in SIDES.items()
        )
        return {
            "is_held": held,
            "is_up": up,
            "is_one_in": up & (inside >= 1),
            "success": up & (inside >= 2),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the holder's hand to the yoke, of that upwards, and of the pegs to it."""
        above = maximum(HEIGHT - state.position("yoke")[:, 2], 0.0)
        pegs = [state.distance(f"peg_{arm}", "yoke") for arm in SIDES]
        return [state.tcp_distance("holder", "yoke"), above, *pegs]
