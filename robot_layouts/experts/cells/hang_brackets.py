"""CellHangBrackets: all arms take their parts, and lower them over the pegs by turns."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import product
from math import inf, pi

import numpy as np

from robot_layouts.experts.cells.moves import carry
from robot_layouts.experts.geometry import backed_off, gripper_facing, turn, yaw_of
from robot_layouts.experts.grasps import bringing, need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import CLOSED, Pose, Scene, Script, Waypoint
from robot_layouts.experts.tips import pose_solver
from robot_layouts.kinematics.rotations import Floats, inverse, multiply, rotate
from tasks import TaskEnv
from tasks.cells.hang_brackets import BASE, GRIPS, PARTS, THICK

HIGH = 0.15  # of a part over its seat before it goes down (m)
DOWN = (0.06, 0.045, 0.03, 0.015, 0.002)  # of a part over its seat, one after the other (m)
EXACT = 0.003  # rad; so near an arm comes to its place over the pegs
# How far above what it grips a hand gets ready (m), and after what the next one comes to the pegs.
WAYS = ((0.05, "rise"), (0.1, "retreat"))


def hang_brackets(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that put the parts on the pegs.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "hanging brackets", *PARTS)
    return first_success(
        task,
        seed,
        lambda scene: [
            _script(task, yaw, above, free) for above, free in WAYS for yaw in _turned(scene)
        ],
        as_declared=True,
    )


def _turned(scene: Scene) -> list[float]:
    """Return how the first part may be turned on the pegs (rad), first its back towards its arm."""
    place, quaternion = scene.body("pegs")
    back = rotate(quaternion, np.array([0.0, 1.0, 0.0]))
    yaw, towards = yaw_of(quaternion), float(back @ (scene.base("first") - place)) > 0
    return [yaw, yaw + pi] if towards else [yaw + pi, yaw]


def _script(task: TaskEnv, yaw: float, above: float, free: str) -> Script:
    """Return the script in which the first part is turned so on the pegs (rad); see `WAYS`."""
    hanging = partial(_hanging, task, above=above)
    return {
        "first": hanging("first", 0, [yaw], []),
        "second": hanging("second", 1, [yaw + pi], [f"first.{free} red"]),
        "third": hanging("third", 2, [yaw, yaw + pi], [f"second.{free} blue"]),
    }


def _hanging(
    task: TaskEnv,
    arm: str,
    level: int,
    yaws: Sequence[float],
    turn_of: Sequence[str],
    *,
    above: float,
) -> list[Waypoint]:
    part = PARTS[arm]

    def seat(scene: Scene, up: float = 0.0) -> Floats:
        return scene.body("pegs")[0] + (0.0, 0.0, BASE + level * THICK + up)

    def at(scene: Scene, up: float) -> list[Pose]:
        return [bringing(scene, arm, part, (seat(scene, up), turn("z", yaw))) for yaw in yaws]

    sides = [0.0, pi]  # about which the gripper may be turned; one of them once it has set off

    def grips(scene: Scene) -> list[Pose]:
        """The grip from which the arm's joints turn least on the way to the seat."""
        position, quaternion = scene.body(part)
        held, ways = position + rotate(quaternion, np.array([0.0, *GRIPS[part]])), []
        for side, yaw in product(sides, yaws):
            grip = held, gripper_facing(yaw_of(quaternion) + side, 0.0)
            by = multiply(turn("z", yaw), inverse(quaternion))
            off, turned = rotate(by, held - position), multiply(by, grip[1])
            goals = [(seat(scene, up) + off, turned) for up in (HIGH, 0.0)]
            way = _way(task, arm, scene, [backed_off(grip, above), grip, *goals])
            ways.append((way, side, grip))
        shortest, side, best = min(ways, key=lambda way: way[0])
        if shortest == inf:
            return []
        sides[:] = [side]
        return [best]

    steps = carry(task, arm, part, grips, seat, height=HIGH, ready=0.03, around=0.01, above=above)
    over = [waypoint.name for waypoint in steps].index(f"over {part}")
    down = [
        Waypoint(f"down {part} {i}", partial(at, up=up), CLOSED, near=EXACT)
        for i, up in enumerate(DOWN)
    ]
    first = Waypoint(f"over {part}", partial(at, up=HIGH), CLOSED, after=tuple(turn_of), near=0.02)
    return [*steps[:over], first, *down, *steps[over + 2 :]]


def _way(task: TaskEnv, arm: str, scene: Scene, poses: Sequence[Pose]) -> float:
    """Return the most that a joint turns after the second of some poses (rad); inf out of reach."""
    solver, robot = pose_solver(task, arm), task.layout.arm(arm).robot
    joints, qpos = [robot.joints.index(joint) for joint in robot.arm_joints], scene.qpos(arm)
    postures = []
    for pose in poses:
        posture = solver.solve(*scene.in_world(pose), qpos)
        if posture is None:
            return inf
        qpos[joints] = posture
        postures.append(posture)
    return float(np.abs(np.diff(postures[1:], axis=0)).max())
