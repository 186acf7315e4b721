"""CellLiftBoard: four arms round a table lift a board by its tabs, level."""

from __future__ import annotations

from math import cos, radians

from layouts import around_table
from tasks import DARK_BLUE, RED, Area, Box, CellTask, Compound, Needs, State, register_task
from tasks.maths import Array, Floats, maximum

HALF_THICKNESS, HALF_WIDTH, TAB, GRIP = 0.018, 0.15, 0.05, 0.21  # m
SIDES = {"south": (0.0, -1.0), "east": (1.0, 0.0), "north": (0.0, 1.0), "west": (-1.0, 0.0)}
HEIGHT, LEVEL, TURN = 0.15, radians(5), radians(12)
SPEED = 0.02  # of a board that is held still (m/s)


def board() -> tuple[Box, ...]:
    """Return a square board with a tab at each side."""
    middle = Box(half_size=(HALF_WIDTH, HALF_WIDTH, HALF_THICKNESS), density=300.0, color=RED)
    tabs = [
        Box(
            half_size=(TAB if x else 0.02, TAB if y else 0.02, HALF_THICKNESS),
            position=(x * (HALF_WIDTH + TAB), y * (HALF_WIDTH + TAB), 0.0),
            density=300.0,
            color=DARK_BLUE,
        )
        for x, y in SIDES.values()
    ]
    return (middle, *tabs)


@register_task("CellLiftBoard-v1")
class CellLiftBoard(CellTask):
    """Lift the board together, each arm by the tab before it, and hold it level.

    The board, 30 cm wide, lies at the table's middle, up to 3 cm off and turned by up to 12°.

    Success: it is 15 cm high and level to 5°, all four arms hold it, and it moves no more.
    """

    instruction = (
        "Lift the board together and hold it level.",
        "Each take the tab before you, then raise the board.",
        "Raise the board by its four tabs without tilting it.",
    )
    layout = around_table(
        dict(zip(SIDES, ("panda", "panda_wristcam") * 2, strict=True)),
        edges=tuple(SIDES),
        table=(1.76, 1.76),
    )
    needs = {"*": Needs(fingers=True, opening=0.04)}
    max_episode_steps = 150
    stages = {"is_one_holding": 0.2, "are_all_holding": 0.5, "is_high": 0.8, "success": 1.0}
    viewpoint = ((1.2, 1.0, 1.0), (0.0, 0.0, 0.1))

    board = Compound(
        board(),
        HALF_THICKNESS,
        start=(0.0, 0.0, HALF_THICKNESS),
        spawn=Area(x=(-0.03, 0.03), y=(-0.03, 0.03), yaw=(-TURN, TURN)),
    )

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: high, level, held by all, at rest."""
        held = self.count([state.is_grasping(arm, "board") for arm in self.arms])
        high = (held >= 4) & (state.position("board")[:, 2] >= HEIGHT)
        level = state.rotation("board")[:, 2, 2] >= cos(LEVEL)
        return {
            "is_one_holding": held >= 1,
            "are_all_holding": held >= 4,
            "is_high": high,
            "success": high & level & (state.speed("board") <= SPEED),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the hands to the board, and of the board upwards."""
        above = maximum(HEIGHT - state.position("board")[:, 2], 0.0)
        return [*(state.tcp_distance(arm, "board") for arm in self.arms), above]
