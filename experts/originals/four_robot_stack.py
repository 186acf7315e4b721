"""FourRobotStack: all arms pick at once and wait; one after the other they stack."""

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
    grips_to,
    held_at,
    lowerable,
    need_fingers,
    pick,
)
from experts.rehearsal import first_success
from experts.script import CLOSED, OPEN, Pose, Scene, Script, Waypoint
from kinematics.rotations import Floats
from tasks import MultiRobotTask
from tasks.originals.four_robot_stack import CUBE_HALF_SIZE, ORDER

IN_PLACE = 0.012  # how near to its place a cube is let go (m)


@dataclass(frozen=True)
class Style:
    """How the cubes are stacked.

    Attributes:
        tilt: Angle of the grippers from straight down, forward (rad); None is any angle, and any
            side of the cube, with which it can be brought to its place.
        waiting: How high a cube is held until its turn comes (m).
        clearance: How high above its place it is before it is lowered (m).
    """

    tilt: float | None = radians(20)
    waiting: float = 0.12
    clearance: float = 0.05


STYLES = (
    Style(),
    Style(tilt=radians(30)),
    Style(tilt=radians(10)),
    Style(tilt=radians(25), clearance=0.07, waiting=0.16),
    Style(tilt=None),
    Style(tilt=None, clearance=0.07, waiting=0.16),
)


def stack_for_four(task: MultiRobotTask, seed: int) -> NDArray[np.float32]:
    """Return the actions of all arms, (T, A).

    Args:
        task: A FourRobotStack; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "stacking cubes", *ORDER)
    return first_success(task, seed, lambda scene: [_script(task, s, scene) for s in STYLES])


def _script(task: MultiRobotTask, style: Style, scene: Scene) -> Script:
    places = list(ORDER)
    return {
        place: _stack(
            task, style, place, level, scene.base(place), places[level - 1] if level else None
        )
        for level, place in enumerate(places)
    }


def _stack(
    task: MultiRobotTask, style: Style, robot: str, level: int, base: Floats, before: str | None
) -> tuple[Waypoint, ...]:
    """One arm picks its cube, waits for the one before it, and lays its own on top."""
    cube = f"cube_{robot}"
    goal = np.array([0.0, 0.0, (2 * level + 1) * CUBE_HALF_SIZE])

    def lift(scene: Scene) -> list[Pose]:
        x, y, _ = scene.body(cube)[0]
        return held_at(scene, robot, cube, np.array([x, y, style.waiting]))

    def place(scene: Scene, up: float, yaws: Sequence[float] = (0.0,)) -> list[Pose]:
        return held_at(scene, robot, cube, goal + (0.0, 0.0, up), yaws)

    def in_place(scene: Scene) -> bool:
        return bool(np.abs(scene.body(cube)[0] - goal).max() < IN_PLACE)

    def rise(scene: Scene) -> list[Pose]:
        return [backed_off(scene.tcp(robot), 0.08)]

    def retreat(scene: Scene) -> list[Pose]:
        position, quaternion = scene.tcp(robot)
        outward = (base - position) * (1.0, 1.0, 0.0)
        return [(position + 0.25 * outward / np.linalg.norm(outward), quaternion)]

    if style.tilt is None:
        grips = grips_to(task, robot, cube, lambda scene: goal, style.clearance)
        over = partial(place, up=style.clearance, yaws=PLACE_YAWS)
        over = lowerable(task, robot, over, style.clearance)
    else:
        grips = partial(_grip, cube=cube, base=base, tilt=style.tilt)
        over = partial(place, up=style.clearance, yaws=YAWS)
    turn = () if before is None else (f"{before}.rise",)
    return (
        *pick(robot, cube, grips),
        Waypoint("lift", lift, CLOSED),
        Waypoint("over", over, CLOSED, after=turn),
        Waypoint("lower", partial(place, up=0.001), CLOSED, near=0.03, until=in_place),
        Waypoint("release", None, OPEN, steps=2),
        Waypoint("rise", rise, OPEN, near=0.1),
        Waypoint("retreat", retreat, OPEN),
    )


def _grip(scene: Scene, cube: str, base: Floats, tilt: float) -> list[Pose]:
    return [cube_grip_from(scene.body(cube), base, tilt)]
