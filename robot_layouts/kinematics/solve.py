"""Joint positions that bring a link somewhere: to a place, to a pose, or as far out as it gets.

Every search is deterministic: random starts come from a fixed seed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robot_layouts.kinematics.rotations import Floats, cross, rotation_vector, transform
from robot_layouts.kinematics.tree import Tree

SEED = 0

ITERATIONS = 80
DAMPING = 0.03  # m and rad; keeps steps small near singular postures
LONGEST_STEP = 0.4  # of a joint, per iteration (rad or m)
NEAR_ENOUGH = 1e-3, 1e-2  # m and rad

_APPROACHES = 4  # steps of `approach`
_PLACE_DAMPING, _TURN_DAMPING, _NO_DAMPING = 0.005, 0.1, 1e-4  # m, rad
_AT = 1e-4  # rad, m; so near to a limit a joint is at it
_HOMEWARD = 0.02  # of the way to its posture, in each of them

_SWEEPS = 30  # over all joints, of the search for the farthest place
_ANGLES = 90  # tried per joint and sweep
_SMALLEST_GAIN = 1e-5  # m per sweep

_DIFFERENCE = 1e-4  # of a joint, for a derivative (rad)
_DIFFERENCE_STEPS = 40
_LONGEST_DIFFERENCE_STEP = 0.3  # of a joint, per iteration (rad)


@dataclass(frozen=True, eq=False)
class IkGoal:
    """Where a point of a tree is to be, and how a link is to be turned, in the root's frame.

    Attributes:
        position: Of the point, (3,) (m); or one for each start, (n, 3).
        links: Indices of the links whose mean origin is the point, or lies beside it.
        rotation: Of the link ``turned``, (3, 3), or one for each start, (n, 3, 3); None if any
            will do.
        turned: Index of the link that has the orientation.
        offset: From the mean origin to the point, in the frame of ``turned``, (3,) (m); None if
            that is the point.
    """

    position: Floats
    links: Sequence[int]
    rotation: Floats | None = None
    turned: int = 0
    offset: Floats | None = None


@dataclass(frozen=True, eq=False)
class Solutions:
    """What a search reached from each of its starts.

    Attributes:
        qpos: Coordinates, (n, coordinates) (rad, m).
        missing: How far the point stays from its place, (n,) (m).
        turn_missing: How far the orientation stays from the one asked for, (n,) (rad).
        solved: Whether both are within `NEAR_ENOUGH`, (n,).
    """

    qpos: Floats
    missing: Floats
    turn_missing: Floats
    solved: NDArray[np.bool_]

    def ranked(self, near: Floats) -> list[int]:
        """Return the solutions, the one first whose farthest coordinate has the shortest way.

        If there is none, the list holds the one posture that comes nearest to the goal.

        Args:
            near: Coordinates from which the way is measured, (coordinates,).
        """
        order = np.argsort(np.abs(self.qpos - near).max(axis=1))
        solved = order[self.solved[order]].tolist()
        return solved or [int(np.argmin(self.missing + self.turn_missing))]


def solve(
    tree: Tree,
    goal: IkGoal,
    starts: Floats,
    free: Sequence[int],
    iterations: int = ITERATIONS,
    turn_worth: float = 1.0,
) -> Solutions:
    """Bring a tree to a goal by damped least squares, from every start at once.

    Args:
        tree: The links.
        goal: What is asked for.
        starts: Coordinates, (n, coordinates) (rad, m).
        free: Indices of the coordinates that may move, within their limits.
        iterations: How many steps it takes at most.
        turn_worth: Distance that counts as much as a turn by 1 rad (m): less where joints are too
            few for both, so that the place comes first.
    """
    needed = tree.towards([*goal.links, goal.turned])
    links = [needed.link(tree.links[link]) for link in goal.links]
    turned = needed.link(tree.links[goal.turned])
    goal = replace(goal, links=links, turned=turned)
    qpos = _solved(needed, goal, starts.copy(), free, iterations, turn_worth)
    missing, turn_missing = shortfalls(needed, goal, qpos)
    solved = (missing < NEAR_ENOUGH[0]) & (turn_missing < NEAR_ENOUGH[1])
    return Solutions(qpos, missing, turn_missing, solved)


def shortfalls(tree: Tree, goal: IkGoal, qpos: Floats) -> tuple[Floats, Floats]:
    """Return how far the point stays from its place, (n,) (m), and how far from its turn (rad).

    Args:
        tree: The links.
        goal: What is asked for.
        qpos: Coordinates, (n, coordinates) (rad, m).
    """
    errors = _missing(goal, tree.forward(qpos))
    return np.linalg.norm(errors[:, :3], axis=1), np.linalg.norm(errors[:, 3:], axis=1)


def approach(
    tree: Tree,
    goal: IkGoal,
    qpos: Floats,
    free: Sequence[int],
    longest: Floats | float,
    rest: Floats,
) -> Floats:
    """Bring a tree a step nearer to a goal: the place first, then the orientation.

    Unlike `solve` it never leaves the neighbourhood. An arm of too few joints, or one whose goal is
    out of reach, ends where the place is missed least; one of more joints than needed keeps near a
    posture with what is left over.

    Args:
        tree: The links.
        goal: What is asked for, for one posture.
        qpos: Coordinates to start from, (coordinates,) (rad, m).
        free: Indices of the coordinates that may move, within their limits.
        longest: How far each of them may move in all, one number or (free,) (rad or m).
        rest: The posture, (free,) (rad, m).

    Returns:
        Coordinates, (coordinates,) (rad, m).
    """
    low, high = tree.limits[free].T
    began = qpos[free]
    low, high = np.maximum(low, began - longest), np.minimum(high, began + longest)
    low, high = np.minimum(low, began), np.maximum(high, began)  # where it begins beyond a limit
    rows = qpos[None].copy()
    for _ in range(_APPROACHES):
        errors, slopes = _errors(tree, goal, rows, free)
        at = rows[0, free]
        # A joint at a limit that it is drawn beyond leaves the way to the others: of the two ways,
        # each asks for itself, so that the second never hinders the first.
        way, aside = _by_priority(errors[0], slopes[0], rest - at)
        free_to_go = _inward(way, at, low, high)
        if not free_to_go.all():
            way, aside = _by_priority(errors[0], slopes[0] * free_to_go, rest - at)
        kept = free_to_go & _inward(aside, at, low, high)
        if (kept != free_to_go).any():
            _, aside = _by_priority(errors[0], slopes[0] * kept, rest - at)
        at, aside = np.clip(at + way, low, high), aside * kept
        at = at + _share(aside, at, low, high) * aside
        rows[0, free] = np.clip(at, low, high)
    return rows[0]


def _by_priority(errors: Floats, slopes: Floats, homeward: Floats) -> tuple[Floats, Floats]:
    """Return the step that corrects the position, and one that corrects the rest, bent homeward."""
    free = np.eye(slopes.shape[1])
    way = _back(slopes[:3], _PLACE_DAMPING) @ errors[:3]
    spare = free - _back(slopes[:3], _NO_DAMPING) @ slopes[:3]
    turning = slopes[3:] @ spare
    back = _back(turning, _TURN_DAMPING)
    aside = back @ (errors[3:] - slopes[3:] @ way)
    return way, aside + (spare - back @ turning) @ (_HOMEWARD * homeward)


def _back(slopes: Floats, damping: float) -> Floats:
    """Return the damped least-squares matrix that turns errors into the step that corrects them."""
    return slopes.T @ np.linalg.inv(slopes @ slopes.T + damping**2 * np.eye(len(slopes)))


def _inward(way: Floats, at: Floats, low: Floats, high: Floats) -> NDArray[np.bool_]:
    """Return which joints a way does not draw beyond a limit that they are at."""
    return ~(((at <= low + _AT) & (way < 0)) | ((at >= high - _AT) & (way > 0)))


def _share(way: Floats, at: Floats, low: Floats, high: Floats) -> float:
    """Return how much of a way stays within bounds, 0 … 1."""
    room = np.where(way > 0, high - at, low - at)
    shares = room[way != 0] / way[way != 0]
    return float(np.clip(shares.min(initial=1.0), 0.0, 1.0))


def _solved(
    tree: Tree,
    goal: IkGoal,
    qpos: Floats,
    free: Sequence[int],
    iterations: int,
    turn_worth: float,
) -> Floats:
    limits = tree.limits[free]
    rows = 3 if goal.rotation is None else 6
    worth = np.array((1.0, 1.0, 1.0, turn_worth, turn_worth, turn_worth))[:rows]
    damping = DAMPING**2 * np.eye(rows)
    for _ in range(iterations):
        errors, slopes = _errors(tree, goal, qpos, free)
        errors, slopes = errors * worth, slopes * worth[:, None]
        if (np.abs(errors).max(axis=1) < NEAR_ENOUGH[0] / 10).all():
            break
        # A joint at a limit that it is drawn beyond leaves the way to the others.
        at, pull = qpos[:, free], (errors[:, None] @ slopes)[:, 0]
        stuck = ((at <= limits[:, 0]) & (pull < 0)) | ((at >= limits[:, 1]) & (pull > 0))
        slopes = np.where(stuck[:, None], 0.0, slopes)
        # The damping vanishes with the error, so that the last steps are whole ones.
        scale = np.minimum(1.0, np.linalg.norm(errors, axis=1) * 10)[:, None, None]
        normal = slopes @ slopes.transpose(0, 2, 1) + scale * damping + 1e-9 * np.eye(rows)
        step = slopes.transpose(0, 2, 1) @ np.linalg.solve(normal, errors[:, :, None])
        moved = at + np.clip(step[:, :, 0], -LONGEST_STEP, LONGEST_STEP)
        qpos[:, free] = np.clip(moved, limits[:, 0], limits[:, 1])
    return qpos


def _errors(tree: Tree, goal: IkGoal, qpos: Floats, free: Sequence[int]) -> tuple[Floats, Floats]:
    """Return what is missing to the goal, (n, 3 or 6), and its slopes by the free coordinates."""
    poses = tree.forward(qpos)
    moving = {link: tree.jacobian(poses, link, free) for link in {*goal.links, goal.turned}}
    slopes = np.zeros((len(qpos), 3, len(free)))
    for link in goal.links:
        slopes += moving[link][:, :3] / len(goal.links)
    if goal.offset is not None:
        beside = poses[:, goal.turned, :3, :3] @ goal.offset
        aside = cross(moving[goal.turned][:, 3:].transpose(0, 2, 1), beside[:, None])
        slopes = slopes + aside.transpose(0, 2, 1)
    if goal.rotation is not None:
        slopes = np.concatenate([slopes, moving[goal.turned][:, 3:]], axis=1)
    return _missing(goal, poses), slopes


def _missing(goal: IkGoal, poses: Floats) -> Floats:
    """Return what is missing to the goal where all links are, (n, 3 or 6)."""
    place = poses[:, goal.links][..., :3, 3].mean(axis=1)
    if goal.offset is not None:
        place = place + poses[:, goal.turned, :3, :3] @ goal.offset
    if goal.rotation is None:
        return goal.position - place
    turn = rotation_vector(goal.rotation @ poses[:, goal.turned, :3, :3].transpose(0, 2, 1))
    return np.concatenate([goal.position - place, turn], axis=1)


def scattered(limits: Floats, count: int) -> Floats:
    """Return the same random coordinates for every request, (count, coordinates) (rad, m).

    Args:
        limits: Lower and upper limits, (coordinates, 2); infinite ones count as ±π.
        count: How many.
    """
    low, high = np.nan_to_num(limits, posinf=np.pi, neginf=-np.pi).T
    return np.random.default_rng(SEED).uniform(low, high, (count, len(limits)))


def nearby(
    qpos: Floats, moving: Sequence[int] | NDArray[np.intp], count: int, spread: float
) -> Floats:
    """Return the same few places around joint positions for every request, (count, joints).

    Args:
        qpos: Joint positions, (joints,) (rad, m).
        moving: Indices of the joints that are elsewhere.
        count: How many.
        spread: Standard deviation (rad, m).
    """
    places = np.tile(qpos, (count, 1))
    places[:, moving] += np.random.default_rng(SEED).normal(0, spread, (count, len(moving)))
    return places


def turned_within(angles: Floats, low: Floats, high: Floats) -> Floats | None:
    """Turn joints by whole turns into their limits, (joints,) (rad), or return None if some stay.

    Args:
        angles: (joints,) (rad).
        low: Lower limits, (joints,) (rad).
        high: Upper limits, (joints,) (rad).
    """
    turns = np.ceil((low - angles) / (2 * np.pi))
    angles = np.where((angles < low) | (angles > high), angles + turns * 2 * np.pi, angles)
    return angles if ((angles >= low) & (angles <= high)).all() else None


def by_way(candidates: Iterable[Floats], start: Floats) -> list[Floats]:
    """Return candidates by the way of their farthest joint from ``start``, the shortest first."""
    return sorted(candidates, key=lambda joints: float(np.abs(joints - start).max()))


def descend_by_differences(
    errors: Callable[[Floats], Floats],
    start: Floats,
    free: Sequence[int],
    limits: Floats | None = None,
) -> Floats:
    """Bring a function of joints, of which nothing is known but its values, towards 0.

    Gauss-Newton's method with forward differences.

    Args:
        errors: What is missing at some joints: (joints,) to (errors,).
        start: Joint positions, (joints,) (rad, m).
        free: Indices of the joints that may move.
        limits: Between which they stay, (joints, 2) (rad, m); None if anywhere will do.
    """
    joints = start.astype(float)
    bounds = np.tile((-np.inf, np.inf), (len(start), 1)) if limits is None else limits
    low, high = bounds[list(free)].T
    for _ in range(_DIFFERENCE_STEPS):
        error = errors(joints)
        slopes = np.zeros((len(error), len(free)))
        for column, joint in enumerate(free):
            moved = joints.copy()
            moved[joint] += _DIFFERENCE
            slopes[:, column] = (errors(moved) - error) / _DIFFERENCE
        # A joint at a limit that it is drawn beyond leaves the way to the others.
        slopes *= _inward(-error @ slopes, joints[free], low, high)
        step = np.linalg.lstsq(slopes, -error, rcond=None)[0]
        joints[free] += np.clip(step, -_LONGEST_DIFFERENCE_STEP, _LONGEST_DIFFERENCE_STEP)
        joints[free] = np.clip(joints[free], low, high)
        if np.abs(step).max() < _DIFFERENCE:
            break
    return joints


def farthest(tree: Tree, link: int, point: Floats, starts: Floats, free: Sequence[int]) -> float:
    """Return the largest distance of a point from the root's z axis that was reached (m).

    One joint moves after the other, from the tip to the base, to where the point is farthest.

    Args:
        tree: The links; each joint on the path follows a coordinate of its own.
        link: Index of the link that the point belongs to.
        point: In the link's frame, (3,) (m).
        starts: Coordinates, (n, coordinates) (rad, m).
        free: Indices of the coordinates that may move, within their limits, which are finite.
    """
    tree = tree.towards([link])
    qpos, best = starts.copy(), np.zeros(len(starts))
    climbing = np.ones(len(starts), bool)
    for _ in range(_SWEEPS):
        reached = _sweep(tree, point, qpos, set(free))
        gained = reached >= best + _SMALLEST_GAIN
        best = np.where(climbing, np.maximum(best, reached), best)
        climbing &= gained
        if not climbing.any():
            break
    return float(best.max())


def _sweep(tree: Tree, point: Floats, qpos: Floats, free: set[int]) -> Floats:
    """Move each free coordinate of every start to its best place, and return the distances."""
    poses = tree.forward(qpos)
    carried = np.broadcast_to(point, (len(qpos), 3))  # in the frame of the link at hand
    for link in range(len(tree.links) - 1, 0, -1):
        driver = int(tree.drivers[link])
        joint = poses[:, tree.parents[link]] @ tree.origins[link]
        if driver in free:
            tried = _tried(qpos[:, driver], *tree.limits[driver])
            places = transform(tree.motion(link, tried), carried[:, None])
            x, y, _ = np.moveaxis(transform(joint[:, None], places), -1, 0)
            chosen = np.argmax(np.hypot(x, y), axis=1)[:, None]
            qpos[:, driver] = np.take_along_axis(tried, chosen, axis=1)[:, 0]
        if driver >= 0:
            carried = transform(tree.motion(link, qpos[:, driver]), carried)
        carried = transform(tree.origins[link], carried)
    return np.hypot(carried[:, 0], carried[:, 1])


def _tried(now: Floats, low: float, high: float) -> Floats:
    """Return for each start the positions to try: where it is, and the joint's whole range."""
    steps = np.array([low + (high - low) * i / _ANGLES for i in range(_ANGLES + 1)])
    return np.concatenate([now[:, None], np.tile(steps, (len(now), 1))], axis=1)
