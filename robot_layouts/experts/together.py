"""Skills of several arms: they hand a thing over, and lift one together."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain, combinations, islice, product
from math import ceil, pi, radians

import numpy as np

from objects import ObjectDescriptor
from robot_layouts.experts.geometry import gripper_facing, heading
from robot_layouts.experts.hands import Hand
from robot_layouts.experts.holds import AJAR, Hold, Holds, holds_of
from robot_layouts.experts.player import BlockedError, StuckError
from robot_layouts.experts.room import room_of
from robot_layouts.experts.routes import PRESSED, Look
from robot_layouts.experts.script import Pose, Scene, Waypoint
from robot_layouts.experts.skills import (
    BACK,
    DRAWN,
    LEG,
    NEAR,
    PASSING,
    UP,
    lift,
    near_posture,
    nearest_posture,
    release,
    shifted,
    taken,
    taking,
)
from robot_layouts.kinematics.rotations import (
    Floats,
    inverse_pose,
    pose_matrix,
    quaternion_of,
    rotation_about,
    rotation_of,
)
from robot_layouts.simulation.checks.overlaps import between_robots
from tasks import TaskEnv

REFERENCE = 0.855  # m; reach of a Panda, for which the next lengths hold
HEIGHTS, LIFT = (0.4, 0.5, 0.3), 0.05
LEANS = tuple(map(radians, (20, 50, 80, 100)))  # of the giver when it gives, from straight down
HEADINGS = tuple(map(radians, (0, 45, -45)))  # of the giver then, from the way to the taker
BESIDE = 0.08  # m between hands that lift a thing together
APART, OPPOSED = 0.02, 0.4  # m between hands, or cosine between their approaches at most
WIDER = 0.024  # m between each pad and a thing, for hands that hold it crosswise
BACKWARD = -0.3  # cosine between the taker's approach and its way to the thing, at least
PITCHES = (0.0, pi, *(k * pi / 4 for k in (1, -1, 2, -2, 3, -3)))  # rad; sides to take from
LEANT = ((0.0,), (pi / 4, -pi / 4))  # rad; by which the giver's hand is pitched, in this order
TIGHT, DEEPEST = 1.5e-3, 5e-3  # m; by which fingers are closed too far, and so deep at most then
OFFERED, PICKS, GIVES, TAKES = 12, 4, 16, 960  # of each that go on
MEETINGS, EACH, CLOSELY = 120, 6, 24  # likewise
OFF = 4.0  # rad of way that a gripper is worth which is turned as it should be, by 1 rad
CLOSER = 0.006  # m that a hand may come nearer to the other than it should
PALM, TOUCHING = 0.1, 1e-3  # m from fingers to palm; between places that count as one
FACING = 1.5  # rad of way that it is worth when two hands come from opposite sides
ROOMY, WIDE = 5.0, 0.2  # rad of way that 1 m between two hands is worth; m up to which it is
PLACES = 0.04  # m; apart, grasps differ
SIDES = (0.03, 0.1, 0.3, 1.0)  # m; by which a grasp may be farther from an arm than the nearest one


def lift_together(
    task: TaskEnv,
    robots: Sequence[str],
    body: str,
    thing: ObjectDescriptor,
    by: float,
    *,
    parts: Sequence[str] = (),
    lean: float = pi / 2,
) -> dict[str, tuple[Waypoint, ...]]:
    """Return the waypoints with which arms take hold of a thing and raise it level, by robot.

    Each takes it on its own side: above, around, grasp, hold, and then raise 0, raise 1, … together
    with the others.

    Args:
        task: Where the arms stand.
        robots: Their names in the layout.
        body: The thing's name in the world.
        thing: Says where it is grasped.
        by: How far it is raised (m).
        parts: What may be held, by the names that its grasps have; all of it if there are none.
        lean: How far a gripper may lean from straight down (rad).

    Raises:
        DescriptorError: If a robot has no fingers.
        TaskError: If a gripper opens for no grasp, or the thing has none.
    """
    hands = {robot: Hand(task, robot) for robot in robots}
    holds = {robot: holds_of(hand, body, thing, parts) for robot, hand in hands.items()}
    count = max(2, ceil(by / LEG))
    planned: dict[str, tuple[Hold, Floats]] = {}
    began: list[Pose] = []

    def choose(scene: Scene, robot: str) -> tuple[Hold, Floats]:
        if robot not in planned:
            began[:] = [scene.body(body)]
            planned.update(_sides(task, hands, holds, scene, by, lean))
        return planned.pop(robot)

    def raised(scene: Scene, robot: str, number: int) -> list[Floats]:
        hand, (place, quaternion) = hands[robot], began[0]
        pose = pose_matrix(place + by * (number + 1) / count * UP, quaternion)
        return nearest_posture(hand, hand.held(scene, body), pose, hand.qpos(scene))

    script: dict[str, tuple[Waypoint, ...]] = {}
    for robot, hand in hands.items():
        others = [other for other in robots if other != robot]
        before = [f"hold {body}", *(f"raise {body} {i}" for i in range(count))]
        script[robot] = (
            *taking(hand, body, holds[robot], partial(choose, robot=robot)),
            *(
                Waypoint(
                    f"raise {body} {i}",
                    joints=partial(raised, robot=robot, number=i),
                    gripper=None,
                    near=PASSING / hand.length,
                    after=tuple(f"{other}.{before[i]}" for other in others),
                )
                for i in range(count)
            ),
        )
    return script


def _sides(
    task: TaskEnv,
    hands: dict[str, Hand],
    holds: dict[str, Holds],
    scene: Scene,
    by: float,
    lean: float,
) -> dict[str, tuple[Hold, Floats]]:
    """Return a grasp for each arm, on its own side of the thing, so that no hands overlap.

    Raises:
        StuckError: If there are none; says why.
    """
    middle = np.mean([hand.base[:3, 3] for hand in hands.values()], axis=0)
    offered = {
        robot: _from_side(
            task,
            hand,
            holds[robot],
            scene,
            hand.base[:3, 3] - middle,
            by,
            lean,
            {other.owner for other in hands.values()} - {hand.owner},
        )
        for robot, hand in hands.items()
    }
    room = room_of(task, scene)
    for off in (CLOSER, 0.0):
        nearer = {
            robot: [
                (hold, posture, _moved(hands[robot], hold, scene, posture, middle, off))
                for hold, posture in some
            ]
            for robot, some in offered.items()
        }
        for chosen in product(*nearer.values()):
            places = [hold.at(scene)[:3, 3] for hold, _, _ in chosen]
            pairs = combinations(places, 2)
            if min(float(np.linalg.norm(one - other)) for one, other in pairs) < BESIDE:
                continue
            postures = {
                hand.owner: moved
                for hand, (_, _, moved) in zip(hands.values(), chosen, strict=True)
            }
            if not between_robots(room.overlaps(scene, postures)):
                return {robot: each[:2] for robot, each in zip(hands, chosen, strict=True)}
    names = " and ".join(map(repr, hands))
    raise StuckError(f"{names} cannot take {next(iter(holds.values())).each[0].thing} at once")


def _moved(
    hand: Hand, hold: Hold, scene: Scene, posture: Floats, middle: Floats, off: float
) -> Floats:
    """Return a posture of an arm with its hand nearer to the middle of all (m), if it can be."""
    pose = hold.at(scene)
    way = (middle - pose[:3, 3]) * (1.0, 1.0, 0.0)
    way *= off / max(float(np.linalg.norm(way)), TOUCHING)
    joints = near_posture(hand, hold.pads, shifted(pose, way), posture)
    moved = posture.copy()
    moved[hand.columns] = joints[0] if joints else posture[hand.columns]
    return moved


def _from_side(
    task: TaskEnv,
    hand: Hand,
    holds: Holds,
    scene: Scene,
    side: Floats,
    by: float,
    lean: float,
    others: Collection[str],
) -> list[tuple[Hold, Floats]]:
    """Return the grasps that an arm can do on its side of a thing, the best first."""
    side = side * (1.0, 1.0, 0.0)
    side = side / max(float(np.linalg.norm(side)), 1e-9)
    steep = [hold for hold in holds.each if -hold.at(scene)[2, 2] >= np.cos(lean) - 1e-6]
    along = [float(hold.at(scene)[:3, 3] @ side) for hold in steep]
    reason = StuckError(f"{hand.arm!r} would lean too far in all grasps of {holds.each[0].thing}")
    for within in SIDES:
        some = [hold for hold, at in zip(steep, along, strict=True) if at >= max(along) - within]
        try:
            return taken(
                task, hand, scene, holds, some, back=BACK, up=by, count=OFFERED, besides=others
            )
        except StuckError as error:
            reason = error
    raise reason


def hand_over(
    task: TaskEnv,
    giver: str,
    taker: str,
    body: str,
    thing: ObjectDescriptor,
    *,
    held: bool = False,
    lean: float = pi / 2,
) -> dict[str, tuple[Waypoint, ...]]:
    """Return the waypoints with which an arm takes a thing and gives it to another one, by robot.

    The giver: above, around, grasp, hold, lift, present, release, leave. The taker: above, around,
    grasp, hold, keep; then it holds the thing alone. Where they meet and how each holds the thing
    is chosen when the first of them begins.

    Args:
        task: Where the arms stand.
        giver: Name of the arm that gives.
        taker: Name of the arm that takes.
        body: The thing's name in the world.
        thing: Says where it is grasped.
        held: Whether the giver holds it already.
        lean: How far the giver may lean from straight down when it takes the thing (rad).

    Raises:
        DescriptorError: If a robot has no fingers.
        TaskError: If a gripper opens for no grasp, or the thing has none.
    """
    exchange = _Passing(task, Hand(task, giver), Hand(task, taker), body, thing, lean)
    first = () if held else exchange.picking()
    present = Waypoint(
        f"present {body}",
        joints=partial(exchange.present, held=held),
        gripper=None,
        near=NEAR / exchange.giver.length,
    )
    return {
        giver: (
            *first,
            present,
            *release(
                task,
                giver,
                body,
                share=exchange.released,
                after=(f"{taker}.hold {body}",),
            ),
        ),
        taker: (
            *taking(
                exchange.taker,
                body,
                exchange.takers,
                exchange.take,
                after=(f"{giver}.{present.name}",),
            ),
            Waypoint(f"keep {body}", gripper=None, after=(f"{giver}.leave {body}",)),
        ),
    }


@dataclass(frozen=True, eq=False)
class _Rendezvous:
    """Where a thing changes hands.

    Attributes:
        give: The giver's posture, (dof,) (rad, m).
        body: Pose of the thing, (4, 4) (m).
        grip: Of the giver's gripper in its TCP link's frame, (4, 4) (m).
        released: How far the giver's gripper opens when it lets go, from 0 to 1.
        hold: The taker's grasp.
        take: The taker's posture, (dof,) (rad, m).
    """

    give: Floats
    body: Floats
    grip: Floats
    released: float
    hold: Hold
    take: Floats


class _Passing:
    """Where and how two hands meet at a thing."""

    def __init__(
        self,
        task: TaskEnv,
        giver: Hand,
        taker: Hand,
        body: str,
        thing: ObjectDescriptor,
        lean: float,
    ) -> None:
        self._task, self.giver, self.taker, self._body = task, giver, taker, body
        self._givers, self.takers = (holds_of(hand, body, thing) for hand in (giver, taker))
        self._lean, self._scale = lean, min(giver.length, taker.length) / REFERENCE
        self._meeting: _Rendezvous | None = None
        self._takes: list[Hold] | None = None
        # The last grasp of each hand in this attempt, and those of earlier ones that failed.
        self._picked: Hold | None = None
        self._taken: Hold | None = None
        self._failed_picks: list[Hold] = []
        self._failed_takes: list[Hold] = []
        self._off = CLOSER
        fingers = task.layout.arm(taker.arm).robot.fingers
        assert fingers is not None  # or `Hand` had said so
        self._fingers = fingers.links

    def picking(self) -> tuple[Waypoint, ...]:
        """Return the giver's waypoints until it has lifted the thing."""
        by = LIFT * self._scale
        return (
            *taking(self.giver, self._body, self._givers, self._pick),
            *lift(self._task, self.giver.arm, self._body, by),
        )

    def released(self, scene: Scene) -> float:
        """Return how far the giver opens when it lets go."""
        assert self._meeting is not None
        return self._meeting.released

    def _pick(self, scene: Scene) -> tuple[Hold, Floats]:
        """Return the grasp with which the giver takes the thing so that it can give it.

        Raises:
            StuckError: If there is none; says why.
        """
        if self._taken is not None:  # an attempt before this one came so far
            self._failed_takes.append(self._taken)
        elif self._picked is not None:
            self._failed_picks.append(self._picked)
        self._picked = self._taken = None
        reasons = [StuckError(f"no grasp of {self._body} is left for {self.taker.arm!r}")]
        offered = (self._offered(scene, some, reasons) for some in LEANT)
        for hold, posture in chain.from_iterable(offered):
            try:
                in_hand = hold.shut @ inverse_pose(hold.own)
                self._meeting = self._meet(scene, posture, in_hand, hold)
            except StuckError as error:
                reasons.append(error)
            else:
                self._picked = hold
                return hold, posture
        raise reasons[:2][-1]

    def _offered(
        self, scene: Scene, pitches: Sequence[float], reasons: list[StuckError]
    ) -> list[tuple[Hold, Floats]]:
        """Return unlike grasps of the giver that leave one to the taker, and postures, best first.

        Args:
            scene: As it is now.
            pitches: By which its hand may be pitched (rad).
            reasons: Why there are none is added.
        """
        takes = np.array([hold.own for hold in self._free_takes(scene)]).reshape(-1, 4, 4)
        gives = (
            hold.opened(self.giver, AJAR).pitched(angle)
            for hold, angle in product(self._givers.each, pitches)
        )
        some = [
            hold
            for hold in gives
            if -hold.at(scene)[2, 2] >= np.cos(self._lean) - 1e-6
            and np.isfinite(_costs(hold.own, takes)).any()
        ]
        some = [hold for hold in some if not _like_any(hold, self._failed_picks)] or some
        if not some:
            return []
        hand, up = self.giver, LIFT * self._scale
        try:
            offered = taken(
                self._task, hand, scene, self._givers, some, back=BACK, up=up, count=OFFERED
            )
        except StuckError as error:
            reasons.append(error)
            return []
        unlike = {_alike(hold): (hold, posture) for hold, posture in reversed(offered)}
        return [*unlike.values()][::-1][:PICKS]

    def present(self, scene: Scene, held: bool) -> list[Floats]:
        """Return the giver's posture where it gives the thing."""
        hand = self.giver
        if held:
            now, in_hand = hand.qpos(scene), hand.held(scene, self._body)
            self._meeting = self._meet(scene, now, in_hand, None)
        assert self._meeting is not None
        start, frame = hand.like(scene, self._meeting.give), hand.held(scene, self._body)
        return nearest_posture(hand, frame, self._meeting.body, start)

    def take(self, scene: Scene) -> tuple[Hold, Floats]:
        """Return the taker's grasp of the thing as it is held out now, and its posture there."""
        meeting = self._meeting
        assert meeting is not None
        if not any(scene.grasps(self.giver.arm, each) for each in self._givers.bodies):
            raise BlockedError(f"{self.giver.arm!r} has lost {self._body} on its way")
        self._off = CLOSER / 2  # less than was planned with, as hands are where they are by now
        now, body = self.giver.qpos(scene), pose_matrix(*scene.body(self._body))
        grip = self.giver.link(now[None])[0] @ meeting.grip
        planned = meeting.hold, meeting.take
        _, hold, posture = self._take(
            scene, now[None], body[None], grip[None], np.zeros(1), meeting.released, planned
        )
        self._taken = hold
        return hold, posture

    def _meet(self, scene: Scene, start: Floats, in_hand: Floats, own: Hold | None) -> _Rendezvous:
        """Return where the giver gives the thing.

        Args:
            scene: As it is now.
            start: Posture of the giver when it has the thing, (dof,) (rad, m).
            in_hand: Pose of the body in the giver's TCP link's frame then, (4, 4) (m).
            own: The giver's grasp, if it is known.

        Raises:
            StuckError: If there is no such place; says why.
        """
        giver = self.giver
        grip = giver.pointing(giver.motion.middle(0.0) if own is None else own.shut[:3, 3])
        places, turns = zip(*self._places(), strict=True)
        gives = giver.reach(np.array(places), np.array(turns), grip, start[None])
        ways = giver.way(gives.qpos, start)
        turned, unlike = gives.which % (len(places) // len(HEIGHTS)), list[int]()
        for each in np.argsort(ways):
            if turned[each] not in turned[unlike]:
                unlike.append(each)
        best = unlike[:GIVES]
        if not best:
            raise StuckError(
                f"{giver.arm!r} cannot reach to where {self.taker.arm!r} could take {self._body}"
            )
        qpos = gives.qpos[best]
        if own is not None:
            qpos = giver.opened(qpos, giver.motion.share(own.grasp.opening))
        links = giver.link(qpos)
        released = own.share if own else max(hold.share for hold in self._givers.each)
        bodies, grips = links @ in_hand, links @ grip
        number, hold, take = self._take(scene, qpos, bodies, grips, ways[best], released)
        return _Rendezvous(qpos[number], bodies[number], grip, released, hold, take)

    def _take(
        self,
        scene: Scene,
        gives: Floats,
        bodies: Floats,
        grips: Floats,
        ways: Floats,
        released: float,
        planned: tuple[Hold, Floats] | None = None,
    ) -> tuple[int, Hold, Floats]:
        """Return which of some postures the giver gives from, the taker's grasp, and its posture.

        Args:
            scene: As it is now.
            gives: Postures of the giver, (n, dof) (rad, m).
            bodies: Poses of the body then, (n, 4, 4) (m).
            grips: Poses of the giver's gripper then, (n, 4, 4) (m).
            ways: How far the giver has to go there, (n,) (rad).
            released: How far the giver's gripper opens when it lets go, from 0 to 1.
            planned: The taker's grasp and posture that are looked at first, if they are in reach.

        Raises:
            StuckError: If the taker can take it in none of them; says why.
        """
        giver, taker, name = self.giver, self.taker, self._body
        now = taker.qpos(scene)
        holds = self._free_takes(scene)
        holds = [hold for hold in holds if not _like_any(hold, self._failed_takes)] or holds
        rows = [
            each
            for row, body in enumerate(bodies)
            for each in self._suited(row, grips[row], body, holds)[: TAKES // len(bodies)]
        ]
        if not rows:
            raise StuckError(f"no grasp of {name} is left for {taker.arm!r} to take it by")
        found = [
            (
                cost + float(ways[row]) + 0.5 * float(taker.way(posture, now)) + OFF * off,
                row,
                hold,
                posture,
            )
            for cost, row, hold, posture, off in self._reached(rows, now)
        ]
        if planned is not None:
            hold, posture = planned
            pose = bodies[0] @ hold.own
            near = taker.reach(
                pose[None, :3, 3], pose[None, :3, :3], hold.pads, posture[None], scatter=False
            )
            found += [(-np.inf, 0, hold, qpos) for qpos in near.qpos]
        if not found:
            raise StuckError(f"{taker.arm!r} cannot reach {name} where {giver.arm!r} can give it")
        look = Look(self._task, scene, [name], {taker.owner: now})
        without = Look(self._task, scene, [], {taker.owner: now}, carried=name)
        both = giver.links | taker.links
        closely, tried, crossed = 0, 0, set[int]()
        for row, own, posture in _spread(found):
            if closely >= CLOSELY or tried >= MEETINGS:
                break
            if id(own) in crossed:  # whichever way the arms come
                continue
            tried += 1
            body = bodies[row]
            moved = {name: (body[:3, 3], quaternion_of(body[:3, :3]))}
            gives_it = gives[row], giver.opened(gives[row], released)
            hands_cross = True
            for hold in (own, own.opened(taker, WIDER)):
                closed = taker.motion.share(hold.grasp.opening)
                at, shut = (taker.opened(posture, share) for share in (hold.share, closed))
                hands = (self._both(give, take) for give in gives_it for take in (at, shut))
                overlap = without.overlap(hands)
                if overlap is not None:
                    hands_cross &= {overlap.one.name, overlap.other.name} <= both
                    continue
                hands_cross = False
                closely += 1
                way = self._on_the_way(scene, hold, body @ hold.own, grips[row], at)
                off = [*way[2:], *taker.opened(way[2:], closed)]
                if (
                    len(way)
                    and look.overlap((self._both(gives[row], q) for q in way[:2]), moved) is None
                    and without.overlap(self._both(gives[row], q) for q in off) is None
                ):
                    return row, hold, at
            if hands_cross:
                crossed.add(id(own))
        raise StuckError(
            f"wherever {taker.arm!r} could take {name} from {giver.arm!r}, something is in the way"
        )

    def _on_the_way(
        self, scene: Scene, hold: Hold, pose: Floats, grip: Floats, posture: Floats
    ) -> Floats:
        """Return postures of the taker before it holds the thing, (n, dof) (rad, m).

        They are one before the thing, one halfway to there, and those in reach that are a little
        off: nearer to the other's fingers and palm, where the fingers part, and too far ahead,
        since arms overshoot. If the first is out of reach, there is none.
        """
        taker, now = self.taker, self.taker.opened(self.taker.qpos(scene), hold.share)
        fingers = (grip - pose)[:3, 3]
        palm = fingers - PALM * (grip - pose)[:3, 2]
        nearer = [way / max(float(np.linalg.norm(way)), TOUCHING) for way in (fingers, palm)]
        off = self._off * np.array([*nearer, pose[:3, 1], -pose[:3, 1], 2 * pose[:3, 2]])
        found: list[Floats] = []
        for way in (-BACK * pose[:3, 2], *off):
            if joints := near_posture(taker, hold.pads, shifted(pose, way), posture):
                found.append(posture.copy())
                found[-1][taker.columns] = joints[0]
            elif not found:
                break
        halfway = [(now + found[0]) / 2] if found else []
        return np.array([*found[:1], *halfway, *found[1:]]).reshape(-1, len(now))

    def _places(self) -> Iterator[tuple[Floats, Floats]]:
        """Yield where and how turned the giver may hold the thing out."""
        one, other = self.giver.base[:3, 3], self.taker.base[:3, 3]
        share = self.giver.length / (self.giver.length + self.taker.length)
        towards, middle = heading(one, other), one + share * (other - one)
        for height, aside, lean, k in product(HEIGHTS, HEADINGS, LEANS, range(4)):
            turn = rotation_of(gripper_facing(towards + aside, lean))
            roll = rotation_about((0.0, 0.0, 1.0), np.array(k * pi / 2))
            yield middle + height * self._scale * UP, turn @ roll

    def _suited(
        self, row: int, grip: Floats, body: Floats, holds: Sequence[Hold]
    ) -> list[tuple[float, int, Hold, Floats]]:
        """Return with which grasps two hands may hold a thing, the taker coming from its own side.

        Args:
            row: Number of the giver's posture.
            grip: Pose of the giver's gripper, (4, 4) (m).
            body: Pose of the thing then, (4, 4) (m).
            holds: Grasps of the taker.

        Returns:
            What each costs (rad of way), that number, grasp and pose; the best first.
        """
        way = (grip[:3, 3] - self.taker.base[:3, 3]) * (1.0, 1.0, 0.0)
        poses = body @ np.array([hold.own for hold in holds]).reshape(-1, 4, 4)
        costs = _costs(grip, poses)
        costs[poses[:, :3, 2] @ way < BACKWARD * np.linalg.norm(way)] = np.inf
        best = [i for i in np.argsort(costs) if costs[i] < np.inf]
        return [(float(costs[i]), row, holds[i], poses[i]) for i in best]

    def _reached(
        self, rows: Sequence[tuple[float, int, Hold, Floats]], now: Floats
    ) -> Iterator[tuple[float, int, Hold, Floats, float]]:
        """Yield what the taker reaches, in several postures where there are some."""
        by_width: dict[float, list[tuple[float, int, Hold, Floats]]] = {}
        for row in rows:
            by_width.setdefault(row[2].grasp.opening, []).append(row)
        for alike in by_width.values():
            poses, pads = np.array([pose for *_, pose in alike]), alike[0][2].pads
            opened = self.taker.opened(now, alike[0][2].share)
            for start in (opened, *self.taker.scattered(opened)):
                found = self.taker.reach(
                    poses[:, :3, 3], poses[:, :3, :3], pads, start[None], scatter=False
                )
                for which, qpos, off in zip(found.which, found.qpos, found.off, strict=True):
                    cost, row, hold, _ = alike[which]
                    yield cost, row, hold, qpos, float(off)

    def _free_takes(self, scene: Scene) -> list[Hold]:
        """Return the taker's grasps, from all sides, in which its hand has the thing to itself."""
        if self._takes is None:
            self._takes = []
            for hold, angle in product(self.takers.each, PITCHES):
                pitched = hold.opened(self.taker, AJAR).pitched(angle)
                drawn = map(pitched.drawn_back, DRAWN)
                free = (each for each in drawn if self._closes_on(scene, each))
                self._takes += islice(free, 1)
        return self._takes

    def _closes_on(self, scene: Scene, hold: Hold) -> bool:
        """Return whether the taker's hand is outside the thing, and closes on it alone."""
        wide = hold.grasp.opening
        ajar, tight = hold.share, self.taker.motion.share(max(wide - 2 * TIGHT, 0.0))
        if any(depth > PRESSED for depth in self._depths(scene, hold.pads, hold, ajar).values()):
            return False
        depths = self._depths(scene, hold.shut, hold, tight)
        fingers = [depths.pop(link, 0.0) for link in self._fingers]
        apart = all(depth < PRESSED for depth in depths.values())
        return apart and min(fingers) > 0.0 and max(fingers) < DEEPEST

    def _depths(self, scene: Scene, frame: Floats, hold: Hold, share: float) -> dict[str, float]:
        """Return how deep links of the taker's hand would be in the thing that it has (m)."""
        hand, room = self.taker, room_of(self._task, scene)
        now = hand.opened(hand.qpos(scene), share)
        body = hand.link(now[None])[0] @ frame @ inverse_pose(hold.own)
        moved = {self._body: (body[:3, 3], quaternion_of(body[:3, :3]))}
        found: dict[str, float] = {}
        for one, other, depth in room.overlaps(scene, {hand.owner: now}, moved):
            ends = {one.name, other.name}
            for link in ends & hand.links if self._body in ends else ():
                found.setdefault(link, depth)
        return found

    def _both(self, give: Floats, take: Floats) -> dict[str, Floats]:
        """Return the postures of the robots, by name, with both arms somewhere."""
        if self.giver.owner != self.taker.owner:
            return {self.giver.owner: give, self.taker.owner: take}
        both = give.copy()
        both[self.taker.columns] = take[self.taker.columns]
        return {self.giver.owner: both}


def _alike(hold: Hold) -> tuple[int, ...]:
    """Return what grasps have in common that hold a thing at about the same place and way."""
    return (*(hold.own[:3, 3] / PLACES).astype(int), *hold.own[:3, 2].round().astype(int))


def _like_any(hold: Hold, others: Sequence[Hold]) -> bool:
    return any(_alike(hold) == _alike(other) for other in others)


def _costs(grip: Floats, takes: Floats) -> Floats:
    """Return what it costs to take a thing while another hand has it, (n,) (rad of way).

    Args:
        grip: Pose of the other hand's gripper, (4, 4) (m).
        takes: Poses of the gripper that takes it, (n, 4, 4) (m).

    Returns:
        Infinity where there is no room for two hands.
    """
    gaps = np.linalg.norm(takes[:, :3, 3] - grip[:3, 3], axis=1)
    facing = takes[:, :3, 2] @ grip[:3, 2]
    costs = FACING * facing - ROOMY * np.minimum(gaps, WIDE)
    return np.where((gaps > APART) | (facing < OPPOSED), costs, np.inf)


def _spread(
    found: Sequence[tuple[float, int, Hold, Floats]],
) -> Iterator[tuple[int, Hold, Floats]]:
    """Yield what was found, the cheapest first, and of each place of meeting only a few."""
    counts = dict[int, int]()
    for _, number, hold, posture in sorted(found, key=lambda row: row[0]):
        counts[number] = counts.get(number, 0) + 1
        if counts[number] <= EACH or len({row[1] for row in found}) == 1:
            yield number, hold, posture
