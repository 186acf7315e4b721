"""Whether the robots of a cell touch each other, themselves or anything else, and where."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinematics.rotations import Floats, transform
from layouts.validation.collisions import FAR
from layouts.validation.findings import length_text
from motion.bodies import Bodies
from robots import LayoutError
from robots.bodies.depth import overlap

Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Contact:
    """Two bodies of a cell, and how near they are.

    Attributes:
        names: ``left/panda_hand`` for a robot's link, else the name of the table or obstacle.
        owners: The robots, tables or obstacles that they belong to.
        distance: Between them (m); negative if they overlap, by how much.
        points: The nearest points of both, or those deepest in the other, world (m).
    """

    names: tuple[str, str]
    owners: tuple[str, str]
    distance: float
    points: tuple[tuple[float, ...], tuple[float, ...]]

    def __str__(self) -> str:
        """Say who, and how near or how deep."""
        one, other = self.names
        if self.distance < 0:
            return f"{one} and {other} overlap by {length_text(-self.distance)}"
        return f"{one} comes within {length_text(self.distance)} of {other}"


class Checker:
    """Tells whether some bodies of a cell come too near to each other; `Cell.checker` makes it.

    It keeps the bodies' last places, so that threads need one each.

    Attributes:
        cell: The cell.
        pairs: The pairs of its solids that count, (m, 2).
        clearance: How near they may come (m).
    """

    def __init__(self, cell: Bodies, pairs: NDArray[np.intp], clearance: float) -> None:
        """Take the pairs that count."""
        self.cell, self.pairs, self.clearance = cell, pairs, clearance

    def free(self, qpos: ArrayLike, times: ArrayLike | None = None) -> Flags:
        """Tell for each state whether nothing that counts is nearer than the clearance, (n,).

        Args:
            qpos: Coordinates, (n, D) (rad, m).
            times: Where obstacles that move are, (n,) (s); None is 0.

        Raises:
            LayoutError: If a shape is wrong.
        """
        states, times = self._states(qpos, times)
        frames = self._frames(states, times)
        return np.array(
            [
                all(self._gap(poses, *pair) for pair in self._near(poses, self.clearance))
                for poses in frames
            ],
            bool,
        )

    def contact(self, qpos: ArrayLike, time: float | None = None) -> Contact | None:
        """Return which two bodies are nearer than the clearance; the nearest ones, or None.

        Args:
            qpos: Coordinates, (D,) (rad, m).
            time: Where obstacles that move are (s); None is 0.

        Raises:
            LayoutError: If a shape is wrong.
        """
        nearest = self.nearest(qpos, time)
        if nearest is None or nearest.distance >= max(self.clearance, 1e-300):
            return None
        return nearest

    def nearest(self, qpos: ArrayLike, time: float | None = None) -> Contact | None:
        """Return which two bodies that count are nearest or overlap most; None beyond `FAR`.

        Args:
            qpos: Coordinates, (D,) (rad, m).
            time: Where obstacles that move are (s); None is 0.

        Raises:
            LayoutError: If a shape is wrong.
        """
        states, times = self._states(
            np.asarray(qpos, float)[None], None if time is None else np.array([time])
        )
        poses = self._frames(states, times)[0]
        best: Contact | None = None
        for a, b in self._near(poses, FAR):
            contact = self._contact(poses, a, b)
            if best is None or contact.distance < best.distance:
                best = contact
        return best

    def distance(self, qpos: ArrayLike, times: ArrayLike | None = None) -> Floats:
        """Return the least distance of any two bodies that count, (n,) (m); at most `FAR`.

        It is negative where they overlap, by how much.

        Args:
            qpos: Coordinates, (n, D) (rad, m).
            times: Where obstacles that move are, (n,) (s); None is 0.

        Raises:
            LayoutError: If a shape is wrong.
        """
        states, times = self._states(qpos, times)
        found = [
            self.nearest(state, None if times is None else float(times[i]))
            for i, state in enumerate(states)
        ]
        return np.array([FAR if near is None else near.distance for near in found])

    def edge_free(
        self,
        start: ArrayLike,
        end: ArrayLike,
        resolution: tuple[float, float] = (0.01, 0.05),
        times: tuple[float, float] | None = None,
    ) -> bool:
        """Tell whether all states on the straight way between two states are free, ends included.

        Args:
            start: Coordinates, (D,) (rad, m).
            end: Coordinates, (D,) (rad, m).
            resolution: How far any link may travel (m) and turn (rad) between two states that are
                looked at, at most.
            times: When the way begins and ends (s), for obstacles that move.

        Raises:
            LayoutError: If a shape is wrong.
        """
        (a, b), _ = self._states(np.stack([np.asarray(start, float), np.asarray(end, float)]), None)
        count = 2 + int(20 * np.abs(b - a).max())
        shares = np.linspace(0.0, 1.0, count)
        moments = None if times is None else times[0] + shares * (times[1] - times[0])
        return bool(self.free(a + shares[:, None] * (b - a), moments).all())

    # -- where everything is -----------------------------------------------------------------

    def _states(
        self, qpos: ArrayLike, times: ArrayLike | None
    ) -> tuple[Floats, NDArray[Any] | None]:
        states = np.asarray(qpos, float)
        if states.ndim != 2 or states.shape[1] != self.cell.size:
            raise LayoutError(
                f"joint positions have the shape {states.shape}; this cell takes"
                f" (n, {self.cell.size}): {', '.join(self.cell.robots)}"
            )
        if times is None:
            return states, None
        moments = np.broadcast_to(np.asarray(times, float), (len(states),))
        return states, moments

    def _frames(self, states: Floats, times: Floats | None) -> Floats:
        """Return the world poses of the solids, (n, solids, 4, 4)."""
        cell = self.cell
        links = cell.poses(states)
        index = {link: i for i, link in enumerate(cell.links)}
        poses = np.empty((len(states), len(cell.solids), 4, 4))
        for i, solid in enumerate(cell.solids):
            part = cell.parts[solid.part]
            if part.track is not None:
                at = part.track.at(np.zeros(len(states)) if times is None else times)
            elif part.robot:
                name = cell.models[part.robot].kinematics.links[part.link]
                at = links[:, index[part.robot, name]]
            else:
                at = np.eye(4)
            poses[:, i] = at @ solid.offset
        return poses

    @cached_property
    def _balls(self) -> tuple[Floats, Floats]:
        """Middle and radius of a ball around each solid, in its own frame."""
        corners = [solid.hull.corners for solid in self.cell.solids]
        middles = np.array([(c.min(axis=0) + c.max(axis=0)) / 2 for c in corners]).reshape(-1, 3)
        radii = [np.linalg.norm(c - m, axis=1).max() for c, m in zip(corners, middles, strict=True)]
        return middles, np.array(radii)

    def _near(self, poses: Floats, within: float) -> Iterator[tuple[int, int]]:
        """Yield the pairs of solids that may be within a distance (m), the likeliest first."""
        middles, radii = self._balls
        places = transform(poses, middles)
        a, b = self.pairs.T
        gaps = np.linalg.norm(places[a] - places[b], axis=1) - radii[a] - radii[b]
        order = np.argsort(gaps, kind="stable")
        for i in order[gaps[order] <= within].tolist():
            yield int(a[i]), int(b[i])

    # -- FCL ---------------------------------------------------------------------------------

    @cached_property
    def _objects(self) -> list[Any]:
        import fcl

        return [fcl.CollisionObject(solid.hull.geometry) for solid in self.cell.solids]

    def _placed(self, poses: Floats, *solids: int) -> list[Any]:
        import fcl

        for i in solids:
            place = fcl.Transform(poses[i, :3, :3], poses[i, :3, 3])
            self._objects[i].setTransform(place)
        return [self._objects[i] for i in solids]

    def _gap(self, poses: Floats, a: int, b: int) -> bool:
        """Whether two solids are not nearer than the clearance."""
        import fcl

        one, other = self._placed(poses, a, b)
        if self.clearance == 0.0:
            return fcl.collide(one, other, fcl.CollisionRequest(), fcl.CollisionResult()) == 0
        return fcl.distance(one, other) >= self.clearance

    def _contact(self, poses: Floats, a: int, b: int) -> Contact:
        import fcl

        request, result = fcl.DistanceRequest(enable_nearest_points=True), fcl.DistanceResult()
        distance = float(fcl.distance(*self._placed(poses, a, b), request, result))
        points: Any = result.nearest_points
        solids = self.cell.solids[a], self.cell.solids[b]
        if distance <= 0.0:
            corners = (
                transform(poses[i], solid.hull.corners)
                for i, solid in zip((a, b), solids, strict=True)
            )
            depth, points = overlap(*corners)
            distance = -depth
        one, other = (tuple(float(x) for x in point) for point in points)
        names, owners = (solids[0].name, solids[1].name), (solids[0].owner, solids[1].owner)
        return Contact(names, owners, distance, (one, other))
