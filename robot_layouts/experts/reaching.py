"""Bringing a tool centre point to a place, turned in any way that suits the arm."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import pi
from typing import Any

from robot_layouts.experts.geometry import gripper_facing, heading, turn
from robot_layouts.experts.script import Pose, Scene, Waypoint
from robot_layouts.experts.tips import pose_solver
from robot_layouts.kinematics.rotations import Floats, multiply
from tasks import TaskEnv

POSE_JOINTS = 6  # of an arm that can choose how its TCP is turned
ROLLS = (0.0, pi, pi / 2, -pi / 2)  # about its approach, of a tip that is round (rad)
LEANS = (0.0, pi / 6, pi / 3, pi / 2, -pi / 6)  # from straight down (rad)


def reaching(
    task: TaskEnv,
    robot: str,
    name: str,
    place: Callable[[Scene], Floats],
    *,
    leans: Sequence[float] = LEANS,
    farther: Sequence[float] = (),
    as_it_is: bool = True,
    **others: Any,
) -> Waypoint:
    """Return the waypoint that brings a robot's TCP to a place, turned in the quickest way.

    Args:
        task: Says which robot it is.
        robot: Its place in the layout.
        name: What the waypoint is called.
        place: Where the TCP should be, (3,) (m, world), given the scene.
        leans: How far the gripper may lean from straight down, away from its base (rad).
        farther: How far it may lean where the arm reaches the place with none of those (rad).
        as_it_is: Whether it may also stay turned as it is.
        **others: Other fields of `robot_layouts.experts.script.Waypoint`.
    """
    arm = task.layout.arm(robot).robot
    if len(arm.arm_joints) < POSE_JOINTS or arm.tcp_position_links:
        return Waypoint(name, at=place, **others)
    rolls = (0.0,) if arm.fingers is not None else ROLLS

    def poses(scene: Scene) -> list[Pose]:
        point = place(scene)
        ahead = heading(scene.base(robot), point)
        own = [(point, scene.tcp(robot)[1])] if as_it_is else []
        usual = [*own, *leaning(point, ahead, leans)]
        if not farther:
            return usual
        solver, qpos = pose_solver(task, robot), scene.qpos(robot)
        if any(solver.solve(*scene.in_world(pose), qpos) is not None for pose in usual):
            return usual
        return leaning(point, ahead, farther)

    def leaning(point: Floats, ahead: float, leans: Sequence[float]) -> list[Pose]:
        return [
            (point, multiply(gripper_facing(ahead, lean), turn("z", roll)))
            for lean in leans
            for roll in rolls
        ]

    return Waypoint(name, to=poses, **others)
