"""TwoRobotStackCube: the right arm lays its cube on the target, the left one stacks its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import radians

import numpy as np
from numpy.typing import NDArray

from experts.geometry import backed_off
from experts.grasps import (
    PLACE_YAWS,
    YAWS,
    cube_grip_from,
    cube_grips,
    grips_to,
    held_at,
    is_near,
    lowerable,
    need_fingers,
    pick,
)
from experts.rehearsal import first_success
from experts.script import CLOSED, OPEN, Pose, Scene, Waypoint
from kinematics.rotations import Floats
from tasks import MultiRobotTask
from tasks.maniskill.two_robot_stack_cube import CUBE_HALF_SIZE

STACKER, LAYER, TOP, BASE, TARGET = "left", "right", "cubeA", "cubeB", "goal_region"
ON_TOP = (0.0, 0.0, 2 * CUBE_HALF_SIZE)  # from the green cube to where the blue one is to lie (m)
IN_PLACE = 0.012  # how near to that place the blue cube is let go (m)
CLEARANCE = 0.05  # how high above its place the blue cube is before it is lowered (m)
WAITING = 0.12  # how high the blue cube is held until its turn comes (m)


@dataclass(frozen=True)
class Style:
    """How the green cube travels.

    Attributes:
        tilt: Angle of the right gripper from straight down, forward, because the target is
            farther away than the arm reaches straight down (rad). None is any angle, and any side
            of the cube, with which it can be brought there; likewise for the left gripper, which
            else points straight down.
        short: How far before the target's middle it is laid down; the target's radius is
            0.06 m (m).
        clearance: How high above its place it is before it is lowered (m).
    """

    tilt: float | None = radians(20)
    short: float = 0.05
    clearance: float = 0.02


# Tried in this order. The first solves each of the seeds 0 … 99.
STYLES = (
    Style(),
    Style(tilt=radians(30)),
    Style(short=0.04),
    Style(tilt=radians(30), short=0.04, clearance=0.04),
    Style(tilt=radians(10)),
    Style(tilt=None),
    Style(tilt=None, clearance=0.04),
)


def stack_for_two(task: MultiRobotTask, seed: int) -> NDArray[np.float32]:
    """Return the actions of both arms, (T, A).

    Args:
        task: A TwoRobotStackCube; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "stacking cubes", STACKER, LAYER)
    base = np.array(task.layout.arm(LAYER).base_position)
    return first_success(
        task,
        seed,
        lambda scene: [
            {LAYER: _lay(task, style, base), STACKER: _stack(task, style, base)} for style in STYLES
        ],
    )


def _lay(task: MultiRobotTask, style: Style, base: Floats) -> tuple[Waypoint, ...]:
    """The right arm brings the green cube and makes room."""
    at_target = partial(_at_target, style=style, base=base)

    def grips(scene: Scene) -> list[Pose]:
        if style.tilt is None:
            return grips_to(task, LAYER, BASE, at_target, style.clearance)(scene)
        return [cube_grip_from(scene.body(BASE), base, style.tilt)]

    def place(scene: Scene, up: float, yaws: Sequence[float] = (0.0,)) -> list[Pose]:
        return held_at(scene, LAYER, BASE, at_target(scene) + (0.0, 0.0, up), yaws)

    def rise(scene: Scene) -> list[Pose]:
        return [backed_off(scene.tcp(LAYER), 0.08)]

    def retreat(scene: Scene) -> list[Pose]:
        position, quaternion = backed_off(scene.tcp(LAYER), 0.1)
        return [(position - 0.15 * _level(position - base), quaternion)]

    over = partial(place, up=style.clearance, yaws=YAWS)
    if style.tilt is None:
        over = partial(place, up=style.clearance, yaws=PLACE_YAWS)
        over = lowerable(task, LAYER, over, style.clearance)
    return (
        *pick(LAYER, BASE, grips),
        Waypoint("over", over, CLOSED),
        Waypoint("lower", partial(place, up=0.001), CLOSED, near=0.03),
        Waypoint("release", None, OPEN, steps=2),
        Waypoint("rise", rise, OPEN, near=0.1),
        Waypoint("retreat", retreat, OPEN),
    )


def _stack(task: MultiRobotTask, style: Style, base: Floats) -> tuple[Waypoint, ...]:
    """The left arm picks the blue cube, waits, and lays it on the green one."""

    def on_top(scene: Scene) -> Floats:
        return _at_target(scene, style, base) + ON_TOP

    def grips(scene: Scene) -> list[Pose]:
        if style.tilt is None:
            return grips_to(task, STACKER, TOP, on_top, CLEARANCE)(scene)
        return cube_grips(scene.body(TOP))

    def lift(scene: Scene) -> list[Pose]:
        x, y, _ = scene.body(TOP)[0]
        return held_at(scene, STACKER, TOP, np.array([x, y, WAITING]))

    def place(scene: Scene, up: float, yaws: Sequence[float] = (0.0,)) -> list[Pose]:
        top = scene.body(BASE)[0] + ON_TOP + np.array([0.0, 0.0, up])
        return held_at(scene, STACKER, TOP, top, yaws)

    over = partial(place, up=CLEARANCE, yaws=YAWS)
    if style.tilt is None:
        over = lowerable(task, STACKER, partial(place, up=CLEARANCE, yaws=PLACE_YAWS), CLEARANCE)
    in_place = partial(is_near, body=TOP, other=BASE, offset=ON_TOP, limit=IN_PLACE)
    return (
        *pick(STACKER, TOP, grips),
        Waypoint("lift", lift, CLOSED),
        Waypoint("over", over, CLOSED, after=(f"{LAYER}.rise",)),
        Waypoint("lower", partial(place, up=0.001), CLOSED, near=0.03, until=in_place),
        Waypoint("release", None, OPEN),
    )


def _at_target(scene: Scene, style: Style, base: Floats) -> Floats:
    """Return where the green cube is to lie, (3,) (m)."""
    target, _ = scene.body(TARGET)
    x, y, _ = target - style.short * _level(target - base)
    return np.array([x, y, CUBE_HALF_SIZE])


def _level(vector: Floats) -> Floats:
    """Return the direction of a vector as seen from above, (3,)."""
    level = vector * (1.0, 1.0, 0.0)
    return level / np.linalg.norm(level)
