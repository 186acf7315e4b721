"""Planning: from a layout, a start and goals to a motion that collides with nothing."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kinematics.rotations import Floats
from layouts import Layout
from layouts.validation.arguments import Rectangle
from motion.cell import Cell
from motion.clearances import Keeping
from motion.goals import CANDIDATES, Goal, Target, read_targets
from motion.motion import Motion
from motion.obstacles import Held, Obstacle
from motion.paths import Path
from motion.priorities import coordinated
from motion.search import connect
from motion.shorten import rounded, shortened
from motion.spaces import Progress, Resolution, Space
from motion.timing import Accelerations, largest_accelerations, largest_velocities, timed
from robots.common.bounds import checked_number, checked_whole
from robots.common.errors import MotionError, NoPlanError

COMBINATIONS = 512  # of postures of all places that are tried as goals
FEW = 4  # robots that plan together at first
RESTARTS = 4  # searches of all robots together
ENDS = 4  # of them that a search may choose from
FINEST = 2e-3  # m; how near places are that are looked at, where no clearance is asked
RADIANS_PER_METRE = 5.0  # how far links may turn between two of them, beside how far they travel


def plan(
    layout: Layout,
    start: Mapping[str, ArrayLike] | ArrayLike | None = None,
    goals: Mapping[str, Goal] | None = None,
    *,
    obstacles: Iterable[Obstacle] = (),
    held: Iterable[Held] = (),
    table: Rectangle | None = None,
    clearance: float = 0.01,
    seed: int = 0,
    patience: float = 30.0,
    control_mode: str | Mapping[str, str] | None = None,
    velocity: float = 1.0,
    acceleration: Accelerations | None = None,
) -> Motion:
    """Return a motion that brings places of a layout to their goals without a collision.

    Robots, or limbs of robots, that have no goal stay where they are; so do grippers, heads and
    mobile bases. The same arguments give the same motion, on every machine.

    Args:
        layout: Which robots stand where.
        start: Joint positions of some robots, by name, the others being where the layout starts
            them; or of all robots one after the other, (D,) (rad, m).
        goals: By place (a robot or a limb): the joint positions of its arm, or of all its joints
            (rad, m); a `TcpGoal`, or a `RegionGoal`.
        obstacles: What else stands in the way.
        held: What arms hold, and carry along.
        table: Outline of a table whose top is at z = 0, as x_min, y_min, x_max, y_max (m), besides
            those of the layout.
        clearance: How far robots stay from each other and from everything else (m). Bodies that
            are nearer at the start or at the goal only have to stay apart, and so do links of one
            robot.
        seed: Of everything random.
        patience: How long planning may take (s). It never changes a motion, only whether there is
            one.
        control_mode: In which the motion will be executed; None for that of the layout. See
            `motion.timing.largest_velocities`.
        velocity: Share of the largest velocities to use, over 0, at most 1.
        acceleration: Largest accelerations (rad/s², m/s²), one for all joints or by robot; by
            default joints get to their largest velocity in 0.4 s.

    Returns:
        The motion, of all robots.

    Raises:
        AssetError: If a robot's files cannot be found or make no sense.
        LayoutError: If obstacles or the table make no sense.
        MissingPackageError: If the extra ``motion`` is not installed.
        MotionError: If another argument makes no sense.
        NoPlanError: If there is no such motion, or none was found; ``reason`` says why.
        UnknownNameError: If there is no such place.
    """
    checked_whole("seed", seed, 0, 2**31, MotionError)
    patience = checked_number("patience", patience, 1e-3, 1e6, MotionError, "s")
    clearance = checked_number("clearance", clearance, 0.0, 1.0, MotionError, "m")
    cell = _cell(layout, tuple(obstacles), tuple(held), table)
    here = _start(cell, start)
    velocities = largest_velocities(layout, control_mode, velocity)
    accelerations = largest_accelerations(layout, velocities, acceleration)
    query = _Query(
        cell,
        here,
        read_targets(cell, goals or {}, here),
        np.concatenate([velocities[name] for name in cell.robots]),
        clearance,
        seed,
        Progress(patience),
    )
    space, path = query.path()
    limits = np.concatenate([accelerations[name] for name in cell.robots])
    times, positions, speeds = timed(path, limits[space.free])
    return Motion(
        layout=layout,
        times=times,
        positions=_by_robot(cell, space.whole(positions)),
        velocities=_by_robot(cell, _spread(space, speeds)),
        obstacles=cell.obstacles,
        held=cell.held,
        table=table,
        clearance=clearance,
        largest_velocities=velocities,
        largest_accelerations=accelerations,
    )


@dataclass(eq=False)
class _Query:
    """One question, with everything that it takes to answer it."""

    cell: Cell
    start: Floats
    targets: tuple[Target, ...]
    speeds: Floats
    clearance: float
    seed: int
    progress: Progress

    def path(self) -> tuple[Space, Path]:
        """Return the space of all moving coordinates, and the way through it."""
        robots = tuple(dict.fromkeys(target.robot for target in self.targets))
        keeping = Keeping(self.cell, robots, self.clearance)
        keeping.expect_free_start(self.start)
        keeping.relax(self.start)
        ends = self._ends(keeping)
        keeping.relax(ends[0])
        moving = np.sort(np.concatenate([target.moving for target in self.targets]))
        space = Space(
            self.cell,
            robots,
            moving,
            self.start,
            _bounds(self.cell.limits[moving], self.start[moving], ends[:, moving]),
            self.speeds[moving],
            keeping.checkers(),
            self.progress,
        )
        goals = [end[moving] for end in ends if space.are_free(end[None, moving])[0]]
        resolution = self._fine()
        points = self._points(space, keeping, goals, resolution)
        if points is None:
            raise self._not_found()
        space.purpose = "shortening"
        points = shortened(space, points, self.seed, resolution)
        return space, rounded(space, points, resolution)

    def _points(
        self, space: Space, keeping: Keeping, goals: Sequence[Floats], resolution: Resolution
    ) -> Floats | None:
        """Return points of a free path: few robots plan together, many alone at first."""
        start = self.start[space.free]
        together = partial(connect, space, start, goals, self.seed, resolution)
        few = len(space.robots) <= FEW
        points = together(restarts=int(few))
        if points is None and len(space.robots) > 1:
            points = coordinated(space, keeping, start, goals[0], self.seed, resolution)
        return together(first=int(few), restarts=RESTARTS) if points is None else points

    def _fine(self) -> Resolution:
        """Return how dense checks make sure that nothing comes nearer than 0 in between."""
        step = max(self.clearance, FINEST)
        return step, RADIANS_PER_METRE * step

    def _ends(self, keeping: Keeping) -> Floats:
        """Return all coordinates at some combinations of goals, best first, (n, D)."""
        lone = [t for t in self.targets if sum(o.robot == t.robot for o in self.targets) == 1]
        kept = {
            target.place: self._free_candidates(target, keeping)
            if target in lone
            else target.candidates[:CANDIDATES]
            for target in self.targets
        }
        counts = [range(len(kept[target.place])) for target in self.targets]
        chosen = sorted(product(*counts), key=lambda choice: (sum(choice), choice))[:COMBINATIONS]
        states = np.tile(self.start, (len(chosen), 1))
        for i, target in enumerate(self.targets):
            postures = kept[target.place][[choice[i] for choice in chosen]]
            states[:, target.moving] = postures
        free = keeping.free(states)
        if not free.any():
            contact = keeping.contact(states[0])
            who = " and ".join(target.place for target in self.targets)
            raise NoPlanError(
                f"the goals of {who} exclude each other: there {contact}", "goal in collision"
            )
        return states[free][:ENDS]

    def _free_candidates(self, target: Target, keeping: Keeping) -> Floats:
        """Return the postures in which a robot touches nothing but what moves, too."""
        alone = keeping.without([t.robot for t in self.targets if t.robot != target.robot])
        states = np.tile(self.start, (len(target.candidates), 1))
        states[:, target.moving] = target.candidates
        free = alone.free(states)
        if not free.any():
            raise NoPlanError(
                f"at the goal of {target.place}, {target.goal}, {alone.contact(states[0])}",
                "goal in collision",
            )
        return target.candidates[free][:CANDIDATES]

    def _not_found(self) -> NoPlanError:
        who = ", ".join(target.place for target in self.targets)
        return NoPlanError(
            f"no motion of {who} was found in {self.progress.checks} checks; another seed, a"
            " smaller clearance or another posture at the goal may help",
            "not found",
        )


def _cell(
    layout: Layout,
    obstacles: tuple[Obstacle, ...],
    held: tuple[Held, ...],
    table: Rectangle | None,
) -> Cell:
    """Return a cell; one of robots and tables alone is kept for the next plan."""
    if obstacles or held:
        return Cell(layout, obstacles, held, table)
    return _plain_cell(layout, table)


@lru_cache(maxsize=8)
def _plain_cell(layout: Layout, table: Rectangle | None) -> Cell:
    return Cell(layout, table=table)


def _start(cell: Cell, given: Mapping[str, ArrayLike] | ArrayLike | None) -> Floats:
    """Return all joint positions at the start, (D,).

    Raises:
        MotionError: If they have another shape, or are not finite.
    """
    if given is None:
        return cell.start.copy()
    if not isinstance(given, Mapping):
        return _numbers("start", given, cell.size)
    start = cell.start.copy()
    for name, values in given.items():
        robot = cell.layout.owner(name)
        arm, own = cell.layout.arm(name).robot, cell.layout[robot].robot
        columns = [cell.slices[robot].start + own.joints.index(joint) for joint in arm.joints]
        start[columns] = _numbers(f"start of {name}", values, len(columns))
    return start


def _numbers(what: str, values: Any, count: int) -> Floats:
    try:
        array = np.array(values, float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (count,) or not np.isfinite(array).all():
        raise MotionError(f"{what} is {values!r}; it takes {count} joint positions (rad, m)")
    return array


def _bounds(limits: Floats, start: Floats, ends: Floats) -> Floats:
    """Return where a search may go: the limits, or around start and goals where there are none."""
    around = np.concatenate([start[None], ends])
    low = np.where(np.isfinite(limits[:, 0]), limits[:, 0], around.min(axis=0) - np.pi)
    high = np.where(np.isfinite(limits[:, 1]), limits[:, 1], around.max(axis=0) + np.pi)
    return np.stack([low, high], axis=1)


def _by_robot(cell: Cell, states: Floats) -> dict[str, Floats]:
    return {name: states[:, part] for name, part in cell.slices.items()}


def _spread(space: Space, speeds: Floats) -> Floats:
    """Return the velocities of all coordinates; those that stay have 0."""
    whole = np.zeros((len(speeds), space.cell.size))
    whole[:, space.free] = speeds
    return whole
