"""How far the parts of a cell travel at most on a straight way between two states."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.bounds import FAR, checked_number
from robot_layouts.kinematics.rotations import Floats, rotation_vector, transform
from robot_layouts.kinematics.tree import FIXED
from robot_layouts.motion.model.bodies import Bodies
from robot_layouts.motion.model.obstacles import Track
from robots import LayoutError


class Intervals(NamedTuple):
    """Intervals of all coordinates, straight or not.

    Attributes:
        starts: When each begins, (n,) (s).
        ends: When each ends, (n,) (s).
        lengths: How far each coordinate goes at most, back and forth, (n, D) (rad, m).
        out: How far from 0 each gets at most, (n, D) (rad, m).
    """

    starts: Floats
    ends: Floats
    lengths: Floats
    out: Floats

    def only(self, which: NDArray[Any]) -> Intervals:
        """Return some of them."""
        return Intervals(*(column[which] for column in self))


class TravelBounds:
    """Bounds of how far the points of a cell's parts travel, and how far the parts turn."""

    def __init__(self, bodies: Bodies) -> None:
        """Take the lengths of the links between joints.

        A point of a part travels no farther than all joints that carry it turn, each times its
        distance from the joint; and that is no longer than the links and slides between.
        """
        self._bodies = bodies
        count, radii = len(bodies.parts), _radii(bodies)
        self._turns = np.zeros((count, bodies.size))  # of each part, per unit of each coordinate
        self._ways = np.zeros((count, bodies.size))
        self._sliding = _sliding(bodies)
        self._slides = np.zeros((count, bodies.size, len(self._sliding)))  # and of each slide
        self._stretch = np.zeros(bodies.size)
        for part, radius in enumerate(radii):
            self._follow(part, radius)
        self._tracks = {
            i: _Way.of(part.track, radius)
            for i, (part, radius) in enumerate(zip(bodies.parts, radii, strict=True))
            if part.track is not None
        }
        self._common = list(self._gather_common())

    def steps(
        self,
        start: Floats,
        end: Floats,
        resolution: tuple[float, float],
        times: tuple[float, float] | None = None,
    ) -> int:
        """Return into how many steps a way is cut; 1 at least.

        Args:
            start: Coordinates, (D,) (rad, m).
            end: Coordinates, (D,) (rad, m).
            resolution: How far any point may travel (m) and any part turn (rad) in one step.
            times: When the way begins and ends (s), for obstacles that move.

        Raises:
            LayoutError: If the resolution is not positive.
        """
        way, turn = (
            checked_number("resolution", value, 1e-9, FAR, LayoutError) for value in resolution
        )
        ways = self._shares(start, end).sum(axis=1)
        turns = self._turns @ np.abs(end - start)
        most = max(ways.max(initial=0.0) / way, turns.max(initial=0.0) / turn)
        for track in self._tracks.values() if times is not None else ():
            travelled, turned = track.fastest(*times) if times else (0.0, 0.0)
            most = max(most, travelled / way, turned / turn)
        return max(1, int(np.ceil(most - 1e-9)))

    def between(
        self, start: Floats, end: Floats, times: tuple[float, float] | None = None
    ) -> Floats:
        """Return how much the distance between two parts changes at most, (parts, parts) (m).

        What moves both of them does not count.

        Args:
            start: Coordinates, (D,) (rad, m).
            end: Coordinates, (D,) (rad, m).
            times: When the way begins and ends (s), for obstacles that move.
        """
        shares = self._shares(start, end)
        ways = shares.sum(axis=1)
        for part, track in self._tracks.items() if times is not None else ():
            ways[part] = track.fastest(*times)[0] if times else 0.0
        changes = ways[:, None] + ways
        for parts, columns, common in self._common:
            moved = shares[parts, columns]
            both = (common * (moved[:, None] + moved)).sum(axis=-1)
            changes[np.ix_(parts, parts)] -= both
        return changes

    def along(self, ways: Intervals) -> tuple[Floats, Floats]:
        """Return how far any point of each part travels, and how far the part turns, at most.

        Returns:
            Both for each way, (n, parts) (m) and (rad).
        """
        moved, turned = ways.lengths @ self._ways.T, ways.lengths @ self._turns.T
        for i, coordinate in enumerate(self._sliding.tolist()):
            out = ways.out[:, coordinate] + self._stretch[coordinate]
            moved += out[:, None] * (ways.lengths @ self._slides[..., i].T)
        for part, track in self._tracks.items():
            moved[:, part], turned[:, part] = track.between(ways.starts, ways.ends)
        return moved, turned

    def nearing(self, ways: Intervals, moved: Floats, parts: NDArray[np.intp]) -> Floats:
        """Return how much nearer to each other two parts come at most, a pair on each way (m).

        What moves both of them does not count.

        Args:
            ways: The ways.
            moved: How far both travel, as `along` says, (n, 2) (m).
            parts: Their indices, (n, 2).
        """
        changes = moved.sum(axis=1)
        out = ways.out[:, self._sliding] + self._stretch[self._sliding]
        for own, columns, common in self._common:
            pairs = np.flatnonzero(np.isin(parts, own).all(axis=1))
            one, other = np.searchsorted(own, parts[pairs]).T
            for part in parts[pairs].T:
                slides = np.einsum("njs,ns->nj", self._slides[part, columns], out[pairs])
                shares = (self._ways[part, columns] + slides) * ways.lengths[pairs, columns]
                changes[pairs] -= (common[one, other] * shares).sum(axis=1)
        return changes

    def _shares(self, start: Floats, end: Floats) -> Floats:
        """Return how far each coordinate takes the points of each part at most, (parts, D) (m)."""
        out = np.maximum(np.abs(start), np.abs(end)) + self._stretch
        return (self._ways + self._slides @ out[self._sliding]) * np.abs(end - start)

    def _gather_common(self) -> Iterator[tuple[NDArray[np.intp], slice, Floats]]:
        """Yield for each robot its parts, its coordinates, and which of these move two parts alike.

        A coordinate does where all joints that follow it carry both parts, or neither.
        """
        parts = self._bodies.parts
        for robot, columns in self._bodies.slices.items():
            own = [i for i, part in enumerate(parts) if part.robot == robot]
            paths = [set(self._path(i)) for i in own]
            tree = self._bodies.models[robot].kinematics
            common = np.ones((len(own), len(own), columns.stop - columns.start))
            for i, j in product(range(len(own)), repeat=2):
                for part in paths[i] ^ paths[j]:
                    common[i, j, int(tree.drivers[parts[part].link])] = 0.0
            yield np.array(own, np.intp), columns, common

    def _path(self, part: int) -> Iterator[int]:
        while self._bodies.parts[part].parent >= 0:
            yield part
            part = self._bodies.parts[part].parent

    def _follow(self, part: int, radius: float) -> None:
        """Write down for one part all joints that carry it."""
        bodies, at, length = self._bodies, part, radius
        slides = np.zeros(bodies.size)
        while bodies.parts[at].parent >= 0:
            here = bodies.parts[at]
            tree = bodies.models[here.robot].kinematics
            driver = int(tree.drivers[here.link]) + bodies.slices[here.robot].start
            factor = abs(float(tree.multipliers[here.link]))
            if tree.slides[here.link]:
                self._ways[part, driver] += factor
                slides[driver] += factor
                self._stretch[driver] = max(
                    self._stretch[driver],
                    abs(float(tree.offsets[here.link])) / max(factor, 1e-9),
                )
            else:
                self._turns[part, driver] += factor
                self._ways[part, driver] += factor * length
                self._slides[part, driver] += factor * slides[self._sliding]
            length += float(np.linalg.norm(here.joint[:3, 3]))
            at = here.parent


class _Way:
    """How far a track leads until each of its times, and how far it turns."""

    def __init__(self, times: Floats, ways: Floats, turns: Floats) -> None:
        self._times, self._ways, self._turns = times, ways, turns

    @classmethod
    def of(cls, track: Track, radius: float) -> _Way:
        """Take a track and the distance of a body's farthest corner from its origin (m)."""
        steps = np.linalg.norm(np.diff(track.poses[:, :3, 3], axis=0), axis=1)
        changes = np.swapaxes(track.poses[:-1, :3, :3], -1, -2) @ track.poses[1:, :3, :3]
        turns = np.linalg.norm(rotation_vector(changes), axis=-1)
        ways = steps + radius * turns
        sums = (np.concatenate([[0.0], np.cumsum(values)]) for values in (ways, turns))
        return cls(track.times, *sums)

    def between(self, starts: Floats, ends: Floats) -> tuple[Floats, Floats]:
        """Return how far it leads (m) and turns (rad) from some times to others, both (n,)."""
        way, turn = (
            np.interp(ends, self._times, sums) - np.interp(starts, self._times, sums)
            for sums in (self._ways, self._turns)
        )
        return way, turn

    def fastest(self, start: float, end: float) -> tuple[float, float]:
        """Return how far it would lead (m) and turn (rad) between two times at full speed.

        Full is the greatest speed that there is between them.
        """
        start, end = min(start, end), max(start, end)
        inner = self._times[(self._times > start) & (self._times < end)]
        moments = np.unique([start, *inner, end])
        way, turn = (
            float(
                (np.diff(np.interp(moments, self._times, sums)) / np.diff(moments)).max(initial=0.0)
            )
            for sums in (self._ways, self._turns)
        )
        return way * (end - start), turn * (end - start)


def _sliding(bodies: Bodies) -> NDArray[np.intp]:
    """Return the coordinates that move a slide."""
    coordinates = {
        int(tree.drivers[i]) + bodies.slices[name].start
        for name, model in bodies.models.items()
        for tree in (model.kinematics,)
        for i in np.flatnonzero(tree.slides & (tree.drivers != FIXED)).tolist()
    }
    return np.array(sorted(coordinates), np.intp)


def _radii(bodies: Bodies) -> list[float]:
    """Return for each part the distance of its farthest corner from its origin (m)."""
    radii = [0.0] * len(bodies.parts)
    for solid in bodies.solids:
        corners = transform(solid.offset, solid.hull.corners)
        radii[solid.part] = max(radii[solid.part], float(np.linalg.norm(corners, axis=1).max()))
    return radii
