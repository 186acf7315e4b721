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
from robot_layouts.experts.hands import Hand, HandPostures, between, box_grips, offsets
from robot_layouts.experts.rehearsal import first_success
from robot_layouts.experts.script import Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats, pose_matrix, rotation_about, rotation_of
from robot_layouts.simulation.checks.overlaps import RobotsAlone
from robot_layouts.simulation.scene.parts import Part
from robots import TaskError
from tasks import TaskEnv

GIVER, TAKER, CUBE, GOAL = "left", "right", "cube", "goal_site"

# Shares of the cube's edge: how far before the cube's middle each gripper's own middle is. Hands
# that hold more than their own half hold it by different faces.
DEPTHS = (0.2, -0.1, -0.35)
OWN_HALF = 0.1  # the least depth at which each holds its own half
NEAR = 0.3  # how far from its place a gripper may be when it closes or waits
SLACK = 0.45  # how much wider than the cube a gripper is open

# Lengths for a Panda (m), as the task fits others.
BACK, LIFT, RETREAT = 0.07, 0.04, 0.1
HEIGHTS, ASIDE = (0.2, 0.28, 0.14), (0.0, 0.05, -0.05)  # of the meeting

LEANS = tuple(map(radians, (20, 50, 80, 100)))  # of the giver when it gives, from straight down
HEADINGS = tuple(map(radians, (0, 45, -45)))  # of the giver then, from the way to the meeting
UPWARD = -0.2  # cosine: a gripper that picks points down more than that
STRIDE = 0.4  # rad between postures on a way that are checked
CLOSING, STEP = 60.0, 4e-4  # N with which fingers close on the cube, at least; m per step, at least
FORCE, LEAST_FORCE = 15.0, 1.5  # N with which they hold a cube for Pandas; any cube, at least
CROSSWISE = 0.5  # cosine between the ways in which two hands open that hold different faces
ALIGNED = 4.0  # rad of way that a hand is worth which is turned as the cube is, by 1 rad
SIMILAR = 0.5  # cosine between the approach that was planned and that which is taken
APART = 0.4  # cosine between the approaches of two hands at most

PICKS, MEETINGS, TAKES, SCRIPTS = 3, 16, 600, 6  # how many of each go on, for each depth


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

    def scripts(scene: Scene) -> Iterator[Script]:
        reasons: list[TaskError] = []
        for depth in DEPTHS:
            try:
                yield from _Search(task, scene, depth).scripts()
            except TaskError as error:
                reasons.append(error)
        if len(reasons) == len(DEPTHS):
            raise reasons[0]

    return first_success(task, seed, scripts)


@dataclass(frozen=True, eq=False)
class _Exchange:
    """How the cube changes hands.

    Attributes:
        pick: Posture of the giver when it holds the cube on the table, (dof,) (rad, m).
        give: The same where it gives it.
        turn: Orientation of the giver's gripper there, (3, 3).
        take: Posture of the taker there.
        grip: Orientation of the taker's gripper in the cube's frame, (3, 3).
        place: Of the cube, (3,) (m).
        cost: How far the arms have to go, and how near the hands are (rad).
    """

    pick: Floats
    give: Floats
    turn: Floats
    take: Floats
    grip: Floats
    place: Floats
    cost: float


class _Search:
    """What a scene lets two hands do."""

    def __init__(self, task: TaskEnv, scene: Scene, depth: float) -> None:
        self._scene = scene
        self._giver, self._taker = Hand(task, GIVER), Hand(task, TAKER)
        self._fit = task.fit
        self._cube = pose_matrix(*scene.body(CUBE))
        self._edge = 2 * float(np.min(_half_size(scene)))
        self._before, self._crosswise = depth * self._edge, depth < OWN_HALF
        self._shares = [self._share(hand) for hand in (self._giver, self._taker)]
        self._alone = RobotsAlone(
            task.standing(),
            task.scenario.physics,
            lambda world, _: task.table.add_to(world, "table"),
        )
        self._usual = self._parts({})

    def scripts(self) -> list[Script]:
        """Return the scripts to try, the most promising first.

        Raises:
            TaskError: If there are none.
        """
        picks = self._picks()
        meetings = sorted(self._meetings(picks), key=lambda meeting: meeting.cost)
        if not meetings:
            raise TaskError(
                f"{TAKER!r} cannot take the cube from {GIVER!r} in any of the ways that were tried;"
                " stand them nearer to each other, or turn them towards one another"
            )
        taker = self._taker
        point = taker.motion.middle(taker.motion.share(self._edge))
        if not len(self._ends(point, taker.qpos(self._scene)[None])):
            raise TaskError(f"{TAKER!r} cannot reach the goal with its gripper")
        found = list(islice(filter(self._is_free, meetings), SCRIPTS))
        if not found:
            raise TaskError(
                f"wherever {TAKER!r} can take the cube from {GIVER!r}, their hands overlap; stand"
                " them a little farther apart"
            )
        return [self._script(meeting) for meeting in found]

    def _share(self, hand: Hand) -> float:
        """Return how far a hand opens for the cube.

        Raises:
            TaskError: If it cannot.
        """
        if hand.motion.widest < 1.05 * self._edge:
            raise TaskError(
                f"the gripper of {hand.arm!r} opens {1e3 * hand.motion.widest:.0f} mm, and the cube"
                f" is {1e3 * self._edge:.0f} mm wide"
            )
        return hand.motion.share((1 + SLACK) * self._edge)

    def _picks(self) -> HandPostures:
        """Return postures in which the giver holds the cube as it lies, the best first."""
        hand, share = self._giver, self._shares[0]
        turns = box_grips(self._cube[:3, :3])
        level = np.abs(turns[:, 2, 1]) < 0.5  # the fingers part along the table
        turns = turns[level & (turns[:, 2, 2] < UPWARD)]
        starts = hand.opened(hand.qpos(self._scene), share)[None]
        point = hand.motion.middle(share)
        places = self._cube[:3, 3] + offsets(turns, self._before)
        picks = hand.reach(places, turns, point, starts)
        if not len(picks):
            raise TaskError(f"{GIVER!r} cannot reach the cube with its gripper")
        down = 1 + picks.turns[:, 2, 2]
        return picks[np.argsort(hand.way(picks.qpos, starts[0]) + down + ALIGNED * picks.off)]

    def _meetings(self, picks: HandPostures) -> Iterator[_Exchange]:
        giver = self._giver
        ground = [self._fit.place((0.0, aside, height)) for height in HEIGHTS for aside in ASIDE]
        middles = np.array(ground)
        ways = heading(giver.base[:3, 3], middles.mean(axis=0))
        turned = _gripper_turns(ways, LEANS)
        turns = np.tile(turned, (len(middles), 1, 1))
        middle = np.repeat(middles, len(turned), axis=0)
        point = giver.motion.middle(giver.motion.share(self._edge))
        for pick in self._free_picks(picks):
            places = middle + offsets(turns, self._before)
            gives = giver.reach(places, turns, point, picks.qpos[pick][None])
            ways_there = giver.way(gives.qpos, picks.qpos[pick])
            some = np.argsort(ways_there)[:MEETINGS]
            # The cube is turned with the gripper that holds it.
            cube_turns = gives.turns[some] @ picks.turns[pick].T @ self._cube[:3, :3]
            yield from self._takes(picks.qpos[pick], gives, some, cube_turns, middle)

    def _free_picks(self, picks: HandPostures) -> list[int]:
        """Return the first picks in which the giver touches nothing but the cube."""
        free = (i for i in range(len(picks)) if self._clear({self._giver.owner: picks.qpos[i]}))
        found = list(islice(free, PICKS))
        return found or list(range(min(PICKS, len(picks))))

    def _takes(
        self,
        pick: Floats,
        gives: HandPostures,
        some: NDArray[np.intp],
        cube_turns: Floats,
        middle: Floats,
    ) -> Iterator[_Exchange]:
        """Yield the meetings in which the taker can hold the cube, where the giver gives it."""
        taker, share = self._taker, self._shares[1]
        start = taker.opened(taker.qpos(self._scene), share)
        rows: list[tuple[int, Floats]] = []
        for row, cube in zip(some, cube_turns, strict=True):
            grips = box_grips(cube)
            rows += [
                (row, grip)
                for grip in grips
                if between(grip, gives.turns[row]) < APART
                and self._comes_from_base(grip)
                and self._other_faces(grip, gives.turns[row])
            ]
        if not rows:
            return
        chosen = np.linspace(0, len(rows) - 1, min(TAKES, len(rows))).astype(int)
        rows = [rows[i] for i in chosen]
        numbers = np.array([row for row, _ in rows])
        turns = np.array([grip for _, grip in rows])
        places = middle[gives.which[numbers]] + offsets(turns, self._before)
        takes = taker.reach(places, turns, taker.motion.middle(share), start[None])
        cubes = dict(zip(some.tolist(), cube_turns, strict=True))
        for i, which in enumerate(takes.which):
            row = int(numbers[which])
            apart = float(between(takes.turns[i], gives.turns[row]))
            cost = (
                float(self._giver.way(gives.qpos[row], pick))
                + 0.5 * float(taker.way(takes.qpos[i], start))
                + 1.5 * (1 + apart)
                + ALIGNED * float(takes.off[i])
            )
            yield _Exchange(
                pick,
                gives.qpos[row],
                gives.turns[row],
                takes.qpos[i],
                cubes[row].T @ takes.turns[i],
                middle[gives.which[row]],
                cost,
            )

    def _other_faces(self, one: Floats, other: Floats) -> bool:
        """Return whether two hands hold the cube by different faces, if they have to."""
        return not self._crosswise or bool(abs(one[:, 1] @ other[:, 1]) < CROSSWISE)

    def _comes_from_base(self, grip: Floats) -> bool:
        """Return whether a gripper that is turned so does not point back to the taker's base."""
        way = self._fit.place((0.0, 0.0, 0.0)) - self._taker.base[:3, 3]
        way[2] = 0.0
        return bool(grip[:, 2] @ way > -0.3 * np.linalg.norm(way))

    def _ends(self, point: Floats, starts: Floats) -> HandPostures:
        """Return postures in which the taker has a point of its TCP link at the goal."""
        goal = self._scene.body(GOAL)[0]
        towards = heading(self._taker.base[:3, 3], goal)
        turns = _gripper_turns(towards, LEANS)
        return self._taker.reach(
            np.tile(goal, (len(turns), 1)), turns, point, starts, scatter=True, loose=True
        )

    def _is_free(self, meeting: _Exchange) -> bool:
        """Return whether no robot is inside itself, the other or the table where they meet."""
        giver, taker = self._giver, self._taker
        held = giver.motion.share(self._edge)
        give, pick = giver.opened(meeting.give, held), giver.opened(meeting.pick, held)
        waiting = taker.opened(taker.qpos(self._scene), self._shares[1])
        return (
            self._clear(self._both(give, meeting.take))
            and all(self._clear(self._both(row, waiting)) for row in _between(pick, give))
            and all(self._clear(self._both(give, row)) for row in _between(waiting, meeting.take))
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

    def _script(self, meeting: _Exchange) -> Script:
        cube_held = partial(Scene.grasps, robot=GIVER, body=CUBE)
        cube_taken = partial(Scene.grasps, robot=TAKER, body=CUBE)
        length = self._fit.length
        # In proportion to its weight: a light cube that is pressed harder slips out.
        force = max(FORCE * self._fit.scale**3, LEAST_FORCE)
        give_share, take_share = self._shares
        give_near, take_near = (
            NEAR * self._edge / hand.length for hand in (self._giver, self._taker)
        )
        picked = self._giver.turns(meeting.pick[None])[0]
        back = partial(self._off, self._giver, meeting.pick, picked, give_share)
        return {
            GIVER: (
                Waypoint(
                    "above", joints=partial(back, by=length(BACK)), share=give_share, near=0.08
                ),
                Waypoint("around", joints=partial(back, by=0.0), share=give_share, near=give_near),
                Waypoint("grasp", squeeze=self._closing(self._giver), until=cube_held, most=150),
                Waypoint("hold", squeeze=force, steps=4, until=cube_held, most=20),
                Waypoint("lift", joints=self._lift, squeeze=force, near=0.08),
                Waypoint(
                    "present", joints=partial(self._give, meeting), squeeze=force, near=give_near
                ),
                Waypoint("release", share=give_share, steps=3, after=("right.take",)),
                Waypoint("retreat", joints=self._retreat, share=give_share, near=0.1),
            ),
            TAKER: (
                Waypoint(
                    "ready", joints=partial(self._expect, meeting), share=take_share, near=0.1
                ),
                Waypoint(
                    "around",
                    joints=partial(self._take, meeting),
                    share=take_share,
                    near=take_near,
                    after=("left.present",),
                ),
                Waypoint("take", squeeze=self._closing(self._taker), until=cube_taken, most=150),
                Waypoint(
                    "hold",
                    squeeze=force,
                    steps=4,
                    after=("left.release",),
                    until=cube_taken,
                    most=20,
                ),
                Waypoint("carry", joints=self._carry, squeeze=force, near=0.1),
            ),
        }

    def _closing(self, hand: Hand) -> float:
        """Return the force with which a hand closes until it feels the cube (N)."""
        return max(CLOSING, hand.motion.force(STEP, hand.motion.share(self._edge)))

    def _near(
        self, hand: Hand, place: Floats, turn: Floats, point: Floats, start: Floats
    ) -> Sequence[Floats]:
        """Return the arm's posture near a start that brings a point to a place; none, if none."""
        found = hand.reach(place[None], turn[None], point, start[None], scatter=False, loose=True)
        return list(hand.joints(found.qpos))

    def _off(
        self, hand: Hand, posture: Floats, turn: Floats, share: float, scene: Scene, by: float
    ) -> Sequence[Floats]:
        """Return the posture ``by`` (m) before that in which a hand holds the cube as it lies."""
        place = scene.body(CUBE)[0] + offsets(turn[None], self._before + by)[0]
        return self._near(hand, place, turn, hand.motion.middle(share), posture)

    def _lift(self, scene: Scene) -> Sequence[Floats]:
        hand, held = self._giver, self._giver.held(scene, CUBE)
        now = hand.qpos(scene)
        place = scene.body(CUBE)[0] + (0.0, 0.0, self._fit.length(LIFT))
        return self._near(hand, place, hand.turns(now[None])[0], held, now)

    def _give(self, meeting: _Exchange, scene: Scene) -> Sequence[Floats]:
        held = self._giver.held(scene, CUBE)
        return self._near(self._giver, meeting.place, meeting.turn, held, meeting.give)

    def _retreat(self, scene: Scene) -> Sequence[Floats]:
        hand = self._giver
        now = hand.qpos(scene)
        turn, link = hand.turns(now[None])[0], hand.link(now[None])[0]
        place = link[:3, 3] + offsets(turn[None], self._fit.length(RETREAT))[0]
        return self._near(hand, place, turn, np.zeros(3), now)

    def _expect(self, meeting: _Exchange, scene: Scene) -> Sequence[Floats]:
        turn = self._taker.turns(meeting.take[None])[0]
        by = self._before + self._fit.length(BACK)
        place = meeting.place + offsets(turn[None], by)[0]
        middle = self._taker.motion.middle(self._shares[1])
        return self._near(self._taker, place, turn, middle, meeting.take)

    def _take(self, meeting: _Exchange, scene: Scene) -> Sequence[Floats]:
        """Return postures that hold the cube as the giver holds it by now, about as planned."""
        position, quaternion = scene.body(CUBE)
        hand, giver = self._taker, self._giver
        planned = hand.turns(meeting.take[None])[0]
        grips = box_grips(rotation_of(quaternion), around=24)
        given = giver.turns(giver.qpos(scene)[None])[0]
        alike = between(grips, planned) > SIMILAR
        grips = grips[alike & (between(grips, given) < APART + 0.2)]
        if not len(grips):
            return ()
        places = position + offsets(grips, self._before)
        middle = hand.motion.middle(self._shares[1])
        found = hand.reach(places, grips, middle, meeting.take[None], scatter=False)
        return list(hand.joints(found.qpos))

    def _carry(self, scene: Scene) -> Sequence[Floats]:
        hand = self._taker
        now = hand.qpos(scene)
        return list(hand.joints(self._ends(hand.held(scene, CUBE), now[None]).qpos))


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
