"""Skills: waypoints with which any arm that has fingers works at any thing that has grasps.

A skill looks at the scene when its waypoints begin, so that skills follow one another in any order.
It takes a way that is in reach and has room; where there is none, the script fails with the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import pi
from types import MappingProxyType

import numpy as np

from objects import NamedPoint, ObjectDescriptor
from robot_layouts.experts.geometry import turn
from robot_layouts.experts.grips import swings
from robot_layouts.experts.hands import Hand
from robot_layouts.experts.holds import SPLAYED, Hold, Holds, holds_of
from robot_layouts.experts.player import BlockedError, StuckError
from robot_layouts.experts.room import NOTHING
from robot_layouts.experts.routes import Way, routes
from robot_layouts.experts.script import Pose, Scene, Share, Waypoint
from robot_layouts.kinematics.rotations import (
    Floats,
    multiply,
    pose_matrix,
    quaternion_about,
    quaternion_of,
    rotate,
)
from robot_layouts.simulation.world import part_name
from tasks import TaskEnv

Poses = Callable[[Scene], Sequence[Pose]]
"""Given the scene, poses of a body to choose from."""
PoseWays = Callable[[Scene], Sequence[Sequence[Pose]]]
"""Given the scene, ways of a body to choose from, each some poses one after the other."""

LEAN = pi / 2  # rad; how far a gripper leans from straight down at most where it takes a thing
LEANING = 0.8  # rad of way that a gripper is worth which points straight down
LEVER = 3.0  # rad of way that it is worth to hold a thing 1 m nearer to its centre of mass
# How far a gripper may be off where it closes or lets go, before that, and on its way (m).
NEAR, READY, PASSING = 0.006, 0.008, 0.02
# Control steps that closing, holding and pushing may take, and that aligning takes at least.
GRASPED, HELD, PUSHED, SETTLED = 150, 20, 100, 15
YAWS = tuple(sorted((k * pi / 8 for k in range(-7, 9)), key=abs))  # rad
QUARTERS = (0.0, pi / 2, -pi / 2, pi)  # rad; ways in which what is square goes in
GENTLY = 0.25  # of its speed, with what quick fingers hold, since each step of an arm shakes it
SHUT = 0.005  # share of its opening from which on a gripper closes no further
BACK = 0.05  # m; before a place, whence a thing or a gripper comes to it
PITCHED = (0.0,), (pi / 6, -pi / 6), (pi / 3, -pi / 3)  # rad; of a hand otherwise out of reach
DRAWN = (0.0, 0.002, 0.005, 0.01)  # m; by which fingers take a thing nearer to their tips
MOVES = 5  # poses on the way of a joint that are checked
LEG, INWARD = 0.03, 0.003  # m; between waypoints of what goes straight, and into a hole
TILT = pi / 8  # rad; between waypoints of what is turned
POURED, LEVEL = 1.6, 0.1  # rad; sine of the least angle between a spout and the vertical
DEEPER = 0.015  # m; beyond its end to which a joint is pushed at most
UP = np.array([0.0, 0.0, 1.0])


def point_at(scene: Scene, body: str, point: NamedPoint) -> Pose:
    """Return where a point of a body is, and how its frame is turned there.

    Args:
        scene: As it is now.
        body: The body.
        point: In the body's frame, such as ``thing.point("spout")``.
    """
    position, quaternion = scene.body(body)
    own = scene.scale(body) * np.array(point.position)
    return position + rotate(quaternion, own), multiply(quaternion, np.array(point.quaternion))


def resting(
    thing: ObjectDescriptor,
    spot: Callable[[Scene], Floats],
    *,
    rest: str | None = None,
    yaws: Sequence[float] = YAWS,
) -> Poses:
    """Return the poses in which a thing rests on a spot.

    Args:
        thing: The thing.
        spot: What it is to rest on, (3,) (m, world): its origin is above it.
        rest: Which of its ``rests``; None takes the usual one.
        yaws: Turns about the vertical to choose from (rad).

    Raises:
        UnknownNameError: If it does not rest so.
    """
    height, turned = thing.height(rest), np.array(thing.rest(rest))

    def poses(scene: Scene) -> list[Pose]:
        place = spot(scene) + height * UP
        return [(place, multiply(turn("z", yaw), turned)) for yaw in yaws]

    return poses


def grasp(
    task: TaskEnv,
    robot: str,
    body: str,
    thing: ObjectDescriptor,
    *,
    parts: Sequence[str] = (),
    lean: float = LEAN,
    back: float = BACK,
    up: float = 0.0,
    goals: Poses | None = None,
    ways: PoseWays | None = None,
    moving: Mapping[str, float] = MappingProxyType({}),
    after: tuple[str, ...] = (),
) -> tuple[Waypoint, ...]:
    """Return the waypoints with which an arm takes hold of a thing: above, around, grasp, hold.

    Each is called by that word and the body's name. Of the thing's grasps one is taken that the
    gripper opens for, that is in reach, and where the hand has room.

    Args:
        task: Where the arm stands.
        robot: Its name in the layout.
        body: What it is to hold.
        thing: Says where that is grasped.
        parts: What may be held, by the names that its grasps have, such as ``["handle"]``; all of
            it if there are none.
        lean: How far the gripper may lean from straight down (rad).
        back: How far before the grasp it gets ready, against its approach (m).
        up: How far it must be able to raise what it holds (m).
        goals: Poses of the body, to one of which the arm must be able to bring it.
        ways: Instead of that, ways of the body, one of which the arm must be able to take it along.
        moving: Where joints of the thing are to be, by name (m or rad): it takes hold of a part
            that one of these moves, so that it is able to move it there.
        after: Waypoints of other robots that must be done before it begins.

    Raises:
        DescriptorError: If the robot has no fingers.
        TaskError: If its gripper opens for no grasp, or the thing has none.
        UnknownNameError: If the thing has no such joint.
    """
    hand = Hand(task, robot)
    holds = holds_of(hand, body, thing, parts or [thing.joint(name).name for name in moving])

    def then(scene: Scene, hold: Hold) -> Sequence[Sequence[Pose]]:
        part = hold.grasp.part
        if part in moving:
            stops = np.linspace(scene.joints(body)[part], moving[part], MOVES + 1)[1:]
            return [[scene.part(body, part, stop) for stop in stops.tolist()]]
        if ways is not None:
            return ways(scene)
        return [] if goals is None else [[pose] for pose in goals(scene)]

    def choose(scene: Scene) -> tuple[Hold, Floats]:
        reason: StuckError | None = None
        for angles in PITCHED:
            offered = [hold.pitched(angle) for angle in angles for hold in holds.each]
            steep = [hold for hold in offered if _leaning(hold.at(scene)) <= lean + 1e-6]
            try:
                if steep:
                    return taken(task, hand, scene, holds, steep, back=back, up=up, then=then)[0]
            except StuckError as error:
                reason = reason or error
        raise reason or StuckError(
            f"{robot!r} would lean more than {lean:.2g} rad in all grasps of {body}"
        )

    return taking(hand, body, holds, choose, back, after)


def taken(
    task: TaskEnv,
    hand: Hand,
    scene: Scene,
    holds: Holds,
    some: Sequence[Hold],
    *,
    back: float,
    up: float,
    then: Callable[[Scene, Hold], Sequence[Sequence[Pose]]] = lambda scene, hold: (),
    count: int = 1,
    besides: Collection[str] = (),
) -> list[tuple[Hold, Floats]]:
    """Return grasps that an arm can do, the best first; see `grasp`.

    Fingers whose tips would be inside of what a thing lies on take it a little higher.

    Raises:
        StuckError: If there are none; says why.
    """
    reason: StuckError | None = None
    for draw in DRAWN:
        drawn = [hold.drawn_back(draw) for hold in some]
        ways: list[Way] = []
        for hold in drawn:
            at = hold.at(scene)
            raised = [shifted(at, up * UP)] if up else []
            onward = [[hold.on(scene, pose) for pose in way] for way in then(scene, hold)]
            poses = (at, shifted(at, -back * at[:3, 2]), *raised)
            place, turned = scene.body(hold.body)
            moved = [NOTHING, NOTHING, {hold.body: (place + up * UP, turned)}][: len(poses)]
            cost = LEANING * float(1 + at[2, 2]) + LEVER * holds.lever(hold)
            ways.append(Way(hold.pads, poses, onward, cost, 1, hold.share, moved))
        try:
            found = routes(
                task,
                hand,
                scene,
                ways,
                what=f"to take {some[0].thing}",
                touched={*holds.bodies},
                besides=besides,
                count=count,
            )
        except StuckError as error:
            reason = reason or error
        else:
            return [(drawn[route.number], route.postures[0]) for route in found]
    assert reason is not None
    raise reason


def taking(
    hand: Hand,
    body: str,
    holds: Holds,
    choose: Callable[[Scene], tuple[Hold, Floats]],
    back: float = BACK,
    after: tuple[str, ...] = (),
) -> tuple[Waypoint, ...]:
    """Return the waypoints of `grasp`.

    Args:
        hand: The arm.
        body: The thing's name in the world.
        holds: Its grasps.
        choose: Given the scene, that which is taken, and a posture of the robot near that with
            which it is done, (dof,) (rad, m).
        back: See `grasp`.
        after: See `Waypoint`.
    """
    chosen: list[tuple[Hold, Floats]] = []

    def before(scene: Scene) -> list[Floats]:
        chosen[:] = [choose(scene)]
        return at(scene, back)

    def around(scene: Scene) -> list[Floats]:
        return at(scene, 0.0)

    def at(scene: Scene, back: float) -> list[Floats]:
        ((hold, _),) = chosen
        pose = hold.at(scene)
        return near(scene, hold.pads, shifted(pose, -back * pose[:3, 2]))

    def shut(scene: Scene) -> list[Floats]:
        ((hold, _),) = chosen
        return near(scene, hold.shut, hold.at(scene))

    def near(scene: Scene, frame: Floats, pose: Floats) -> list[Floats]:
        found = nearest_posture(hand, frame, pose, hand.like(scene, chosen[0][1]))
        if not found:  # there was a posture when the grasp was chosen
            raise BlockedError(f"{hand.arm!r} has pushed {body} away")
        return found

    def share(scene: Scene) -> float:
        return chosen[0][0].share

    def held(scene: Scene) -> bool:
        return any(scene.grasps(hand.arm, each) for each in holds.bodies)

    def firm(scene: Scene) -> bool:
        return max(scene.pressure(hand.arm, each) for each in holds.bodies) > holds.pressing

    def pressed(scene: Scene) -> bool:
        return held(scene) and (firm(scene) or hand.share(scene) < SHUT)

    def closed(scene: Scene) -> float:
        ((hold, _),) = chosen
        if not swings(hand.motion, hold.grasp.opening):
            return 1.0
        end = hand.motion.share(hold.grasp.opening)
        return float(np.clip((hold.share - hand.share(scene)) / (hold.share - end), 0.0, 1.0))

    return (
        Waypoint(
            f"above {body}",
            joints=before,
            share=share,
            near=READY / hand.length,
            after=after,
        ),
        Waypoint(f"around {body}", joints=around, share=share, near=NEAR / hand.length),
        Waypoint(
            f"grasp {body}",
            joints=shut,
            squeeze=holds.closing,
            near=pi,
            until=pressed,
            most=GRASPED,
            progress=closed,
        ),
        Waypoint(
            f"hold {body}",
            squeeze=holds.holding,
            steps=4,
            until=held,
            most=HELD,
            pace=GENTLY if hand.quick else 1.0,
        ),
    )


def carry(
    task: TaskEnv,
    robot: str,
    body: str,
    ways: PoseWays,
    names: Sequence[str],
    *,
    near: float = NEAR,
    after: tuple[str, ...] = (),
    loose: bool = False,
) -> tuple[Waypoint, ...]:
    """Return the waypoints that take what an arm holds along a way.

    Of the ways the best is chosen, when the first waypoint begins, that the arm can follow to its
    end with room for itself.

    Args:
        task: Where the arm stands.
        robot: Its name in the layout.
        body: What it holds.
        ways: Of the body, each with as many poses as there are names.
        names: What the waypoints are called.
        near: How near it must come to each pose (m).
        after: Waypoints of other robots that must be done before it begins.
        loose: Whether the body may be turned otherwise by up to 0.35 rad, as arms of fewer than six
            joints always turn it.
    """
    hand = Hand(task, robot)
    chosen: list[tuple[Floats, Floats]] = []

    def choose(scene: Scene) -> None:
        frame = hand.held(scene, body)
        offered = [Way(frame, [pose_matrix(*pose) for pose in way]) for way in ways(scene)]
        what = f"to {names[-1]}"
        (best,) = routes(
            task, hand, scene, offered, what=what, touched=[body], carried=body, loose=loose
        )
        chosen[:] = [*zip(offered[best.number].poses, best.postures, strict=True)]

    def joints(scene: Scene, number: int) -> list[Floats]:
        if not number:
            choose(scene)
        pose, posture = chosen[number]
        frame, start = hand.held(scene, body), hand.like(scene, posture)
        return nearest_posture(hand, frame, pose, start, loose=loose)

    return tuple(
        Waypoint(
            name,
            joints=partial(joints, number=number),
            gripper=None,
            near=near / hand.length,
            after=() if number else after,
        )
        for number, name in enumerate(names)
    )


def bring(
    task: TaskEnv,
    robot: str,
    body: str,
    poses: Poses,
    *,
    name: str | None = None,
    near: float = NEAR,
    after: tuple[str, ...] = (),
    loose: bool = False,
) -> tuple[Waypoint, ...]:
    """Return the waypoint that brings what an arm holds to one of some poses, ``bring BODY``.

    Args:
        task: Where the arm stands.
        robot: Its name in the layout.
        body: What it holds.
        poses: Of the body.
        name: What the waypoint is called instead.
        near: How near it must come (m).
        after: Waypoints of other robots that must be done before it begins.
        loose: See `carry`.
    """

    def ways(scene: Scene) -> list[list[Pose]]:
        return [[pose] for pose in poses(scene)]

    names = [name or f"bring {body}"]
    return carry(task, robot, body, ways, names, near=near, after=after, loose=loose)


def lift(
    task: TaskEnv, robot: str, body: str, by: float, *, after: tuple[str, ...] = ()
) -> tuple[Waypoint, ...]:
    """Return the waypoint that raises what an arm holds, turned as it is, ``lift BODY``.

    Args:
        task: Where the arm stands.
        robot: Its name in the layout.
        body: What it holds.
        by: How far (m).
        after: Waypoints of other robots that must be done before it begins.
    """

    def poses(scene: Scene) -> list[Pose]:
        position, quaternion = scene.body(body)
        return [(position + by * UP, quaternion)]

    return bring(task, robot, body, poses, name=f"lift {body}", near=PASSING, after=after)


def place(
    task: TaskEnv,
    robot: str,
    body: str,
    poses: Poses,
    *,
    above: float = BACK,
    away: float = 2 * BACK,
    after: tuple[str, ...] = (),
) -> tuple[Waypoint, ...]:
    """Return the waypoints that put down what an arm holds: over, place, release, leave.

    Each is called by that word and the body's name.

    Args:
        task: Where the arm stands.
        robot: Its name in the layout.
        body: What it holds.
        poses: In which it may rest; see `resting`.
        above: How far above them it comes first (m).
        away: How far the gripper goes back, against its approach, once it has let go (m).
        after: Waypoints of other robots that must be done before it begins.
    """

    def ways(scene: Scene) -> list[list[Pose]]:
        return [[(p + above * UP, q), (p, q)] for p, q in poses(scene)]

    names = [f"over {body}", f"place {body}"]
    return (
        *carry(task, robot, body, ways, names, after=after),
        *release(task, robot, body, away=away),
    )


def release(
    task: TaskEnv,
    robot: str,
    body: str,
    *,
    away: float = 2 * BACK,
    share: Share | None = None,
    after: tuple[str, ...] = (),
) -> tuple[Waypoint, ...]:
    """Return the waypoints that let go of what an arm holds and draw back: release, leave.

    Args:
        task: Where the arm stands.
        robot: Its name in the layout.
        body: What it holds.
        away: How far the gripper goes back, against its approach (m).
        share: How far the gripper opens, from 0 to 1; None is as far as its pads stay about
            parallel.
        after: Waypoints of other robots that must be done before it lets go.
    """
    hand = Hand(task, robot)
    if share is None:
        share = hand.motion.share(hand.motion.widest_within(SPLAYED))

    def leave(scene: Scene) -> list[Floats]:
        now = hand.qpos(scene)
        gripper = hand.link(now[None])[0] @ hand.pointing(np.zeros(3))
        for way in (away, away / 2, away / 4):
            back = shifted(gripper, -way * gripper[:3, 2])
            found = near_posture(hand, hand.pointing(np.zeros(3)), back, now)
            if found:
                return found
        return [hand.joints(now)]

    return (
        Waypoint(f"release {body}", share=share, steps=6, after=after),
        Waypoint(f"leave {body}", joints=leave, share=share, near=PASSING / hand.length),
    )


def hold(robot: str, body: str, *, steps: int = 0, after: tuple[str, ...] = ()) -> Waypoint:
    """Return the waypoint with which an arm keeps still what it holds, ``keep BODY``.

    Args:
        robot: Its name in the layout.
        body: What it holds.
        steps: For how many control steps at least.
        after: Waypoints of other robots, until which it goes on with what it did before.
    """
    held = partial(Scene.grasps, robot=robot, body=body)
    return Waypoint(f"keep {body}", gripper=None, steps=steps, until=held, after=after)


def insert(
    task: TaskEnv,
    robot: str,
    body: str,
    tip: NamedPoint,
    hole: Callable[[Scene], Pose],
    depth: float,
    *,
    turns: Sequence[float] = QUARTERS,
    before: float = BACK,
    after: tuple[str, ...] = (),
) -> tuple[Waypoint, ...]:
    """Return the waypoints that push what an arm holds into a hole: before, align, in 0, in 1 etc.

    Args:
        task: Where the arm stands.
        robot: Its name in the layout.
        body: What it holds.
        tip: The point of it that goes in first; its z axis points ahead.
        hole: Given the scene, where the hole opens; its z axis points out of it. `point_at` gives
            it of a thing that has such a point.
        depth: How far the tip goes in (m).
        turns: How the body may be turned about the hole's axis (rad): a square peg fits in four
            ways. Zero turns the tip's x axis along the hole's.
        before: How far before the hole it begins (m).
        after: Waypoints of other robots that must be done before it begins.
    """
    count = max(2, round(depth / INWARD) + 1)
    stops = (before, INWARD, *(-depth * (i + 1) / count for i in range(count)))

    def ways(scene: Scene) -> list[list[Pose]]:
        own = pose_matrix(scene.scale(body) * np.array(tip.position), tip.quaternion)
        (place, quaternion), into = hole(scene), np.linalg.inv(own)
        out = rotate(quaternion, UP)
        found: list[list[Pose]] = []
        for angle in turns:
            facing = multiply(multiply(quaternion, turn("x", pi)), turn("z", angle))
            poses = (pose_matrix(place + stop * out, facing) @ into for stop in stops)
            found.append([(pose[:3, 3], quaternion_of(pose[:3, :3])) for pose in poses])
        return found

    names = [f"before {body}", f"align {body}", *(f"in {body} {i}" for i in range(count))]
    before_it, align, *inward = carry(task, robot, body, ways, names, near=NEAR / 4, after=after)
    return (before_it, replace(align, near=align.near / 3, steps=SETTLED), *inward)


def pouring(
    spout: NamedPoint,
    over: Callable[[Scene], Floats],
    *,
    angle: float = POURED,
    yaws: Sequence[float] = YAWS,
) -> PoseWays:
    """Return ways of a vessel that is turned about its spout, which stays where it is.

    Args:
        spout: Where it pours, in its own frame; one whose z axis points up, such as a rim's middle,
            pours along the vessel's x axis.
        over: Given the scene, where the spout is to be, (3,) (m).
        angle: How far the vessel is turned (rad).
        yaws: Headings from which it may pour (rad).
    """
    count = max(2, round(angle / TILT))
    out = rotate(np.array(spout.quaternion), UP)
    aside = np.array([-out[1], out[0], 0.0])
    length = float(np.linalg.norm(aside))
    axis = (aside / length).tolist() if length > LEVEL else (0.0, 1.0, 0.0)

    def ways(scene: Scene) -> list[list[Pose]]:
        place, own = over(scene), np.array(spout.position)
        found: list[list[Pose]] = []
        for yaw in yaws:
            tilts = (quaternion_about(axis, angle * i / count) for i in range(count + 1))
            turned = [multiply(turn("z", yaw), tilt) for tilt in tilts]
            found.append([(place - rotate(each, own), each) for each in turned])
        return found

    return ways


def pour(
    task: TaskEnv,
    robot: str,
    body: str,
    spout: NamedPoint,
    over: Callable[[Scene], Floats],
    *,
    angle: float = POURED,
    yaws: Sequence[float] = YAWS,
    after: tuple[str, ...] = (),
) -> tuple[Waypoint, ...]:
    """Return the waypoints that pour from a vessel that an arm holds: over, tilt 0, tilt 1 and on.

    ``grasp(…, ways=pouring(…))`` takes it so that this can be done.

    Args:
        task: Where the arm stands.
        robot: Its name in the layout.
        body: The vessel.
        spout: See `pouring`.
        over: See `pouring`.
        angle: See `pouring`.
        yaws: See `pouring`.
        after: Waypoints of other robots that must be done before it begins.
    """
    count = max(2, round(angle / TILT))
    names = [f"over {body}", *(f"tilt {body} {i}" for i in range(count))]
    ways = pouring(spout, over, angle=angle, yaws=yaws)
    return carry(task, robot, body, ways, names, near=PASSING, after=after)


def operate(
    task: TaskEnv,
    robot: str,
    body: str,
    joint: str,
    to: float,
    *,
    steps: int = 8,
    after: tuple[str, ...] = (),
) -> tuple[Waypoint, ...]:
    """Return the waypoints that open, turn or slide what an arm holds: BODY.JOINT 0, 1 and so on.

    Args:
        task: Where the arm stands.
        robot: Its name in the layout.
        body: The thing's name in the world; `grasp` with ``moving`` takes hold of its part.
        joint: Its joint.
        to: Where that is to be (m or rad).
        steps: Number of waypoints, which are evenly apart.
        after: Waypoints of other robots that must be done before it begins.
    """
    part = part_name(body, joint)

    def ways(scene: Scene) -> list[list[Pose]]:
        stops = np.linspace(scene.joints(body)[joint], to, steps + 1)[1:]
        return [[scene.part(body, joint, stop) for stop in stops.tolist()]]

    names = [f"{part} {i}" for i in range(steps)]
    return carry(task, robot, part, ways, names, near=PASSING, after=after)


def press(
    task: TaskEnv,
    robot: str,
    body: str,
    thing: ObjectDescriptor,
    joint: str,
    to: float,
    *,
    point: NamedPoint,
    back: float = BACK,
    after: tuple[str, ...] = (),
) -> tuple[Waypoint, ...]:
    """Return the waypoints that push a joint with closed fingers: before, press, leave.

    Each is called by that word and the part's name. The gripper comes along the point's z axis,
    turned about it as suits the arm, and pushes until the joint is where it is to be.

    Args:
        task: Where the arm stands.
        robot: Its name in the layout.
        body: The thing's name in the world.
        thing: What it is.
        joint: Its joint.
        to: Where that is to be (m or rad).
        point: Where it is pushed, such as ``thing.point("top")``; its z axis points out.
        back: How far before that the gripper begins (m).
        after: Waypoints of other robots that must be done before it begins.

    Raises:
        UnknownNameError: If the thing has no such joint.
    """
    hand, part = Hand(task, robot), part_name(body, joint)
    frame, start = hand.pointing(hand.motion.middle(0.0)), thing.joint(joint).start
    chosen: list[tuple[Floats, Floats]] = []

    def gripper(scene: Scene, position: float, turned: float, away: float) -> Floats:
        at = pose_matrix(*scene.part(body, joint, position))
        at = at @ pose_matrix(scene.scale(body) * np.array(point.position), point.quaternion)
        return at @ pose_matrix((0.0, 0.0, away), multiply(turn("x", pi), turn("z", turned)))

    def choose(scene: Scene) -> None:
        now = scene.joints(body)[joint]
        ways = [
            Way(
                frame,
                [
                    gripper(scene, now, yaw, BACK / 5),
                    gripper(scene, now, yaw, back),
                ],
                [[gripper(scene, to, yaw, -DEEPER)]],
                enter=1,
                share=0.0,
            )
            for yaw in YAWS
        ]
        what = f"to press {part}"
        (best,) = routes(task, hand, scene, ways, what=what, touched={part, body})
        way = ways[best.number]
        chosen[:] = [(way.poses[1], best.postures[1]), (way.then[0][0], best.postures[0])]

    def joints(scene: Scene, number: int) -> list[Floats]:
        if not number:
            choose(scene)
        pose, posture = chosen[number]
        return near_posture(hand, frame, pose, hand.like(scene, posture))

    def leave(scene: Scene) -> list[Floats]:
        return near_posture(hand, frame, chosen[0][0], hand.like(scene, chosen[0][1]))

    def pressed(scene: Scene) -> bool:
        now = scene.joints(body)[joint]
        return now >= to if to > start else now <= to

    near = NEAR / hand.length
    return (
        Waypoint(
            f"before {part}", joints=partial(joints, number=0), share=0.0, near=near, after=after
        ),
        Waypoint(
            f"press {part}",
            joints=partial(joints, number=1),
            share=0.0,
            near=pi,
            until=pressed,
            most=PUSHED,
        ),
        Waypoint(f"leave {part}", joints=leave, share=0.0, near=PASSING / hand.length),
    )


def near_posture(
    hand: Hand, frame: Floats, pose: Floats, start: Floats, *, loose: bool = False
) -> list[Floats]:
    """Return the arm's posture near a start that brings a frame to a pose; none, if none."""
    found = hand.reach(
        pose[None, :3, 3], pose[None, :3, :3], frame, start[None], scatter=False, loose=loose
    )
    return list(hand.joints(found.qpos))


def nearest_posture(
    hand: Hand, frame: Floats, pose: Floats, start: Floats, *, loose: bool = False
) -> list[Floats]:
    """Return what `near_posture` does; turned otherwise by up to 0.35 rad if there is no other."""
    exact = near_posture(hand, frame, pose, start, loose=loose)
    return exact or near_posture(hand, frame, pose, start, loose=True)


def _leaning(gripper: Floats) -> float:
    """Return how far a gripper leans from straight down, given its frame's pose, (4, 4) (rad)."""
    return float(np.arccos(np.clip(-gripper[2, 2], -1.0, 1.0)))


def shifted(pose: Floats, way: Floats) -> Floats:
    """Return a pose, (4, 4) (m), moved along a way, (3,) (m)."""
    moved = pose.copy()
    moved[:3, 3] += way
    return moved
