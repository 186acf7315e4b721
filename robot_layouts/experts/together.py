"""Skills of several arms: they hand a thing over, and lift one together."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice, product
from math import ceil, pi, radians

import numpy as np

from objects import ObjectDescriptor
from robot_layouts.experts.geometry import gripper_facing, heading
from robot_layouts.experts.hands import Hand
from robot_layouts.experts.holds import Hold, Holds, holds_of
from robot_layouts.experts.player import StuckError
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
from robot_layouts.simulation.backend import Overlap
from tasks import TaskEnv

REFERENCE = 0.855  # m; reach of a Panda, for which the next lengths hold
HEIGHTS, LIFT = (0.4, 0.5, 0.3), 0.05
LEANS = tuple(map(radians, (20, 50, 80, 100)))  # of the giver when it gives, from straight down
HEADINGS = tuple(map(radians, (0, 45, -45)))  # of the giver then, from the way to the taker
BESIDE = 0.08  # m between hands that lift a thing together
APART, OPPOSED = 0.02, 0.4  # m between hands, or cosine between their approaches at most
OFFERED, PICKS, GIVES, TAKES, MEETINGS, EACH = 12, 4, 16, 500, 60, 6  # of each that go on
OFF = 4.0  # rad of way that a gripper is worth which is turned as it should be, by 1 rad
CLOSER, TOUCHING = 0.006, 1e-3  # m that a hand may come nearer to the other than it should
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
    planned: dict[str, list[tuple[Hold, Floats]]] = {}
    began: list[Pose] = []

    def choose(scene: Scene, robot: str) -> list[tuple[Hold, Floats]]:
        if robot not in planned:
            began[:] = [scene.body(body)]
            planned.update(_sides(task, hands, holds, scene, by, lean))
        return [*planned.pop(robot)]

    def raised(scene: Scene, robot: str, number: int) -> list[Floats]:
        hand, (place, quaternion) = hands[robot], began[0]
        pose = pose_matrix(place + by * (number + 1) / count * UP, quaternion)
        frame = hand.held(scene, body)
        return near_posture(hand, frame, pose, hand.qpos(scene), loose=True)

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
) -> dict[str, list[tuple[Hold, Floats]]]:
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
    for chosen in product(*offered.values()):
        places = [hold.at(scene)[:3, 3] for hold, _ in chosen]
        gaps = [np.linalg.norm(one - other) for i, one in enumerate(places) for other in places[:i]]
        if min(gaps) < BESIDE:
            continue
        postures = {
            hand.owner: posture for hand, (_, posture) in zip(hands.values(), chosen, strict=True)
        }
        between = [
            overlap
            for overlap in room.overlaps(scene, postures)
            if overlap.one.robot
            and overlap.other.robot
            and overlap.one.robot != overlap.other.robot
        ]
        if not between:
            return {robot: [each] for robot, each in zip(hands, chosen, strict=True)}
    names = " and ".join(map(repr, hands))
    raise StuckError(f"{names} cannot take {next(iter(holds.values())).each[0].thing} at once")


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
            return taken(task, hand, scene, holds, some, back=BACK, up=by, count=3, besides=others)
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
    """

    give: Floats
    body: Floats
    grip: Floats


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
        self.released = self._givers.share
        self._lean, self._scale = lean, min(giver.length, taker.length) / REFERENCE
        self._meeting: _Rendezvous | None = None
        self._takes: list[Hold] | None = None

    def picking(self) -> tuple[Waypoint, ...]:
        """Return the giver's waypoints until it has lifted the thing."""
        by = LIFT * self._scale
        return (
            *taking(self.giver, self._body, self._givers, self._pick),
            *lift(self._task, self.giver.arm, self._body, by),
        )

    def _pick(self, scene: Scene) -> list[tuple[Hold, Floats]]:
        """Return the grasp with which the giver takes the thing so that it can give it.

        Raises:
            StuckError: If there is none; says why.
        """
        hand = self.giver
        some = [h for h in self._givers.each if -h.at(scene)[2, 2] >= np.cos(self._lean) - 1e-6]
        by = LIFT * self._scale
        offered = taken(
            self._task, hand, scene, self._givers, some, back=BACK, up=by, count=OFFERED
        )
        unlike = {_alike(hold): (hold, posture) for hold, posture in reversed(offered)}
        found = [*unlike.values()][::-1][:PICKS]
        reason: StuckError | None = None
        for hold, posture in found:
            in_hand = hold.shut @ inverse_pose(hold.own)
            try:
                self._meeting = self._meet(scene, posture, in_hand, hold)
            except StuckError as error:
                reason = reason or error
            else:
                return [(hold, posture)]
        assert reason is not None
        raise reason

    def present(self, scene: Scene, held: bool) -> list[Floats]:
        """Return the giver's posture where it gives the thing."""
        hand = self.giver
        if held:
            now, in_hand = hand.qpos(scene), hand.held(scene, self._body)
            self._meeting = self._meet(scene, now, in_hand, None)
        assert self._meeting is not None
        start, frame = hand.like(scene, self._meeting.give), hand.held(scene, self._body)
        return near_posture(hand, frame, self._meeting.body, start, loose=True)

    def take(self, scene: Scene) -> list[tuple[Hold, Floats]]:
        """Return the taker's grasp of the thing as it is held out now, and its posture there."""
        assert self._meeting is not None
        now, body = self.giver.qpos(scene), pose_matrix(*scene.body(self._body))
        grip = self.giver.link(now[None])[0] @ self._meeting.grip
        _, hold, posture = self._take(scene, now[None], body[None], grip[None], ways=np.zeros(1))
        return [(hold, posture)]

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
        best = np.argsort(ways)[:GIVES]
        if not len(best):
            raise StuckError(
                f"{giver.arm!r} cannot reach to where {self.taker.arm!r} could take {self._body}"
            )
        qpos = gives.qpos[best]
        if own is not None:
            qpos = giver.opened(qpos, giver.motion.share(own.grasp.opening))
        links = giver.link(qpos)
        number, _, _ = self._take(scene, qpos, links @ in_hand, links @ grip, ways[best])
        return _Rendezvous(qpos[number], (links @ in_hand)[number], grip)

    def _take(
        self, scene: Scene, gives: Floats, bodies: Floats, grips: Floats, ways: Floats
    ) -> tuple[int, Hold, Floats]:
        """Return which of some postures the giver gives from, the taker's grasp, and its posture.

        Args:
            scene: As it is now.
            gives: Postures of the giver, (n, dof) (rad, m).
            bodies: Poses of the body then, (n, 4, 4) (m).
            grips: Poses of the giver's gripper then, (n, 4, 4) (m).
            ways: How far the giver has to go there, (n,) (rad).

        Raises:
            StuckError: If the taker can take it in none of them; says why.
        """
        giver, taker, name = self.giver, self.taker, self._body
        rows = [
            (row, hold, bodies[row] @ hold.own)
            for row in range(len(gives))
            for hold in self._free_takes(scene)
        ]
        rows = [row for row in rows if self._fits(grips[row[0]], row[2])]
        if not rows:
            raise StuckError(f"no grasp of {name} is left for {taker.arm!r} to take it by")
        chosen = np.linspace(0, len(rows) - 1, min(TAKES, len(rows))).astype(int)
        now = taker.opened(taker.qpos(scene), self.takers.share)
        found: list[tuple[float, int, Hold, Floats]] = []
        for number, hold, posture, off in self._reached([rows[i] for i in chosen], now):
            gap = float(np.linalg.norm((bodies[number] @ hold.own - grips[number])[:3, 3]))
            facing = float(grips[number][:3, 2] @ (bodies[number] @ hold.own)[:3, 2])
            cost = float(ways[number]) + 0.5 * float(taker.way(posture, now)) + FACING * facing
            found.append((cost + OFF * off - ROOMY * min(gap, WIDE), number, hold, posture))
        if not found:
            raise StuckError(f"{taker.arm!r} cannot reach {name} where {giver.arm!r} can give it")
        look = Look(self._task, scene, [name], {taker.owner: now})
        for number, hold, posture in islice(_spread(found), MEETINGS):
            body = bodies[number]
            moved = {name: (body[:3, 3], quaternion_of(body[:3, :3]))}
            pose = body @ hold.own
            back = shifted(pose, -BACK * pose[:3, 2])
            before = near_posture(taker, hold.pads, back, posture)
            if not before:
                continue
            towards = (grips[number] - pose)[:3, 3]
            towards = towards / max(float(np.linalg.norm(towards)), TOUCHING)
            closer = near_posture(taker, hold.pads, shifted(pose, CLOSER * towards), posture)
            if not closer:
                continue
            ready, nearer = taker.like(scene, posture), taker.like(scene, posture)
            ready[taker.columns], nearer[taker.columns] = before[0], closer[0]
            takes = (posture, nearer, ready, (now + ready) / 2)
            both = [self._both(gives[number], take) for take in takes]
            both += [self._both(giver.opened(gives[number], self.released), posture)]
            if look.overlap(both, moved) is None:
                return number, hold, posture
        raise StuckError(
            f"wherever {taker.arm!r} could take {name} from {giver.arm!r}, something is in the way"
        )

    def _places(self) -> Iterator[tuple[Floats, Floats]]:
        """Yield where and how turned the giver may hold the thing out."""
        one, other = self.giver.base[:3, 3], self.taker.base[:3, 3]
        share = self.giver.length / (self.giver.length + self.taker.length)
        towards, middle = heading(one, other), one + share * (other - one)
        for height, aside, lean, k in product(HEIGHTS, HEADINGS, LEANS, range(4)):
            turn = rotation_of(gripper_facing(towards + aside, lean))
            roll = rotation_about((0.0, 0.0, 1.0), np.array(k * pi / 2))
            yield middle + height * self._scale * UP, turn @ roll

    def _fits(self, grip: Floats, take: Floats) -> bool:
        """Return whether two hands may hold a thing so, the taker coming from its own side."""
        apart = np.linalg.norm(grip[:3, 3] - take[:3, 3]) > APART
        opposed = float(grip[:3, 2] @ take[:3, 2]) < OPPOSED
        way = (grip[:3, 3] - self.taker.base[:3, 3]) * (1.0, 1.0, 0.0)
        ahead = take[:3, 2] @ way > -0.3 * np.linalg.norm(way)
        return bool((apart or opposed) and ahead)

    def _reached(
        self, rows: Sequence[tuple[int, Hold, Floats]], now: Floats
    ) -> Iterator[tuple[int, Hold, Floats, float]]:
        """Yield what the taker reaches, in several postures where there are some."""
        by_width: dict[float, list[tuple[int, Hold, Floats]]] = {}
        for row in rows:
            by_width.setdefault(row[1].grasp.opening, []).append(row)
        for alike in by_width.values():
            poses = np.array([pose for _, _, pose in alike])
            pads = alike[0][1].pads
            for start in (now, *self.taker.scattered(now)):
                near = start is now
                found = self.taker.reach(
                    poses[:, :3, 3], poses[:, :3, :3], pads, start[None], scatter=near
                )
                for which, qpos, off in zip(found.which, found.qpos, found.off, strict=True):
                    number, hold, _ = alike[which]
                    yield number, hold, qpos, float(off)

    def _other_end(self, overlap: Overlap) -> set[str]:
        """Return what overlaps the thing, if that is it."""
        ends = {overlap.one.name, overlap.other.name}
        return ends - {self._body} if self._body in ends else set()

    def _free_takes(self, scene: Scene) -> list[Hold]:
        """Return the grasps, from before or behind, with which the hand is outside the thing."""
        if self._takes is None:
            hand = self.taker
            now = hand.opened(hand.qpos(scene), self.takers.share)
            room = room_of(self._task, scene)
            link = hand.link(now[None])[0]
            self._takes = []
            for hold in (each for own in self.takers.each for each in (own, own.from_behind())):
                for drawn in map(hold.drawn_back, DRAWN):
                    body = link @ drawn.pads @ inverse_pose(drawn.own)
                    moved = {self._body: (body[:3, 3], quaternion_of(body[:3, :3]))}
                    if not any(
                        overlap.depth > PRESSED and hand.links & self._other_end(overlap)
                        for overlap in room.overlaps(scene, {hand.owner: now}, moved)
                    ):
                        self._takes.append(drawn)
                        break
        return self._takes

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


def _spread(
    found: Sequence[tuple[float, int, Hold, Floats]],
) -> Iterator[tuple[int, Hold, Floats]]:
    """Yield what was found, the cheapest first, and of each place of meeting only a few."""
    counts = dict[int, int]()
    for _, number, hold, posture in sorted(found, key=lambda row: row[0]):
        counts[number] = counts.get(number, 0) + 1
        if counts[number] <= EACH or len({row[1] for row in found}) == 1:
            yield number, hold, posture
