"""CellRunPlant: four arms work a button, a lever, a tap and a fader, all to be on at once."""

from __future__ import annotations

from math import pi

from layouts import ring
from tasks import CellTask, EpisodeRandom, Object, State, World, register_task
from tasks.maths import Array, Floats, maximum

# By arm: what it works, its joint, from where on that is on (m or rad), and where it is worked
WORKS = {
    "holder": ("button", "cap", 0.005, (0.0, 0.0, 0.052)),
    "thrower": ("lever", "lever", 0.5, (0.0, 0.0, 0.21)),
    "turner": ("tap", "handle", 1.1, (0.06, 0.0, 0.17)),
    "pusher": ("slider", "cap", 0.12, (-0.1, 0.0, 0.07)),
}
NEAR = 0.1  # of a tip that is at its control (m)
ACROSS = (-pi / 2 - 0.3, -pi / 2 + 0.3)  # of the ways of lever and slider, from that to the arm


@register_task("CellRunPlant-v1")
class CellRunPlant(CellTask):
    """Hold the button down, throw the lever, open the tap and push the slider up, all at once.

    The controls stand 35 to 41 cm from the middle before their arms, up to 5 cm aside, lever and
    slider across the way to the arm, the tap's handle towards it, turned by up to 17°.

    Success: the button is pressed by 5 mm while the lever is thrown, the tap open by 1.1 rad and
    the slider up by 12 cm.
    """

    instruction = (
        "Run the plant: hold the button, throw the lever, open the tap, push the slider up.",
        "Keep the button down, and switch on lever, tap and slider.",
        "All controls on at once: button, lever, tap and slider.",
    )
    layout = ring(
        {"holder": "ur10", "thrower": "xarm7", "turner": "panda_stick", "pusher": "panda"},
        radius=0.85,
    )
    max_episode_steps = 150
    stages = {"is_one_near": 0.1, "is_one_on": 0.4, "are_three_on": 0.8, "success": 1.0}
    viewpoint = ((1.2, 1.0, 1.0), (0.0, 0.0, 0.1))

    button = Object("button", kind="kinematic")
    lever = Object("lever", kind="kinematic")
    tap = Object("tap", kind="kinematic")
    slider = Object("slider", kind="kinematic")

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand a control before each arm."""
        super().sample(world, rng)
        for arm, (body, *_) in WORKS.items():
            turned = ACROSS if body in ("lever", "slider") else (-0.3, 0.3)
            self.lay_before(world, rng, arm, body, (0.35, -0.05), (0.41, 0.05), turned)

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: all are on."""
        on = self.count([left <= 0.0 for left in self._left(state)])
        near = self.count([tip <= NEAR for tip in self._tips(state)])
        return {"is_one_near": near >= 1, **self.passed(on, 1, 3, 4)}

    def ways(self, state: State) -> list[Floats]:
        """Of the tips to the controls, and of these until they are on, 0.2 where all is left."""
        ends = [end for _, _, end, _ in WORKS.values()]
        shares = [0.2 * w / end for w, end in zip(self._left(state), ends, strict=True)]
        return [*self._tips(state), *shares]

    def _left(self, state: State) -> list[Floats]:
        return [
            maximum(end - state.joint(body, joint), 0.0) for body, joint, end, _ in WORKS.values()
        ]

    def _tips(self, state: State) -> list[Floats]:
        return [
            self.tip_distance(state, arm, f"{body}.{joint}", point)
            for arm, (body, joint, _, point) in WORKS.items()
        ]
