"""FourRobotStack: all arms pick at once and wait; one after the other they stack."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import radians

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.driver import ArmDriver
from robot_layouts.experts.geometry import backed_off
from robot_layouts.experts.grasps import (
    PLACE_YAWS,
    YAWS,
    cube_grip_from,
    grips_to,
    held_at,
    lowerable,
    need_fingers,
    pick,
)
from robot_layouts.experts.rehearsal import first_success
from robot_layouts.experts.script import CLOSED, OPEN, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
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
        home: Whether an arm that has let go returns to where it started, not just out of the way.
        patient: Whether an arm takes its cube only when the arm before it has let go.
        turn: What the arm before must have done when the next brings its cube.
        ready: How near an arm must come to the place above its cube before it goes down (rad).
    """

    tilt: float | None = radians(20)
    waiting: float = 0.12
    clearance: float = 0.05
    home: bool = False
    patient: bool = False
    turn: str = "rise"
    ready: float = 0.1


STYLES = (
    Style(),
    Style(turn="retreat", ready=0.03),
    Style(ready=0.03),
    Style(tilt=radians(30)),
    Style(tilt=radians(10)),
    Style(tilt=radians(25), clearance=0.07, waiting=0.16),
    Style(tilt=None),
    Style(tilt=None, clearance=0.07, waiting=0.16),
    Style(home=True),
    Style(tilt=None, home=True),
    Style(home=True, patient=True),
    Style(tilt=None, home=True, patient=True),
)


def stack_for_four(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions of all arms, (T, A).

    Args:
        task: A FourRobotStack; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "stacking cubes", *ORDER)

    def scripts(scene: Scene) -> list[Script]:
        starts = {
            place: ArmDriver(task.layout.arm(place).robot).arm(scene.qpos(place)) for place in ORDER
        }
        return [
            {place: _stack(task, style, place, scene.base(place), starts[place]) for place in ORDER}
            for style in STYLES
        ]

    return first_success(task, seed, scripts)


def _stack(
    task: TaskEnv, style: Style, robot: str, base: Floats, start: Floats
) -> tuple[Waypoint, ...]:
    """One arm picks its cube, waits for the one before it, and lays its own on top.

    Args:
        task: Says where it stands.
        style: How.
        robot: The arm.
        base: Where it stands, (3,) (m, world).
        start: Its joints at the beginning, (arm joints,) (rad).
    """
    level = list(ORDER).index(robot)
    cube = f"cube_{robot}"

    def goal(scene: Scene) -> Floats:
        scales = [scene.scale(f"cube_{place}") for place in list(ORDER)[: level + 1]]
        return np.array([0.0, 0.0, (2 * sum(scales[:-1]) + scales[-1]) * CUBE_HALF_SIZE])

    def lift(scene: Scene) -> list[Pose]:
        x, y, _ = scene.body(cube)[0]
        return held_at(scene, robot, cube, np.array([x, y, style.waiting]))

    def place(scene: Scene, up: float, yaws: Sequence[float] = (0.0,)) -> list[Pose]:
        return held_at(scene, robot, cube, goal(scene) + (0.0, 0.0, up), yaws)

    def in_place(scene: Scene) -> bool:
        return bool(np.abs(scene.body(cube)[0] - goal(scene)).max() < IN_PLACE)

    def rise(scene: Scene) -> list[Pose]:
        return [backed_off(scene.tcp(robot), 0.08)]

    def retreat(scene: Scene) -> list[Pose]:
        position, quaternion = scene.tcp(robot)
        outward = (base - position) * (1.0, 1.0, 0.0)
        return [(position + 0.25 * outward / np.linalg.norm(outward), quaternion)]

    if style.tilt is None:
        grips = grips_to(task, robot, cube, goal, style.clearance)
        over = partial(place, up=style.clearance, yaws=PLACE_YAWS)
        over = lowerable(task, robot, over, style.clearance)
    else:
        grips = partial(_grip, cube=cube, base=base, tilt=style.tilt)
        over = partial(place, up=style.clearance, yaws=YAWS)
    turn = (f"{list(ORDER)[level - 1]}.{style.turn}",) if level else ()
    above, *picking = pick(robot, cube, grips, ready=style.ready)
    return (
        replace(above, after=turn if style.patient else ()),
        *picking,
        Waypoint("lift", lift, CLOSED),
        Waypoint("over", over, CLOSED, after=turn),
        Waypoint("lower", partial(place, up=0.001), CLOSED, near=0.03, until=in_place),
        Waypoint("release", None, OPEN, steps=2),
        Waypoint("rise", rise, OPEN, near=0.1),
        Waypoint("retreat", turn=lambda arm: start - arm)
        if style.home
        else Waypoint("retreat", retreat, OPEN),
    )


def _grip(scene: Scene, cube: str, base: Floats, tilt: float) -> list[Pose]:
    return [cube_grip_from(scene.body(cube), base, tilt)]
