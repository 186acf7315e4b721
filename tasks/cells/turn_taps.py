"""CellTurnTaps: four arms of different makes open their taps as far as the instruction says."""

from __future__ import annotations

from typing import Any

from layouts import ring
from tasks import CellTask, EpisodeRandom, Object, State, World, register_task
from tasks.maths import Array, Floats

PHRASES = (
    "Open the taps, first to fourth, by {}, {}, {} and {} notches.",
    "Taps: {}, {}, {}, {}.",
    "Turn the first tap to {}, the second to {}, the third to {} and the fourth to {}.",
)
SETTINGS = ((1, 3, 2, 3), (2, 1, 3, 2), (3, 2, 1, 1), (2, 3, 1, 3))
NOTCH, NEAR, SLOW = 0.45, 0.15, 0.1  # rad; off its number (rad); of a tap that is set (rad/s)
HANDLE = (0.075, 0.0, 0.17)  # where it is pushed, in its frame (m)
ARM = 0.2  # m that a radian off its number is worth on the way
TOWARDS = (-0.3, 0.3)  # of a handle, from the way to the arm (rad)


@register_task("CellTurnTaps-v1")
class CellTurnTaps(CellTask):
    """Open every tap as far as the instruction says: 0.45 rad a notch.

    The taps stand 35 to 41 cm from the middle before their arms, up to 5 cm aside, shut, their
    handles towards the arm, turned by up to 17°. The numbers are not observed.

    Success: all are within 0.15 rad of their numbers, and at rest.
    """

    instruction = tuple(words.format(*setting) for words in PHRASES for setting in SETTINGS)
    layout = ring(
        {"first": "ur10", "second": "panda_stick", "third": "xarm7", "fourth": "panda"},
        radius=0.85,
    )
    max_episode_steps = 150
    stages = {"is_one_near": 0.2, "is_one_set": 0.4, "are_three_set": 0.8, "success": 1.0}
    viewpoint = ((1.2, 1.0, 1.0), (0.0, 0.0, 0.1))

    tap_first = tap_second = tap_third = tap_fourth = Object("tap", kind="kinematic")

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand a tap before each arm."""
        for arm in self.arms:
            self.lay_before(world, rng, arm, f"tap_{arm}", (0.35, -0.05), (0.41, 0.05), TOWARDS)

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: all are set."""
        still = [abs(state.joint_velocity(f"tap_{arm}", "handle")) <= SLOW for arm in self.arms]
        near = [off <= NEAR for off in self._off(state)]
        done = self.count([n & s for n, s in zip(near, still, strict=True)])
        tips = self.count([tip <= 0.1 for tip in self._tips(state)])
        return {"is_one_near": tips >= 1, **self.passed(done, 1, 3, 4)}

    def ways(self, state: State) -> list[Floats]:
        """Of the tips to the handles, and of these to their numbers."""
        return [*self._tips(state), *(ARM * off for off in self._off(state))]

    def _off(self, state: State) -> list[Floats]:
        wanted = self.told(state, SETTINGS) * NOTCH
        taps = [state.joint(f"tap_{arm}", "handle") for arm in self.arms]
        off: Any = [abs(tap - wanted[:, i]) for i, tap in enumerate(taps)]
        return off

    def _tips(self, state: State) -> list[Floats]:
        return [self.tip_distance(state, arm, f"tap_{arm}.handle", HANDLE) for arm in self.arms]
