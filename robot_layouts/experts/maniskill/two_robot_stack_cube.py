"""TwoRobotStackCube: the right arm lays its cube on the target, the left one stacks its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import radians

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.geometry import backed_off, turn
from robot_layouts.experts.grasps import (
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
from robot_layouts.experts.rehearsal import first_success
from robot_layouts.experts.script import CLOSED, OPEN, Pose, Scene, Waypoint
from robot_layouts.kinematics.rotations import Floats, multiply, rotate
from tasks import TaskEnv
from tasks.maniskill.two_robot_stack_cube import CUBE_HALF_SIZE

STACKER, LAYER, TOP, BASE, TARGET = "left", "right", "cubeA", "cubeB", "goal_region"
ON_TOP = (0.0, 0.0, 2 * CUBE_HALF_SIZE)  # from the green cube to where the blue one is to lie (m)
IN_PLACE = 0.012  # how near to that place the blue cube is let go (m)
CLEARANCE = 0.05  # how high above its place the blue cube is before it is lowered (m)
WAITING = 0.12  # how high the blue cube is held until its turn comes (m)
RISES = (0.1, 0.05, 0.0)  # how far an arm may rise when it makes room (m)


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
        aside: How far an arm turns about its base, away from the other one's, to make room for it
            (rad): the left arm with its cube before the green one comes, the right arm after it.
            With 0 the left arm waits above where its cube lay, and goes on as soon as the right
            gripper has risen.
        late: Whether the left arm picks its cube only when the right one has left.
        ready: How near a gripper comes to its place above a cube before it goes down (rad).
    """

    tilt: float | None = radians(20)
    short: float = 0.05
    clearance: float = 0.02
    aside: float = 0.0
    late: bool = False
    ready: float = 0.1


# Tried in this order. The first solves each of the seeds 0 … 99.
STYLES = (
    Style(),
    Style(tilt=radians(30)),
    Style(short=0.04),
    Style(tilt=radians(30), short=0.04, clearance=0.04),
    Style(tilt=radians(10)),
    Style(tilt=None),
    Style(tilt=None, clearance=0.04),
    Style(tilt=None, aside=0.4),
    Style(tilt=None, aside=0.4, late=True),
    Style(tilt=None, aside=0.7),
    Style(tilt=None, aside=0.7, late=True),
    Style(tilt=radians(10), short=0.03, aside=0.4, ready=0.03),
)


def stack_for_two(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions of both arms, (T, A).

    Args:
        task: A TwoRobotStackCube; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "stacking cubes", STACKER, LAYER)
    return first_success(
        task,
        seed,
        lambda scene: [
            {LAYER: _lay(task, style, scene), STACKER: _stack(task, style, scene)}
            for style in STYLES
        ],
    )


def _lay(task: TaskEnv, style: Style, first: Scene) -> tuple[Waypoint, ...]:
    """The right arm brings the green cube and makes room."""
    base, other = first.base(LAYER), first.base(STACKER)
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
        tcp = scene.tcp(LAYER)
        if style.aside:
            return [_swung(tcp, base, other, style.aside, up) for up in RISES]
        position, quaternion = backed_off(tcp, 0.1)
        return [(position - 0.15 * _level(position - base), quaternion)]

    over = partial(place, up=style.clearance, yaws=YAWS)
    if style.tilt is None:
        over = partial(place, up=style.clearance, yaws=PLACE_YAWS)
        over = lowerable(task, LAYER, over, style.clearance)
    begin = (f"{STACKER}.lift",) if style.aside and not style.late else ()
    return (
        *pick(LAYER, BASE, grips, ready=style.ready),
        Waypoint("over", over, CLOSED, after=begin),
        Waypoint("lower", partial(place, up=0.001), CLOSED, near=0.03),
        Waypoint("release", None, OPEN, steps=2),
        Waypoint("rise", rise, OPEN, near=0.1),
        Waypoint("retreat", retreat, OPEN, near=0.2 if style.aside else 0.05),
    )


def _stack(task: TaskEnv, style: Style, first: Scene) -> tuple[Waypoint, ...]:
    """The left arm picks the blue cube, waits, and lays it on the green one."""
    base, other = first.base(STACKER), first.base(LAYER)

    def on_top(scene: Scene) -> Floats:
        return _at_target(scene, style, other) + ON_TOP

    def grips(scene: Scene) -> list[Pose]:
        if style.tilt is None:
            return grips_to(task, STACKER, TOP, on_top, CLEARANCE)(scene)
        return cube_grips(scene.body(TOP))

    def lift(scene: Scene) -> list[Pose]:
        x, y, _ = scene.body(TOP)[0]
        lifted = held_at(scene, STACKER, TOP, np.array([x, y, WAITING]))
        return aside(lifted) if style.aside and not style.late else lifted

    def ready(scene: Scene) -> list[Pose]:
        return aside([backed_off(grip, WAITING) for grip in grips(scene)])

    def aside(poses: Sequence[Pose]) -> list[Pose]:
        return [_swung(pose, base, other, style.aside) for pose in poses]

    def place(scene: Scene, up: float, yaws: Sequence[float] = (0.0,)) -> list[Pose]:
        top = scene.body(BASE)[0] + ON_TOP + np.array([0.0, 0.0, up])
        return held_at(scene, STACKER, TOP, top, yaws)

    over = partial(place, up=CLEARANCE, yaws=YAWS)
    if style.tilt is None:
        over = lowerable(task, STACKER, partial(place, up=CLEARANCE, yaws=PLACE_YAWS), CLEARANCE)
    in_place = partial(is_near, body=TOP, other=BASE, offset=ON_TOP, limit=IN_PLACE)
    stack = (
        Waypoint("lower", partial(place, up=0.001), CLOSED, near=0.03, until=in_place),
        Waypoint("release", None, OPEN),
    )
    left = (f"{LAYER}.{'retreat' if style.aside else 'rise'}",)
    if style.late:
        return (
            Waypoint("ready", ready, OPEN, near=0.2),
            Waypoint("wait", None, OPEN, after=left),
            *pick(STACKER, TOP, grips, ready=style.ready),
            Waypoint("lift", lift, CLOSED, near=0.3),
            Waypoint("over", over, CLOSED),
            *stack,
        )
    return (
        *pick(STACKER, TOP, grips, ready=style.ready),
        Waypoint("lift", lift, CLOSED, near=0.2 if style.aside else 0.05),
        Waypoint("over", over, CLOSED, after=left),
        *stack,
    )


def _at_target(scene: Scene, style: Style, base: Floats) -> Floats:
    """Return where the green cube is to lie, (3,) (m)."""
    target, _ = scene.body(TARGET)
    x, y, _ = target - style.short * _level(target - base)
    return np.array([x, y, CUBE_HALF_SIZE])


def _swung(pose: Pose, base: Floats, other: Floats, angle: float, up: float = 0.0) -> Pose:
    """Return a gripper's pose after the arm turned about its base, away from the other's (rad)."""
    position, quaternion = pose
    reach = (position - base) * (1.0, 1.0, 0.0)
    left = np.array([-reach[1], reach[0], 0.0])
    swing = turn("z", angle if left @ (position - other) > 0 else -angle)
    place = position - reach + rotate(swing, reach) + (0.0, 0.0, up)
    return place, multiply(swing, quaternion)


def _level(vector: Floats) -> Floats:
    """Return the direction of a vector as seen from above, (3,)."""
    level = vector * (1.0, 1.0, 0.0)
    return level / np.linalg.norm(level)
