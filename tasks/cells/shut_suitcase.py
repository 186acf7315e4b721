"""CellShutSuitcase: one arm shuts the lid of a suitcase, two push its latches home."""

from __future__ import annotations

from math import pi

from layouts import ring
from tasks import CellTask, EpisodeRandom, Object, State, World, register_task
from tasks.maths import Array, Floats

OPEN = (1.66, 1.85)  # of the lid when an episode begins (rad); it leans back
TRAVEL = 0.044  # of a latch that is pulled out (m)
SHUT, HOME = 0.05, 0.006  # of lid and latches, up to here (rad, m)
TABS = {"east": ("right", (0.135, -0.11, 0.131)), "west": ("left", (0.135, 0.11, 0.131))}  # m


@register_task("CellShutSuitcase-v1")
class CellShutSuitcase(CellTask):
    """Shut the lid, then push both latches over it.

    The suitcase stands 2 cm beyond the middle to 10 cm before it for the closer, up to 5 cm aside,
    its front away from it, turned by up to 23°. Its lid leans back, open by 95° to 106°, and both
    latches are pulled out by 4.4 cm.

    Success: the lid is shut to 0.05 rad, and both latches are home to 6 mm.
    """

    instruction = (
        "Shut the suitcase and push both its latches home.",
        "Close the lid, then latch it on both sides.",
        "One shuts the lid, two push the latches over it.",
    )
    layout = ring({"closer": "xarm7", "east": "xarm7", "west": "ur10"}, radius=0.75)
    max_episode_steps = 120
    stages = {"is_shut": 0.4, "is_one_home": 0.7, "success": 1.0}
    viewpoint = ((0.9, 0.9, 0.9), (0.0, 0.0, 0.1))

    case = Object(
        "suitcase",
        kind="kinematic",
        joints={"lid": OPEN, "left": TRAVEL, "right": TRAVEL},
    )

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand the suitcase in the middle, its lid open."""
        super().sample(world, rng)
        turned = (pi - 0.4, pi + 0.4)
        self.lay_before(world, rng, "closer", "case", (-0.02, -0.05), (0.1, 0.05), turned)

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: shut, and both latches home."""
        shut = state.joint("case", "lid") <= SHUT
        home = self.count([state.joint("case", side) <= HOME for side, _ in TABS.values()])
        return {
            "is_shut": shut,
            "is_one_home": shut & (home >= 1),
            "success": shut & (home >= 2),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the tips to the latches, and of lid and latches, 0.2 where they begin."""
        tabs = TABS.items()
        tips = [self.tip_distance(state, arm, f"case.{part}", at) for arm, (part, at) in tabs]
        latches = [0.2 * state.joint("case", side) / TRAVEL for side, _ in TABS.values()]
        return [*tips, 0.2 * state.joint("case", "lid") / OPEN[1], *latches]
