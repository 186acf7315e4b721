"""CellPackKit: four arms put four parts into the pockets of a kit, each into that of its colour."""

from __future__ import annotations

from math import cos, pi, sin

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
    Cuboid,
    Cylinder,
    EpisodeRandom,
    Needs,
    State,
    World,
    register_task,
)
from tasks.maths import Array, Floats

HALF, TALL = 0.02, 0.03  # of the parts' sides and heights, half (m)
IN, WALL, RIM, OUT, KIT = 0.033, 0.004, 0.011, 0.075, 0.004  # of pockets and kit, half (m)
LOW, HIGH = (-0.02, -0.02, 0.01), (0.02, 0.02, 0.045)  # of a part in its pocket, in its frame (m)
UPRIGHT = (0.5**0.5, 0.0, -(0.5**0.5), 0.0)
PARTS = {"south": "block", "east": "rod", "north": "stair", "west": "cross"}
ROD = Cylinder(HALF, TALL, quaternion=UPRIGHT, color=GREEN)
STAIR = (
    Box((HALF, HALF, TALL / 2), position=(0.0, 0.0, -TALL / 2), color=BLUE),
    Box((HALF, HALF / 2, TALL / 2), position=(0.0, 0.0, TALL / 2), color=BLUE),
)
CROSS = (Box((HALF, 0.008, TALL), color=WHITE), Box((0.008, HALF, TALL), color=WHITE))


def pocket(color: Color) -> Compound:
    """Return an open square pocket, its origin on what it stands on."""
    at, low = IN + WALL / 2, 0.001
    boxes = [((IN, IN, low), (0.0, 0.0, low))]
    boxes += [((WALL / 2, IN + WALL, RIM), (x, 0.0, RIM)) for x in (-at, at)]
    boxes += [((IN, WALL / 2, RIM), (0.0, y, RIM)) for y in (-at, at)]
    shapes = (Box(size, position=place, color=color) for size, place in boxes)
    return Compound(tuple(shapes), kind="kinematic")


@register_task("CellPackKit-v1")
class CellPackKit(CellTask):
    """Put every part into the pocket of its colour, each arm the one before it.

    The kit lies in the middle, up to 2 cm off along x and y, turned at random; which of its four
    pockets is of which colour is drawn. The parts lie 30 to 36 cm from the middle before their
    arms, up to 6 cm aside, turned at random.

    Success: all four parts stand in the pockets of their colours, let go.
    """

    instruction = (
        "Put every part into the pocket of its colour.",
        "Fill the kit: red block, green rod, blue stair and white cross, each where its colour is.",
        "Each pack your part into the kit, in the pocket that has its colour.",
    )
    layout = ring(
        {"south": "panda", "east": "franka_panda", "north": "panda_wristcam", "west": "panda"},
        radius=0.68,
        facing="tangent",
    )
    needs = {"*": Needs(fingers=True, opening=2 * HALF)}
    max_episode_steps = 600
    stages = {"is_one_in": 0.25, "are_two_in": 0.5, "are_three_in": 0.75, "success": 1.0}
    viewpoint = ((0.7, 0.65, 1.1), (0.0, 0.0, 0.05))

    kit = Cuboid((0.125, 0.125, KIT), (0.2, 0.2, 0.2, 1.0), kind="kinematic")
    pocket_south, pocket_east, pocket_north, pocket_west = map(pocket, (RED, GREEN, BLUE, WHITE))
    block, rod = Cuboid((HALF, HALF, TALL), RED), Compound((ROD,), rest_height=TALL)
    stair, cross = Compound(STAIR, rest_height=TALL), Compound(CROSS, rest_height=TALL)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the kit down, its pockets in any order, and a part before each arm."""
        x, y, yaw = rng.uniform_between([-0.02, -0.02, -pi], [0.02, 0.02, pi]).tolist()
        turned = (cos(yaw / 2), 0.0, 0.0, sin(yaw / 2))
        world.set_pose("kit", (x, y, KIT), turned)
        for arm, corner in zip(PARTS, rng.uniform(len(PARTS)).argsort().tolist(), strict=True):
            angle = yaw + pi / 4 + corner * pi / 2
            place = (x + OUT * cos(angle), y + OUT * sin(angle), 2 * KIT)
            world.set_pose(f"pocket_{arm}", place, turned)
            self.lay_before(world, rng, arm, PARTS[arm], (0.3, -0.06), (0.36, 0.06))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: all are in their pockets, let go."""
        done = self.count(
            self.is_left_in(state, arm, part, f"pocket_{arm}", LOW, HIGH)
            for arm, part in PARTS.items()
        )
        return self.passed(done, 1, 2, 3, 4)

    def ways(self, state: State) -> list[Floats]:
        """Of the parts to their pockets."""
        return [state.planar_distance(part, f"pocket_{arm}") for arm, part in PARTS.items()]
