"""CellSortCubes: three arms sort the cubes before them onto the nearest pads of their colours."""

from __future__ import annotations

from layouts import ring
from tasks import (
    BLUE,
    GREEN,
    RED,
    CellTask,
    Cube,
    Cuboid,
    EpisodeRandom,
    Needs,
    State,
    World,
    is_at_rest,
    register_task,
)
from tasks.maths import Array, Flags, Floats

HALF, PAD, THICK = 0.02, 0.07, 0.004  # half edges of cubes, of pads, and half of a pad's height (m)
PADS = {"red": (0.325, -0.1876), "green": (0.0, 0.375), "blue": (-0.325, -0.1876)}  # m, world
SIDES = {"first": (0.0, -1.0), "second": (0.866, 0.5), "third": (-0.866, 0.5)}
NEAREST = {"first": ("red", "blue"), "second": ("green", "red"), "third": ("blue", "green")}
CUBES = tuple((arm, color) for arm, colors in NEAREST.items() for color in colors)


@register_task("CellSortCubes-v1")
class CellSortCubes(CellTask):
    """Sort the cubes by colour: each arm puts its two on the pads at its sides.

    Before each arm lie two cubes of the colours of its pads, 28 to 34 cm from the middle, one 6 to
    9 cm to each side, turned at random; which is on which side is drawn.

    Success: every cube rests on the pad of its colour, let go.
    """

    instruction = (
        "Sort the cubes by colour.",
        "Put every cube on the pad of its colour.",
        "Each arm lays its cubes on the pads that match.",
    )
    layout = ring({"first": "panda", "second": "panda_wristcam", "third": "panda"}, radius=0.75)
    needs = {"*": Needs(fingers=True, opening=2 * HALF)}
    max_episode_steps = 300
    stages = {"is_one_held": 0.1, "is_one_sorted": 0.3, "are_three_sorted": 0.6, "success": 1.0}
    viewpoint = ((1.3, 1.0, 1.1), (0.0, 0.0, 0.0))

    pad_red = Cuboid((PAD, PAD, THICK), RED, kind="kinematic")
    pad_green = Cuboid((PAD, PAD, THICK), GREEN, kind="kinematic")
    pad_blue = Cuboid((PAD, PAD, THICK), BLUE, kind="kinematic")
    first_red, second_red = Cube(HALF, RED), Cube(HALF, RED)
    second_green, third_green = Cube(HALF, GREEN), Cube(HALF, GREEN)
    third_blue, first_blue = Cube(HALF, BLUE), Cube(HALF, BLUE)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the pads down, and two cubes before each arm."""
        for color, place in PADS.items():
            world.set_pose(f"pad_{color}", (*place, THICK))
        for arm, (x, y) in SIDES.items():
            side = 1.0 if rng.uniform(1).item() < 0.5 else -1.0
            for color in NEAREST[arm]:
                out, aside = rng.uniform_between([0.28, 0.06], [0.34, 0.09]).tolist()
                place = (out * x - side * aside * y, out * y + side * aside * x, HALF)
                world.set_pose(f"{arm}_{color}", place, rng.yaw_quaternion())
                side = -side

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: every cube on its pad, at rest and let go."""
        held = [state.is_grasping(arm, f"{arm}_{color}") for arm, color in CUBES]
        lies = [self._lies(state, f"{arm}_{color}", f"pad_{color}") for arm, color in CUBES]
        done = self.count([lie & ~hold for lie, hold in zip(lies, held, strict=True)])
        return {"is_one_held": self.count(held) >= 1, **self.passed(done, 1, 3, 6)}

    def ways(self, state: State) -> list[Floats]:
        """Of the cubes to their pads."""
        return [state.planar_distance(f"{arm}_{color}", f"pad_{color}") for arm, color in CUBES]

    def _lies(self, state: State, cube: str, pad: str) -> Flags:
        low = state.position(cube)[:, 2] <= 2 * THICK + HALF + 0.005
        return (state.planar_distance(cube, pad) <= PAD) & low & is_at_rest(state, cube)
