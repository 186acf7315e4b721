"""The hand-over by any two grippers: where and how the cube changes hands is searched for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice, product
from math import pi, radians

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.geometry import gripper_facing, heading
from robot_layouts.experts.grasps import need_fingers
from robot_layouts.experts.hands import (
    FIRMNESSES,
    Grip,
    Hand,
    HandPostures,
    between,
    box_grips,
    offsets,
)
from robot_layouts.experts.rehearsal import Attempt, Rehearsal, search, tried
from robot_layouts.experts.script import Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import (
    Floats,
    pose_matrix,
    rotation_about,
    rotation_of,
)
from robot_layouts.simulation.checks.overlaps import RobotsAlone
from robot_layouts.simulation.world import Part
from robots import TaskError
from tasks import TaskEnv

GIVER, TAKER, CUBE, GOAL = "left", "right", "cube", "goal_site"

# Shares of the cube's edge: how far before the cube's middle each gripper's own middle is. Hands
# that hold more than their own half hold it by different faces. Those of one body come from the
# same side, across each other's fingers, and hold it by its edge first.
DEPTHS, EDGE = (0.2, -0.1, -0.35), 0.4
# The same: how far fingers may reach beyond that, little more than a Panda's. What reaches farther
# first holds the cube by as much less as it is beyond the second, so that two hands have room.
BEYOND, TIPS = 0.3, 0.15
OWN_HALF = 0.1  # the least depth at which each holds its own half
NEAR = 0.3  # how far from its place a gripper may be when it closes or waits
BEFORE = 3  # times as far it may be from where it begins to come to the cube

# Lengths for a Panda (m), as the task fits others.
BACK, LIFT, RETREAT = 0.07, 0.04, 0.1
HEIGHTS, ASIDE = (0.2, 0.28, 0.14), (0.0, 0.05, -0.05)  # of the meeting

LEANS = tuple(map(radians, (20, 50, 80, 100)))  # of the giver when it gives, from straight down
HEADINGS = tuple(map(radians, (0, 45, -45)))  # of the giver then, from the way to the meeting
UPWARD = -0.2  # cosine: a gripper that picks points down more than that
STRIDE = 0.4  # rad between postures on a way that are checked
CLOSING, STEP = 60.0, 4e-4  # N with which fingers close on the cube, at least; m per step, at least
FORCE, LEAST_FORCE = 15.0, 1.5  # N with which they hold a cube for Pandas; any cube, at least
YIELD = 6e-5  # m that quick fingers are driven into what they hold, at least
CROSSWISE = 0.5  # cosine between the ways in which two hands open that hold different faces
ALIGNED = 4.0  # rad of way that a hand is worth which is turned as the cube is, by 1 rad
SIMILAR = 0.5  # cosine between the approach that was planned and that which is taken
APART = 0.4  # cosine between the approaches of two hands at most

# How the cube comes to the goal, and how near (rad); it moves a little in the hand on the way.
CARRIES = (("carry", 0.1), ("correct", 0.02))

PICKS, MEETINGS, TAKES, SCRIPTS = 3, 16, 600, 4  # how many of each go on, for each depth


def hand_over(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions of the hand-over, (T, A).

    Args:
        task: A TwoRobotHandOver; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If an arm has no fingers, cannot hold the cube, or cannot reach what it should;
            it says which, and what lacks.
    """
    need_fingers(task, "the hand-over", GIVER, TAKER)
    return search(task, seed, lambda copy: tried(copy, seed, _scripts(task, seed, copy)))


def _scripts(task: TaskEnv, seed: int, copy: Rehearsal) -> Iterator[Script | Attempt]:
    """Yield scripts that begin with a pick that was seen to lift the cube; also picks that do not.

    Raises:
        TaskError: If there is nothing to try.
    """
    find = _Search(task, copy.begin(seed))
    reasons, yielded = list[TaskError](), False
    for pick in find.picks():
        copy.begin(seed)
        attempt = copy.play({GIVER: find.picking(pick)}, until=f"{GIVER}.lift")
        if not attempt.success:
            yield attempt
            yielded = True
            continue
        try:
            yield from find.scripts(pick, copy.scene())
            yielded = True
        except TaskError as error:
            reasons.append(error)
    if not yielded:
        raise reasons[0]


@dataclass(frozen=True, eq=False)
class _Picking:
    """How the giver holds the cube as it lies.

    Attributes:
        qpos: All joints of its robot then, (dof,) (rad, m).
        turn: How the grip's frame is turned, (3, 3), world.
        grip: How the cube lies in its hand.
        depth: Of that, one of `DEPTHS` or `EDGE`.
    """

    qpos: Floats
    turn: Floats
    grip: Grip
    depth: float


@dataclass(frozen=True, eq=False)
class _Exchange:
    """How the cube changes hands.

    Attributes:
        give: Posture of the giver where it gives the cube, (dof,) (rad, m).
        turn: Orientation of its gripper there, (3, 3).
        take: Posture of the taker there.
        grip: How the cube lies in the taker's hand.
        turned: How that grip's frame is turned, (3, 3).
        place: Of the cube, (3,) (m).
        cost: How far the arms have to go, and how near the hands are (rad).
    """

    give: Floats
    turn: Floats
    take: Floats
    grip: Grip
    turned: Floats
    place: Floats
    cost: float


class _Search:
    """What a scene lets two hands do."""

    def __init__(self, task: TaskEnv, scene: Scene) -> None:
        self._scene = scene
        self._giver, self._taker = Hand(task, GIVER), Hand(task, TAKER)
        self._fit = task.fit
        self._cube = pose_matrix(*scene.body(CUBE))
        self._edge = 2 * float(np.min(_half_size(scene)))
        for hand in (self._giver, self._taker):
            self._check_opening(hand)
        self._alone = RobotsAlone(
            task.standing(),
            task.scenario.physics,
            lambda world, _: task.table.add_to(world, "table"),
            simulator=task.scenario.simulator,
        )
        self._usual = self._parts({})
        one_body = self._giver.owner == self._taker.owner
        self._depths = (EDGE, *DEPTHS) if one_body else (*DEPTHS, EDGE)

    def picks(self) -> Iterator[_Picking]:
        """Yield ways to hold the cube as it lies, the most promising first.

        Those in which the giver touches something else come last, and only for depths at which
        there are no others.

        Raises:
            TaskError: If there are none.
        """
        found, touching = False, list[_Picking]()
        for grip, depth in self._grips(self._giver, *self._depths):
            postures = self._picks(grip)
            free = self._free_picks(postures)
            rows = free or range(min(PICKS, len(postures)))
            picks = [_Picking(postures.qpos[i], postures.turns[i], grip, depth) for i in rows]
            if free:
                found = True
                yield from picks
            else:
                touching += picks
        if not (found or touching):
            raise TaskError(f"{GIVER!r} cannot reach the cube with its gripper")
        yield from touching

    def scripts(self, pick: _Picking, lifted: Scene) -> list[Script]:
        """Return the scripts to try, the most promising first.

        Args:
            pick: How the giver picks the cube.
            lifted: What is seen once it has.

        Raises:
            TaskError: If there are none.
        """
        now, held = self._giver.qpos(lifted), self._giver.held(lifted, CUBE)
        meetings = sorted(self._meetings(pick, now, held), key=lambda meeting: meeting.cost)
        if not meetings:
            raise TaskError(
                f"{TAKER!r} cannot take the cube from {GIVER!r} in any of the ways that were tried;"
                " stand them nearer to each other, or turn them towards one another"
            )
        taker = self._taker
        if not len(self._ends(meetings[0].grip.pose, taker.qpos(self._scene)[None])):
            raise TaskError(f"{TAKER!r} cannot reach the goal with its gripper")
        found = self._free(now, pick, meetings)
        if not found:
            raise TaskError(
                f"wherever {TAKER!r} can take the cube from {GIVER!r}, their hands overlap; stand"
                " them a little farther apart"
            )
        return [
            self._script(pick, meeting, together=together)
            for meeting in found
            for together in (True, False)
        ]

    def _check_opening(self, hand: Hand) -> None:
        """Refuse a hand that the cube does not fit in.

        Raises:
            TaskError: If it is too wide.
        """
        if hand.motion.widest < 1.05 * self._edge:
            raise TaskError(
                f"the gripper of {hand.arm!r} opens {1e3 * hand.motion.widest:.0f} mm, and the cube"
                f" is {1e3 * self._edge:.0f} mm wide"
            )

    def _grips(self, hand: Hand, *depths: float) -> Iterator[tuple[Grip, float]]:
        """Yield how a hand holds the cube, at the depths at which it does, in their order.

        Fingers that reach far are tried with their tips first. It is held more firmly only if it
        would be lost there.

        Raises:
            TaskError: If it does at none.
        """
        beyond = hand.motion.beyond / self._edge
        more = beyond - TIPS if beyond > BEYOND else 0.0
        found = False
        tips = [(depth + more, depth) for depth in depths if more and depth == self._depths[0]]
        for at, depth in (*tips, *zip(depths, depths, strict=True)):
            for firmness in FIRMNESSES:
                if (grip := hand.grip(self._edge, at, firmness)) is not None:
                    found = True
                    yield grip, depth
                    break
        if not found:
            raise TaskError(
                f"the gripper of {hand.arm!r} closes on a cube of {1e3 * self._edge:.3g} mm without"
                " holding it; robot-layouts robots inspect ROBOT --try says how it grasps"
            )

    def _picks(self, grip: Grip) -> HandPostures:
        """Return postures in which the giver holds the cube as it lies, the best first."""
        hand = self._giver
        turns = box_grips(self._cube[:3, :3])
        level = np.abs(turns[:, 2, 1]) < 0.5  # the fingers part along the table
        turns = turns[level & (turns[:, 2, 2] < UPWARD)]
        starts = hand.opened(hand.qpos(self._scene), grip.share)[None]
        places = np.tile(self._cube[:3, 3], (len(turns), 1))
        picks = hand.reach(places, turns, grip.pose, starts)
        down = 1 + picks.turns[:, 2, 2]
        return picks[np.argsort(hand.way(picks.qpos, starts[0]) + down + ALIGNED * picks.off)]

    def _free_picks(self, picks: HandPostures) -> list[int]:
        """Return the first picks in which the giver touches nothing but the cube."""
        free = (i for i in range(len(picks)) if self._clear({self._giver.owner: picks.qpos[i]}))
        return list(islice(free, PICKS))

    def _meetings(self, pick: _Picking, now: Floats, held: Floats) -> Iterator[_Exchange]:
        """Yield where the giver may give the cube, and the taker take it.

        Args:
            pick: How the giver picked it.
            now: Posture of the giver with the cube lifted, (dof,) (rad, m).
            held: Pose of the cube in its TCP link's frame, (4, 4) (m).
        """
        giver = self._giver
        ground = [self._fit.place((0.0, aside, height)) for height in HEIGHTS for aside in ASIDE]
        middles = np.array(ground)
        turned = _gripper_turns(heading(giver.base[:3, 3], middles.mean(axis=0)), LEANS)
        gives = giver.reach(
            np.repeat(middles, len(turned), axis=0),
            np.tile(turned, (len(middles), 1, 1)),
            giver.pointing(held[:3, 3]),
            now[None],
        )
        gives = gives[np.argsort(giver.way(gives.qpos, now))[:MEETINGS]]
        yield from self._takes(pick.depth, now, gives, giver.link(gives.qpos) @ held)

    def _takes(
        self, depth: float, now: Floats, gives: HandPostures, cubes: Floats
    ) -> Iterator[_Exchange]:
        """Yield the meetings in which the taker can hold the cube, where the giver gives it."""
        taker = self._taker
        grip, taken = next(self._grips(taker, depth, *self._depths))
        start = taker.opened(taker.qpos(self._scene), grip.share)
        rows = [
            (row, turn)
            for row, cube in enumerate(cubes)
            for turn in box_grips(cube[:3, :3])
            if between(turn, gives.turns[row]) < APART
            and self._comes_from_base(turn)
            and (min(depth, taken) >= OWN_HALF or _other_faces(turn, gives.turns[row]))
        ]
        if not rows:
            return
        chosen = np.linspace(0, len(rows) - 1, min(TAKES, len(rows))).astype(int)
        numbers = np.array([rows[i][0] for i in chosen])
        turns = np.array([rows[i][1] for i in chosen])
        takes = taker.reach(cubes[numbers, :3, 3], turns, grip.pose, start[None])
        for i, which in enumerate(takes.which):
            row = int(numbers[which])
            apart = float(between(takes.turns[i], gives.turns[row]))
            cost = (
                float(self._giver.way(gives.qpos[row], now))
                + 0.5 * float(taker.way(takes.qpos[i], start))
                + 1.5 * (1 + apart)
                + ALIGNED * float(takes.off[i])
            )
            yield _Exchange(
                gives.qpos[row],
                gives.turns[row],
                takes.qpos[i],
                grip,
                takes.turns[i],
                cubes[row, :3, 3],
                cost,
            )

    def _comes_from_base(self, grip: Floats) -> bool:
        """Return whether a gripper that is turned so does not point back to the taker's base."""
        way = self._fit.place((0.0, 0.0, 0.0)) - self._taker.base[:3, 3]
        way[2] = 0.0
        return bool(grip[:, 2] @ way > -0.3 * np.linalg.norm(way))

    def _ends(self, held: Floats, starts: Floats) -> HandPostures:
        """Return postures in which the taker brings to the goal what it holds.

        Args:
            held: Its pose in the TCP link's frame, (4, 4) (m).
            starts: See `Hand.reach`.
        """
        goal = self._scene.body(GOAL)[0]
        towards = heading(self._taker.base[:3, 3], goal)
        turns = _gripper_turns(towards, LEANS)
        frame = self._taker.pointing(held[:3, 3])
        return self._taker.reach(
            np.tile(goal, (len(turns), 1)), turns, frame, starts, scatter=True, loose=True
        )

    def _free(self, now: Floats, pick: _Picking, meetings: Sequence[_Exchange]) -> list[_Exchange]:
        """Return the first meetings to which both hands come without touching anything.

        Those come first to which the taker could also come straight from where it starts.
        """
        direct, other = list[_Exchange](), list[_Exchange]()
        for meeting in meetings:
            if not self._is_free(now, pick, meeting):
                continue
            ready = self._ready(meeting, meeting.take).qpos
            if not (len(ready) and self._comes(pick, meeting, ready[0])):
                continue
            start = self._waiting(meeting)
            if self._comes(pick, meeting, *_between(start, meeting.take)):
                direct.append(meeting)
            elif self._comes(pick, meeting, *_between(start, ready[0])):
                other.append(meeting)
            if len(direct) == SCRIPTS:
                break
        return direct or other[:SCRIPTS]

    def _comes(self, pick: _Picking, meeting: _Exchange, *postures: Floats) -> bool:
        """Return whether the taker is clear of the giver, which holds out the cube, in postures."""
        give = self._giver.opened(meeting.give, pick.grip.held)
        return all(self._clear(self._both(give, row)) for row in postures)

    def _waiting(self, meeting: _Exchange) -> Floats:
        """Return the posture in which the taker starts, its gripper open for the cube."""
        return self._taker.opened(self._taker.qpos(self._scene), meeting.grip.share)

    def _is_free(self, now: Floats, pick: _Picking, meeting: _Exchange) -> bool:
        """Return whether no robot is inside itself, the other or the table where they meet."""
        giver, taker = self._giver, self._taker
        give, lifted = (giver.opened(row, pick.grip.held) for row in (meeting.give, now))
        released = giver.opened(meeting.give, pick.grip.share)
        taken = taker.opened(meeting.take, meeting.grip.held)
        waiting = self._waiting(meeting)
        return (
            self._clear(self._both(give, meeting.take))
            and self._clear(self._both(give, taken))
            and self._clear(self._both(released, taken))
            and all(self._clear(self._both(row, waiting)) for row in _between(lifted, give))
        )

    def _both(self, give: Floats, take: Floats) -> dict[str, Floats]:
        """Return the postures of the robots, by name, with both arms somewhere."""
        giver, taker = self._giver, self._taker
        if giver.owner != taker.owner:
            return {giver.owner: give, taker.owner: take}
        both = give.copy()
        both[taker.columns] = take[taker.columns]
        return {giver.owner: both}

    def _clear(self, postures: dict[str, Floats]) -> bool:
        """Return whether nothing overlaps in postures that does not where the robots start."""
        return self._parts(postures) <= self._usual

    def _parts(self, postures: dict[str, Floats]) -> set[frozenset[Part]]:
        return {frozenset(overlap[:2]) for overlap in self._alone.overlaps(postures)}

    # -- the script --------------------------------------------------------------------------

    def picking(self, pick: _Picking) -> tuple[Waypoint, ...]:
        """Return the giver's waypoints until it has lifted the cube."""
        cube_held = partial(Scene.grasps, robot=GIVER, body=CUBE)
        share, force = pick.grip.share, self._force(self._giver, pick.grip)
        back, near = partial(self._off, pick), self._near(self._giver)
        length = self._fit.length(BACK)
        return (
            Waypoint("above", joints=partial(back, by=length), share=share, near=BEFORE * near),
            Waypoint("around", joints=partial(back, by=0.0), share=share, near=near),
            Waypoint("grasp", squeeze=self._closing(self._giver), until=cube_held, most=150),
            Waypoint("hold", squeeze=force, steps=4, until=cube_held, most=20),
            Waypoint(
                "lift", joints=self._lift, squeeze=force, near=0.08, until=cube_held, most=200
            ),
        )

    def _script(self, pick: _Picking, meeting: _Exchange, *, together: bool) -> Script:
        """Return a script; unless both move together, the taker waits until the giver has come."""
        cube_taken = partial(Scene.grasps, robot=TAKER, body=CUBE)
        give_share, take_share = pick.grip.share, meeting.grip.share
        return {
            GIVER: (
                *self.picking(pick),
                Waypoint(
                    "present",
                    joints=partial(self._give, meeting),
                    squeeze=self._force(self._giver, pick.grip),
                    near=self._near(self._giver),
                ),
                Waypoint("release", share=give_share, steps=3, after=("right.take",)),
                Waypoint("retreat", joints=self._retreat, share=give_share, near=0.1),
            ),
            TAKER: (
                Waypoint(
                    "ready",
                    joints=partial(self._expect, meeting),
                    share=take_share,
                    near=0.1,
                    after=() if together else ("left.present",),
                ),
                Waypoint(
                    "around",
                    joints=partial(self._take, meeting),
                    share=take_share,
                    near=self._near(self._taker),
                    after=("left.present",),
                ),
                Waypoint("take", squeeze=self._closing(self._taker), until=cube_taken, most=150),
                Waypoint(
                    "hold",
                    squeeze=self._force(self._taker, meeting.grip),
                    steps=4,
                    after=("left.release",),
                    until=cube_taken,
                    most=20,
                ),
                *(
                    Waypoint(
                        name,
                        joints=self._carry,
                        squeeze=self._force(self._taker, meeting.grip),
                        near=near,
                    )
                    for name, near in CARRIES
                ),
                # Of arms whose quick fingers press hard the joints' speeds do not come to 0.
                Waypoint("place", joints=self._carry, squeeze=self._gentle(meeting.grip)),
            ),
        }

    def _force(self, hand: Hand, grip: Grip) -> float:
        """Return the force with which a hand holds the cube while it moves (N).

        Of what quick drives press with, little is left once they have settled.
        """
        share = hand.motion.share(self._edge)
        gentle = self._gentle(grip)
        return max(gentle, hand.motion.force(YIELD, share)) if hand.quick else gentle

    def _gentle(self, grip: Grip) -> float:
        """Return the force with which the cube is held at rest (N).

        It is in proportion to its weight: a light cube that is pressed harder slips out.
        """
        return grip.firmness * max(FORCE * self._fit.scale**3, LEAST_FORCE)

    def _near(self, hand: Hand) -> float:
        """Return how near a hand has to come to its place at the cube (rad)."""
        return NEAR * self._edge / hand.length

    def _closing(self, hand: Hand) -> float:
        """Return the force with which a hand closes until it feels the cube (N)."""
        return max(CLOSING, hand.motion.force(STEP, hand.motion.share(self._edge)))

    def _postures(
        self, hand: Hand, place: Floats, turn: Floats, frame: Floats, start: Floats
    ) -> Sequence[Floats]:
        """Return the arm's posture near a start that brings a frame to a pose; none, if none."""
        found = hand.reach(place[None], turn[None], frame, start[None], scatter=False, loose=True)
        return list(hand.joints(found.qpos))

    def _off(self, pick: _Picking, scene: Scene, by: float) -> Sequence[Floats]:
        """Return the posture ``by`` (m) before that in which it holds the cube as it lies."""
        place = scene.body(CUBE)[0] + offsets(pick.turn[None], by)[0]
        start = self._giver.like(scene, pick.qpos)
        return self._postures(self._giver, place, pick.turn, pick.grip.pose, start)

    def _lift(self, scene: Scene) -> Sequence[Floats]:
        hand, now = self._giver, self._giver.qpos(scene)
        held = hand.pointing(hand.held(scene, CUBE)[:3, 3])
        place = scene.body(CUBE)[0] + (0.0, 0.0, self._fit.length(LIFT))
        return self._postures(hand, place, hand.turns(now[None])[0], held, now)

    def _give(self, meeting: _Exchange, scene: Scene) -> Sequence[Floats]:
        hand = self._giver
        held, start = hand.pointing(hand.held(scene, CUBE)[:3, 3]), hand.like(scene, meeting.give)
        return self._postures(hand, meeting.place, meeting.turn, held, start)

    def _retreat(self, scene: Scene) -> Sequence[Floats]:
        hand = self._giver
        now = hand.qpos(scene)
        turn, link = hand.turns(now[None])[0], hand.link(now[None])[0]
        place = link[:3, 3] + offsets(turn[None], self._fit.length(RETREAT))[0]
        return self._postures(hand, place, turn, hand.pointing(np.zeros(3)), now)

    def _expect(self, meeting: _Exchange, scene: Scene) -> Sequence[Floats]:
        ready = self._ready(meeting, self._taker.like(scene, meeting.take))
        return list(self._taker.joints(ready.qpos))

    def _ready(self, meeting: _Exchange, start: Floats) -> HandPostures:
        """Return the posture near a start in which the taker waits before the cube, if any."""
        place = meeting.place + offsets(meeting.turned[None], self._fit.length(BACK))[0]
        return self._taker.reach(
            place[None],
            meeting.turned[None],
            meeting.grip.pose,
            start[None],
            scatter=False,
            loose=True,
        )

    def _take(self, meeting: _Exchange, scene: Scene) -> Sequence[Floats]:
        """Return postures that hold the cube as the giver holds it by now, about as planned."""
        position, quaternion = scene.body(CUBE)
        hand, giver = self._taker, self._giver
        turns = box_grips(rotation_of(quaternion), around=24)
        given = giver.turns(giver.qpos(scene)[None])[0]
        alike = between(turns, meeting.turned) > SIMILAR
        turns = turns[alike & (between(turns, given) < APART + 0.2)]
        if not len(turns):
            return ()
        places = np.tile(position, (len(turns), 1))
        start = hand.like(scene, meeting.take)[None]
        found = hand.reach(places, turns, meeting.grip.pose, start, scatter=False)
        return list(hand.joints(found.qpos))

    def _carry(self, scene: Scene) -> Sequence[Floats]:
        hand = self._taker
        now = hand.qpos(scene)
        return list(hand.joints(self._ends(hand.held(scene, CUBE), now[None]).qpos))


def _other_faces(one: Floats, other: Floats) -> bool:
    """Return whether two hands hold the cube by different faces."""
    return bool(abs(one[:, 1] @ other[:, 1]) < CROSSWISE)


def _between(start: Floats, end: Floats) -> Floats:
    """Return postures on the way between two, (n, dof) (rad, m)."""
    shares = np.linspace(0.0, 1.0, int(np.abs(end - start).max() / STRIDE) + 2)[1:-1]
    return start + shares[:, None] * (end - start)


def _gripper_turns(towards: float, leans: Sequence[float]) -> Floats:
    """Return orientations of a gripper that reaches about in some direction, (n, 3, 3), world."""
    rolls = [rotation_about((0.0, 0.0, 1.0), np.array(k * pi / 2)) for k in range(4)]
    return np.array(
        [
            rotation_of(gripper_facing(towards + aside, lean)) @ roll
            for aside, lean, roll in product(HEADINGS, leans, rolls)
        ]
    )


def _half_size(scene: Scene) -> tuple[float, float, float]:
    """Return half the extents of the cube as it was built (m)."""
    body = next(body for body in scene.bodies if body.name == CUBE)
    return body.shapes[0].half_size  # type: ignore[union-attr]
