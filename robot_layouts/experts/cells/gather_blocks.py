"""CellGatherBlocks: each tip goes behind its block and pushes it, aiming at every stroke."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from robot_layouts.experts.reaching import reaching
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import CLOSED, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.gather_blocks import SIDES

HIGH = 0.14  # of the tip on its way over the table (m)


@dataclass(frozen=True)
class Style:
    """How a block is pushed.

    Attributes:
        end: How far from the middle it comes to lie (m).
        gap: Between the tip and the block's middle when the tip comes down (m).
        strokes: In how many parts; before each the tip aims anew.
        height: Of the tip over the table (m).
    """

    end: float = 0.16
    gap: float = 0.08
    strokes: int = 8
    height: float = 0.025


STYLES = (Style(), Style(strokes=14), Style(end=0.14, strokes=14), Style(gap=0.1, height=0.035))


def gather_blocks(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that gather the blocks."""
    return first_success(
        task, seed, lambda scene: [_script(task, style) for style in STYLES], as_declared=True
    )


def _script(task: TaskEnv, style: Style) -> Script:
    return {arm: tuple(_push(task, arm, style)) for arm in SIDES}


def _push(task: TaskEnv, arm: str, style: Style) -> list[Waypoint]:
    block = f"block_{arm}"
    go = partial(reaching, task, arm, leans=(0.0, 0.3, 0.6, -0.3), as_it_is=False, gripper=CLOSED)

    def behind(scene: Scene, height: float) -> Floats:
        place = scene.body(block)[0][:2]
        away = place / np.linalg.norm(place)
        return np.array([*(place + style.gap * away), height])

    def along(scene: Scene, left: int) -> Floats:
        """The tip's next place: behind the block, on the line from the middle through it."""
        place, tip = scene.body(block)[0][:2], scene.tcp(arm)[0][:2]
        away = place / np.linalg.norm(place)
        far = float(tip @ away)
        end = style.end + CONTACT
        return np.array([*((far + (end - far) / left) * away), style.height])

    def back(scene: Scene, height: float) -> Floats:
        tip = scene.tcp(arm)[0][:2]
        return np.array([*(tip + 0.06 * tip / np.linalg.norm(tip)), height])

    return [
        go("above", partial(behind, height=HIGH), near=0.05),
        go("behind", partial(behind, height=style.height), near=0.03),
        *(
            go(f"push {i}", partial(along, left=style.strokes - i), near=0.03)
            for i in range(style.strokes)
        ),
        go("back", partial(back, height=style.height), near=0.1),
        go("away", partial(back, height=HIGH), near=0.1),
    ]


CONTACT = 0.04  # from the tip's middle to the block's when they touch, about (m)
