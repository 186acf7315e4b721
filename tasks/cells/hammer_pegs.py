"""CellHammerPegs: three arms pass a mallet on, and each drives its own peg home with it."""

from __future__ import annotations

from layouts import ring
from objects import ObjectDescriptor
from objects.joints import Joint
from tasks import (
    GREEN,
    RED,
    WHITE,
    Box,
    CellTask,
    Compound,
    Cylinder,
    EpisodeRandom,
    Needs,
    Object,
    State,
    Target,
    World,
    is_at_rest,
    register_task,
)
from tasks.maths import Array, Floats, maximum

TOP, TRAVEL, HOME, MARK = 0.08, 0.03, 0.025, 0.05  # of pegs, when one is home, of the mark (m)
HELD, GRIP = 0.115, 0.01  # how high the mallet is held, and half of how wide it is there (m)
UPRIGHT = (0.5**0.5, 0.0, -(0.5**0.5), 0.0)
PEG = Cylinder(
    0.014, 0.023, position=(0.0, 0.0, TOP - 0.023), quaternion=UPRIGHT, density=100.0, color=RED
)
BLOCK = ObjectDescriptor(
    name="peg_block",
    about="A block with a tight peg, which stays as deep as it is driven",
    source="robot-layouts",
    parts=(
        *(Box((0.015, 0.045, 0.025), position=(x, 0.0, 0.025)) for x in (-0.03, 0.03)),
        *(Box((0.015, 0.015, 0.025), position=(0.0, y, 0.025)) for y in (-0.03, 0.03)),
    ),
    joints=(
        Joint(name="peg", kind="slide", parts=(PEG,), axis=(0, 0, -1), upper=TRAVEL, damping=400.0),
    ),
)


@register_task("CellHammerPegs-v1")
class CellHammerPegs(CellTask):
    """Drive all pegs home with the mallet, each arm its own, and put it on the mark.

    The mark is up to 3 cm off the middle along x and y. The blocks stand 36 to 42 cm from the
    middle before their arms, up to 8 cm aside; the mallet 20 to 26 cm before the first, likewise.

    Success: all pegs are driven by 2.5 cm, and the mallet stands on the mark, let go.
    """

    instruction = (
        "Drive all three pegs home with the mallet, and put it on the mark.",
        "Pass the mallet on over the mark: each drive your peg home with it.",
        "Everybody knock your peg in; there is one mallet, which belongs on the mark.",
    )
    layout = ring(
        {"first": "panda", "second": "franka_panda", "third": "panda_wristcam"}, radius=0.75
    )
    needs = {"*": Needs(fingers=True, opening=2 * GRIP)}
    max_episode_steps = 600
    stages = {
        "is_held": 0.1,
        "is_one_home": 0.25,
        "is_passed_on": 0.4,
        "are_two_home": 0.55,
        "is_passed_again": 0.7,
        "are_all_home": 0.85,
        "success": 1.0,
    }
    viewpoint = ((0.8, -0.5, 0.7), (-0.03, 0.05, 0.05))

    mark = Target(MARK)
    mallet = Compound(
        (
            Cylinder(0.03, 0.025, position=(0.0, 0.0, 0.025), quaternion=UPRIGHT, color=WHITE),
            Box((GRIP, GRIP, 0.045), position=(0.0, 0.0, 0.095), color=GREEN),
        )
    )
    block_first = block_second = block_third = Object(BLOCK, kind="kinematic")

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the mark, stand the mallet before the first arm and a block before each."""
        super().sample(world, rng)
        x, y = rng.uniform_between([-0.03, -0.03], [0.03, 0.03]).tolist()
        world.set_pose("mark", (x, y, self.mark.height), self.mark.lying)
        self.lay_before(world, rng, "first", "mallet", (0.2, -0.08), (0.26, 0.08))
        for arm in self.arms:
            self.lay_before(world, rng, arm, f"block_{arm}", (0.36, -0.08), (0.42, 0.08))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: all pegs are home, and the mallet stands on the mark, let go."""
        home = self.count([state.joint(f"block_{arm}", "peg") >= HOME for arm in self.arms])
        held = self.count([state.is_grasping(arm, "mallet") for arm in self.arms])
        stands = is_at_rest(state, "mallet") & (state.position("mallet")[:, 2] <= 0.01)
        back = stands & (state.planar_distance("mallet", "mark") <= MARK) & (held < 1)
        return {
            "is_held": held >= 1,
            "is_one_home": home >= 1,
            "is_passed_on": (home >= 1) & back,
            "are_two_home": home >= 2,
            "is_passed_again": (home >= 2) & back,
            "are_all_home": home >= 3,
            "success": (home >= 3) & back,
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the pegs until they are home, 0.2 where they begin."""
        left = [TRAVEL - state.joint(f"block_{arm}", "peg") for arm in self.arms]
        return [0.2 / TRAVEL * maximum(way, 0.0) for way in left]
