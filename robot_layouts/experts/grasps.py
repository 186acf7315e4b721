"""What scripts that hold a body in a gripper share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import pi

import numpy as np

from objects import ObjectDescriptor
from robot_layouts.experts.geometry import (
    backed_off,
    gripper_facing,
    heading,
    squared,
    turn,
    yaw_of,
)
from robot_layouts.experts.script import CLOSED, OPEN, Pose, Scene, Waypoint
from robot_layouts.experts.tips import pose_solver
from robot_layouts.kinematics.rotations import Floats, inverse, multiply, rotate
from robot_layouts.simulation.world import part_name
from robots import TaskError
from robots.urdf.reading import model_of
from tasks import TaskEnv

Numbers = Sequence[float] | Floats

LEAN = pi / 3  # rad; how far a gripper leans from straight down at most where it holds a thing

QUARTERS = (0, 1, 2, 3)

# How a gripper may turn about the vertical on its way to a place; the quickest is taken (rad).
YAWS = tuple(0.3 * i for i in range(-4, 5))
PLACE_YAWS = sorted((*YAWS, -pi / 2, pi / 2, pi), key=abs)

# How far a gripper may lean forward from straight down, the best first (rad).
TILTS = tuple(np.radians((20, 10, 0, 30, 40, 50, 60, -15)))


def need_fingers(task: TaskEnv, plan: str, *robots: str) -> None:
    """Make sure that robots can grasp.

    Args:
        task: The task they stand in.
        plan: What they are to do, for the message.
        robots: Their names in the layout.

    Raises:
        TaskError: If one has no fingers, or some that nothing can touch.
    """
    for name in robots:
        robot = task.layout.arm(name).robot
        if robot.fingers is None:
            raise TaskError(
                f"{plan} needs fingers on {' and '.join(map(repr, robots))}; {name!r} is a"
                f" {robot.name}, which has none (if two links of it grasp, its field"
                " fingers=Fingers((LINK, LINK), opening_signs=(1, 1), opening_axes=(WAY, WAY)) says"
                " so, with which way each opens in its own frame)"
            )
        solid = model_of(robot.urdf.locate()).collisions
        if bare := [link for link in robot.fingers.links if link not in solid]:
            raise TaskError(
                f"{plan} needs fingers that touch; {' and '.join(bare)} of {name!r} go through what"
                f" they close on: the URDF of {robot.name} gives them no <collision>"
            )


def cube_grips(cube: Pose, turns: Sequence[int] = QUARTERS, tilt: float = 0.0) -> list[Pose]:
    """Return the grips of a cube from above, by its side faces.

    Args:
        cube: Where it is.
        turns: Quarter turns of the gripper from the cube's own heading, one grip each.
        tilt: Angle of the gripper from straight down (rad).
    """
    position, quaternion = cube
    yaw = yaw_of(quaternion)
    return [(position, gripper_facing(yaw + turn * pi / 2, tilt)) for turn in turns]


def cube_grip_from(cube: Pose, base: Floats, tilt: float) -> Pose:
    """Return the grip of a cube by the side faces that look most along the way from a base.

    Args:
        cube: Where it is.
        base: Where the arm stands, (3,) (m, world).
        tilt: Angle of the gripper from straight down, forward (rad).
    """
    position, quaternion = cube
    direction = squared(heading(base, position), yaw_of(quaternion))
    return position, gripper_facing(direction, tilt)


def thing_grips(
    thing: ObjectDescriptor, body: str, opening: float, lean: float = LEAN
) -> Callable[[Scene], list[Pose]]:
    """Return the grips of a thing that a gripper can do, wherever the thing is.

    Grasps of what its joints move go with that.

    Args:
        thing: Says where it is grasped.
        body: Its name in the world.
        opening: How far the gripper opens (m).
        lean: Most that the gripper may lean from straight down (rad).

    Raises:
        TaskError: If it opens wide enough for none.
    """
    grasps = thing.grasps_for(opening)
    if not grasps:
        raise TaskError(
            f"a gripper that opens {opening:g} m holds {thing.name} in none of its"
            f" {len(thing.grasps)} grasps"
        )
    places = np.array([grasp.position for grasp in grasps])
    turns = np.array([grasp.quaternion for grasp in grasps])
    moving = {joint.name for joint in thing.joints}
    held = [part_name(body, g.part) if g.part in moving else body for g in grasps]

    def grips(scene: Scene) -> list[Pose]:
        poses = {name: scene.body(name) for name in held}
        position, quaternion = (np.array(rows) for rows in zip(*map(poses.get, held), strict=True))
        points, frames = position + rotate(quaternion, places), multiply(quaternion, turns)
        steep = -rotate(frames, np.array([0.0, 0.0, 1.0]))[:, 2] >= np.cos(lean)
        return [*zip(points[steep], frames[steep], strict=True)]

    return grips


def grips_to(
    task: TaskEnv,
    robot: str,
    body: str,
    place: Callable[[Scene], Floats],
    above: float,
    tilts: Sequence[float] = TILTS,
) -> Callable[[Scene], list[Pose]]:
    """Return the grips of a cube with which an arm can bring it to a place, however it leans.

    Args:
        task: Says where the arm stands.
        robot: The arm.
        body: The cube.
        place: Where the cube's origin is to be, (3,) (m), given the scene.
        above: How far above the cube and its place the gripper has to get as well (m).
        tilts: Angles of the gripper from straight down, forward (rad); the first counts with which
            there is a grip.
    """
    solver = pose_solver(task, robot)

    def reachable(scene: Scene, pose: Pose) -> bool:
        position, quaternion = pose
        poses = [(position, quaternion), (position + (0.0, 0.0, above), quaternion)]
        qpos = scene.qpos(robot)
        return all(solver.solve(*scene.in_world(each), qpos) is not None for each in poses)

    def brings(scene: Scene, grip: Pose) -> bool:
        start, _ = scene.body(body)
        if not reachable(scene, grip):
            return False
        turned = (turn("z", yaw) for yaw in PLACE_YAWS)
        arm, end = grip[0] - start, place(scene)
        return any(
            reachable(scene, (end + rotate(yaw, arm), multiply(yaw, grip[1]))) for yaw in turned
        )

    def grips(scene: Scene) -> list[Pose]:
        for tilt in tilts:
            some = [grip for grip in cube_grips(scene.body(body), tilt=tilt) if brings(scene, grip)]
            if some:
                return some
        return []

    return grips


def lowerable(
    task: TaskEnv, robot: str, poses: Callable[[Scene], Sequence[Pose]], way: float
) -> Callable[[Scene], list[Pose]]:
    """Return those of some poses of a gripper from which it can be lowered.

    Args:
        task: Says where the arm stands.
        robot: The arm.
        poses: The poses, given the scene.
        way: How far (m).
    """
    solver = pose_solver(task, robot)

    def kept(scene: Scene) -> list[Pose]:
        qpos, below = scene.qpos(robot), np.array([0.0, 0.0, way])
        return [
            (position, quaternion)
            for position, quaternion in poses(scene)
            if solver.solve(*scene.in_world((position - below, quaternion)), qpos) is not None
        ]

    return kept


def in_reach(
    task: TaskEnv,
    robot: str,
    grips: Callable[[Scene], Sequence[Pose]],
    *,
    above: float = 0.05,
    on: Callable[[Scene, Pose], Sequence[Pose]] = lambda scene, grip: (),
) -> Callable[[Scene], list[Pose]]:
    """Return those of some grips that an arm gets to from where `pick` lets it get ready.

    Args:
        task: Says where the arm stands.
        robot: The arm.
        grips: The grips, given the scene.
        above: As `pick` takes it (m).
        on: Where else a gripper with one of them has to get, one pose after the other.
    """
    solver, descriptor = pose_solver(task, robot), task.layout.arm(robot).robot
    places = [descriptor.joints.index(joint) for joint in descriptor.arm_joints]

    def reaches(scene: Scene, grip: Pose) -> bool:
        qpos = scene.qpos(robot)
        for pose in (backed_off(grip, above), grip, *on(scene, grip)):
            arm = solver.solve(*scene.in_world(pose), qpos)
            if arm is None:
                return False
            qpos[places] = arm
        return True

    return lambda scene: [grip for grip in grips(scene) if reaches(scene, grip)]


def pick(
    robot: str,
    body: str,
    grips: Callable[[Scene], Sequence[Pose]],
    *,
    above: float = 0.05,
    ready: float = 0.1,
    around: float = 0.03,
    most: int | None = None,
    opening: float = OPEN,
) -> tuple[Waypoint, ...]:
    """Return the waypoints after which a gripper holds a body: above, around, grasp.

    Each is called by that word and the body's name.

    Args:
        robot: Whose gripper.
        body: What it is to hold.
        grips: The gripper's poses to choose from.
        above: How far before the grip it gets ready, against its approach (m).
        ready: How near it must come to that place before it goes on (rad).
        around: How near it must come to the grip before it closes (rad).
        most: How many steps each waypoint may take.
        opening: Action number of the gripper on the way; 0 leaves one as it stands that moves by
            so much per step, such as an SO-100's.
    """

    def before(scene: Scene) -> list[Pose]:
        return [backed_off(grip, above) for grip in grips(scene)]

    held = partial(Scene.grasps, robot=robot, body=body)
    return (
        Waypoint(f"above {body}", before, opening, near=ready, most=most),
        Waypoint(f"around {body}", grips, opening, near=around, most=most),
        Waypoint(f"grasp {body}", None, CLOSED, steps=2, until=held, most=most),
    )


def move_joint(
    robot: str, body: str, joint: str, to: float, *, steps: int = 8, most: int | None = None
) -> tuple[Waypoint, ...]:
    """Return the waypoints with which a gripper moves a joint of a body whose part it holds.

    They are called by the part's name and their number, from 0 on.

    Args:
        robot: Whose gripper.
        body: The body.
        joint: Its joint.
        to: Where the joint is to be (m or rad).
        steps: Number of waypoints, which are evenly apart.
        most: How many control steps each may take.
    """

    def then(scene: Scene, left: int) -> list[Pose]:
        now = scene.joints(body)[joint]
        return [moved_along(scene, body, joint, now + (to - now) / left, scene.tcp(robot))]

    name = part_name(body, joint)
    return tuple(
        Waypoint(f"{name} {i}", partial(then, left=steps - i), CLOSED, most=most)
        for i in range(steps)
    )


def moved_along(scene: Scene, body: str, joint: str, position: float, pose: Pose) -> Pose:
    """Return where a gripper goes with the part of a body that it holds.

    Args:
        scene: As it is now.
        body: The body.
        joint: Its joint.
        position: Where the joint is then (m or rad).
        pose: Of the gripper now.
    """
    place, turned = scene.part(body, joint, position)
    start, before = scene.body(part_name(body, joint))
    turn_by = multiply(turned, inverse(before))
    return place + rotate(turn_by, pose[0] - start), multiply(turn_by, pose[1])


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


def held_at(
    scene: Scene,
    robot: str,
    body: str,
    place: Floats,
    yaws: Sequence[float] = (0.0,),
    leans: Sequence[float] = (0.0,),
) -> list[Pose]:
    """Return the gripper's poses that bring the body it holds to a place, turned a little.

    Args:
        scene: As it is now.
        robot: Whose gripper.
        body: What it holds.
        place: Where the body's origin is to be, (3,) (m).
        yaws: Turns about the vertical to choose from (rad).
        leans: Turns about the way the fingers open to choose from (rad).
    """
    _, now = scene.tcp(robot)
    turned = [
        multiply(turn("z", yaw), multiply(now, turn("y", lean))) for yaw in yaws for lean in leans
    ]
    return [holding(scene, robot, body, place, quaternion) for quaternion in turned]


def is_near(scene: Scene, body: str, other: str, offset: Numbers, limit: float) -> bool:
    """Return whether a body is at a place beside another one.

    Args:
        scene: As it is now.
        body: The body.
        other: The other one.
        offset: From the other one's origin to where the body's is to be, (3,) (m), world.
        limit: How far it may be off along each axis (m).
    """
    error = scene.body(body)[0] - scene.body(other)[0] - np.array(offset)
    return bool(np.abs(error).max() < limit)
