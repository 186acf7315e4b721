"""What the experts of cells share: taking a body along and putting it down."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import islice
from typing import Any

import numpy as np

from objects import ObjectDescriptor
from robot_layouts.experts.cells.tips import FAR, over_table
from robot_layouts.experts.geometry import backed_off, heading, turn, yaw_of
from robot_layouts.experts.grasps import (
    PLACE_YAWS,
    bringing,
    cube_grips,
    held_at,
    lowerable,
    pick,
    thing_grips,
)
from robot_layouts.experts.reaching import reaching
from robot_layouts.experts.script import CLOSED, OPEN, Pose, Scene, Waypoint
from robot_layouts.experts.tips import pose_solver
from robot_layouts.kinematics.rotations import Floats, inverse, multiply, rotate
from tasks import TaskEnv

Grips = Callable[[Scene], Sequence[Pose]]
Place = Callable[[Scene], Floats]
"""Where the origin of a body is to be, (3,) (m, world), given the scene."""

MOST_GRIPS = 6
FREE, BEYOND = 0.08, -0.02  # before a handle, and beyond it so that it is pushed home (m)
TILTS = tuple(np.radians((0, 20, 35, 50)))  # of grippers that hold cubes, from straight down
NEAR_BASE, WAITING = 0.4, 0.3  # of a hand that waits, from its base, and over the table (m)
LEANT, SAME = 0.6, 1e-3  # rad, of grips of a rim, and m between two of the same place at most
READY = 0.03  # rad: so near a gripper comes to its place above a body before it goes down


def cube_holds(body: str, up: float = 0.0) -> Grips:
    """Return the grips of a cube, or of another body of that cross section, from above.

    Args:
        body: The body.
        up: How far above its origin it is held (m).
    """

    def grips(scene: Scene) -> list[Pose]:
        position, quaternion = scene.body(body)
        cube = position + (0.0, 0.0, up), quaternion
        return [grip for tilt in TILTS for grip in cube_grips(cube, tilt=tilt)]

    return grips


def rim_holds(thing: ObjectDescriptor, body: str, robot: str, side: float = 0.0) -> Grips:
    """Return the grips of a vessel by one place on its rim.

    Args:
        thing: Says where it is grasped.
        body: Its name in the world.
        robot: The arm.
        side: Where that place is, seen from the vessel's middle, from the way to the arm on (rad).
    """
    rim = replace(thing, grasps=tuple(grasp for grasp in thing.grasps if grasp.part == "rim"))
    on_rim = thing_grips(rim, body, 0.08, lean=LEANT)

    def grips(scene: Scene) -> list[Pose]:
        middle, _ = scene.body(body)
        towards = heading(middle, scene.base(robot)) + side
        way = np.array([np.cos(towards), np.sin(towards), 0.0])
        found = [((grip[0] - middle) @ way, grip) for grip in on_rim(scene)]
        most = max((out for out, _ in found), default=0.0)
        return [grip for out, grip in found if out > most - SAME]

    return grips


def carriable(
    task: TaskEnv, robot: str, body: str, grips: Grips, place: Place, above: float
) -> Grips:
    """Return those of some grips of a body with which an arm can put it down somewhere.

    Args:
        task: Says where the arm stands.
        robot: The arm.
        body: The body.
        grips: The grips, given the scene; the steepest are tried first.
        place: Where the body is to be.
        above: How far above both places the gripper has to get as well (m).
    """
    solver = pose_solver(task, robot)

    def reachable(scene: Scene, position: Floats, quaternion: Floats) -> bool:
        places, qpos = (position, position + (0.0, 0.0, above)), scene.qpos(robot)
        poses = (scene.in_world((at, quaternion)) for at in places)
        return all(solver.solve(*pose, qpos) is not None for pose in poses)

    def brings(scene: Scene, grip: Pose) -> bool:
        start, _ = scene.body(body)
        if not reachable(scene, *grip):
            return False
        arm, end = grip[0] - start, place(scene)
        turned = (turn("z", yaw) for yaw in PLACE_YAWS)
        return any(
            reachable(scene, end + rotate(yaw, arm), multiply(yaw, grip[1])) for yaw in turned
        )

    def kept(scene: Scene) -> list[Pose]:
        steepest = sorted(grips(scene), key=_steepness)
        return [*islice((grip for grip in steepest if brings(scene, grip)), MOST_GRIPS)]

    return kept


def _steepness(grip: Pose) -> float:
    return float(rotate(grip[1], np.array([0.0, 0.0, 1.0]))[2])


def carry(
    task: TaskEnv,
    robot: str,
    body: str,
    grips: Grips,
    place: Place,
    *,
    height: float = 0.12,
    drop: float = 0.002,
    back: float = 0.2,
    ready: float = READY,
    yaws: Sequence[float] = PLACE_YAWS,
    turn_of: Sequence[str] = (),
    taking: Sequence[str] = (),
    **picking: Any,
) -> tuple[Waypoint, ...]:
    """Return the waypoints with which an arm takes a body and puts it down elsewhere.

    They are those of `pick`, then ``lift``, ``over``, ``lower``, ``release``, ``rise`` and
    ``retreat``, each with the body's name.

    Args:
        task: Says where the arm stands.
        robot: The arm.
        body: The body.
        grips: The gripper's poses to choose from.
        place: Where the body's origin is to be.
        height: How high it is lifted, and how far above its place it is before it goes down (m).
        drop: How far above its place it is let go (m).
        back: How far the hand goes back towards its base then (m).
        ready: As `pick` takes it (rad).
        yaws: How it may turn about the vertical on its way (rad).
        turn_of: Waypoints of other arms that come before it is brought.
        taking: Those that come before it is taken.
        picking: Other arguments of `pick`.
    """
    grips = carriable(task, robot, body, grips, place, height)

    def retreat(scene: Scene) -> list[Pose]:
        position, quaternion = scene.tcp(robot)
        outward = (scene.base(robot) - position) * (1.0, 1.0, 0.0)
        return [(position + back * outward / np.linalg.norm(outward), quaternion)]

    def lift(scene: Scene) -> list[Pose]:
        return [(scene.tcp(robot)[0] + (0.0, 0.0, height), scene.tcp(robot)[1])]

    def at(scene: Scene, up: float, yaws: Sequence[float]) -> list[Pose]:
        return held_at(scene, robot, body, place(scene) + (0.0, 0.0, up), yaws)

    over = lowerable(task, robot, partial(at, up=height, yaws=yaws), height - drop)
    above, *others = pick(robot, body, grips, ready=ready, **picking)
    return (
        replace(above, after=tuple(taking)),
        *others,
        Waypoint(f"lift {body}", lift, CLOSED),
        Waypoint(f"over {body}", over, CLOSED, after=tuple(turn_of), near=0.03),
        Waypoint(f"lower {body}", partial(at, up=drop, yaws=(0.0,)), CLOSED, near=0.02),
        Waypoint(f"release {body}", None, OPEN, steps=3),
        Waypoint(f"rise {body}", lambda scene: [backed_off(scene.tcp(robot), height)], OPEN),
        Waypoint(f"retreat {body}", retreat, OPEN, near=0.1),
    )


def stand_back(task: TaskEnv, robot: str) -> Waypoint:
    """Return the waypoint ``wait``, which brings an arm of a ring back towards its base."""

    def back(scene: Scene) -> Floats:
        base = scene.base(robot)[:2]
        return np.array([*(base * (1 - NEAR_BASE / np.linalg.norm(base))), WAITING])

    return reaching(task, robot, "wait", back, near=0.1)


def lift_together(
    body: str,
    grips: Mapping[str, Grips],
    height: float,
    *,
    legs: int = 4,
    onward: Sequence[Callable[[Scene], Pose]] = (),
    turn_of: Sequence[str] = (),
    near: float = 0.04,
    **picking: Any,
) -> dict[str, tuple[Waypoint, ...]]:
    """Return the script with which arms take a body and raise it level, step by step together.

    After those of `pick`, the waypoints are ``raise 0`` …, and ``move 0`` … if it goes on.

    Args:
        body: What they lift.
        grips: By arm, the gripper's poses to choose from.
        height: How far it is raised (m).
        legs: In how many steps; between them the arms' joints go straight, not the body.
        onward: Where the body goes then, one pose after the other, each worked out from the scene
            when the first arm begins with it.
        turn_of: Waypoints of other arms that come before it goes on.
        near: How near each arm must come to the end of a step before the next (rad).
        picking: Other arguments of `pick`.
    """
    start: list[Pose] = []
    goals: dict[str, Pose] = {}

    def raised(scene: Scene, share: float) -> Pose:
        if not start:  # all of them hold it now
            start.append(scene.body(body))
        position, quaternion = start[0]
        return position + (0.0, 0.0, share * height), turn("z", yaw_of(quaternion))

    steps = {f"raise {i}": partial(raised, share=(i + 1) / legs) for i in range(legs)}
    steps |= {f"move {i}": goal for i, goal in enumerate(onward)}
    before = dict(zip(steps, [f"grasp {body}", *steps], strict=False))

    def waits(step: str, robot: str) -> tuple[str, ...]:
        others = (f"{other}.{before[step]}" for other in grips if other != robot)
        return (*others, *(turn_of if step == "move 0" else ()))

    def brought(scene: Scene, robot: str, step: str) -> list[Pose]:
        if step not in goals:
            goals[step] = steps[step](scene)
        return [bringing(scene, robot, body, goals[step])]

    return {
        robot: (
            *pick(robot, body, own, **picking),
            *(
                Waypoint(
                    step,
                    partial(brought, robot=robot, step=step),
                    CLOSED,
                    after=waits(step, robot),
                    near=near,
                )
                for step in steps
            ),
        )
        for robot, own in grips.items()
    }


def set_down(
    body: str, arms: Sequence[str], last: str, *, rise: float = 0.1, opening: float = OPEN
) -> dict[str, tuple[Waypoint, ...]]:
    """Return the waypoints with which arms let go of a body together: ``release``, ``rise``.

    Args:
        body: What they hold, where it is to stay.
        arms: Who holds it.
        last: The waypoint of all of them that comes before.
        rise: How far the hands back off then (m).
        opening: Action number of the grippers then.
    """

    def rising(scene: Scene, robot: str) -> list[Pose]:
        return [backed_off(scene.tcp(robot), rise)]

    return {
        robot: (
            Waypoint(
                f"release {body}",
                None,
                opening,
                steps=3,
                after=tuple(f"{other}.{last}" for other in arms if other != robot),
            ),
            Waypoint(f"rise {body}", partial(rising, robot=robot), opening, near=0.1),
        )
        for robot in arms
    }


def push_shut(
    task: TaskEnv,
    robot: str,
    body: str,
    *,
    handle: Floats,
    height: float,
    after: Sequence[str] = (),
    strokes: int = 6,
) -> tuple[Waypoint, ...]:
    """Return the waypoints with which a tip pushes the drawer of a case shut by its handle.

    They are ``before``, ``down``, ``shut 0`` … and ``back``, each with the body's name.

    Args:
        task: Says where the arm stands.
        robot: The arm; its fingers stay closed, if it has some.
        body: The case, whose joint is called ``drawer`` and opens along its x axis.
        handle: Where the handle is with the drawer shut, in the case's frame, (3,) (m).
        height: Of the tip over the table (m).
        after: Waypoints of other arms that come before.
        strokes: In how many parts it pushes.
    """
    go = partial(over_table, task, robot, leans=(0.0, 0.3, 0.6), farther=FAR)

    def at(scene: Scene, out: float, up: float) -> Floats:
        """The place so far (m) before the handle as it is with the drawer shut."""
        place, quaternion = scene.body(body)
        x, y, _ = place + rotate(quaternion, handle + (out, 0.0, 0.0))
        return np.array([x, y, up])

    def free(scene: Scene, up: float) -> Floats:
        return at(scene, scene.joints(body)["drawer"] + FREE, up)

    def shut(scene: Scene, left: int) -> Floats:
        place, quaternion = scene.body(body)
        tip = rotate(inverse(quaternion), scene.tcp(robot)[0] - place)[0] - handle[0]
        return at(scene, tip - (tip - BEYOND) / left, height)

    return (
        go(f"before {body}", partial(free, up=height + 0.12), near=0.05, after=tuple(after)),
        go(f"down {body}", partial(free, up=height), near=0.03),
        *(
            go(f"shut {body} {i}", partial(shut, left=strokes - i), near=0.03)
            for i in range(strokes)
        ),
        go(f"back {body}", partial(at, out=FREE, up=height), near=0.1),
    )
