"""CellUnloadTurntable: three arms take their cubes off a table that turns, each into its box."""

from __future__ import annotations

from dataclasses import replace
from math import atan2, copysign, cos, sin

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
    Object,
    State,
    World,
    register_task,
)
from tasks.maths import Array, Floats

HALF, RIM, WALL = 0.02, 0.07, 0.004  # of cubes, of boxes and of their walls (m)
OUT, HIGH = 0.13, 0.0665  # of cubes on the plate, and of its top (m)
LOW, UP = (-RIM, -RIM, 0.0), (RIM, RIM, 0.06)  # of a cube in a box, in its frame (m)
DECAY = 200.0  # s; a plate that is wound up by 30 rad turns at 30 / 200 rad/s


def box(color: tuple[float, float, float, float]) -> Compound:
    """A square box, open above."""
    middles = [(RIM, 0.0), (-RIM, 0.0), (0.0, RIM), (0.0, -RIM)]
    halves = [(WALL, RIM, 0.02)] * 2 + [(RIM, WALL, 0.02)] * 2
    walls = [
        Box(half_size=half, position=(x, y, 0.02), color=color)
        for half, (x, y) in zip(halves, middles, strict=True)
    ]
    floor = Box(half_size=(RIM, RIM, WALL / 2), position=(0.0, 0.0, WALL / 2), color=color)
    return Compound((floor, *walls), kind="kinematic")


def wound_up() -> Object:
    """A turntable that a weak spring against much friction keeps turning, ever more slowly."""
    found = Object("turntable", scale=1.25).descriptor
    turning = tuple(replace(j, stiffness=20.0 / DECAY, damping=20.0) for j in found.joints)
    return Object(replace(found, joints=turning), kind="kinematic")


@register_task("CellUnloadTurntable-v1")
class CellUnloadTurntable(CellTask):
    """Take the cubes off the turntable while it turns, and put each into the box of its colour.

    The table turns at 0.15 to 0.22 rad/s, to the left or to the right. On it lies a cube for each
    arm, 13 cm from its middle, turned at random, which passes the arm after 0.9 to 2.1 rad. The
    boxes stand 42 to 47 cm from the middle before their arms, 8 to 16 cm to the right.

    Success: all cubes are in their boxes, let go.
    """

    instruction = (
        "Take the cubes off the turning table and put each into the box of its colour.",
        "Unload the turntable: red, green and blue go into their boxes.",
        "Pick your cube as it comes by, and put it into the box beside you.",
    )
    layout = ring({"red": "panda", "green": "franka_panda", "blue": "panda_wristcam"}, radius=0.8)
    needs = {"*": Needs(fingers=True, opening=2 * HALF)}
    max_episode_steps = 450
    stages = {"is_one_held": 0.1, "is_one_in": 0.4, "are_two_in": 0.7, "success": 1.0}
    viewpoint = ((0.0, 1.5, 1.2), (0.0, 0.0, 0.0))

    turntable = wound_up()
    box_red, box_green, box_blue = box(RED), box(GREEN), box(BLUE)
    cube_red, cube_green, cube_blue = Cube(HALF, RED), Cube(HALF, GREEN), Cube(HALF, BLUE)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Wind up the table, lay the cubes on it, and stand a box beside each arm."""
        super().sample(world, rng)
        speed, side = rng.uniform_between([0.15, -1.0], [0.22, 1.0]).tolist()
        wound = DECAY * copysign(speed, side)
        world.set_joints("turntable", plate=wound)
        for arm in self.arms:
            self.lay_before(world, rng, arm, f"box_{arm}", (0.42, 0.08), (0.47, 0.16), (0.0, 0.0))
            (left,) = rng.uniform_between([0.9], [2.1]).tolist()
            angle = atan2(*self.before(arm, 1.0)[::-1]) + copysign(left, side)
            place = (OUT * cos(angle), OUT * sin(angle), HIGH + HALF)
            world.set_pose(f"cube_{arm}", place, rng.yaw_quaternion())

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: all are in their boxes, let go."""
        held = [state.is_grasping(arm, f"cube_{arm}") for arm in self.arms]
        done = self.count(
            self.is_left_in(state, arm, f"cube_{arm}", f"box_{arm}", LOW, UP) for arm in self.arms
        )
        return {"is_one_held": self.count(held) >= 1, **self.passed(done, 1, 2, 3)}

    def ways(self, state: State) -> list[Floats]:
        """Of the cubes to their boxes."""
        return [state.distance(f"cube_{arm}", f"box_{arm}") for arm in self.arms]
