"""CellThrowLevers: four arms throw the levers that the instruction names, and no others."""

from __future__ import annotations

from math import pi

from layouts import ring
from tasks import CellTask, EpisodeRandom, Object, State, World, register_task
from tasks.maths import Array, Floats, maximum

PAIRS = (("red", "blue"), ("green", "white"), ("white", "red"), ("blue", "green"))
ARMS = ("red", "green", "blue", "white")
NAMED = {arm: tuple(float(arm in pair) for pair in PAIRS) for arm in ARMS}
PHRASES = (
    "Throw the levers of the arms {} and {}, and leave the others.",
    "Only {} and {} throw their levers.",
    "Levers: {} and {}.",
)
THROWN = 0.5  # rad; of a lever that is thrown, and below 0 of one that is not
ACROSS = (-pi / 2 - 0.3, -pi / 2 + 0.3)  # of the way of a lever, from that to the arm (rad)


@register_task("CellThrowLevers-v1")
class CellThrowLevers(CellTask):
    """Throw the levers of the two arms that the instruction names, and leave the other two.

    The levers stand 35 to 41 cm from the middle before their arms, up to 5 cm aside, across the way
    to the arm, turned by up to 17°. Which are named is not observed.

    Success: the two are thrown, and the others as they were.
    """

    instruction = tuple(words.format(*pair) for words in PHRASES for pair in PAIRS)
    layout = ring(
        {"red": "ur10", "green": "panda_stick", "blue": "xarm7", "white": "panda"}, radius=0.85
    )
    max_episode_steps = 150
    stages = {"is_one_near": 0.2, "is_one_thrown": 0.6, "success": 1.0}
    viewpoint = ((1.2, 1.0, 1.0), (0.0, 0.0, 0.1))

    lever_red = lever_green = lever_blue = lever_white = Object("lever", kind="kinematic")

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand a lever before each arm."""
        super().sample(world, rng)
        for arm in self.arms:
            lever = f"lever_{arm}"
            self.lay_before(world, rng, arm, lever, (0.35, -0.05), (0.41, 0.05), ACROSS)

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: the named levers are thrown, and no others."""
        left = self._left(state)
        named = self._named(state)
        thrown = self.count(
            [(way <= 0.0) & (name > 0) for way, name in zip(left, named, strict=True)]
        )
        tips = zip(self._tips(state), named, strict=True)
        return {
            "is_one_near": self.count([(tip <= 0.12) & (name > 0) for tip, name in tips]) >= 1,
            "is_one_thrown": thrown >= 1,
            "success": self.count([way <= 0.0 for way in left]) >= len(left),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the named arms' tips to their levers, and of all levers to where they should be."""
        tips = zip(self._tips(state), self._named(state), strict=True)
        return [*(tip * name for tip, name in tips), *(0.3 * way for way in self._left(state))]

    def _named(self, state: State) -> list[Floats]:
        """Return by arm whether it is named, (N,) of 0 and 1."""
        return [self.told(state, NAMED[arm]) for arm in self.arms]

    def _left(self, state: State) -> list[Floats]:
        """Return by arm how far its lever is from where it should be (rad)."""
        levers = [state.joint(f"lever_{arm}", "lever") for arm in self.arms]
        signs = [2.0 * name - 1.0 for name in self._named(state)]
        return [
            maximum(THROWN - sign * lever, 0.0) for sign, lever in zip(signs, levers, strict=True)
        ]

    def _tips(self, state: State) -> list[Floats]:
        knob = self.lever_red.descriptor.points["knob"].position
        return [self.tip_distance(state, arm, f"lever_{arm}.lever", knob) for arm in self.arms]
