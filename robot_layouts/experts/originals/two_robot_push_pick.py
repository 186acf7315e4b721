"""TwoRobotPushPick: the stick pushes the cube straight ahead, correcting; the gripper takes it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import radians

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.geometry import gripper_facing, heading
from robot_layouts.experts.grasps import cube_grips, held_at, need_fingers, pick
from robot_layouts.experts.rehearsal import first_success
from robot_layouts.experts.script import CLOSED, OPEN, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv

PUSHER, PICKER, CUBE, GOAL = "pusher", "picker", "cube", "goal_site"

HIGH = 0.12  # of the tip when it moves over the table (m)
LEANS = tuple(map(radians, (0, 20, -20, 40)))  # of the stick, from straight down
GRIP_LEANS = tuple(map(radians, (0, -20, 20, -40, 40)))  # at the goal


@dataclass(frozen=True)
class Style:
    """How the cube is pushed.

    Attributes:
        until: How far along y (m, world) it is to come.
        gap: Between the tip and the cube's middle when the tip comes down (m).
        stroke: How far the tip advances before it aims again (m).
        height: Of the tip over the table (m).
        near: How near the arm must come to the end of a stroke before the next (rad).
    """

    until: float = 0.0
    gap: float = 0.05
    stroke: float = 0.02
    height: float = 0.02
    near: float = 0.03


# Tried in this order. The first solves each of the seeds 0 … 99.
STYLES = (
    Style(),
    Style(stroke=0.012),
    Style(until=0.03, near=0.06),
    Style(until=-0.03, height=0.015),
)


def push_and_pick(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions of both arms, (T, A).

    Args:
        task: A TwoRobotPushPick; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If the picker has no fingers, or an arm cannot reach what it should.
    """
    need_fingers(task, "picking the cube", PICKER)
    return first_success(task, seed, lambda scene: [_script(style, scene) for style in STYLES])


def _script(style: Style, scene: Scene) -> Script:
    forward = heading(scene.base(PUSHER), scene.base(PICKER))
    ahead = np.array([np.cos(forward), np.sin(forward), 0.0])
    aside = np.array([-ahead[1], ahead[0], 0.0])
    start, _ = scene.body(CUBE)
    way = (np.array([start[0], style.until, 0.0]) - start) @ ahead
    strokes = max(1, int(np.ceil((way + style.gap) / style.stroke)))

    def tip(place: Floats, height: float) -> list[Pose]:
        at = np.array([*place[:2], height])
        return [(at, gripper_facing(forward, lean)) for lean in LEANS]

    def behind(scene: Scene, height: float) -> list[Pose]:
        return tip(scene.body(CUBE)[0] - style.gap * ahead, height)

    def push(scene: Scene, share: float) -> list[Pose]:
        cube, _ = scene.body(CUBE)
        along = start @ ahead - style.gap + share * (way + style.gap - _CONTACT)
        return tip(along * ahead + (cube @ aside) * aside, style.height)

    def back(scene: Scene, height: float, way: float) -> list[Pose]:
        return tip(scene.tcp(PUSHER)[0] - way * ahead, height)

    def carry(scene: Scene) -> list[Pose]:
        return held_at(scene, PICKER, CUBE, scene.body(GOAL)[0], leans=GRIP_LEANS)

    def make_room(scene: Scene) -> list[Pose]:
        position, quaternion = scene.tcp(PICKER)
        return [(position + 0.2 * ahead, quaternion)]

    return {
        PUSHER: (
            Waypoint("above", partial(behind, height=HIGH), CLOSED, near=0.1),
            Waypoint("behind", partial(behind, height=style.height), CLOSED, near=style.near),
            *(
                Waypoint(
                    f"push {i}", partial(push, share=(i + 1) / strokes), CLOSED, near=style.near
                )
                for i in range(strokes)
            ),
            Waypoint("back", partial(back, height=style.height, way=0.05), CLOSED, near=0.1),
            Waypoint("away", partial(back, height=HIGH, way=0.25), CLOSED, near=0.1),
        ),
        PICKER: (
            Waypoint("make room", make_room, OPEN, near=0.1),
            Waypoint("wait", None, OPEN, after=(f"{PUSHER}.back",)),
            *pick(PICKER, CUBE, lambda scene: cube_grips(scene.body(CUBE))),
            Waypoint("carry", carry, CLOSED, near=0.0),
        ),
    }


_CONTACT = 0.028  # from the tip's middle to the cube's when they touch (m)
