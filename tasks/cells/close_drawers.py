"""CellCloseDrawers: three arms of different makes push three drawers shut."""

from __future__ import annotations

from math import atan2

from layouts import ring
from tasks import CellTask, EpisodeRandom, Object, State, World, register_task
from tasks.maths import Array, Floats

SHUT = 0.01  # of a drawer (m)
AREA = ([0.235, -0.12], [0.3, 0.12])  # of a case, from the middle towards its arm, and aside (m)
SIDES = {"first": (0.0, -1.0), "second": (0.866, 0.5), "third": (-0.866, 0.5)}
OPENED = {"drawer": (0.07, 0.12)}  # m, in a case of full size
TURN = 0.25  # rad


@register_task("CellCloseDrawers-v1")
class CellCloseDrawers(CellTask):
    """Close all drawers, each arm the one before it.

    The cases stand back to back, their fronts towards the arms, 24 to 30 cm from the middle, up to
    12 cm aside and turned by up to 14°; the drawers are open by 5 to 9 cm.

    Success: no drawer is open by more than 1 cm.
    """

    source = "robot-layouts; geometry and rewards are its own"
    instruction = (
        "Close all drawers.",
        "Push the three drawers shut.",
        "Everybody shut the drawer before you.",
    )
    layout = ring({"first": "xarm7", "second": "panda_stick", "third": "panda"}, radius=1.0)
    max_episode_steps = 250
    stages = {"is_one_near": 0.2, "is_one_shut": 0.5, "are_two_shut": 0.75, "success": 1.0}
    viewpoint = ((1.4, 1.1, 1.2), (0.0, 0.0, 0.1))

    case_first = Object("drawer", kind="kinematic", scale=0.77, joints=OPENED)
    case_second = Object("drawer", kind="kinematic", scale=0.77, joints=OPENED)
    case_third = Object("drawer", kind="kinematic", scale=0.77, joints=OPENED)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand the cases, their drawers open."""
        super().sample(world, rng)
        for arm, (x, y) in SIDES.items():
            out, aside = rng.uniform_between(*AREA).tolist()
            place = (out * x - aside * y, out * y + aside * x, 0.0)
            ahead = atan2(y, x)
            world.set_pose(f"case_{arm}", place, rng.yaw_quaternion(ahead - TURN, ahead + TURN))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: all are shut."""
        near = [state.tcp_distance(arm, f"case_{arm}.drawer") <= 0.25 for arm in self.arms]
        shut = self.count([far <= SHUT for far in self._open(state)])
        return {
            "is_one_near": self.count(near) >= 1,
            "is_one_shut": shut >= 1,
            "are_two_shut": shut >= 2,
            "success": shut >= 3,
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the drawers, three times as they are, and of the tips to them, a fifth."""
        tips = [0.2 * state.tcp_distance(arm, f"case_{arm}.drawer") for arm in self.arms]
        return [*(3.0 * far for far in self._open(state)), *tips]

    def _open(self, state: State) -> list[Floats]:
        return [state.joint(f"case_{arm}", "drawer") for arm in self.arms]
