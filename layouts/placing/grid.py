"""Base poses on a grid: all those of one robot are compared at once, for one robot after the other.

Workspaces and bodies are cells of one grid of the world here; reach is judged by sampled postures.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layouts.placing.bases import BasePose
from layouts.placing.cost import (
    CLEARANCE_COST,
    FARTHEST,
    GAP_VALUE,
    MISALIGNMENT_COST,
    MISSING_COST,
    REACH_VALUE,
    Bases,
    Cost,
    Requirement,
)
from layouts.placing.scene import SearchScene
from layouts.validation.findings import length_text
from layouts.validation.reach import RADIAN, Arm
from robot_layouts.core.progress import Progress
from robot_layouts.kinematics.rotations import Floats, pose_matrix, transform

CELLS = 60_000  # of the grid of the world, about
POINTS, CORNERS = 600, 80  # of a workspace, and of a body
SWEEPS = 5  # over all robots, from one random start
LIKELIEST = 12  # base poses from which an arm must get to a target, or comes nearest to it
STEPS = (0.1, 0.05, 0.02, 0.01)  # m; by which a base comes nearer to a target

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class RobotGrid:
    """Base poses of one robot, and what it does from each.

    Attributes:
        bases: The base poses, (n).
        matrices: The same in the world, (n, 4, 4).
        beyond: How far each requirement is beyond its reach (m), (n, requirements); infinite where
            it may not meet it.
        spaces: Cells of its workspace, (n, points).
        bodies: Cells of its body where it starts, (n, corners).
    """

    bases: Sequence[BasePose]
    matrices: Floats
    beyond: Floats
    spaces: Indices
    bodies: Indices


class GridSearch:
    """A search over grids of base poses."""

    def __init__(self, scene: SearchScene, cost: Cost) -> None:
        """Take what is asked for, and lay the grids."""
        self._scene, self._cost = scene, cost
        bases, matrices = scene.ground.grid(), dict[str, Floats]()
        for name, robot in scene.robots.items():
            poses = [scene.ground.in_world(name, robot, base) for base in bases]
            positions, quaternions = zip(*((p.position, p.quaternion) for p in poses), strict=True)
            matrices[name] = pose_matrix(positions, quaternions)
        self._cells = _Cells(np.concatenate([*matrices.values()])[:, :3, 3], scene.reach)
        self._grids = {n: self._robot_grid(n, bases, matrices[n]) for n in scene.robots}

    def best(self, starts: int, most: int, random: np.random.Generator) -> list[Bases]:
        """Return the best base poses, the best first.

        Args:
            starts: How many random ones to improve.
            most: How many to return at most; they differ.
            random: Source of randomness.
        """
        found: dict[tuple[int, ...], float] = {}
        for _ in range(starts):
            chosen = {n: int(random.integers(len(g.bases))) for n, g in self._grids.items()}
            cost = self._improve(chosen)
            found[tuple(chosen.values())] = cost
        ranked = sorted(found, key=lambda chosen: (found[chosen], chosen))[:most]
        return [
            {name: g.bases[i] for i, (name, g) in zip(chosen, self._grids.items(), strict=True)}
            for chosen in ranked
        ]

    def _improve(self, chosen: dict[str, int]) -> float:
        """Choose the best base pose of one robot after the other until none changes its own."""
        cost = math.inf
        for _ in range(SWEEPS):
            before = dict(chosen)
            for name in chosen:
                costs = self._costs(name, chosen)
                chosen[name] = int(np.argmin(costs))
                cost = float(costs[chosen[name]])
            if chosen == before:
                break
        return cost

    def _costs(self, name: str, chosen: Mapping[str, int]) -> Floats:
        """Return about what each base pose of a robot costs, with the others where they are."""
        own = self._grids[name]
        others = {n: (self._grids[n], i) for n, i in chosen.items() if n != name}
        beyond = own.beyond
        for grid, i in others.values():
            beyond = np.minimum(beyond, grid.beyond[i])
        costs = MISSING_COST * np.minimum(beyond, FARTHEST).sum(axis=1)
        matrices = [grid.matrices[i] for grid, i in others.values()]
        away = self._cost.misalignment(name, own.matrices, matrices)
        near = (own.beyond == 0).sum(axis=1) / max(self._cost.choices, 1)
        costs += MISALIGNMENT_COST * away / len(chosen) - REACH_VALUE * near
        if not others:
            return costs
        field, bodies = self._cells.empty(), self._cells.empty()
        for grid, i in others.values():
            field[np.unique(grid.spaces[i])] += 1.0
            bodies[grid.bodies[i]] = 1.0
        field[-1] = 0.0  # what lies outside is not shared
        share = field[own.spaces].mean(axis=1) / len(others)
        gaps = self._cells.distances(bodies)[own.bodies].min(axis=1)
        ample = min(self._scene.ample_gap(name, other) for other in others)
        costs += CLEARANCE_COST * self._cost.lacking(gaps)
        return costs - share - GAP_VALUE * np.minimum(gaps / ample, 1.0)

    def _robot_grid(self, name: str, bases: Sequence[BasePose], matrices: Floats) -> RobotGrid:
        scene, size = self._scene, self._cells.size
        arms = [arm for arm in scene.arms.values() if arm.owner == name]
        beyond = np.full((len(bases), len(self._cost.requirements)), np.inf)
        for column, requirement in enumerate(self._cost.requirements):
            for arm in arms:
                if arm.name in requirement.arms:
                    far = arm.beyond(matrices, requirement.numbers)
                    beyond[:, column] = np.minimum(beyond[:, column], far)
        points = np.concatenate([_unique_points(arm.sampled_poses[0], size) for arm in arms])
        model = scene.models[name]
        links = model.kinematics.forward(scene.start(name)[None])[0]
        corners = np.concatenate([transform(links[h.link], h.corners) for h in model.hulls])
        spaces = self._cells.of(matrices, _some(points, POINTS))
        bodies = self._cells.of(matrices, _some(_unique_points(corners, size), CORNERS))
        return RobotGrid(bases, matrices, beyond, spaces, bodies)

    # -- what cannot be met ------------------------------------------------------------------

    def unreachable(self, progress: Progress) -> dict[int, str]:
        """Return the requirements that no arm can meet, by number, each with what comes nearest."""
        found: dict[int, str] = {}
        for number, requirement in enumerate(self._cost.requirements):
            progress.tell(f"who can reach {requirement.target}")
            missing = self._least_missing(number, requirement)
            if missing is not None:
                found[number] = f"{requirement.target}: {missing}"
        return found

    def _least_missing(self, number: int, requirement: Requirement) -> str | None:
        """Say how far the nearest arm stays from a target; None if one gets there."""
        least, nearest = math.inf, ""
        arms = [self._scene.arms[name] for name in requirement.arms]
        for arm in sorted(arms, key=lambda arm: self._grids[arm.owner].beyond[:, number].min()):
            grid = self._grids[arm.owner]
            order = np.argsort(grid.beyond[:, number], kind="stable")[:LIKELIEST]
            missing = self._missing_nearby(arm, [grid.bases[i] for i in order], requirement)
            if missing is None:
                return None
            if missing < least:
                least, nearest = missing, arm.name
        if least == 0:
            return f"{nearest} would touch itself or a table there"
        turned = len(requirement.numbers) == 7
        note = f" (a turn of 1 rad counts as {RADIAN:g} m)" if turned else ""
        return f"{nearest} stays {length_text(least)} away{note}"

    def _missing_nearby(
        self, arm: Arm, bases: Sequence[BasePose], requirement: Requirement
    ) -> float | None:
        """Return how far an arm stays from a target (m); None if it gets there from some pose.

        From the best of the base poses it comes nearer by steps.
        """
        missing: dict[BasePose, float] = {}
        for base in bases:
            far = self._missing(arm, base, requirement)
            if far is None:
                return None
            missing[base] = far
        best = min(missing, key=lambda base: missing[base])
        for step in STEPS:
            for dx, dy in ((step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)):
                base = self._scene.ground.near(best, dx, dy)
                if base is None or base in missing:
                    continue
                far = self._missing(arm, base, requirement)
                if far is None:
                    return None
                missing[base] = far
                best = base if far < missing[best] else best
        return missing[best]

    def _missing(self, arm: Arm, base: BasePose, requirement: Requirement) -> float | None:
        """Return how far an arm stays away from there (m), 0 if it would touch; None if not."""
        scene = self._scene
        found = arm.solve([requirement.numbers], base=scene.placed(arm.owner, base).base)
        for qpos in found.qpos[found.solved]:
            if scene.free(arm.owner, scene.posture(arm.owner, base, qpos)):
                return None
        missing = found.missing + RADIAN * found.turn_missing
        return 0.0 if found.solved.any() else float(missing.min())


class _Cells:
    """Cubes of the world around where bases may stand."""

    def __init__(self, bases: Floats, reach: float) -> None:
        low, high = bases.min(axis=0) - reach, bases.max(axis=0) + reach
        self.size = float((np.prod(high - low) / CELLS) ** (1 / 3))  # m
        self._low = low
        self._shape = np.ceil((high - low) / self.size).astype(int)

    def empty(self) -> Floats:
        """Return a number for each cell, and one for all that is outside."""
        return np.zeros(int(np.prod(self._shape)) + 1)

    def of(self, bases: Floats, points: Floats) -> Indices:
        """Return in which cells points of a base's frame lie, (bases, points)."""
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


def _unique_points(points: Floats, size: float) -> Floats:
    """Return the middles of the cubes of some size (m) that points lie in, (n, 3)."""
    return (np.unique(np.floor(points / size), axis=0) + 0.5) * size


def _some(points: Floats, most: int) -> Floats:
    """Return some of many points, evenly chosen."""
    if len(points) <= most:
        return points
    return points[np.linspace(0, len(points) - 1, most).astype(int)]
