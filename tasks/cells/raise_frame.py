"""CellRaiseFrame: three to eight arms in a ring lift a frame by its tabs, in step."""

from __future__ import annotations

from math import atan2, cos, pi, radians, sin, tan

from layouts import ring
from tasks import (
    DARK_BLUE,
    RED,
    Box,
    CellTask,
    Color,
    EpisodeRandom,
    Info,
    Needs,
    State,
    Vector3,
    World,
    register_task,
)
from tasks.maths import Array, Floats, maximum

THICK, WIDE = 0.018, 0.02  # half the height and the width of bars and tabs (m)
RADIUS, GRIP, END = 0.27, 0.34, 0.38  # of the bars, where tabs are held, and where they end (m)
HEIGHT, LEVEL, TURN = 0.12, radians(5), radians(5)
MAKES = ("panda", "franka_panda", "panda_wristcam", "panda")
SPEED = 0.02  # of a frame that is held still (m/s)


@register_task("CellRaiseFrame-v1")
class CellRaiseFrame(CellTask):
    """Lift the frame together, each arm by the tab before it, and hold it level.

    The frame, 54 cm wide, has a bar and a tab for each arm. It lies in the middle, up to 2 cm off
    along x and y and turned by up to 5°.

    Success: it is 12 cm high and level to 5°, all arms hold it, and it moves no more.
    """

    instruction = (
        "Lift the frame together and hold it level.",
        "Each take the tab before you, then raise the frame in step.",
        "Raise the frame by all its tabs without tilting it.",
    )
    layout = ring({f"arm{i}": robot for i, robot in enumerate(MAKES * 2)}, radius=0.99)
    robot_counts = range(3, 9)
    needs = {"*": Needs(fingers=True, opening=2 * WIDE)}
    max_episode_steps = 120
    stages = {"is_one_holding": 0.2, "are_all_holding": 0.5, "is_high": 0.8, "success": 1.0}
    viewpoint = ((1.5, 1.3, 1.4), (0.0, 0.0, 0.1))

    def build(self, world: World) -> None:
        """Add the table, and the frame: a bar and a tab before each arm."""
        super().build(world)
        bar = (WIDE, RADIUS * tan(pi / len(self.arms)) + WIDE, THICK)
        tab = ((END - RADIUS) / 2, WIDE, THICK)
        parts = [
            self._part(arm, out, size, color)
            for arm in self.arms
            for out, size, color in ((RADIUS, bar, RED), ((RADIUS + END) / 2, tab, DARK_BLUE))
        ]
        world.add("frame", *parts, position=(0.0, 0.0, THICK))

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the frame down."""
        super().sample(world, rng)
        x, y = rng.uniform_between([-0.02, -0.02], [0.02, 0.02]).tolist()
        world.set_pose("frame", (x, y, THICK), rng.yaw_quaternion(-TURN, TURN))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: high, level, held by all, at rest."""
        held = self.count([state.is_grasping(arm, "frame") for arm in self.arms])
        high = (held >= len(self.arms)) & (state.position("frame")[:, 2] >= HEIGHT)
        level = state.rotation("frame")[:, 2, 2] >= cos(LEVEL)
        return {
            "is_one_holding": held >= 1,
            "are_all_holding": held >= len(self.arms),
            "is_high": high,
            "success": high & level & (state.speed("frame") <= SPEED / state.scale),
        }

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCPs and the frame."""
        return {**super().observe(state, info), "frame_pose": state.pose("frame")}

    def ways(self, state: State) -> list[Floats]:
        """Of the hands to the frame, and of the frame upwards."""
        above = maximum(HEIGHT - state.position("frame")[:, 2], 0.0)
        return [*(state.tcp_distance(arm, "frame") for arm in self.arms), above]

    def _part(self, arm: str, out: float, half_size: Vector3, color: Color) -> Box:
        """Return a box before an arm, its x axis towards it."""
        x, y = self.before(arm, out)
        half_turn = atan2(y, x) / 2
        turned = (cos(half_turn), 0.0, 0.0, sin(half_turn))
        return Box(
            half_size=half_size, position=(x, y, 0.0), quaternion=turned, density=300.0, color=color
        )
