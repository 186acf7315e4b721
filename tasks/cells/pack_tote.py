"""CellPackTote: four arms pack a can, a block, a ball and a cube into one tote."""

from __future__ import annotations

from layouts import ring
from tasks import (
    BLUE,
    GREEN,
    RED,
    Ball,
    CellTask,
    Cube,
    Cuboid,
    EpisodeRandom,
    Needs,
    Object,
    State,
    World,
    register_task,
)
from tasks.maths import Array, Floats

PARTS = {"south": "can", "east": "block", "north": "ball", "west": "cube"}
LOW, HIGH = (-0.145, -0.095, 0.0), (0.145, 0.095, 0.1)  # of what is in the tote, in its frame (m)
TURN = 0.25  # of the tote (rad)


@register_task("CellPackTote-v1")
class CellPackTote(CellTask):
    """Pack all four things into the tote, each arm the one before it.

    The tote stands in the middle, up to 2 cm off along x and y and turned by up to 14°; the things
    lie 33 to 38 cm from the middle before their arms, up to 6 cm aside, turned at random.

    Success: all four are in the tote, let go.
    """

    instruction = (
        "Pack the can, the block, the ball and the cube into the tote.",
        "Put everything into the tote.",
        "Everybody pack what lies before you into the tote in the middle.",
    )
    layout = ring(
        {"south": "panda", "east": "franka_panda", "north": "panda_wristcam", "west": "panda"},
        radius=0.8,
    )
    needs = {"*": Needs(fingers=True, opening=0.066)}
    max_episode_steps = 400
    stages = {"is_one_in": 0.25, "are_two_in": 0.5, "are_three_in": 0.75, "success": 1.0}
    viewpoint = ((1.2, 1.0, 1.0), (0.0, 0.0, 0.0))

    tote = Object("tote", kind="kinematic")
    can = Object("can")
    block = Cuboid((0.02, 0.02, 0.03), GREEN)
    ball = Ball(0.02, RED)
    cube = Cube(0.02, BLUE)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand the tote, and lay a thing before each arm."""
        x, y = rng.uniform_between([-0.02, -0.02], [0.02, 0.02]).tolist()
        world.set_pose("tote", (x, y, 0.0), rng.yaw_quaternion(-TURN, TURN))
        for arm, part in PARTS.items():
            self.lay_before(world, rng, arm, part, (0.33, -0.06), (0.38, 0.06))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: all are in the tote, let go."""
        done = self.count(
            [self.is_left_in(state, arm, part, "tote", LOW, HIGH) for arm, part in PARTS.items()]
        )
        return self.passed(done, 1, 2, 3, 4)

    def ways(self, state: State) -> list[Floats]:
        """Of the things to the tote."""
        return [state.distance(part, "tote") for part in PARTS.values()]
