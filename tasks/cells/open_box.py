"""CellOpenBox: one arm holds a sprung lid open by its lever, two others fill the box."""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, sin

from layouts import ring
from objects import ObjectDescriptor, ObjectRegistry
from tasks import (
    BLUE,
    RED,
    Box,
    CellTask,
    Cube,
    EpisodeRandom,
    Needs,
    Object,
    State,
    World,
    register_task,
)
from tasks.maths import Array, Floats

HALF, OPENED, SHUT = 0.02, 1.0, 0.1  # of cubes (m), and of the lid: from here and up to here (rad)
LONG, STEEP = 0.11, 0.9  # of the lever (m), and how steep it is while the lid is shut (rad)
MOST = STEEP + 0.6  # of the lid (rad)
LOW, HIGH = (-0.11, -0.09, 0.0), (0.11, 0.09, 0.1)  # of a cube in the box, in its frame (m)
PACKERS = ("left", "right")


def lever_box() -> ObjectDescriptor:
    """Return a box whose lid a lever behind its hinge opens and a spring shuts."""
    box = ObjectRegistry.load("hinged_box")
    (lid,) = box.joints
    x, _, z = lid.at
    lever = Box(
        half_size=(LONG / 2, 0.03, 0.004),
        position=(x - LONG / 2 * cos(STEEP), 0.0, z + LONG / 2 * sin(STEEP)),
        quaternion=(cos(STEEP / 2), 0.0, sin(STEEP / 2), 0.0),
        density=400.0,
        color=RED,
    )
    sprung = {"upper": MOST, "damping": 0.1, "stiffness": 0.3, "rest": -0.3}
    return replace(box, joints=(replace(lid, parts=(*lid.parts, lever), **sprung),))


@register_task("CellOpenBox-v1")
class CellOpenBox(CellTask):
    """Hold the lid open by its lever until both cubes are in the box, then let it fall shut.

    The box stands in the middle, up to 6 cm towards the opener or 2 cm away from it and 3 cm aside,
    its back towards the opener to 17°; the cubes lie 34 to 42 cm from the middle before their arms,
    up to 8 cm aside, turned at random. A spring shuts the lid.

    Success: both cubes are in the box, let go, and its lid is shut to 0.1 rad.
    """

    instruction = (
        "Hold the box open by its lever, put both cubes into it, and let it fall shut.",
        "One presses the lever that lifts the lid, two put a cube each into the box.",
        "Keep the lid up until the red cube and the blue one are in the box.",
    )
    layout = ring({"opener": "ur10", "right": "franka_panda", "left": "panda"}, radius=0.78)
    needs = {arm: Needs(fingers=True, opening=2 * HALF) for arm in PACKERS} | {
        "opener": Needs(reach=0.7)
    }
    max_episode_steps = 300
    stages = {"is_open": 0.3, "is_one_in": 0.5, "are_both_in": 0.8, "success": 1.0}
    viewpoint = ((0.9, -0.9, 0.8), (0.0, 0.0, 0.1))

    box = Object(lever_box(), kind="kinematic")
    cube_left, cube_right = Cube(HALF, RED), Cube(HALF, BLUE)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand the box before the opener, and lay a cube before each packer."""
        super().sample(world, rng)
        turned = (pi - 0.3, pi + 0.3)
        self.lay_before(world, rng, "opener", "box", (-0.02, -0.03), (0.06, 0.03), turned)
        for arm in PACKERS:
            self.lay_before(world, rng, arm, f"cube_{arm}", (0.34, -0.08), (0.42, 0.08))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: both in it, let go, and the lid shut."""
        lid = state.joint("box", "lid")
        inside = self.count(
            [self.is_left_in(state, arm, f"cube_{arm}", "box", LOW, HIGH) for arm in PACKERS]
        )
        return {
            "is_open": lid >= OPENED,
            "is_one_in": inside >= 1,
            "are_both_in": inside >= 2,
            "success": (inside >= 2) & (lid <= SHUT),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the opener's tip to the lever, and of the cubes to the box."""
        x, _, z = self.box.descriptor.joints[0].at
        end = (x - LONG * cos(STEEP), 0.0, z + LONG * sin(STEEP))
        tip = self.tip_distance(state, "opener", "box.lid", end)
        return [tip, *(state.planar_distance(f"cube_{arm}", "box") for arm in PACKERS)]
