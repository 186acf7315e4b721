"""Ways of an arm that touch nothing on their way: no other arm, not itself, no body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_layouts.core.errors import MissingPackageError, NoPlanError
from robot_layouts.core.progress import Progress
from robot_layouts.experts.obstacles import obstacles
from robot_layouts.experts.script import Scene
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.collision.cell import Cell
from robot_layouts.motion.collision.checker import Checker, Contact
from robot_layouts.motion.model.obstacles import Held, Obstacle
from robot_layouts.motion.planning.rrt_connect import connect, import_ompl
from robot_layouts.motion.planning.shortcuts import shortened
from robot_layouts.motion.planning.space import Resolution, Space
from robots.bodies.hulls import require_packages
from tasks import TaskEnv

CLEARANCE = 0.02  # m
RESOLUTION: Resolution = (0.02, 0.1)  # m and rad
ROUNDING = 0.004  # m by which a hand may overlap what stands where it goes
SHARES = np.linspace(0.0, 1.0, 5)  # of their ways, at which arms that move too are checked
STANDING = 0.02  # rad: an arm that has less to go stands
SHORT = 0.4  # rad: a way that long at most, from or to a body, is only made straight
CANDIDATES, MANY = 8, 40  # postures at the goal that are checked; where there is no other way
SOUGHT = 2  # postures at the goal to which a way round is sought
CHECKS = 600  # lines and postures that a search may check


def without_planner() -> str:
    """Return what to add to a reason where no way round can be sought; nothing if it can."""
    try:
        require_packages()
        import_ompl()
    except MissingPackageError as error:
        return f"; no way round was sought: {error}"
    return ""


class NoWayError(Exception):
    """There is no way now; says what is in the way.

    Attributes:
        stays: Whether nothing of that moves on; then other postures are looked for at once.
    """

    def __init__(self, message: str, *, stays: bool = False) -> None:
        """Take the reason."""
        super().__init__(message)
        self.stays = stays


class Ways:
    """Finds ways for the arms of a task, given where the others are and go."""

    def __init__(self, task: TaskEnv) -> None:
        """Take a task: where its robots stand, and its bodies as scenes show them."""
        self._layout = task.standing()
        self._alone = Cell(self._layout)
        self._columns = {arm: self._columns_of(arm) for arm in task.layout.arms}
        self._graspers = [
            arm for arm, place in task.layout.arms.items() if place.robot.fingers is not None
        ]

    def known(self, arm: str) -> str | None:
        """Return the full name of an arm; None if there is no such arm."""
        name = self._layout.arm_name(arm)
        return name if name in self._columns else None

    def find(
        self,
        arm: str,
        goals: Sequence[Floats],
        scene: Scene,
        ahead: Mapping[str, Floats],
        candidates: int = CANDIDATES,
    ) -> Floats:
        """Return the points of a way that touches nothing, its start left out, (n, arm joints).

        It is the straight way to the first goal that has a free one, else a way round (rad).

        Args:
            arm: Its name in the layout.
            goals: Postures of the arm, each (arm joints,) (rad), the best first.
            scene: As it is now.
            ahead: What lies before the other arms, by name, (n, arm joints) (rad), beginning where
                they are.
            candidates: How many of the goals are looked at.

        Raises:
            MissingPackageError: If a way round is needed and the extra ``motion`` not installed.
            NoWayError: If there is no free way now.
        """
        query = self._query(self._layout.arm_name(arm), scene, ahead)
        places: list[_GoalPosture] = []
        for goal in goals[:candidates]:
            if (place := query.place(goal)) is None:
                continue
            if place.space.edge_free(query.start, goal, RESOLUTION):
                return goal[None]
            places.append(place)
        if not places:
            raise NoWayError(f"{query.trouble} at its end", stays=query.stays)
        for place in places[:SOUGHT]:
            points = query.way_round(place)
            if points is not None:
                return points
        raise NoWayError("all ways there are blocked")

    def _query(self, arm: str, scene: Scene, ahead: Mapping[str, Floats]) -> _Query:
        here = np.concatenate([scene.qpos(robot) for robot in self._alone.robots])
        cell = self._cell(scene, here)
        everywhere = np.tile(here, (len(SHARES), 1))
        moves = False
        for other, points in ahead.items():
            if other != arm and np.abs(points - points[0]).max() > STANDING:
                everywhere[:, self._columns[other]] = _along(points, SHARES)
                moves = True
        rows = everywhere if moves else here[None]
        return _Query(
            cell, arm, self._columns[arm], rows, {f"the {name}" for name in _movable(scene)}
        )

    def _cell(self, scene: Scene, here: Floats) -> Cell:
        """Return the robots with all bodies of the scene; those that two arms hold do not count."""
        held: list[Held] = []
        standing: list[Obstacle] = []
        movable = _movable(scene)
        for name, obstacle in obstacles(scene).items():
            grasping = (arm for arm in self._graspers if scene.grasps(arm, name))
            match list(grasping) if name in movable else []:
                case []:
                    standing.append(obstacle)
                case [arm]:
                    held.append(self._alone.grasped(arm, obstacle, here))
                case _:
                    pass
        return Cell(self._layout, standing, held)

    def _columns_of(self, arm: str) -> NDArray[np.intp]:
        robot = self._layout.owner(arm)
        own, first = self._layout[robot].robot.joints, self._alone.slices[robot].start
        joints = self._layout.arm(arm).robot.arm_joints
        return np.array([first + own.index(joint) for joint in joints], np.intp)


class _GoalPosture(NamedTuple):
    """A posture at the goal, (arm joints,) (rad), and the space in which ways there lie."""

    goal: Floats
    space: Space
    only_straight: bool


_Nearer = dict[frozenset[str], float]
"""How near two bodies may be, by their names, where that is nearer than usual (m)."""


class _Query:
    """Where one arm may go: what it has to keep clear of, and what its hand is at already."""

    def __init__(
        self,
        cell: Cell,
        arm: str,
        columns: NDArray[np.intp],
        everywhere: Floats,
        movable: set[str],
    ) -> None:
        """Note what the arm is near now.

        Args:
            cell: All robots and bodies.
            arm: The arm.
            columns: Of its joints among the cell's coordinates.
            everywhere: All coordinates now, and as the other arms go on, (k, D) (rad, m).
            movable: Obstacles that physics moves.
        """
        self._cell, self._columns, self._movable = cell, columns, movable
        self._robot = cell.layout.owner(arm)
        self._passing = {*cell.robots, *movable} - {self._robot}
        hand = cell.hand(arm)
        held = {held.obstacle.name for held in cell.held if held.place == arm}
        links = {s.name for s in cell.solids if s.mover == self._robot and s.part in hand}
        self._hand = held | links
        self._whole = cell.checker((self._robot,), CLEARANCE)
        self.start = everywhere[0, columns]
        self._nearer: _Nearer = {}
        self._at_body = self._allow(self._nearer, everywhere[0], leaving=True)
        later = [state for state in everywhere[1:] if self._forbidden(self._nearer, state) is None]
        self._everywhere = np.stack([everywhere[0], *later])
        self.trouble, self.stays = "", True

    def place(self, goal: Floats) -> _GoalPosture | None:
        """Return a posture at the goal; None if something is in the way there.

        `trouble` says what, and `stays` whether it never was what moves on.
        """
        nearer, states = dict(self._nearer), self._everywhere.copy()
        states[:, self._columns] = goal
        at_body = self._allow(nearer, states[0], leaving=False)
        self._allow(nearer, states[-1], leaving=False)
        found = (self._forbidden(nearer, state) for state in states)
        contact = next((contact for contact in found if contact is not None), None)
        if contact is not None:
            self.trouble = str(contact)
            self.stays &= self._passing.isdisjoint(contact.owners)
            return None
        short = bool(np.abs(goal - self.start).max() < SHORT)
        only_straight = (self._at_body or at_body) and short
        return _GoalPosture(goal, self._space(nearer, goal), only_straight)

    def way_round(self, place: _GoalPosture) -> Floats | None:
        """Return the points of a way that is not straight, without its start; None if none."""
        if place.only_straight:
            return None
        try:
            points = connect(place.space, self.start, [place.goal], 0, RESOLUTION, restarts=1)
            if points is None:
                return None
            return shortened(place.space, points, 0, RESOLUTION)[1:]
        except NoPlanError:
            return None

    def _space(self, nearer: _Nearer, goal: Floats) -> Space:
        cell, columns, everywhere = self._cell, self._columns, self._everywhere
        ends = np.stack([self.start, goal])
        checker = _AmongMoving(cell, *self._counted(nearer), columns, everywhere)
        bounds = _bounds(cell.limits[columns], ends)
        ones = np.ones(len(goal))
        return Space(cell, (self._robot,), columns, everywhere[0], bounds, ones, checker, _Budget())

    def _forbidden(self, nearer: _Nearer, state: Floats) -> Contact | None:
        """Return a contact in a state that is not allowed, or None."""
        for contact in self._whole.contacts(state):
            if contact.distance < nearer.get(frozenset(contact.names), np.inf):
                return contact
        return None

    def _allow(self, nearer: _Nearer, state: Floats, *, leaving: bool) -> bool:
        """Allow what may be nearer than usual in a state; return whether the hand is at a body.

        What is nearer than the clearance already may be so on the way. What physics moves may be
        touched by the hand that is there; so may what it overlaps by rounding, and what the arm is
        to get away from.
        """
        at_body = False
        for contact in self._whole.contacts(state):
            names = frozenset(contact.names)
            bodies = [name for name in contact.names if name not in self._hand]
            of_hand = len(bodies) == 1 and bodies[0] in contact.owners
            at_body |= of_hand
            touches = of_hand and bodies[0] in self._movable
            by_rounding = of_hand and contact.distance > -ROUNDING
            if touches or (contact.distance <= 0 and (by_rounding or leaving)):
                nearer[names] = -np.inf
            elif contact.distance > 0:
                nearer.setdefault(names, 0.0)
        return at_body

    def _counted(self, nearer: _Nearer) -> tuple[NDArray[np.intp], Floats]:
        """Return the pairs that count, and how far each has to be apart, (m, 2) and (m,) (m)."""
        names = np.array([solid.name for solid in self._cell.solids])[self._whole.pairs]
        apart = self._whole.apart.copy()
        for bodies, distance in nearer.items():
            one, other = bodies if len(bodies) > 1 else (*bodies, *bodies)
            theirs = ((names == one) & (names[:, ::-1] == other)).any(axis=1)
            apart[theirs] = np.minimum(apart[theirs], distance)
        counts = apart > -np.inf
        return self._whole.pairs[counts], apart[counts]


class _AmongMoving(Checker):
    """A checker for an arm among others that are in several postures at once."""

    def __init__(
        self,
        cell: Cell,
        pairs: NDArray[np.intp],
        apart: Floats,
        columns: NDArray[np.intp],
        everywhere: Floats,
    ) -> None:
        super().__init__(cell, pairs, apart)
        self._columns, self._everywhere = columns, everywhere

    def free(self, qpos: ArrayLike, times: ArrayLike | None = None) -> NDArray[np.bool_]:
        """Tell for each posture of the arm whether it is free wherever the others are, (n,)."""
        places = np.asarray(qpos, float)[:, None, self._columns]
        states = np.tile(self._everywhere, (len(places), 1, 1))
        states[..., self._columns] = places
        free = super().free(states.reshape(-1, states.shape[-1]), times)
        return np.asarray(free.reshape(states.shape[:2]).all(axis=1))

    def edge_free(
        self,
        start: ArrayLike,
        end: ArrayLike,
        resolution: tuple[float, float] = RESOLUTION,
        times: tuple[float, float] | None = None,
    ) -> bool:
        """Tell whether a straight way of the arm is free wherever the others are."""
        ends = np.array([start, end])[:, self._columns]
        for state in self._everywhere:
            a, b = state.copy(), state.copy()
            a[self._columns], b[self._columns] = ends
            if not super().edge_free(a, b, resolution, times):
                return False
        return True


class _Budget(Progress):
    """Ends a search that takes too many checks, however long they take."""

    def tell(self, what: str) -> None:
        """Count a check."""
        self.told += 1
        if self.told > CHECKS:
            raise NoPlanError(f"no way was found in {CHECKS} checks", "not found")


def _bounds(limits: Floats, ends: Floats) -> Floats:
    """Return where a search may go: the limits, or around its ends where there are none, (d, 2)."""
    around = np.stack([ends.min(axis=0) - np.pi, ends.max(axis=0) + np.pi], axis=1)
    return np.where(np.isfinite(limits), limits, around)


def _movable(scene: Scene) -> set[str]:
    return {body.name for body in scene.bodies if body.kind == "dynamic"}


def _along(points: Floats, shares: Floats) -> Floats:
    """Return places along the lines through points, at some shares of the way, (n, d)."""
    steps = np.abs(np.diff(points, axis=0)).max(axis=1)
    marks = np.concatenate([[0.0], np.cumsum(steps)])
    rows = [np.interp(shares * marks[-1], marks, column) for column in points.T]
    return np.stack(rows, axis=1)
