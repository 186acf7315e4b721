"""CellFillHeldBin: one arm holds a bin up by its handle, two others drop a cube each into it."""

from __future__ import annotations

from math import cos, radians

from layouts import ring
from tasks import (
    BLUE,
    GREEN,
    RED,
    Box,
    CellTask,
    Compound,
    Cube,
    EpisodeRandom,
    Needs,
    State,
    World,
    register_task,
)
from tasks.maths import Array, Floats, maximum

HALF, HEIGHT, LEVEL = 0.02, 0.08, radians(15)  # of cubes, of the bin when it is up (m), and rad
LONG, WIDE, DEEP, WALL = 0.09, 0.08, 0.07, 0.002  # of the bin: half, half, whole, and half (m)
GRIP = (0.145, 0.0, 0.05)  # where its handle is held, in its frame (m)
LOW, HIGH = (-LONG, -WIDE, 0.0), (LONG, WIDE, DEEP)  # of a cube in the bin, in its frame (m)
TURN = 0.4  # of the bin from the way to the holder (rad)
FILLERS = ("left", "right")


def part(x: float, y: float, low: float, half_size: tuple[float, float, float]) -> Box:
    """Return a part of the bin, from so high (m) on."""
    place = (x, y, low + half_size[2])
    return Box(half_size=half_size, position=place, density=150.0, color=GREEN)


BIN = (
    part(0.0, 0.0, 0.0, (LONG, WIDE, WALL)),
    *(part(0.0, side * (WIDE - WALL), 0.0, (LONG, WALL, DEEP / 2)) for side in (-1, 1)),
    *(part(side * (LONG - WALL), 0.0, 0.0, (WALL, WIDE, DEEP / 2)) for side in (-1, 1)),
    part(LONG + 0.045, 0.0, 0.03, (0.045, 0.012, 0.02)),
)


@register_task("CellFillHeldBin-v1")
class CellFillHeldBin(CellTask):
    """Hold the bin up by its handle, and drop both cubes into it.

    The bin lies in the middle, up to 4 cm off towards the holder or away from it and 5 cm aside,
    its handle towards the holder to 23°; the cubes lie 34 to 42 cm from the middle before their
    arms, up to 8 cm aside, turned at random.

    Success: both cubes are in the bin, let go, while the holder holds it 8 cm high, level to 15°.
    """

    instruction = (
        "Hold the bin up by its handle and drop both cubes into it.",
        "One lifts the bin and holds it, two put a cube each into it.",
        "Fill the bin with the red cube and the blue one while it is held in the air.",
    )
    layout = ring(
        {"holder": "panda", "right": "franka_panda", "left": "panda_wristcam"}, radius=0.78
    )
    needs = {"*": Needs(fingers=True, opening=2 * HALF)}
    max_episode_steps = 300
    stages = {"is_held": 0.15, "is_up": 0.4, "is_one_in": 0.7, "success": 1.0}
    viewpoint = ((0.9, -0.9, 0.8), (0.0, 0.0, 0.1))

    bin = Compound(BIN)
    cube_left, cube_right = Cube(HALF, RED, density=300.0), Cube(HALF, BLUE, density=300.0)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the bin before the holder, and a cube before each filler."""
        self.lay_before(world, rng, "holder", "bin", (-0.04, -0.05), (0.04, 0.05), (-TURN, TURN))
        for arm in FILLERS:
            self.lay_before(world, rng, arm, f"cube_{arm}", (0.34, -0.08), (0.42, 0.08))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: held high and level, both cubes in it, let go."""
        held = state.is_grasping("holder", "bin")
        level = state.rotation("bin")[:, 2, 2] >= cos(LEVEL)
        up = held & level & (state.position("bin")[:, 2] >= HEIGHT)
        inside = self.count(
            [self.is_left_in(state, arm, f"cube_{arm}", "bin", LOW, HIGH) for arm in FILLERS]
        )
        return {
            "is_held": held,
            "is_up": up,
            "is_one_in": up & (inside >= 1),
            "success": up & (inside >= 2),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the holder's hand to the bin, of that upwards, and of the cubes to it."""
        above = maximum(HEIGHT - state.position("bin")[:, 2], 0.0)
        cubes = [state.distance(f"cube_{arm}", "bin") for arm in FILLERS]
        return [state.tcp_distance("holder", "bin"), above, *cubes]
