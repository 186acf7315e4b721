"""CellBalanceBall: three arms carry a board with a loose ball on it over a mark, level."""

from __future__ import annotations

from math import cos, pi, radians, sin, sqrt

from layouts import ring
from tasks import RED, Area, Ball, Box, CellTask, Compound, Needs, State, Target, register_task
from tasks.maths import Array, Floats, maximum

WIDE, TAB, GRIP = 0.12, 0.05, 0.18  # of board and half a tab, and where it is held (m)
THICK, RIM, RADIUS = 0.018, 0.006, 0.02  # of half a tab, half a rim, and the ball (m)
HEIGHT, NEAR, LEVEL, SPEED = 0.12, 0.03, radians(5), 0.02  # m, m, rad, m/s
OFF, TURN, FAR = 0.03, radians(8), 0.08  # of board and ball, and of the mark (m, rad, m)
LOW, HIGH = (-WIDE, -WIDE, 0.0), (WIDE, WIDE, 0.06)  # of a ball on the board, in its frame (m)
TABS = {"south": -pi / 2, "east": pi / 6, "west": 5 * pi / 6}  # rad, from the board's x axis


def bar(turn: float, half_size: tuple[float, float, float], out: float = 0.0) -> Box:
    """Return a box turned about the origin (rad), its middle so far (m) out."""
    low = half_size[2] - THICK  # its bottom is the board's
    return Box(
        half_size=half_size,
        position=(out * cos(turn), out * sin(turn), low),
        quaternion=(cos(turn / 2), 0.0, 0.0, sin(turn / 2)),
        density=300.0,
    )


def board() -> tuple[Box, ...]:
    """Return a board of six sides with a rim, and a tab at every other side."""
    side, turns = WIDE / sqrt(3), [pi / 6 + i * pi / 3 for i in range(6)]
    floor = [bar(turn, (WIDE, side, 0.008)) for turn in turns[:3]]
    rim = [bar(turn, (RIM, side, THICK), WIDE - RIM) for turn in turns]
    return (*floor, *rim, *(bar(turn, (TAB, 0.02, THICK), WIDE + TAB) for turn in TABS.values()))


@register_task("CellBalanceBall-v1")
class CellBalanceBall(CellTask):
    """Lift the board by its tabs, and hold it over the mark without losing the ball.

    The board lies in the middle, up to 3 cm off along x and y, turned by up to 8°; the ball on it,
    up to 3 cm off as well; the mark is up to 8 cm off.

    Success: the board is 12 cm high, level to 5° and within 3 cm of the mark, all arms hold it,
    the ball is on it, and it moves no more.
    """

    instruction = (
        "Carry the board over the mark without losing the ball.",
        "Lift the board together, keep it level, and bring the ball over the mark.",
        "Each take the tab before you; balance the ball on its way over the mark.",
    )
    layout = ring(
        dict(zip(TABS, ("panda", "franka_panda", "panda_wristcam"), strict=True)), radius=0.78
    )
    needs = {"*": Needs(fingers=True, opening=0.04)}
    max_episode_steps = 120
    stages = {"is_one_holding": 0.2, "are_all_holding": 0.4, "is_high": 0.7, "success": 1.0}
    viewpoint = ((1.1, -0.7, 0.9), (0.0, 0.0, 0.1))

    mark = Target(NEAR, spawn=Area(x=(-FAR, FAR), y=(-FAR, FAR)))
    board = Compound(board(), THICK, spawn=Area(x=(-OFF, OFF), y=(-OFF, OFF), yaw=(-TURN, TURN)))
    ball = Ball(
        RADIUS,
        RED,
        density=300.0,
        spawn=Area(x=(-OFF, OFF), y=(-OFF, OFF), z=0.016 + RADIUS),
    )

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: high, level, over the mark, held by all, at rest, the ball on it."""
        held = self.count([state.is_grasping(arm, "board") for arm in self.arms])
        on = self.is_within(state, "ball", "board", LOW, HIGH)
        high = (held >= 3) & on & (state.position("board")[:, 2] >= HEIGHT)
        level = state.rotation("board")[:, 2, 2] >= cos(LEVEL)
        there = level & (state.planar_distance("board", "mark") <= NEAR)
        return {
            "is_one_holding": held >= 1,
            "are_all_holding": held >= 3,
            "is_high": high,
            "success": high & there & (state.speed("board") <= SPEED),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the hands to the board, of the board upwards, and of it to the mark."""
        above = maximum(HEIGHT - state.position("board")[:, 2], 0.0)
        hands = [state.tcp_distance(arm, "board") for arm in self.arms]
        return [*hands, above, state.planar_distance("board", "mark")]
