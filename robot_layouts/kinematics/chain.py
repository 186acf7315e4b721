"""One chain of links of a tree, and a search for the joints that bring its end to a pose.

The search ends where that of Pinocchio ends, with which native's controllers drive. That one takes
steps of a fixed share of the way that is left, until the error is below a tolerance; here Newton's
method goes all the way in a few steps, and then back by what Pinocchio's would leave.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_layouts.kinematics.rotations import Floats, inverse_pose, rotation_vector
from robot_layouts.kinematics.tree import FIXED, Tree

_NEWTON_STEPS = 40
_LONGEST_STEP = 0.4  # of a joint (rad or m)
_DAMPED = 1e-6 * np.eye(6)  # m², rad²; as Pinocchio
_STANDS = 1e-7  # rad or m; a joint that goes no farther
_SMALL_ANGLE = 1e-3  # below it a series is taken (rad)


class Search(NamedTuple):
    """A search by steps of a fixed share of the way that is left, and when it ends.

    Attributes:
        steps: How many it takes at most.
        share: Of that way, what each of them goes.
        tolerance: Norm of the pose error (m and rad together) below which it has arrived.
    """

    steps: int
    share: float
    tolerance: float = 1e-4

    def left(self, error: float) -> float | None:
        """Return what part of the way is left at its end, or None if it does not arrive.

        Args:
            error: Norm of the pose error at its start (m and rad together).
        """
        if not error >= self.tolerance:
            return None if math.isnan(error) else 0.0
        steps = math.floor(math.log(self.tolerance / error) / math.log(1 - self.share)) + 1
        return None if steps > self.steps else (1 - self.share) ** steps


class Chain:
    """The links of a tree from one, the root of the chain, to another, its end."""

    def __init__(self, tree: Tree, end: int, root: int = 0) -> None:
        """Take a part of a tree.

        Args:
            tree: The tree; the coordinates stay all of its.
            end: Index of the link at the end.
            root: Index of the link in whose frame poses are; the end hangs on it.
        """
        path = tree.path(end)
        movers: list[int] = []
        terms: list[Floats] = []
        carried = np.eye(4)
        for link in path[path.index(root) + 1 :]:
            carried = carried @ tree.origins[link]
            if tree.drivers[link] != FIXED:
                movers.append(link)
                terms.append(motion_terms(carried, tree.axes[link], slides=bool(tree.slides[link])))
                carried = np.eye(4)
        self._tail = carried  # from the last link that moves to the end
        self._drivers = tree.drivers[movers]
        self._multipliers, self._offsets = tree.multipliers[movers], tree.offsets[movers]
        self._slides = np.flatnonzero(tree.slides[movers])
        self._axes = (self._multipliers[:, None] * tree.axes[movers])[:, None, :, None]
        self._terms = np.array(terms).reshape(-1, 3, 16)
        span = np.diff(tree.limits, axis=1)[:, 0]
        sliding = {int(tree.drivers[i]) for i in range(len(tree.links)) if tree.slides[i]}
        self._endless = np.array(
            [bool(np.isinf(s)) and i not in sliding for i, s in enumerate(span)], bool
        )

    @property
    def coordinates(self) -> set[int]:
        """Indices of the coordinates that move the end."""
        return set(self._drivers.tolist())

    def end_poses(self, qpos: Floats) -> Floats:
        """Return where coordinates bring the end in the root's frame, (n, 4, 4) (m).

        Args:
            qpos: Coordinates of the tree, (n, coordinates) (rad, m).
        """
        return self._poses(qpos)[-1] @ self._tail

    def search(
        self, pose: Floats, starts: Floats, free: Sequence[int], search: Search
    ) -> tuple[Floats, NDArray[np.bool_]]:
        """Bring the end to a pose, from each start by itself; limits are not looked at.

        Args:
            pose: Of the end in the root's frame, (4, 4) (m).
            starts: Coordinates, (n, coordinates) (rad, m).
            free: Indices of the coordinates that may move.
            search: Where it ends.

        Returns:
            Coordinates, (n, coordinates) (rad, m), joints that turn without end in [-π, π); and
            which have arrived, (n,).
        """
        wanted = pose @ inverse_pose(self._tail)
        twists = screw(inverse_pose(self._poses(starts)[-1]) @ wanted)
        lefts = [search.left(error) for error in np.linalg.norm(twists, axis=1).tolist()]
        arriving = np.array([left is not None for left in lefts])
        left = np.array([left or 0.0 for left in lefts])
        drives = (self._drivers[:, None] == np.asarray(free)).astype(float)  # (k, free)
        qpos, going = np.array(starts, float), np.flatnonzero(left)
        for _ in range(_NEWTON_STEPS):
            poses = self._poses(qpos[going])
            steps = self._steps(poses, _errors(poses[-1], wanted), drives)
            qpos[going[:, None], free] += np.clip(steps, -_LONGEST_STEP, _LONGEST_STEP)
            going = going[np.abs(steps).max(axis=1) > _STANDS]
            if not len(going):
                break
        poses = self._poses(qpos)
        away = np.linalg.norm(_errors(poses[-1], wanted), axis=1)
        qpos[:, free] -= self._steps(poses, left[:, None] * twists, drives)
        turns = qpos[:, self._endless]
        qpos[:, self._endless] = (turns + np.pi) % (2 * np.pi) - np.pi
        return qpos, arriving & (away < search.tolerance)

    def _poses(self, qpos: Floats) -> Floats:
        """Return the poses of the root and of the links that move, (k + 1, n, 4, 4)."""
        positions = qpos.T[self._drivers] * self._multipliers[:, None] + self._offsets[:, None]
        basis = np.empty((*positions.shape, 3))
        basis[..., 0] = 1.0
        np.sin(positions, out=basis[..., 1])
        np.cos(positions, out=basis[..., 2])
        basis[self._slides, :, 1] = positions[self._slides]
        motions = (basis @ self._terms).reshape(*positions.shape, 4, 4)
        poses = np.empty((len(motions) + 1, len(qpos), 4, 4))
        poses[0] = np.eye(4)
        for i, motion in enumerate(motions):
            np.matmul(poses[i], motion, out=poses[i + 1])
        return poses

    def _steps(self, poses: Floats, errors: Floats, drives: Floats) -> Floats:
        """Return the joints' ways that correct errors of the last link that moves, (n, free).

        Args:
            poses: What `_poses` returned.
            errors: Place and turn in that link's frame, (n, 6) (m, rad).
            drives: Which coordinate that may move each joint follows, (k, free).
        """
        slopes = self._slopes(poses) @ drives
        across = slopes.transpose(0, 2, 1)
        return (across @ np.linalg.solve(slopes @ across + _DAMPED, errors[..., None]))[..., 0]

    def _slopes(self, poses: Floats) -> Floats:
        """Return how each joint moves the last link that moves, in its frame, (n, 6, k)."""
        moved, last = poses[1:, :, :3], poses[-1, :, :3]
        axes = (moved[..., :3] @ self._axes)[..., 0]
        both = np.empty((*axes.shape[:2], 2, 3))
        both[:, :, 0] = _cross(axes, last[..., 3] - moved[..., 3])
        both[:, :, 1] = axes
        both[self._slides, :, 0], both[self._slides, :, 1] = axes[self._slides], 0.0
        own = both @ last[..., :3]
        return own.reshape(*axes.shape[:2], 6).transpose(1, 2, 0)


def motion_terms(joint: Floats, axis: Floats, *, slides: bool) -> Floats:
    """Return what a joint does as A, B and C of A + B sin q + C cos q, or A + B q if it slides.

    Args:
        joint: Its pose in the frame of what carries it, (4, 4) (m).
        axis: In its own frame, unit length, (3,).
        slides: Whether it moves along the axis instead of about it.

    Returns:
        The three matrices, (3, 4, 4).
    """
    x, y, z = axis
    cross, along, eye = np.zeros((4, 4)), np.zeros((4, 4)), np.eye(4)
    cross[:3, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    along[:3, 3] = axis
    if slides:
        return joint @ np.array([eye, along, np.zeros((4, 4))])
    return joint @ np.array([eye + cross @ cross, cross, -cross @ cross])


def screw(pose: Floats) -> Floats:
    """Return the constant twists that lead to poses within a unit of time, (n, 6) (m, rad).

    Args:
        pose: (n, 4, 4) (m).
    """
    turn, place = rotation_vector(pose[:, :3, :3]), pose[:, :3, 3]
    angle = np.linalg.norm(turn, axis=1, keepdims=True)
    small = angle < _SMALL_ANGLE
    safe = np.where(small, 1.0, angle)
    factor = (1 - safe / (2 * np.tan(safe / 2))) / safe**2
    factor = np.where(small, 1 / 12 + angle**2 / 720, factor)
    aside = _cross(turn, place)
    return np.concatenate([place - aside / 2 + factor * _cross(turn, aside), turn], axis=1)


def _errors(poses: Floats, wanted: Floats) -> Floats:
    """Return what poses miss of one, place and turn in their own frames, (n, 6) (m, rad)."""
    back = poses[:, :3, :3].transpose(0, 2, 1)
    turn = back @ wanted[:3, :3]
    errors = np.empty((len(poses), 6))
    errors[:, :3] = (back @ (wanted - poses)[:, :3, 3:])[..., 0]
    twice = errors[:, 3:]  # the axis times twice the sine of the angle
    twice[:, 0] = turn[:, 2, 1] - turn[:, 1, 2]
    twice[:, 1] = turn[:, 0, 2] - turn[:, 2, 0]
    twice[:, 2] = turn[:, 1, 0] - turn[:, 0, 1]
    sine = np.sqrt((twice**2).sum(-1)) / 2
    cosine = (turn[:, 0, 0] + turn[:, 1, 1] + turn[:, 2, 2] - 1) / 2
    turning = sine > 0
    twice *= np.where(turning, np.arctan2(sine, cosine) / np.where(turning, 2 * sine, 1.0), 0.5)[
        :, None
    ]
    return errors


def _cross(one: Floats, other: Floats) -> Floats:
    """Return what `numpy.cross` does of vectors along the last axis, several times as fast."""
    crossed = np.empty(np.broadcast_shapes(one.shape, other.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        crossed[..., i] = one[..., j] * other[..., k] - one[..., k] * other[..., j]
    return crossed
