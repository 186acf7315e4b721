"""Searching for a path between places: the straight line first, then RRT-Connect by OMPL."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from robot_layouts.core.importing import optional
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.planning.space import Resolution, Space

COARSE: Resolution = (0.03, 0.15)  # m and rad; paths are checked again, more finely
RANGES = (0.8, 1.6, 0.4)  # rad: the longest lines of each restart, per root of the coordinates
CHECKS = 1500  # lines per restart


def connect(
    space: Space,
    start: Floats,
    goals: Sequence[Floats],
    seed: int,
    resolution: Resolution,
    first: int = 0,
    restarts: int = 3,
) -> Floats | None:
    """Return points of a free path from a start to one of some goals, or None if none was found.

    The same arguments give the same path, on every machine.

    Args:
        space: What to move in.
        start: (d,) (rad, m).
        goals: Each (d,); the first ones are tried first.
        seed: Of OMPL's random numbers.
        resolution: Of the path that is returned; the search looks at places farther apart.
        first: The number of the first search; 0 if there was none before.
        restarts: The number that the searches end before, each of which has another seed.

    Returns:
        The points, start and goal included, (n, d).

    Raises:
        MissingPackageError: If OMPL is not installed.
        NoPlanError: If all goals are cut off from the start, or the time given is over.
    """
    for goal in goals:
        if space.edge_free(start, goal, COARSE) and space.edge_free(start, goal, resolution):
            return np.array([start, goal])
    looked_at = COARSE
    for attempt in range(first, restarts):
        longest = RANGES[attempt % len(RANGES)] * np.sqrt(len(start))
        points = _rrt_connect(space, start, goals, seed + 1000 * attempt, longest, looked_at)
        if points is not None and space.path_free(points, resolution):
            return points
        if attempt == 0:
            space.expect_connected(goals)
        looked_at = COARSE if points is None else resolution
    return None


def import_ompl() -> tuple[Any, Any, Any]:
    """Return OMPL's modules ``base``, ``geometric`` and ``util``, which keeps its messages.

    Raises:
        MissingPackageError: If OMPL is not installed.
    """
    what = "planning needs OMPL, which has wheels for Python 3.10 to 3.13 on Linux and macOS"
    optional("ompl", what, "motion")
    from ompl import base, geometric, util

    util.setLogLevel(util.LogLevel.LOG_NONE)
    return base, geometric, util


def _rrt_connect(
    space: Space,
    start: Floats,
    goals: Sequence[Floats],
    seed: int,
    longest: float,
    resolution: Resolution,
) -> Floats | None:
    base, geometric, util = import_ompl()
    util.RNG.setSeed(seed + 1)  # OMPL takes 0 as no seed
    size = len(start)
    states = _state_space(base, space, [start, *goals])
    info = base.SpaceInformation(states)
    left = [CHECKS]

    def read(state: Any) -> Floats:
        return np.array([state[i] for i in range(size)])

    def valid(state: Any) -> bool:
        return bool(space.are_free(read(state)[None])[0])

    class Lines(base.MotionValidator):
        def checkMotion(self, a: Any, b: Any, *_: Any) -> bool:
            left[0] -= 1
            return space.edge_free(read(a), read(b), resolution)

    def written(place: Floats) -> Any:
        state = states.allocState()
        for i, value in enumerate(place.tolist()):
            state[i] = value
        return state

    lines = Lines(info)
    info.setStateValidityChecker(valid)
    info.setMotionValidator(lines)
    info.setup()
    problem = base.ProblemDefinition(info)
    problem.addStartState(written(start))
    ends = base.GoalStates(info)
    for goal in goals:
        ends.addState(written(goal))
    problem.setGoal(ends)
    planner = geometric.RRTConnect(info)
    planner.setProblemDefinition(problem)
    planner.setRange(float(longest))
    planner.setup()
    planner.solve(base.PlannerTerminationCondition(lambda: left[0] <= 0))
    if not problem.hasExactSolution():
        return None
    points = np.array([read(state) for state in problem.getSolutionPath().getStates()])
    points[0] = start
    return points


def _state_space(base: Any, space: Space, places: Sequence[Floats]) -> Any:
    states = base.RealVectorStateSpace(len(space.free))
    bounds = base.RealVectorBounds(len(space.free))
    low = np.minimum(space.bounds[:, 0], np.min(places, axis=0))
    high = np.maximum(space.bounds[:, 1], np.max(places, axis=0))
    for i, (a, b) in enumerate(zip(low.tolist(), high.tolist(), strict=True)):
        bounds.setLow(i, a)
        bounds.setHigh(i, b)
    states.setBounds(bounds)
    return states
