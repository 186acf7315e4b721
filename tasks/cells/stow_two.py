"""CellStowTwo: while one arm holds a button, one opens and shuts a drawer, two fill it."""

from __future__ import annotations

from math import pi

from layouts import ring
from tasks import (
    BLUE,
    RED,
    Area,
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

HALF, DOWN, OPENED, SHUT = 0.02, 0.005, 0.12, 0.015  # of cubes, button and drawer (m)
LOW, HIGH = (-0.12, -0.13, 0.0), (0.12, 0.13, 0.09)  # of a cube in the drawer, in its frame (m)
FINGERS = Needs(fingers=True, opening=2 * HALF)
PACKERS = ("left", "right")


@register_task("CellStowTwo-v1")
class CellStowTwo(CellTask):
    """Stow both cubes in the drawer, which is shut before and after, and hold the button down.

    The drawer stands before the opener, its front towards it, x in [-0.02, 0.02], y in
    [0.105, 0.13] (m), the button behind it before the holder, 42 to 46 cm from the middle and up to
    5 cm aside; the cubes lie 34 to 40 cm from the middle before their arms, up to 5 cm aside,
    turned at random.

    Success: both cubes are in the drawer, let go, and it is shut to 1.5 cm while the button is
    pressed by 5 mm.
    """

    instruction = (
        "Hold the button, stow both cubes in the drawer, and shut it.",
        "Keep the button down; open the drawer, put the two cubes into it, and close it again.",
        "Put the red cube and the blue one away while the button is held.",
    )
    layout = ring(
        {"opener": "panda", "right": "franka_panda", "holder": "ur10", "left": "panda_wristcam"},
        radius=0.8,
    )
    needs = {arm: FINGERS for arm in ("opener", "left", "right")} | {"holder": Needs(reach=0.7)}
    max_episode_steps = 350
    stages = {"is_open": 0.3, "is_one_in": 0.5, "are_both_in": 0.7, "success": 1.0}
    viewpoint = ((1.2, -0.8, 1.1), (0.0, 0.0, 0.1))

    case = Object(
        "drawer", kind="kinematic", spawn=Area(x=(-0.02, 0.02), y=(0.105, 0.13), yaw=-pi / 2)
    )
    button = Object("button", kind="kinematic")
    cube_left, cube_right = Cube(HALF, RED), Cube(HALF, BLUE)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand drawer and button, and lay a cube before each packer."""
        super().sample(world, rng)
        self.lay_before(world, rng, "holder", "button", (0.42, -0.05), (0.46, 0.05))
        for arm in PACKERS:
            self.lay_before(world, rng, arm, f"cube_{arm}", (0.34, -0.05), (0.4, 0.05))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: both in it, let go, and it is shut, the button down."""
        drawer, held = state.joint("case", "drawer"), state.joint("button", "cap") >= DOWN
        inside = self.count(
            self.is_left_in(state, arm, f"cube_{arm}", "case.drawer", LOW, HIGH) for arm in PACKERS
        )
        return {
            "is_open": drawer >= OPENED,
            "is_one_in": inside >= 1,
            "are_both_in": inside >= 2,
            "success": (inside >= 2) & (drawer <= SHUT) & held,
        }

    def ways(self, state: State) -> list[Floats]:
        """Of opener and holder to what they work, and of the cubes to the case."""
        cubes = [state.planar_distance(f"cube_{arm}", "case") for arm in PACKERS]
        works = (("opener", "case.drawer"), ("holder", "button"))
        return [*(state.tcp_distance(arm, what) for arm, what in works), *cubes]
