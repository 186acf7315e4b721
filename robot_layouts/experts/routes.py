"""Which of several ways of a gripper an arm can follow: all in reach, and with room for it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robot_layouts.experts.hands import Hand
from robot_layouts.experts.player import StuckError
from robot_layouts.experts.room import NOTHING, room_of
from robot_layouts.experts.script import Pose, Scene
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.simulation.backend import Overlap
from tasks import TaskEnv

PRESSED = 3e-3  # m; by which a finger may be inside what it is to hold
AWAY: Pose = np.array([0.0, 0.0, -50.0]), np.array([1.0, 0.0, 0.0, 0.0])  # of what is not there
MARGIN = 3e-3  # m; by which what lies below fingers is taken to be higher than it is
FOLLOWED, CHECKED = 60, 30  # of the ways whose first pose is in reach; of those, for room
PASSED = (0.2, 0.4, 0.6, 0.8)  # shares of the way to where it begins that are checked
OFF = 3.0  # rad of way that a gripper is worth which is turned as it should be, by 1 rad


@dataclass(frozen=True, eq=False)
class Way:
    """Poses that an arm is to be able to bring a frame of its TCP link to, one from the other.

    Attributes:
        frame: The frame's pose in the TCP link's, (4, 4) (m).
        poses: Of the frame, world, each (4, 4) (m). They are checked in this order.
        then: Ways to go on with from the last of them, one of which must be possible; without any,
            that is no condition.
        cost: What it is worth to have another way instead (rad of way).
        enter: Number of the pose to which the arm goes first.
        share: How far the gripper is open meanwhile, from 0 to 1; None is as now.
        moved: For each of the poses, where bodies are then that are elsewhere now; without any, all
            but what is carried are where they are.
    """

    frame: Floats
    poses: Sequence[Floats]
    then: Sequence[Sequence[Floats]] = ()
    cost: float = 0.0
    enter: int = 0
    share: float | None = None
    moved: Sequence[Mapping[str, Pose]] = ()

    def begun(self, hand: Hand, start: Floats) -> Floats:
        """Return a posture with the gripper as open as it is on this way, (dof,) (rad, m)."""
        return start if self.share is None else hand.opened(start, self.share)


@dataclass(frozen=True, eq=False)
class Route:
    """A way that an arm can follow.

    Attributes:
        number: Of the way among those that were asked for.
        postures: For each of its poses, (dof,) (rad, m).
        cost: What it costs (rad of way).
    """

    number: int
    postures: tuple[Floats, ...]
    cost: float


def routes(
    task: TaskEnv,
    hand: Hand,
    scene: Scene,
    ways: Sequence[Way],
    *,
    what: str,
    touched: Collection[str] = (),
    carried: str | None = None,
    besides: Collection[str] = (),
    count: int = 1,
    loose: bool = False,
) -> list[Route]:
    """Return ways that an arm can follow, the best first.

    Args:
        task: Where it stands.
        hand: The arm.
        scene: As it is now.
        ways: The ways.
        what: What it is to do, for the reason: "to take the mug".
        touched: Bodies that its fingers may touch.
        carried: A body that it holds, whose frame in the TCP link's is that of the ways.
        besides: Robots that are not looked at.
        count: How many ways are enough.
        loose: See `Hand.reach`.

    Raises:
        StuckError: If there is no such way; says why.
    """
    start = hand.qpos(scene)
    reached = sorted(_begun(hand, ways, start, loose=loose), key=lambda route: route.cost)
    if not reached:
        raise StuckError(f"{hand.arm!r} cannot reach far enough {what}, in any of {len(ways)} ways")
    followed = (
        whole
        for route in reached[:FOLLOWED]
        if (whole := _followed(hand, ways[route.number], route, loose=loose)) is not None
    )
    look = Look(task, scene, touched, {hand.owner: ways[0].begun(hand, start)}, carried, besides)
    free, swept, worst, any_followed = list[Route](), list[Route](), None, False
    for _, route in zip(range(CHECKED), followed, strict=False):
        any_followed = True
        way = ways[route.number]
        if carried is None:
            moved = way.moved or [NOTHING] * len(route.postures)
        else:  # arms of few joints turn it otherwise than was asked for
            moved = [{carried: hand.brought(qpos, way.frame)} for qpos in route.postures]
        ends = [*zip(route.postures, moved, strict=True)]
        found = (look.overlap([{hand.owner: q}], there) for q, there in ends[:2] + ends[2:][-1:])
        overlap = max(filter(None, found), key=lambda one: one.depth, default=None)
        if overlap is None:
            entry, begun = route.postures[way.enter], way.begun(hand, start)
            passed = ({hand.owner: begun + share * (entry - begun)} for share in PASSED)
            (free if look.overlap(passed) is None else swept).append(route)
            if len(free) == count:
                break
        elif worst is None or overlap.depth < worst.depth:
            worst = overlap
    if free or swept:
        return [*free, *swept][:count]
    if any_followed:
        raise StuckError(f"{hand.arm!r} has no room {what}: {worst}")
    raise StuckError(f"{hand.arm!r} comes near enough {what}, but cannot go on from there")


def _begun(hand: Hand, ways: Sequence[Way], start: Floats, *, loose: bool) -> Iterator[Route]:
    """Yield the ways whose first pose is in reach."""
    for numbers in _alike(ways):
        frame, begun = ways[numbers[0]].frame, ways[numbers[0]].begun(hand, start)
        poses = np.array([ways[number].poses[0] for number in numbers])
        found = hand.reach(poses[:, :3, 3], poses[:, :3, :3], frame, begun[None], loose=loose)
        for which, qpos, off in zip(found.which, found.qpos, found.off, strict=True):
            number = numbers[which]
            cost = float(hand.way(qpos, start)) + OFF * float(off) + ways[number].cost
            yield Route(number, (qpos,), cost)


def _alike(ways: Sequence[Way]) -> Iterable[list[int]]:
    """Return the numbers of the ways, those of the same frame and gripper together."""
    alike: dict[tuple[bytes, float | None], list[int]] = {}
    for number, way in enumerate(ways):
        alike.setdefault((np.round(way.frame, 9).tobytes(), way.share), []).append(number)
    return alike.values()


def _followed(hand: Hand, way: Way, route: Route, *, loose: bool) -> Route | None:
    """Return a way with all its postures; None if an arm cannot follow it."""
    postures = _along(hand, way.frame, way.poses[1:], route.postures[0], loose=loose)
    if postures is None:
        return None
    whole = (*route.postures, *postures)
    if way.then and not _goes_on(hand, way, whole[-1], loose=loose):
        return None
    return Route(route.number, whole, route.cost)


def _goes_on(hand: Hand, way: Way, start: Floats, *, loose: bool) -> bool:
    """Return whether an arm can go on from a posture; ends are looked at first, all at once."""
    ends = np.array([rest[-1] for rest in way.then])
    found = hand.reach(ends[:, :3, 3], ends[:, :3, :3], way.frame, start[None], loose=loose)
    return any(
        _along(hand, way.frame, way.then[which], start, loose=loose, far=True) is not None
        for which in found.which
    )


def _along(
    hand: Hand,
    frame: Floats,
    poses: Sequence[Floats],
    start: Floats,
    *,
    loose: bool,
    far: bool = False,
) -> list[Floats] | None:
    """Return postures at poses, one from the other; None if one is out of reach.

    Args:
        hand: The arm.
        frame: See `Way`.
        poses: See `Way`.
        start: Posture to begin from, (dof,) (rad, m).
        loose: See `Hand.reach`.
        far: Whether the first of them may be sought far from there.
    """
    found: list[Floats] = []
    for i, pose in enumerate(poses):
        at = hand.reach(
            pose[None, :3, 3],
            pose[None, :3, :3],
            frame,
            start[None],
            scatter=far and i == 0,
            loose=loose,
        )
        if not len(at):
            return None
        start = at.qpos[0]
        found.append(start)
    return found


class Look:
    """Looks for what robots would be inside of, besides what they are inside of at first."""

    def __init__(
        self,
        task: TaskEnv,
        scene: Scene,
        touched: Collection[str],
        start: Mapping[str, Floats],
        carried: str | None = None,
        besides: Collection[str] = (),
    ) -> None:
        """Look at the scene first.

        Args:
            task: Says where robots stand.
            scene: As it is now.
            touched: Bodies that fingers may touch.
            start: All joints of some robots, by name, each (dof,) (rad, m).
            carried: A body that is not looked at.
            besides: Robots that are not looked at.
        """
        self._besides = {*besides}
        self._room, self._scene, self._touched = room_of(task, scene), scene, {*touched}
        self._nearer = {
            name: (position + (0.0, 0.0, MARGIN), quaternion)
            for name in self._room.movable
            if name not in self._touched
            for position, quaternion in (scene.body(name),)
        }
        found = self._room.overlaps(scene, start, self._nearer)
        self._usual = {frozenset(overlap[:2]) for overlap in found}
        if carried is not None:
            self._nearer[carried] = AWAY

    def overlap(
        self, postures: Iterable[Mapping[str, Floats]], moved: Mapping[str, Pose] = NOTHING
    ) -> Overlap | None:
        """Return the deepest overlap in some postures that does not count as touching.

        Args:
            postures: All joints of some robots, by name, each (dof,) (rad, m).
            moved: Poses of bodies that are elsewhere then.
        """
        worst: Overlap | None = None
        for posture in postures:
            for overlap in self._room.overlaps(self._scene, posture, self._nearer | dict(moved)):
                ends = {overlap.one.name, overlap.other.name}
                light = overlap.depth < PRESSED and ends & self._touched
                other = self._besides & {overlap.one.robot, overlap.other.robot}
                if frozenset(overlap[:2]) in self._usual or light or other:
                    continue
                if worst is None or overlap.depth > worst.depth:
                    worst = overlap
        return worst
