"""Where all parts of a cell are, for many states at once."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from robot_layouts.kinematics.chain import motion_terms
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.motion.model.bodies import WORLD, Bodies, RigidBody


class LinkPoses:
    """The parts of a cell and the joints between them, ordered for few and large products.

    What a joint does is A + B sin q + C cos q, or A + B q if it slides; the rows of one depth, of
    all robots, are computed at once.

    Attributes:
        rows: The row of each part in what `places` returns.
    """

    def __init__(self, bodies: Bodies, parts: Iterable[int]) -> None:
        """Prepare some parts, and all that carry them.

        Args:
            bodies: The cell.
            parts: Indices of its parts.
        """
        self._bodies = bodies
        depths = _depths(bodies.parts, {WORLD, *parts})
        tracks = [i for i in depths if bodies.parts[i].track is not None]
        moved = sorted((depth, i) for i, depth in depths.items() if i not in tracks)
        order = [i for _, i in moved]
        self.rows = {part: row for row, part in enumerate([*order, *tracks])}
        self._tracks = [bodies.parts[i].track for i in tracks]
        jointed = [bodies.parts[i] for i in order[1:]]
        self._count, self._jointed = len(self.rows), len(order)
        self._parents = np.array([self.rows[part.parent] for part in jointed], np.intp)
        ends = np.flatnonzero(np.diff([depth for depth, _ in moved])) + 1
        bounds = [*ends.tolist(), len(order)]
        self._levels = list(zip(bounds, bounds[1:], strict=False))
        trees = [bodies.models[part.robot].kinematics for part in jointed]
        links = [part.link for part in jointed]
        pick = list(zip(trees, links, strict=True))
        firsts = [bodies.slices[part.robot].start for part in jointed]
        drivers = [tree.drivers[i] + at for (tree, i), at in zip(pick, firsts, strict=True)]
        self._drivers = np.array(drivers, np.intp)
        self._factors = np.array([tree.multipliers[i] for tree, i in pick])[:, None]
        self._offsets = np.array([tree.offsets[i] for tree, i in pick])[:, None]
        self._slides = np.flatnonzero([tree.slides[i] for tree, i in pick])
        self._terms = np.array(
            [
                motion_terms(part.joint, tree.axes[i], slides=bool(tree.slides[i]))
                for part, (tree, i) in zip(jointed, pick, strict=True)
            ]
        ).reshape(-1, 3, 16)

    def places(self, qpos: Floats, times: Floats | None = None) -> Floats:
        """Return the world poses of the parts, (rows, n, 4, 4) (m).

        Args:
            qpos: Coordinates, (n, D) (rad, m).
            times: Where obstacles that move are, (n,) (s); None is 0.
        """
        count = len(qpos)
        poses = np.empty((self._count, count, 4, 4))
        poses[WORLD] = np.eye(4)
        if self._jointed > 1:
            self._place(poses[1 : self._jointed], self._motions(qpos))
        if self._tracks:
            moments = np.zeros(count) if times is None else times
            for row, track in enumerate(self._tracks, start=self._jointed):
                assert track is not None
                poses[row] = track.at(moments)
        return poses

    def _motions(self, qpos: Floats) -> Floats:
        """Return what each joint does, seen from the part that carries it, (joints, n, 4, 4)."""
        positions = qpos.T[self._drivers] * self._factors + self._offsets
        basis = np.empty((*positions.shape, 3))
        basis[..., 0] = 1.0
        np.sin(positions, out=basis[..., 1])
        np.cos(positions, out=basis[..., 2])
        if len(self._slides):
            basis[self._slides, :, 1] = positions[self._slides]
        return (basis @ self._terms).reshape(*positions.shape, 4, 4)

    def _place(self, poses: Floats, motions: Floats) -> None:
        """Fill in the poses of what hangs on joints, depth by depth."""
        first = self._levels[0][1] - 1 if self._levels else 0
        poses[:first] = motions[:first]  # those hang on the world
        for low, high in self._levels[1:]:
            own = slice(low - 1, high - 1)
            np.matmul(poses[self._parents[own] - 1], motions[own], out=poses[own])


def _depths(parts: tuple[RigidBody, ...], wanted: Iterable[int]) -> dict[int, int]:
    """Return how many joints away from the world some parts are, and those that carry them."""
    depths: dict[int, int] = {}

    def depth(part: int) -> int:
        if part not in depths:
            parent = parts[part].parent
            depths[part] = 0 if parent < 0 else depth(parent) + 1
        return depths[part]

    for part in wanted:
        depth(part)
    return depths
