"""Where robots might stand: all of a grid of seats tried at once for one robot after the other.

Workspaces and bodies are cells of one grid of the world here; reach is judged by sampled postures.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layouts.placing.arms import corners_of, unique_points
from layouts.placing.demands import Demand
from layouts.placing.scene import Scene
from layouts.placing.sites import Seat, Site
from layouts.placing.trials import AWKWARD, CRAMPED, FARTHEST, HELP, ROOM, UNREACHED, Seats
from robot_layouts.kinematics.rotations import Floats, pose_matrix

MOST_SEATS = 1500  # of one robot
TURNS = 8  # in which a base may face, of a whole turn
CELLS = 60_000  # of the grid, about
POINTS, CORNERS = 600, 80  # of a workspace, and of a body
SWEEPS = 5  # over all robots, from one random beginning

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Candidates:
    """Seats of one robot, and what it does from each.

    Attributes:
        seats: The seats, (n).
        bases: Poses of the base, (n, 4, 4).
        beyond: How far each demand is beyond its reach (m), (n, demands); infinite where it may
            not meet it.
        spaces: Cells of its workspace, (n, points).
        bodies: Cells of its body where it starts, (n, corners).
    """

    seats: tuple[Seat, ...]
    bases: Floats
    beyond: Floats
    spaces: Indices
    bodies: Indices


class Coarse:
    """A search over grids of seats."""

    def __init__(self, scene: Scene, demands: Sequence[Demand], clearance: float) -> None:
        """Take what is asked for; see `layouts.placing.trials.Trials`."""
        self._scene, self._demands, self._clearance = scene, tuple(demands), clearance
        seats = {name: tuple(grid_of_seats(scene.ground.sites)) for name in scene.robots}
        bases = {name: self._bases(name, seats[name]) for name in seats}
        self._grid = _Grid(np.concatenate([*bases.values()])[:, :3, 3], self._reaches())
        self.robots = {
            name: self._candidates(name, seats[name], bases[name], demands) for name in seats
        }

    def best(self, beginnings: int, kept: int, random: np.random.Generator) -> list[Seats]:
        """Return the best seats, the best first.

        Args:
            beginnings: How many random ones to better.
            kept: How many to return at most; they differ.
            random: Where randomness comes from.
        """
        found: dict[tuple[int, ...], float] = {}
        for _ in range(beginnings):
            chosen = {n: int(random.integers(len(c.seats))) for n, c in self.robots.items()}
            loss = self._better(chosen)
            found[tuple(chosen.values())] = loss
        ranked = sorted(found, key=lambda chosen: (found[chosen], chosen))[:kept]
        return [
            {name: c.seats[at] for at, (name, c) in zip(chosen, self.robots.items(), strict=True)}
            for chosen in ranked
        ]

    def _better(self, chosen: dict[str, int]) -> float:
        """Choose the best seat for one robot after the other until none changes its own."""
        loss = math.inf
        for _ in range(SWEEPS):
            before = dict(chosen)
            for name in chosen:
                losses = self._losses(name, chosen)
                chosen[name] = int(np.argmin(losses))
                loss = float(losses[chosen[name]])
            if chosen == before:
                break
        return loss

    def _losses(self, name: str, chosen: Mapping[str, int]) -> Floats:
        """Return the loss of each seat of a robot, beside the others where they are."""
        own = self.robots[name]
        others = {n: at for n, at in chosen.items() if n != name}
        beyond = own.beyond
        for other, at in others.items():
            beyond = np.minimum(beyond, self.robots[other].beyond[at])
        losses = UNREACHED * np.minimum(beyond, FARTHEST).sum(axis=1)
        bases = [self.robots[other].bases[at] for other, at in others.items()]
        awkward = self._scene.awkward(name, own.bases, bases)
        near = self._near(own)
        losses += AWKWARD * awkward / len(chosen) - HELP * near
        if not others:
            return losses
        field, bodies = self._grid.empty(), self._grid.empty()
        for other, at in others.items():
            field[np.unique(self.robots[other].spaces[at])] += 1.0
            bodies[self.robots[other].bodies[at]] = 1.0
        field[-1] = 0.0  # what lies outside is not shared
        share = field[own.spaces].mean(axis=1) / len(others)
        gaps = self._grid.distances(bodies)[own.bodies].min(axis=1)
        enough = min(self._scene.enough(name, other) for other in others)
        lacking = np.maximum(self._clearance - gaps, 0.0) / max(self._clearance, 0.1)
        return losses + CRAMPED * lacking - share - ROOM * np.minimum(gaps / enough, 1.0)

    def _near(self, own: Candidates) -> Floats:
        """Return the share of arms and their targets that each seat of a robot brings together."""
        allowed = sum(len(demand.arms) for demand in self._demands)
        return (own.beyond == 0).sum(axis=1) / max(allowed, 1)

    def _reaches(self) -> float:
        return max(robot.reach for robot in self._scene.robots.values())

    def _bases(self, name: str, seats: Sequence[Seat]) -> Floats:
        scene = self._scene
        poses = [scene.ground.in_world(name, scene.robots[name], seat) for seat in seats]
        return pose_matrix([p.position for p in poses], [p.quaternion for p in poses])

    def _candidates(
        self, name: str, seats: tuple[Seat, ...], bases: Floats, demands: Sequence[Demand]
    ) -> Candidates:
        scene = self._scene
        arms = [arm for arm in scene.arms.values() if arm.owner == name]
        beyond = np.full((len(seats), len(demands)), np.inf)
        for column, demand in enumerate(demands):
            for arm in arms:
                if arm.name in demand.arms:
                    far = arm.beyond(bases, demand.numbers)
                    beyond[:, column] = np.minimum(beyond[:, column], far)
        points = np.concatenate([unique_points(arm.points, self._grid.size) for arm in arms])
        corners = corners_of(scene.models[name], scene.start(name))
        return Candidates(
            seats,
            bases,
            beyond,
            self._grid.cells(bases, _some(points, POINTS)),
            self._grid.cells(bases, _some(unique_points(corners, self._grid.size), CORNERS)),
        )


class _Grid:
    """Cubes of the world around where bases may stand."""

    def __init__(self, bases: Floats, reach: float) -> None:
        low, high = bases.min(axis=0) - reach, bases.max(axis=0) + reach
        self.size = float((np.prod(high - low) / CELLS) ** (1 / 3))  # m
        self._low = low
        self._shape = np.ceil((high - low) / self.size).astype(int)

    def empty(self) -> Floats:
        """Return a number for each cell, and one for all that is outside."""
        return np.zeros(int(np.prod(self._shape)) + 1)

    def cells(self, bases: Floats, points: Floats) -> Indices:
        """Return in which cells points lie, (bases, points)."""
        places = points @ bases[:, :3, :3].transpose(0, 2, 1) + bases[:, None, :3, 3]
        cells = np.floor((places - self._low) / self.size).astype(np.intp)
        inside = ((cells >= 0) & (cells < self._shape)).all(axis=-1)
        _, ny, nz = self._shape.tolist()
        flat = (cells[..., 0] * ny + cells[..., 1]) * nz + cells[..., 2]
        return np.where(inside, flat, len(self.empty()) - 1)

    def distances(self, marked: Floats) -> Floats:
        """Return for each cell how far it is from what is marked (m), to about a cell."""
        from scipy.ndimage import distance_transform_edt

        free = marked[:-1].reshape(self._shape.tolist()) == 0
        away: Any = distance_transform_edt(free, sampling=self.size)
        return np.append(np.maximum(away.ravel() - self.size, 0.0), 10.0)


def grid_of_seats(sites: Sequence[Site]) -> list[Seat]:
    """Return seats all over some sites, `MOST_SEATS` at most, or few more."""
    planes = [site for site in sites if site.low[0] < site.high[0]]
    areas = [(s.high[0] - s.low[0]) * (s.high[1] - s.low[1]) for s in planes]
    step = max(math.sqrt(sum(areas) * TURNS / MOST_SEATS), 0.05) if planes else 0.05
    return [
        seat
        for number, site in enumerate(sites)
        for x in _along(site.low[0], site.high[0], step)
        for y in _along(site.low[1], site.high[1], step)
        for yaw in _turns(site)
        if (seat := site.seat(number, x, y, yaw)) is not None
    ]


def _along(low: float, high: float, step: float) -> list[float]:
    count = math.ceil((high - low) / step - 1e-9) + 1 if high > low else 1
    return np.linspace(low, high, count).tolist()


def _turns(site: Site) -> list[float]:
    low, high = site.turns
    whole = high - low >= 2 * math.pi
    count = TURNS if whole else round(TURNS * (high - low) / (2 * math.pi)) + 1
    return np.linspace(low, high, count, endpoint=not whole).tolist()


def _some(points: Floats, most: int) -> Floats:
    """Return some of many points, evenly chosen."""
    if len(points) <= most:
        return points
    return points[np.linspace(0, len(points) - 1, most).astype(int)]
