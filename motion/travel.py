"""How far the parts of a cell travel at most on a straight way between two states."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from kinematics.rotations import Floats, rotation_vector, transform
from motion.bodies import Bodies
from motion.obstacles import Track
from robots import LayoutError
from robots.common.bounds import FAR, checked_number

FIRST = 8  # states that are looked at together at first; then always twice as many
MOST = 64


class Travel:
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
        self._slides = np.zeros((count, bodies.size, bodies.size))  # and per length of a slide
        self._stretch = np.zeros(bodies.size)
        for part, radius in enumerate(radii):
            self._follow(part, radius)
        self._tracks = [
            _Way.of(part.track, radius)
            for part, radius in zip(bodies.parts, radii, strict=True)
            if part.track is not None
        ]

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
        moved = np.abs(end - start)
        out = np.maximum(np.abs(start), np.abs(end)) + self._stretch
        ways, turns = (self._ways + self._slides @ out) @ moved, self._turns @ moved
        most = max(ways.max(initial=0.0) / way, turns.max(initial=0.0) / turn)
        for track in self._tracks if times is not None else ():
            travelled, turned = track.between(*times) if times else (0.0, 0.0)
            most = max(most, travelled / way, turned / turn)
        return max(1, int(np.ceil(most - 1e-9)))

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
                self._slides[part, driver] += factor * slides
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

    def between(self, start: float, end: float) -> tuple[float, float]:
        """Return how far it leads (m) and turns (rad) between two times (s)."""
        ways, turns = (
            np.interp([start, end], self._times, values) for values in (self._ways, self._turns)
        )
        return float(abs(ways[1] - ways[0])), float(abs(turns[1] - turns[0]))


@lru_cache(maxsize=256)
def _order(steps: int) -> Floats:
    """Return 0, 1, a half, a quarter, three quarters, … of the way, (steps + 1,)."""
    bits = max(1, int(np.ceil(np.log2(steps + 1))))
    every = np.arange(2**bits)
    mirrored = np.zeros_like(every)
    for _ in range(bits):
        mirrored, every = mirrored * 2 + every % 2, every // 2
    inner = mirrored[(mirrored > 0) & (mirrored < steps)]
    order = np.concatenate([[0, steps], inner]) / steps
    order.setflags(write=False)
    return order


def in_halves(steps: int) -> Iterator[Floats]:
    """Yield which shares of a way to look at together: both ends and its middle first.

    Args:
        steps: Into how many steps the way is cut.
    """
    order, first, size = _order(steps), 0, FIRST
    while first < len(order):
        yield order[first : first + size]
        first, size = first + size, min(2 * size, MOST)


def _radii(bodies: Bodies) -> list[float]:
    """Return for each part the distance of its farthest corner from its origin (m)."""
    radii = [0.0] * len(bodies.parts)
    for solid in bodies.solids:
        corners = transform(solid.offset, solid.hull.corners)
        radii[solid.part] = max(radii[solid.part], float(np.linalg.norm(corners, axis=1).max()))
    return radii
