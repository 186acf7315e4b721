"""CellHoldAndPush: one arm keeps a button down while two others push their blocks."""

from __future__ import annotations

from layouts import ring
from tasks import (
    BLUE,
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

HALF, RADIUS, DOWN = 0.025, 0.06, 0.005  # of blocks and marks, and of the button's cap (m)
PUSHERS = ("left", "right")


@register_task("CellHoldAndPush-v1")
class CellHoldAndPush(CellTask):
    """Keep the button down until both blocks lie on their marks.

    The button stands 25 to 33 cm from the middle before its arm, up to 8 cm aside; the blocks
    lie 30 to 36 cm from it before theirs, up to 8 cm aside, turned at random; a mark is 12 cm from
    the middle.

    Success: the cap is pressed by 5 mm, and both blocks rest within 6 cm of their marks.
    """

    instruction = (
        "Keep the button pressed while the others push their blocks onto the marks.",
        "Hold the button down until both blocks lie on their marks.",
        "One holds the button, two push the blocks.",
    )
    layout = ring({"holder": "ur10", "left": "panda_stick", "right": "xarm7"}, radius=0.8)
    max_episode_steps = 250
    stages = {"is_down": 0.3, "is_one_there": 0.6, "success": 1.0}
    viewpoint = ((1.2, 0.9, 0.9), (0.0, 0.0, 0.0))

    button = Object("button", kind="kinematic")
    mark_left, mark_right = Target(RADIUS), Target(RADIUS)
    block_left, block_right = Cube(HALF, RED), Cube(HALF, BLUE)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand the button, and lay the marks and a block before each pusher."""
        self.lay_before(world, rng, "holder", "button", (0.25, -0.08), (0.33, 0.08))
        for arm in PUSHERS:
            place = (*self.before(arm, 0.12), self.mark_left.height)
            world.set_pose(f"mark_{arm}", place, self.mark_left.lying)
            self.lay_before(world, rng, arm, f"block_{arm}", (0.3, -0.08), (0.36, 0.08))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: the button is down and both blocks lie there, at rest."""
        down = state.joint("button", "cap") >= DOWN
        left, right = (
            (way <= RADIUS) & is_at_rest(state, f"block_{arm}")
            for arm, way in zip(PUSHERS, self._left(state), strict=True)
        )
        return {
            "is_down": down,
            "is_one_there": down & (left | right),
            "success": down & left & right,
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the holder's tip to the button, and of the blocks to their marks."""
        top = state.array((self.button.descriptor.points["top"].position,))
        tip = norm(state.position("button") + top - state.tcp_position("holder"))
        return [tip, *self._left(state)]

    def _left(self, state: State) -> list[Floats]:
        return [state.planar_distance(f"block_{arm}", f"mark_{arm}") for arm in PUSHERS]
