"""What tips do, of sticks, flanges and closed fingers: they push bodies, and press on them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import pi
from typing import Any

import numpy as np

from robot_layouts.experts.grips import driven_gripper, may_swing
from robot_layouts.experts.reaching import reaching
from robot_layouts.experts.script import CLOSED, Scene, Waypoint
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv

Place = Callable[[Scene], Floats]
"""A place, (3,) (m, world), given the scene."""

PUSHING = (0.0, 0.3, 0.6, -0.3)  # how far grippers lean from straight down (rad)
FAR = (0.9, 1.2)  # these where those are out of reach
PRESSING = (0.0, 0.3, -0.3, 0.6)
UPRIGHT, SLANTED = (0.0, 0.15, -0.15), (0.3, 0.6, 0.9, 1.2)  # these where those are out of reach
HIGH, OVER = 0.14, 0.06  # of tips on their way over the table, and over what they press (m)
OFF = 0.005  # m; of fingers that push over the table, as they are, not as declared
DIP = 0.02  # m below the TCP that fingers may reach, wherever tips go
LEAST = 0.012  # m; of a stroke, unless less is left
PRESSED = 8  # control steps that pressing takes, however far the tip comes
BEYOND = 0.15  # m behind its end, where a push aims; so it stays steady near the end
LOST = 0.03  # m from its end, at which a block is pushed once more


def push(
    task: TaskEnv,
    robot: str,
    body: str,
    end: Place,
    *,
    gap: float = 0.08,
    strokes: int = 10,
    height: float = 0.025,
    after: Sequence[str] = (),
    again: bool = False,
) -> tuple[Waypoint, ...]:
    """Return the waypoints with which a tip pushes a block to a place, aiming at every stroke.

    They are ``above``, ``behind``, ``push 0`` …, ``back`` and ``away``, with the block's name, and
    with ``again`` after it those of a second push. What a flat tip pushes moves as the tip does,
    which goes the way that the block has to; round ones slip, and get behind the block anew.

    Args:
        task: Says where the arm stands.
        robot: The arm; its fingers stay closed, if it has some.
        body: The block.
        end: Where it is to lie; its height does not count.
        gap: Between the tip and the block's middle when the tip comes down (m).
        strokes: In how many parts it is pushed.
        height: Of the TCP over the table (m), or more where fingers reach farther down.
        after: Waypoints of other arms that come before.
        again: Whether it pushes a second time a block that it has lost on the way.
    """
    pushing = partial(_push, task, robot, body, end, gap, strokes, height)
    more = pushing(f"{body} again", once_lost=True) if again else ()
    return (*pushing(body, after), *more)


def _push(
    task: TaskEnv,
    robot: str,
    body: str,
    end: Place,
    gap: float,
    strokes: int,
    height: float,
    called: str,
    after: Sequence[str] = (),
    *,
    once_lost: bool = False,
) -> tuple[Waypoint, ...]:
    """Return the waypoints of one push; with ``once_lost``, the tip stays if the block is there."""
    arm = task.layout.arm(robot).robot
    flat = driven_gripper(arm) is not None and not may_swing(arm)
    line: list[Floats] = []  # where it aims
    lost: list[bool] = []  # whether the block was, as the push began

    def aim(scene: Scene) -> tuple[Floats, Floats]:
        """Return where the push aims, and the way from there to the block, of length 1."""
        place, goal = scene.body(body)[0][:2], end(scene)[:2]
        if not line:
            line.append(goal + BEYOND * (goal - place) / np.linalg.norm(goal - place))
        away = place - line[0]
        return line[0], away / np.linalg.norm(away)

    def go(name: str, place: Place, **more: Any) -> Waypoint:
        def where(scene: Scene) -> Floats:
            away = np.linalg.norm((scene.body(body)[0] - end(scene))[:2])
            lost[:] = lost or [not once_lost or bool(away > LOST)]
            return place(scene) if lost[0] else scene.tcp(robot)[0]

        return over_table(task, robot, name, where, leans=PUSHING, farther=FAR, **more)

    def behind(scene: Scene, up: float) -> Floats:
        return np.array([*(scene.body(body)[0][:2] + gap * aim(scene)[1]), up])

    def along(scene: Scene, left: int) -> Floats:
        target, away = aim(scene)
        tip, block = scene.tcp(robot)[0][:2], scene.body(body)[0][:2]
        far, rest = float((tip - target) @ away), float((block - target) @ away) - BEYOND
        start = tip if flat else target + far * away
        return np.array([*(start - max(rest / left, min(LEAST, rest)) * away), height])

    def back(scene: Scene, up: float) -> Floats:
        return np.array([*(scene.tcp(robot)[0][:2] + 0.06 * aim(scene)[1]), up])

    return (
        go(f"above {called}", partial(behind, up=HIGH), near=0.05, after=tuple(after)),
        go(f"behind {called}", partial(behind, up=height), near=0.03),
        *(
            go(f"push {called} {i}", partial(along, left=strokes - i), near=0.03, pushes=True)
            for i in range(strokes)
        ),
        go(f"back {called}", partial(back, up=height), near=0.1),
        go(f"away {called}", partial(back, up=HIGH), near=0.1),
    )


def advance(
    task: TaskEnv,
    robot: str,
    body: str,
    start: Place,
    ahead: Place,
    left: Callable[[Scene], float],
    *,
    strokes: int = 12,
    back: float = 0.06,
    beside: Sequence[str] = (),
    after: Sequence[str] = (),
) -> tuple[Waypoint, ...]:
    """Return the waypoints with which a tip pushes something straight until no way is left.

    They are ``above``, ``at``, ``push 0`` … and ``back``, each with the body's name.

    Args:
        task: Says where the arm stands.
        robot: The arm; its fingers stay closed, if it has some.
        body: What is pushed.
        start: Where the tip begins, a little behind it.
        ahead: Which way it is pushed, of length 1.
        left: How far it still has to go (m).
        strokes: In how many parts; before each, what is left is looked at anew.
        back: How far the tip goes back in the end (m).
        beside: Other arms that push the same in step.
        after: Waypoints of other arms that come before the tip comes down.
    """
    go = partial(over_table, task, robot, leans=UPRIGHT, farther=SLANTED)
    line: list[Floats] = []  # where it begins, and which way it goes

    def at(scene: Scene, up: float) -> Floats:
        line[:] = line or [start(scene), ahead(scene)]
        return line[0] + np.array([0.0, 0.0, up])

    def along(scene: Scene, stroke: int) -> Floats:
        begin, way = line
        done = float((scene.tcp(robot)[0] - begin) @ way)
        if stroke == strokes:
            return begin + (done - back) * way
        more = left(scene)
        return begin + (done + max(more / (strokes - stroke), min(LEAST, more))) * way

    def step(stroke: int) -> Waypoint:
        before = f"push {body} {stroke - 1}" if stroke else f"at {body}"
        waits = tuple(f"{other}.{before}" for other in beside)
        return go(
            f"push {body} {stroke}",
            partial(along, stroke=stroke),
            near=0.03,
            after=waits,
            pushes=True,
        )

    return (
        go(f"above {body}", partial(at, up=HIGH), near=0.05),
        go(f"at {body}", partial(at, up=0.0), near=0.03, after=tuple(after)),
        *map(step, range(strokes)),
        go(f"back {body}", partial(along, stroke=strokes), near=0.05),
    )


def sweep(
    task: TaskEnv,
    robot: str,
    body: str,
    path: Callable[..., Floats],
    *,
    count: int = 10,
    after: Sequence[str] = (),
) -> tuple[Waypoint, ...]:
    """Return the waypoints with which a tip goes along a path: above, and sweep 0 and on.

    Each is called by that word and the body's name.

    Args:
        task: Says where the arm stands.
        robot: The arm; its fingers stay closed, if it has some.
        body: What is swept along.
        path: Given the scene and a share of the path, from 0 to 1, where the tip is then, (3,) (m).
        count: In how many parts.
        after: Waypoints of other arms that come before the tip comes down.
    """
    go = partial(over_table, task, robot, leans=UPRIGHT, farther=SLANTED)

    def above(scene: Scene) -> Floats:
        return path(scene, 0.0) + np.array([0.0, 0.0, HIGH])

    def step(number: int) -> Waypoint:
        place, waits = partial(path, share=number / count), () if number else tuple(after)
        return go(f"sweep {body} {number}", place, near=0.06, after=waits)

    return (go(f"above {body}", above, near=0.05), *map(step, range(count + 1)))


def press_down(
    task: TaskEnv, robot: str, body: str, top: Place, depth: float, *, after: Sequence[str] = ()
) -> tuple[Waypoint, ...]:
    """Return the waypoints with which a tip presses on something and stays: over, press.

    Each is called by that word and the body's name.

    Args:
        task: Says where the arm stands.
        robot: The arm; its fingers stay closed, if it has some.
        body: What is pressed.
        top: Where.
        depth: How far the tip, or the end of fingers, goes below that (m).
        after: Waypoints of other arms that come before it is pressed.
    """
    lean = {"leans": PRESSING, "farther": FAR}
    go = partial(reaching, task, robot, **lean, as_it_is=False, gripper=CLOSED)
    low = _below_tcp(task, robot)

    def at(scene: Scene, up: float) -> Floats:
        return top(scene) + np.array([0.0, 0.0, up + low])

    return (
        go(f"high {body}", partial(at, up=2 * OVER), near=0.03),
        go(f"over {body}", partial(at, up=OVER), near=0.02),
        go(f"press {body}", partial(at, up=-depth), near=pi, steps=PRESSED, after=tuple(after)),
    )


def over_table(
    task: TaskEnv, robot: str, name: str, place: Place, *, leans: Sequence[float], **others: Any
) -> Waypoint:
    """Return the waypoint that brings a tip to a place, or above it where fingers reach too low.

    Args:
        task: Says where the arm stands.
        robot: The arm; its fingers stay closed, if it has some.
        name: What the waypoint is called.
        place: Where the TCP should be.
        leans: See `reaching`.
        **others: Likewise.
    """
    raised = max(0.0, _below_tcp(task, robot) - DIP)
    lowest = _below_tcp(task, robot, OFF)

    def over(scene: Scene) -> Floats:
        x, y, z = place(scene)
        return np.array([x, y, max(z + raised, lowest)])

    as_they_are = {"as_it_is": False, "gripper": CLOSED}
    return reaching(task, robot, name, over, leans=leans, **as_they_are, **others)


def _below_tcp(task: TaskEnv, robot: str, more: float = 0.0) -> float:
    """Return how far fingers reach below the TCP, and more (m, as declared); 0 without any."""
    hand = driven_gripper(task.layout.arm(robot).robot)
    return 0.0 if hand is None else (hand.beyond + more) / task.task.fit.scale
