"""CellTwoHandPress: one arm loads a press, two arms start it by its two-hand control."""

from __future__ import annotations

from math import pi

from layouts import ring
from tasks import (
    RED,
    CellTask,
    Cube,
    EpisodeRandom,
    Object,
    State,
    Target,
    World,
    is_at_rest,
    register_task,
)
from tasks.maths import Array, Floats, norm

HALF, RADIUS, CLEAR = 0.025, 0.06, 0.2  # of block and die, and of a hand that is clear of it (m)
PRESSED = 0.004  # how far a cap goes in (m)
SIDES = {"east": "right", "west": "left"}  # by arm, its button


@register_task("CellTwoHandPress-v1")
class CellTwoHandPress(CellTask):
    """Push the block onto the die, clear it, and press both buttons of the control at once.

    The block lies 36 to 44 cm from the middle before the loader, up to 10 cm aside, turned at
    random; the die 4 to 12 cm from it, up to 6 cm aside. The control stands opposite, 26 to 32 cm
    from the middle, up to 4 cm aside, turned by up to 9°.

    Success: both buttons are pressed by 4 mm at once while the block rests within 6 cm of the die's
    middle and the loader's tip is at least 20 cm from it.
    """

    instruction = (
        "Load the press, step back, and start it with both buttons.",
        "Push the block onto the die; once the loader is clear, press both buttons at once.",
        "One loads the press, two start it by its two-hand control.",
    )
    layout = ring({"loader": "xarm7", "east": "ur10", "west": "panda_stick"}, radius=0.8)
    max_episode_steps = 200
    stages = {"is_loaded": 0.4, "is_clear": 0.6, "is_one_pressed": 0.8, "success": 1.0}
    viewpoint = ((1.1, -0.9, 1.0), (0.0, 0.05, 0.0))

    die = Target(RADIUS)
    block = Cube(HALF, RED)
    control = Object("two_hand_control", kind="kinematic")

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay die and block before the loader, and stand the control opposite."""
        self.lay_before(world, rng, "loader", "die", (0.04, -0.06), (0.12, 0.06))
        self.lay_before(world, rng, "loader", "block", (0.36, -0.1), (0.44, 0.1))
        turned = (pi - 0.15, pi + 0.15)
        self.lay_before(world, rng, "loader", "control", (-0.32, -0.04), (-0.26, 0.04), turned)

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: loaded, clear, and both pressed."""
        loaded = (state.planar_distance("block", "die") <= RADIUS) & is_at_rest(state, "block")
        clear = loaded & (norm(state.position("die") - state.tcp_position("loader")) >= CLEAR)
        pressed = self.count([state.joint("control", cap) >= PRESSED for cap in SIDES.values()])
        return {
            "is_loaded": loaded,
            "is_clear": clear,
            "is_one_pressed": clear & (pressed >= 1),
            "success": clear & (pressed >= 2),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the block to the die, and of the tips to the buttons."""
        points = self.control.descriptor.points
        tips = [
            self.tip_distance(state, arm, "control", points[cap].position)
            for arm, cap in SIDES.items()
        ]
        return [state.planar_distance("block", "die"), *tips]
