"""Trees of links: where every link is for many joint positions at once, and how it moves.

A tree is plain arrays, one row for each link. A link hangs on its parent by one joint, which turns
it about an axis, slides it along one, or is fixed; what moves the joints are coordinates, and
several joints may follow one coordinate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_layouts.kinematics.rotations import Floats, cross, rotation_about

FIXED = -1  # in ``drivers``: no coordinate moves the joint
_STILL = np.eye(4)


@dataclass(frozen=True, eq=False)
class Tree:
    """Links, each with the joint that carries it; parents stand before children.

    Attributes:
        links: Their names, the root first.
        parents: Index of each link's parent, (links,); -1 for the root.
        origins: Pose of each joint in the frame of the parent link, (links, 4, 4) (m).
        axes: Axis of motion in the joint's frame, unit length, (links, 3).
        slides: Whether the joint moves along its axis instead of about it, (links,).
        drivers: Index of the coordinate that moves the joint, (links,); `FIXED` for none.
        multipliers: Joint position per unit of that coordinate, (links,).
        offsets: Joint position where the coordinate is 0, (links,) (rad, m).
        coordinates: Names of the coordinates.
        limits: Their lower and upper limits, (coordinates, 2) (rad, m).
    """

    links: tuple[str, ...]
    parents: NDArray[np.intp]
    origins: Floats
    axes: Floats
    slides: NDArray[np.bool_]
    drivers: NDArray[np.intp]
    multipliers: Floats
    offsets: Floats
    coordinates: tuple[str, ...]
    limits: Floats

    def __post_init__(self) -> None:
        """Refuse arrays that do not fit each other.

        Raises:
            ValueError: If one has another shape, a parent stands behind its child, or a joint
                follows a coordinate that does not exist.
        """
        count = len(self.links)
        shapes: dict[str, tuple[int, ...]] = {
            "parents": (count,),
            "origins": (count, 4, 4),
            "axes": (count, 3),
            "slides": (count,),
            "drivers": (count,),
            "multipliers": (count,),
            "offsets": (count,),
            "limits": (len(self.coordinates), 2),
        }
        for name, shape in shapes.items():
            found = np.shape(getattr(self, name))
            if found != shape:
                raise ValueError(f"{name} has the shape {found}; {count} links need {shape}")
        if count == 0 or self.parents[0] != -1:
            raise ValueError("a tree needs a root, which comes first and has the parent -1")
        for i, parent in enumerate(self.parents.tolist()[1:], start=1):
            if not 0 <= parent < i:
                raise ValueError(
                    f"link {self.links[i]!r}, number {i}, hangs on number {parent}; parents stand"
                    " before their children"
                )
        if (self.drivers >= len(self.coordinates)).any() or (self.drivers < FIXED).any():
            raise ValueError(
                f"drivers are {self.drivers.tolist()}; there are {len(self.coordinates)}"
                " coordinates"
            )

    def link(self, name: str) -> int:
        """Return the index of a link.

        Raises:
            KeyError: If there is no such link.
        """
        return self._index[name]

    @cached_property
    def bodies(self) -> tuple[int, ...]:
        """For each link the index of the first link that it is rigidly fixed to."""
        bodies = [0]
        for i in range(1, len(self.links)):
            bodies.append(i if self.drivers[i] != FIXED else bodies[self.parents[i]])
        return tuple(bodies)

    def carrier(self, body: int) -> int:
        """Return the body that a rigid body hangs on; -1 for the root's.

        Args:
            body: One of ``bodies``.
        """
        return -1 if body == 0 else self.bodies[self.parents[body]]

    def path(self, link: int) -> tuple[int, ...]:
        """Return the links from the root to a link, both included."""
        path = [link]
        while path[-1] > 0:
            path.append(int(self.parents[path[-1]]))
        return tuple(reversed(path))

    def towards(self, links: Sequence[int]) -> Tree:
        """Return the tree of only those links that some links hang on, and these; much faster.

        The coordinates stay the same, also those that move none of the links that are left.

        Args:
            links: Indices of the links that are of interest.
        """
        kept = sorted({0, *(at for link in links for at in self.path(link))})
        parents = [-1, *(kept.index(self.parents[at]) for at in kept[1:])]
        rows: dict[str, Any] = {
            name: getattr(self, name)[kept]
            for name in ("origins", "axes", "slides", "drivers", "multipliers", "offsets")
        }
        names = tuple(self.links[at] for at in kept)
        return replace(self, links=names, parents=np.array(parents), **rows)

    def forward(self, qpos: Floats) -> Floats:
        """Return the poses of all links in the frame of the root, (n, links, 4, 4).

        Args:
            qpos: Coordinates, (n, coordinates) (rad, m).
        """
        poses = np.empty((len(qpos), len(self.links), 4, 4))
        poses[:, 0] = np.eye(4)
        for i in range(1, len(self.links)):
            poses[:, i] = poses[:, self.parents[i]] @ self.origins[i]
            if self.drivers[i] != FIXED:
                position = self.multipliers[i] * qpos[:, self.drivers[i]] + self.offsets[i]
                poses[:, i] = poses[:, i] @ self.motion(i, position)
        return poses

    def motion(self, link: int, position: Floats) -> Floats:
        """Return what a joint does to its link, (…, 4, 4).

        Args:
            link: Index of the link that it carries.
            position: Joint positions, (…) (rad or m).
        """
        motion = np.empty((*position.shape, 4, 4))
        motion[:] = _STILL
        if self.slides[link]:
            motion[..., :3, 3] = position[..., None] * self.axes[link]
        else:
            motion[..., :3, :3] = rotation_about(self.axes[link].tolist(), position)
        return motion

    def jacobian(
        self, poses: Floats, link: int, coordinates: Sequence[int] | None = None
    ) -> Floats:
        """Return how a link moves per unit of some coordinates, in the root's frame.

        Joints that follow one coordinate move together.

        Args:
            poses: What `forward` returned, (n, links, 4, 4).
            link: Index of the link.
            coordinates: Indices of coordinates; None for all.

        Returns:
            Shape (n, 6, coordinates): the velocity of the link's origin (rows 0 to 2, m per unit),
            and its angular velocity (rows 3 to 5, rad per unit).
        """
        chosen = range(len(self.coordinates)) if coordinates is None else coordinates
        column = {coordinate: i for i, coordinate in enumerate(chosen)}
        linear, angular = np.zeros((2, len(poses), len(column), 3))  # of a point at the root
        driven = [at for at in self.path(link) if self.drivers[at] != FIXED]
        moving = [at for at in driven if self.drivers[at] in column]
        axes = np.empty((len(poses), len(moving), 3))
        for k, at in enumerate(moving):
            axes[:, k] = self.multipliers[at] * (poses[:, at, :3, :3] @ self.axes[at])
        ways = cross(poses[:, moving][..., :3, 3], axes)
        for k, at in enumerate(moving):
            i = column[self.drivers[at]]
            if self.slides[at]:
                linear[:, i] += axes[:, k]
            else:
                angular[:, i] += axes[:, k]
                linear[:, i] += ways[:, k]
        linear += cross(angular, poses[:, link, None, :3, 3])
        return np.concatenate([linear.transpose(0, 2, 1), angular.transpose(0, 2, 1)], axis=1)

    @cached_property
    def _index(self) -> dict[str, int]:
        return {link: i for i, link in enumerate(self.links)}
