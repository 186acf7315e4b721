"""CellSetFaders: three arms push three faders to the numbers that the instruction names."""

from __future__ import annotations

from math import pi
from typing import Any

from layouts import ring
from tasks import CellTask, EpisodeRandom, Object, State, World, register_task
from tasks.maths import Array, Floats

PHRASES = (
    "Set the first fader to {}, the second to {} and the third to {}.",
    "Faders, first to third: {}, {}, {}.",
    "Push the faders to {}, {} and {}.",
)
SETTINGS = ((1, 3, 2), (4, 2, 3), (2, 4, 1), (3, 1, 4))
STEP, NEAR, SLOW = 0.04, 0.012, 0.02  # of a number, off it (m), and of a fader that is set (m/s)
ACROSS = (-pi / 2 - 0.2, -pi / 2 + 0.2)  # of a rail, from the way to the arm (rad)


@register_task("CellSetFaders-v1")
class CellSetFaders(CellTask):
    """Push every fader to its number, which the instruction names: 4 cm each.

    The faders lie 22 to 30 cm from the middle before their arms, up to 4 cm aside, across the way
    to the arm, turned by up to 11°; they begin at 0 to 2 cm. The numbers are not observed.

    Success: all are within 1.2 cm of their numbers, and at rest.
    """

    instruction = tuple(words.format(*setting) for words in PHRASES for setting in SETTINGS)
    layout = ring({"first": "xarm7", "second": "panda_stick", "third": "panda"}, radius=0.8)
    max_episode_steps = 150
    stages = {"is_one_near": 0.2, "is_one_set": 0.5, "are_two_set": 0.75, "success": 1.0}
    viewpoint = ((1.2, 0.9, 0.9), (0.0, 0.0, 0.0))

    fader_first = fader_second = fader_third = Object(
        "slider", kind="kinematic", joints={"cap": (0.0, 0.02)}
    )

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the faders across the ways to their arms."""
        super().sample(world, rng)
        for arm in self.arms:
            fader = f"fader_{arm}"
            self.lay_before(world, rng, arm, fader, (0.22, -0.04), (0.3, 0.04), ACROSS)

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: all are set."""
        still = [abs(state.joint_velocity(f"fader_{arm}", "cap")) <= SLOW for arm in self.arms]
        near = [off <= NEAR for off in self._off(state)]
        done = self.count([n & s for n, s in zip(near, still, strict=True)])
        tips = self.count([way <= 0.1 for way in self._tips(state)])
        return {"is_one_near": tips >= 1, **self.passed(done, 1, 2, 3)}

    def ways(self, state: State) -> list[Floats]:
        """Of the tips to the faders, and of these to their numbers."""
        return [*self._tips(state), *self._off(state)]

    def _off(self, state: State) -> list[Floats]:
        wanted = self.told(state, SETTINGS) * STEP
        faders = [state.joint(f"fader_{arm}", "cap") for arm in self.arms]
        off: Any = [abs(fader - wanted[:, i]) for i, fader in enumerate(faders)]
        return off

    def _tips(self, state: State) -> list[Floats]:
        cap = self.fader_first.descriptor.points["cap"].position
        return [self.tip_distance(state, arm, f"fader_{arm}.cap", cap) for arm in self.arms]
