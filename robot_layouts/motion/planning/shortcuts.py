"""Making paths shorter and rounder: shortcuts, also of single robots, and corners cut."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.planning.space import Resolution, Space
from robot_layouts.motion.timing.paths import Path, way, without_straight_points

TRIES = 40  # shortcuts at most
FAILURES = 12  # in a row, after which a path counts as short
GAIN = 0.01  # s; what a shortcut must save
BLENDS = (1.0, 0.5, 0.25, 0.1, 0.03)  # shares of the longest blend, tried in this order


def shortened(space: Space, points: Floats, seed: int, resolution: Resolution) -> Floats:
    """Return points of a shorter free path between the same ends, (m, d).

    Args:
        space: What it moves in.
        points: Of a free path, (n, d) (rad, m).
        seed: Of the random shortcuts.
        resolution: Of the checks of what is new.

    Raises:
        NoPlanError: If the time given is over.
    """
    points = without_straight_points(points, space.speeds)
    points = _without_detours(space, points, resolution)
    random = np.random.default_rng(seed)
    robots = [space.columns([name]) for name in space.robots]
    everything = np.arange(points.shape[1])
    failures = 0
    for attempt in range(TRIES):
        if len(points) < 3 or failures >= FAILURES:
            break
        single = len(robots) > 1 and attempt % 2 == 1
        columns = robots[int(random.integers(len(robots)))] if single else everything
        shorter = _shortcut(space, points, columns, random, resolution)
        failures = 0 if shorter is not None else failures + 1
        points = points if shorter is None else shorter
    return points


def rounded(space: Space, points: Floats, resolution: Resolution) -> Path:
    """Return the path through points with corners cut as far as that is free.

    Where not even a small blend is free, the path stops.

    Args:
        space: What it moves in.
        points: Of a free path, (n, d) (rad, m).
        resolution: Of the checks of blends.

    Raises:
        NoPlanError: If the time given is over.
    """
    points = without_straight_points(points, space.speeds)
    path = Path(points, np.zeros(len(points)), space.speeds)
    longest = np.minimum(path.lengths[:-1], path.lengths[1:]) / 2
    for corner in range(1, len(points) - 1):
        for share in BLENDS:
            blends = path.blends.copy()
            blends[corner] = share * longest[corner - 1]
            tried = Path(points, blends, space.speeds)
            if space.blend_free(tried, corner, resolution):
                path = tried
                break
    return path


def _without_detours(space: Space, points: Floats, resolution: Resolution) -> Floats:
    """Leave points out that the path gets on without, from each the farthest first."""
    at, kept = 0, [points[0]]
    while at < len(points) - 1:
        behind = len(points) - 1
        while behind > at + 1 and not space.edge_free(points[at], points[behind], resolution):
            behind -= max(1, (behind - at) // 2)
            behind = max(behind, at + 1)
        kept.append(points[behind])
        at = behind
    return np.array(kept)


def _shortcut(
    space: Space,
    points: Floats,
    columns: NDArray[np.intp],
    random: np.random.Generator,
    resolution: Resolution,
) -> Floats | None:
    """Go straight between two random places of a path, with some coordinates only, if it saves."""
    lengths = way(points, space.speeds)
    marks = np.concatenate([[0.0], np.cumsum(lengths)])
    a, b = np.sort(random.uniform(0.0, marks[-1], 2)).tolist()
    first, last = (int(np.searchsorted(marks, s, side="right")) for s in (a, b))
    last = min(last, len(points) - 1)
    if first >= last:
        return None
    start, end = _at(points, marks, a), _at(points, marks, b)
    inner = points[first:last].copy()
    shares = ((marks[first:last] - a) / (b - a))[:, None]
    inner[:, columns] = start[columns] + shares * (end - start)[columns]
    whole = len(columns) == points.shape[1]
    middle = np.array([start, end]) if whole else np.concatenate([[start], inner, [end]])
    tried = np.concatenate([points[:first], middle, points[last:]])
    tried = without_straight_points(tried, space.speeds)
    if _cost(tried, space.speeds) > _cost(points, space.speeds) - GAIN:
        return None
    return tried if space.path_free(middle, resolution) else None


def _cost(points: Floats, speeds: Floats) -> float:
    """Return the time at full speed, and a little of every coordinate's way."""
    steps = np.diff(points, axis=0) / speeds
    return float(np.abs(steps).max(axis=1).sum() + 0.3 * np.linalg.norm(steps, axis=1).sum())


def _at(points: Floats, marks: Floats, s: float) -> Floats:
    i = min(int(np.searchsorted(marks, s, side="right")) - 1, len(points) - 2)
    return points[i] + (s - marks[i]) / (marks[i + 1] - marks[i]) * (points[i + 1] - points[i])
