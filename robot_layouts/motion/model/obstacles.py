"""What robots may not run into besides each other: bodies that stand, move as told, or are held."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_layouts.core.bounds import (
    FAR,
    UNIT_TOLERANCE,
    as_float,
    checked_numbers,
    expect_unit,
    shown,
)
from robot_layouts.kinematics.rotations import Floats, pose_matrix, quaternion_of
from robots import AssetError, LayoutError
from robots.bodies.hulls import SIDES, Hull, convex_hull, require_packages
from robots.descriptor import IDENTITY

_STILL = np.eye(4)


@dataclass(frozen=True, eq=False)
class Track:
    """How a body moves: poses at some times, straight and evenly turned between them.

    Before the first time and after the last one it stands still.

    Attributes:
        times: Increasing, (T,) (s).
        poses: World poses, (T, 4, 4) (m).
    """

    times: Floats
    poses: Floats

    def __post_init__(self) -> None:
        """Refuse times and poses that do not fit each other.

        Raises:
            LayoutError: If they do not, or one of them is invalid.
        """
        times, poses = _array("a track's times", self.times), _array("its poses", self.poses)
        if times.ndim != 1 or not len(times) or poses.shape != (len(times), 4, 4):
            raise LayoutError(
                f"a track has times of shape {times.shape} and poses of shape {poses.shape}; it"
                " takes (T,) and (T, 4, 4)"
            )
        if not _meant(times) or (np.diff(times) <= 0).any():
            raise LayoutError(
                f"the times of a track must increase and be finite, {FAR:g} s at most"
            )
        for pose in poses:
            _checked_pose("a pose of a track", pose)
        times.setflags(write=False)
        poses.setflags(write=False)
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "poses", poses)

    def at(self, times: ArrayLike) -> Floats:
        """Return the world poses at some times, (n, 4, 4) (m).

        Args:
            times: (n,) (s).
        """
        asked = np.clip(np.asarray(times, float), self.times[0], self.times[-1])
        after = np.clip(np.searchsorted(self.times, asked, side="right"), 1, None)
        after = np.minimum(after, len(self.times) - 1)
        before = np.maximum(after - 1, 0)
        span = np.where(after > before, self.times[after] - self.times[before], 1.0)
        share = ((asked - self.times[before]) / span)[:, None]
        quaternions = self._quaternions
        one, other = quaternions[before], quaternions[after]
        start, end = self.poses[before, :3, 3], self.poses[after, :3, 3]
        return pose_matrix(start + share * (end - start), _between(one, other, share))

    @cached_property
    def _quaternions(self) -> Floats:
        return quaternion_of(self.poses[:, :3, :3])


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A body in a robot's way.

    `box`, `sphere`, `cylinder` and `mesh` make obstacles.

    Attributes:
        name: Its name, for messages; no robot, table or other obstacle of a cell may have it.
        shapes: Corners of its convex parts in its own frame, each (n, 3) (m).
        pose: Its world pose, (4, 4) (m), or a `Track`. Of a body that is held: its pose in the
            frame of the TCP link that holds it.
    """

    name: str
    shapes: tuple[Floats, ...]
    pose: Floats | Track = field(default_factory=_STILL.copy)

    def __post_init__(self) -> None:
        """Refuse a body without a name, a volume or a place.

        Raises:
            LayoutError: If it is one.
        """
        if not (isinstance(self.name, str) and self.name and self.name.isprintable()):
            raise LayoutError(f"an obstacle's name is {shown(self.name)}; it takes a text")
        if not isinstance(self.shapes, (tuple, list)) or not self.shapes:
            raise LayoutError(
                f"obstacle {self.name!r} has no shape; it needs a tuple of one at least, not"
                f" {shown(self.shapes)}"
            )
        shapes = tuple(_array(f"a shape of obstacle {self.name!r}", s) for s in self.shapes)
        for corners in shapes:
            if corners.ndim != 2 or corners.shape[1] != 3 or not _meant(corners):
                raise LayoutError(
                    f"a shape of obstacle {self.name!r} is {shown(corners.tolist())}; it takes the"
                    f" corners of a convex body, (n, 3) finite numbers, {FAR:g} m at most"
                )
        object.__setattr__(self, "shapes", shapes)
        if not isinstance(self.pose, Track):
            pose = _array(f"the pose of obstacle {self.name!r}", self.pose)
            _checked_pose(f"the pose of obstacle {self.name!r}", pose)
            object.__setattr__(self, "pose", pose)

    @property
    def moves(self) -> bool:
        """Whether it is somewhere else at other times."""
        return isinstance(self.pose, Track)

    @cached_property
    def hulls(self) -> tuple[Hull, ...]:
        """Its convex parts, in its own frame.

        Raises:
            LayoutError: If one has no volume.
            MissingPackageError: If trimesh or python-fcl is not installed.
        """
        require_packages()
        try:
            return tuple(convex_hull(0, s, f"obstacle {self.name!r}") for s in self.shapes)
        except AssetError as error:
            raise LayoutError(str(error)) from error

    def poses(self, times: ArrayLike | None, count: int) -> Floats:
        """Return its poses at some times, (count, 4, 4) (m).

        Args:
            times: (count,) (s); None is 0 for all of them.
            count: How many.
        """
        if isinstance(self.pose, Track):
            return self.pose.at(np.zeros(count) if times is None else times)
        return np.broadcast_to(self.pose, (count, 4, 4))

    def moved(self, pose: ArrayLike | Track) -> Obstacle:
        """Return the same body elsewhere, at a pose, (4, 4) (m), or along a track."""
        body = replace(self, pose=pose)
        vars(body)["hulls"] = self.hulls  # computed once, and shared with what is known of them
        return body


@dataclass(frozen=True, eq=False)
class Held:
    """A body that an arm holds and carries.

    It may touch the hand that holds it, and nothing else.

    Attributes:
        place: The arm: a robot's name in the layout, or a limb's.
        obstacle: The body; its pose is that in the frame of the arm's TCP link.
    """

    place: str
    obstacle: Obstacle

    def __post_init__(self) -> None:
        """Refuse what is no body, and one that moves by itself.

        Raises:
            LayoutError: If it is one.
        """
        if not isinstance(self.obstacle, Obstacle):
            raise LayoutError(f"{self.place} holds {shown(self.obstacle)}; it takes an Obstacle")
        if self.obstacle.moves:
            raise LayoutError(
                f"obstacle {self.obstacle.name!r} follows a track; what {self.place} holds has a"
                " fixed pose in the frame of its TCP link"
            )


def box(
    name: str,
    size: Sequence[float],
    position: Sequence[float] = (0.0, 0.0, 0.0),
    quaternion: Sequence[float] = IDENTITY,
) -> Obstacle:
    """Return a box.

    Args:
        name: Its name.
        size: Its lengths along its own x, y and z (m).
        position: Its middle (m).
        quaternion: Its orientation, wxyz.

    Raises:
        LayoutError: If a number is invalid.
    """
    lengths = checked_numbers(f"the size of {name}", size, 3, FAR, LayoutError, "m")
    for length in lengths:
        _positive(f"a length of {name}", length)
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    return Obstacle(name, (signs * lengths / 2,), _pose(name, position, quaternion))


def sphere(name: str, radius: float, position: Sequence[float] = (0.0, 0.0, 0.0)) -> Obstacle:
    """Return a ball; a polytope that contains it, 1 % larger at its corners, stands for it.

    Args:
        name: Its name.
        radius: Its radius (m).
        position: Its middle (m).

    Raises:
        LayoutError: If a number is invalid.
    """
    radius = _positive(f"the radius of {name}", radius)
    require_packages()
    import trimesh

    ball: Any = trimesh.creation.icosphere(subdivisions=3, radius=1.0)
    within = np.einsum("ij,ij->i", ball.face_normals, ball.triangles_center).min()
    corners = np.asarray(ball.vertices, float) * (radius / within)
    return Obstacle(name, (corners,), _pose(name, position, IDENTITY))


def cylinder(
    name: str,
    radius: float,
    length: float,
    position: Sequence[float] = (0.0, 0.0, 0.0),
    quaternion: Sequence[float] = IDENTITY,
) -> Obstacle:
    """Return a cylinder along its own z; a prism around it, 0.5 % wider, stands for it.

    Args:
        name: Its name.
        radius: Its radius (m).
        length: Its length (m).
        position: Its middle (m).
        quaternion: Its orientation, wxyz.

    Raises:
        LayoutError: If a number is invalid.
    """
    radius = _positive(f"the radius of {name}", radius) / np.cos(np.pi / SIDES)
    half = _positive(f"the length of {name}", length) / 2
    angles = np.arange(SIDES) * (2 * np.pi / SIDES)
    circle = np.stack([radius * np.cos(angles), radius * np.sin(angles)], axis=-1)
    ends = [np.column_stack([circle, np.full(SIDES, z)]) for z in (-half, half)]
    return Obstacle(name, (np.concatenate(ends),), _pose(name, position, quaternion))


def mesh(
    name: str,
    path: str | os.PathLike[str],
    position: Sequence[float] = (0.0, 0.0, 0.0),
    quaternion: Sequence[float] = IDENTITY,
    scale: Sequence[float] = (1.0, 1.0, 1.0),
) -> Obstacle:
    """Return the convex hull of a mesh.

    Args:
        name: Its name.
        path: A mesh file that trimesh reads (m).
        position: Of the mesh's origin (m).
        quaternion: Orientation of the mesh, wxyz.
        scale: Factors along the mesh's x, y and z.

    Raises:
        AssetError: If the mesh cannot be read, or has no volume.
        LayoutError: If a number is invalid.
        MissingPackageError: If trimesh is not installed.
    """
    from robots.urdf.mesh_files import read_corners

    if not isinstance(path, (str, os.PathLike)):
        raise LayoutError(f"the mesh of {name} is {shown(path)}; it takes a file's path")
    factors = checked_numbers(f"the scale of {name}", scale, 3, FAR, LayoutError)
    corners = read_corners(os.fspath(path), factors, f"obstacle {name!r}", os.fspath(path))
    return Obstacle(name, (corners,), _pose(name, position, quaternion))


def _pose(name: str, position: Sequence[float], quaternion: Sequence[float]) -> Floats:
    place = checked_numbers(f"the position of {name}", position, 3, FAR, LayoutError, "m")
    turn = checked_numbers(f"the quaternion of {name}", quaternion, 4, FAR, LayoutError)
    expect_unit(f"the quaternion of {name}", turn, LayoutError)
    return pose_matrix(place, np.array(turn) / float(np.linalg.norm(turn)))


def _positive(what: str, value: Any) -> float:
    number = as_float(value)
    if number is None or not 0 < number <= FAR:
        raise LayoutError(f"{what} is {shown(value)} m; it must be greater than 0, {FAR:g} at most")
    return number


def _array(what: str, numbers: Any) -> Floats:
    try:
        return np.array(numbers, float)
    except (TypeError, ValueError):
        raise LayoutError(f"{what}: {shown(numbers)} are no numbers") from None


def _meant(numbers: Floats) -> bool:
    """Tell whether all numbers are finite and no farther from 0 than `FAR`."""
    return bool((np.abs(numbers) <= FAR).all())


def _checked_pose(what: str, pose: NDArray[Any]) -> None:
    """Refuse what is no pose.

    Raises:
        LayoutError: If it is not a pose.
    """
    if pose.shape != (4, 4) or not _meant(pose):
        raise LayoutError(
            f"{what} is {shown(pose.tolist())}; it takes 4 x 4 finite numbers, {FAR:g} at most"
        )
    turn = pose[:3, :3]
    if (pose[3] != _STILL[3]).any() or np.abs(turn @ turn.T - np.eye(3)).max() > UNIT_TOLERANCE:
        raise LayoutError(
            f"{what} is {shown(pose.tolist())}; it takes a rotation matrix and a position, above"
            " the row 0, 0, 0, 1"
        )
    if np.linalg.det(turn) < 0:
        raise LayoutError(f"{what} mirrors; it takes a rotation matrix")


def _between(one: Floats, other: Floats, share: Floats) -> Floats:
    """Return quaternions evenly turned from one to another, the short way, (n, 4)."""
    cosine = np.einsum("ni,ni->n", one, other)[:, None]
    other, cosine = np.where(cosine < 0, -other, other), np.abs(cosine)
    angle = np.arccos(np.minimum(cosine, 1.0))
    small = angle < 1e-6
    sine = np.where(small, 1.0, np.sin(angle))
    first = np.where(small, 1 - share, np.sin((1 - share) * angle) / sine)
    second = np.where(small, share, np.sin(share * angle) / sine)
    turned = first * one + second * other
    return turned / np.linalg.norm(turned, axis=-1, keepdims=True)
