"""CellPushBar: three arms of different makes push a long bar onto a line, which lies askew."""

from __future__ import annotations

from typing import Any

from layouts import around_table
from tasks import (
    GREEN,
    RED,
    Area,
    Box,
    CellTask,
    Compound,
    Cuboid,
    State,
    Table,
    is_at_rest,
    register_task,
    transform,
)
from tasks.maths import Array, Floats

HALF_WIDTH, HALF_LENGTH, HALF_HEIGHT = 0.025, 0.65, 0.02  # of the bar (m)
NEAR, ON = 0.1, 0.02  # of a tip that is at the bar, and of the bar's ends on the line (m)
ENDS = ((0.0, -0.6, 0.0), (0.0, 0.6, 0.0))  # of bar and line, in their frames (m)
LINE = Box(half_size=(0.015, HALF_LENGTH, 0.0005), color=GREEN, collides=False)


@register_task("CellPushBar-v1")
class CellPushBar(CellTask):
    """Push the bar onto the line, all together.

    The bar, 1.3 m long, lies across before the arms, x in [-0.1, -0.06] (m), turned by up to 2°;
    the line's middle is at x in [0.05, 0.13] (m), and it is turned by up to 6°.

    Success: both ends of the bar are within 2 cm of the line, and it is at rest.
    """

    instruction = (
        "Push the bar onto the line.",
        "Together push the long bar until it lies on the green line.",
        "Line the bar up with the mark.",
    )
    layout = around_table(
        {"right": "xarm7", "middle": "panda_stick", "left": "panda"},
        edges=("west", "west", "west"),
        table=(1.2, 1.5),
        inset=0.1,
    )
    table = Table()
    max_episode_steps = 200
    stages = {"is_one_at": 0.2, "are_all_at": 0.4, "is_half_way": 0.7, "success": 1.0}
    viewpoint = ((1.3, -0.9, 1.1), (-0.1, 0.0, 0.0))

    line = Compound((LINE,), 0.0005, kind="kinematic", spawn=Area(x=(0.05, 0.13), yaw=(-0.1, 0.1)))
    bar = Cuboid(
        (HALF_WIDTH, HALF_LENGTH, HALF_HEIGHT),
        RED,
        density=300.0,
        spawn=Area(x=(-0.1, -0.06), yaw=(-0.035, 0.035)),
    )

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: both ends on the line, at rest."""
        at = self.count([way <= NEAR for way in self._tips(state)])
        near, on = (self.count([e <= far for e in self._ends(state)]) for far in (0.09, ON))
        return {
            "is_one_at": at >= 1,
            "are_all_at": at >= 3,
            "is_half_way": near >= 2,
            "success": (on >= 2) & is_at_rest(state, "bar"),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the tips to the bar, and of its ends to the line."""
        return [*self._tips(state), *self._ends(state)]

    def _ends(self, state: State) -> list[Floats]:
        ends = [state.array((end,)) for end in ENDS]
        bar, line = ([transform(state.pose(b), e) for e in ends] for b in ("bar", "line"))
        off: Any = [abs(one[:, 0] - other[:, 0]) for one, other in zip(bar, line, strict=True)]
        return off

    def _tips(self, state: State) -> list[Floats]:
        """Of tips to the bar along x; while they are high or far aside, they are not at it."""
        bar = state.position("bar")
        tips = [state.tcp_position(arm) for arm in self.arms]
        off: Any = [abs(tip[:, 0] - bar[:, 0]) + abs(tip[:, 2] - bar[:, 2]) for tip in tips]
        return off
