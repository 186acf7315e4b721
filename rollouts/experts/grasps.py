"""What scripts that hold a body in a gripper share."""

from __future__ import annotations

from robots import TaskError
from rollouts.experts.geometry import Floats, inverse, multiply, rotate
from rollouts.experts.script import Pose, Scene
from tasks import MultiRobotTask


def need_fingers(task: MultiRobotTask, plan: str, *robots: str) -> None:
    """Make sure that robots can grasp.

    Args:
        task: The task they stand in.
        plan: What they are to do, for the message.
        robots: Their names in the layout.

    Raises:
        TaskError: If one has no fingers.
    """
    for name in robots:
        robot = task.layout[name].robot
        if robot.fingers is None:
            raise TaskError(
                f"{plan} needs fingers on {' and '.join(map(repr, robots))}; {name!r} is a"
                f" {robot.name}, which has none"
            )


def holding(scene: Scene, robot: str, body: str, place: Floats, quaternion: Floats) -> Pose:
    """Return the gripper's pose that brings the body it holds to a place, turned as asked.

    Args:
        scene: As it is now.
        robot: Whose gripper.
        body: What it holds.
        place: Where the body's origin is to be, (3,) (m).
        quaternion: Orientation of the gripper then, (4,).
    """
    tcp, now = scene.tcp(robot)
    arm = rotate(multiply(quaternion, inverse(now)), tcp - scene.body(body)[0])
    return place + arm, quaternion


def bringing(scene: Scene, robot: str, body: str, goal: Pose) -> Pose:
    """Return the gripper's pose that brings the body it holds to a pose.

    Args:
        scene: As it is now.
        robot: Whose gripper.
        body: What it holds.
        goal: Pose that the body is to have.
    """
    place, quaternion = goal
    turned = multiply(quaternion, inverse(scene.body(body)[1]))
    return holding(scene, robot, body, place, multiply(turned, scene.tcp(robot)[1]))
