"""CellPressTogether: three arms of different makes press their buttons at the same moment."""

from __future__ import annotations

from layouts import ring
from tasks import CellTask, EpisodeRandom, Object, State, World, register_task, transform
from tasks.maths import Array, Floats, norm

TOP, PRESSED, NEAR = 0.052, 0.005, 0.06  # height of a cap, how far it goes in, over it (m)
AREA = ([0.25, -0.1], [0.33, 0.1])  # from the middle towards an arm, and aside (m)
SIDES = {"first": (0.0, -1.0), "second": (0.866, 0.5), "third": (-0.866, 0.5)}


@register_task("CellPressTogether-v1")
class CellPressTogether(CellTask):
    """Press all three buttons at the same moment, each arm the one before it.

    The buttons stand 25 to 33 cm from the middle, up to 10 cm aside.

    Success: all caps are pressed by 5 mm at once.
    """

    source = "robot-layouts; geometry and rewards are its own"
    instruction = (
        "Press all three buttons at the same moment.",
        "Everybody press the button before you, together.",
        "Push the three buttons down at once.",
    )
    layout = ring({"first": "xarm7", "second": "panda_stick", "third": "panda"}, radius=0.8)
    max_episode_steps = 150
    stages = {"is_one_over": 0.2, "are_all_over": 0.5, "is_one_pressed": 0.7, "success": 1.0}
    viewpoint = ((1.2, 0.9, 0.9), (0.0, 0.0, 0.1))

    button_first = Object("button", kind="kinematic")
    button_second = Object("button", kind="kinematic")
    button_third = Object("button", kind="kinematic")

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand a button before each arm."""
        for arm, (x, y) in SIDES.items():
            out, aside = rng.uniform_between(*AREA).tolist()
            world.set_pose(f"button_{arm}", (out * x - aside * y, out * y + aside * x, 0.0))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: all are pressed."""
        pressed = self.count([state.joint(f"button_{a}", "cap") >= PRESSED for a in self.arms])
        over = self.count([way <= NEAR for way in self.ways(state)])
        return {
            "is_one_over": over >= 1,
            "are_all_over": over >= 3,
            "is_one_pressed": pressed >= 1,
            "success": pressed >= 3,
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the tips to the caps."""
        top = state.array(((0.0, 0.0, TOP),))
        return [
            norm(transform(state.pose(f"button_{arm}"), top) - state.tcp_position(arm))
            for arm in self.arms
        ]
