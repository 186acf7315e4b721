"""Geometry of shapes: volumes, centres, how far they reach, surfaces to draw and to measure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import combinations
from math import pi
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from objects.joints import Joint
from objects.shapes import Box, Capsule, ConvexHull, Cylinder, Mesh, Place, Shape, Sphere
from robot_layouts.core.errors import DescriptorError
from robot_layouts.kinematics.rotations import (
    Floats,
    inverse,
    multiply,
    pose_matrix,
    rotate,
    transform,
)
from robots.descriptor import Quaternion
from robots.urdf.mesh_files import has_volume

SIDES = 32  # of the polygon that stands for a circle where a surface is wanted
_WHOLE = 1e9  # nanometres are whole numbers
_DIGITS = 9  # of numbers that shapes are written with
_SAME_PLANE = 1e-7  # m; corners this near to a plane are in it
_BOX = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


class Triangles(NamedTuple):
    """Triangles of the surface of a shape.

    Attributes:
        corners: In the body's frame, (n, 3) (m).
        triangles: Three corners each, counter-clockwise seen from outside, (t, 3).
    """

    corners: Floats
    triangles: NDArray[np.intp]

    @property
    def normals(self) -> Floats:
        """The outward normal of each triangle, as long as twice its area, (t, 3) (m²)."""
        one, two, three = self.corners[self.triangles].transpose(1, 0, 2)
        return np.cross(two - one, three - one)


class MassProperties(NamedTuple):
    """What shapes weigh together.

    Attributes:
        volume: Of all of them, overlaps counted twice, as physics counts them (m³).
        mass: Likewise (kg).
        centre: Their centre of mass in the body's frame, (3,) (m).
    """

    volume: float
    mass: float
    centre: Floats


def rounded_place(numbers: Sequence[float] | Floats) -> Place:
    """Return a place as shapes are written with it (m)."""
    x, y, z = (round(float(number), _DIGITS) + 0.0 for number in numbers)
    return x, y, z


def rounded_turn(quaternion: Floats) -> Quaternion:
    """Return a quaternion likewise, wxyz."""
    w, x, y, z = (round(number, _DIGITS) + 0.0 for number in quaternion.tolist())
    return w, x, y, z


def mass_of(shapes: Iterable[Shape]) -> MassProperties:
    """Return what the shapes of a body that collide weigh together.

    Raises:
        DescriptorError: If none of them has a volume.
    """
    volume, mass, moment = 0.0, 0.0, np.zeros(3)
    for shape in shapes:
        if shape.collides:
            own, centre = _volume(shape)
            volume, mass = volume + own, mass + own * shape.density
            moment += own * shape.density * transform(_pose(shape), centre)
    if not mass:
        raise DescriptorError("no shape of this body collides, so that it weighs nothing")
    return MassProperties(volume, mass, moment / mass)


def inertia_of(shapes: Iterable[Shape], centre: Floats) -> Floats:
    """Return the inertia of shapes that collide, along the body's axes, (3, 3) (kg·m²).

    Args:
        shapes: In the body's frame.
        centre: Point of that frame about which it is, (3,) (m).
    """
    whole = np.zeros((3, 3))
    for shape in shapes:
        if shape.collides:
            volume, middle = _volume(shape)
            mass, turn = volume * shape.density, _pose(shape)[:3, :3]
            away = transform(_pose(shape), middle) - centre
            whole += turn @ _inertia(shape, mass) @ turn.T
            whole += mass * (away @ away * np.eye(3) - np.outer(away, away))
    return whole


def reach(shapes: Iterable[Shape], way: Floats) -> float:
    """Return how far shapes that collide reach in a direction, from the body's origin (m).

    Args:
        shapes: In the body's frame.
        way: The direction in that frame, of length 1, (3,).

    Raises:
        DescriptorError: If none of them collides.
    """
    ways = [_reach(shape, way) for shape in shapes if shape.collides]
    if not ways:
        raise DescriptorError("no shape of this body collides, so that it rests on nothing")
    return max(ways)


def lowest(shapes: Iterable[Shape], quaternion: Iterable[float]) -> float:
    """Return the height of the lowest point of a body that is turned, from its origin (m).

    Args:
        shapes: In the body's frame.
        quaternion: How it is turned, wxyz.
    """
    down = rotate(inverse(np.array([*quaternion])), np.array([0.0, 0.0, -1.0]))
    return -reach(shapes, down)


def bounds(shapes: Iterable[Shape]) -> tuple[Floats, Floats]:
    """Return the least and the greatest corner of the box around shapes that collide, (3,) (m)."""
    parts = tuple(shapes)
    high = np.array([reach(parts, axis) for axis in np.eye(3)])
    low = -np.array([reach(parts, -axis) for axis in np.eye(3)])
    return low, high


def part_poses(joints: Sequence[Joint], root: Floats, positions: Floats) -> Mapping[str, Floats]:
    """Return where the parts of a thing are.

    Args:
        joints: The thing's joints.
        root: Poses of the thing, (T, 7): position (m) and quaternion (wxyz).
        positions: Of its joints, (T, joints).

    Returns:
        The pose of each part by name, (T, 7); that of the thing where all joints are at zero,
        moved by the joint's ``origin``.
    """
    found, moved = dict[str, Floats](), dict[str, Floats]()
    for joint, position in zip(joints, np.asarray(positions, float).T, strict=True):
        carrier = np.asarray(root if joint.carrier is None else moved[joint.carrier], float)
        axis, at = np.array(joint.axis), np.array(joint.at)
        turn = np.zeros((len(position), 4))
        turn[:, 0], way = 1.0, position[:, None] * axis
        if joint.kind == "turn":
            turn[:, 0], turn[:, 1:] = np.cos(position / 2), np.sin(position / 2)[:, None] * axis
            way = at - rotate(turn, np.broadcast_to(at, way.shape))
        place = carrier[:, :3] + rotate(carrier[:, 3:], way)
        turned = multiply(carrier[:, 3:], turn)
        found[joint.name] = moved[joint.name] = np.concatenate([place, turned], axis=1)
        if any(joint.origin):
            origin = np.broadcast_to(np.array(joint.origin), place.shape)
            found[joint.name] = np.concatenate([place + rotate(turned, origin), turned], axis=1)
    return found


def surface(shape: Shape) -> Triangles:
    """Return the surface of a shape in the body's frame; round ones have flat faces.

    Raises:
        DescriptorError: If it is a plane or a floor, or its file cannot be read.
    """
    corners, triangles = _surface(shape)
    return Triangles(transform(_pose(shape), corners), triangles)


def sampled(found: Triangles, count: int, random: np.random.Generator) -> Floats:
    """Return points on a surface, drawn evenly, (count, 3) (m)."""
    areas = np.linalg.norm(found.normals, axis=1)
    chosen = random.choice(len(areas), count, p=areas / areas.sum())
    first, second = np.sqrt(random.random(count)), random.random(count)
    shares = np.stack([1 - first, first * (1 - second), first * second], axis=1)
    return np.einsum("nk,nkj->nj", shares, found.corners[found.triangles[chosen]])


@lru_cache(maxsize=4096)
def hull_triangles(corners: tuple[Place, ...]) -> NDArray[np.intp]:
    """Return the surface of the convex hull of some points, (t, 3): counter-clockwise triangles.

    Every three points are tried, so that it takes no library and always finds the same ones.
    """
    points, places = np.array(corners), {corner: i for i, corner in enumerate(corners)}
    three = np.array(list(combinations(sorted(places.values()), 3)))  # repeated ones but once
    one, two, other = points[three].transpose(1, 0, 2)
    normals = np.cross(two - one, other - one)
    lengths = np.linalg.norm(normals, axis=1)
    large = lengths > _SAME_PLANE**2
    normals, one = normals[large] / lengths[large, None], one[large]
    heights = points @ normals.T - np.einsum("ij,ij->i", normals, one)
    single = np.isin(np.arange(len(points)), [*places.values()])
    outer = (heights <= _SAME_PLANE).all(axis=0)
    inner = (heights >= -_SAME_PLANE).all(axis=0)
    faces: dict[tuple[int, ...], Floats] = {}
    for at in np.flatnonzero(outer | inner):
        members = tuple(np.flatnonzero((np.abs(heights[:, at]) <= _SAME_PLANE) & single).tolist())
        faces.setdefault(members, normals[at] if outer[at] else -normals[at])
    triangles = [
        (ring[0], ring[i], ring[i + 1])
        for members, normal in faces.items()
        for ring in [_ring(points, members, normal)]
        for i in range(1, len(ring) - 1)
    ]
    if not _is_closed(triangles):  # as where corners are so near to a plane that it is a guess
        triangles = _exact_hull([[round(x * _WHOLE) for x in corner] for corner in corners])
    found = np.array(triangles, np.intp)
    found.setflags(write=False)
    return found


def _is_closed(triangles: Sequence[Sequence[int]]) -> bool:
    """Tell whether each edge of triangles is that of another one, the other way round."""
    edges = [(t[i - 1], t[i]) for t in triangles for i in range(3)]
    return len(set(edges)) == len(edges) and {(b, a) for a, b in edges} == set(edges)


def _exact_hull(points: Sequence[Sequence[int]]) -> list[tuple[int, int, int]]:
    """Return the surface of the convex hull of points, which whole numbers make exact.

    It grows point by point: what a point sees of the surface is replaced by triangles to it.
    """

    def above(face: tuple[int, int, int], point: int) -> int:
        (x, y, z), *others = (points[i] for i in (point, *face))
        (a, b, c), (d, e, f), (g, h, i) = ((p - x, q - y, r - z) for p, q, r in others)
        return a * (f * h - e * i) + b * (d * i - f * g) + c * (e * g - d * h)

    count = len(points)
    first = next(t for t in combinations(range(count), 4) if above((t[0], t[1], t[2]), t[3]))
    one, two, three, four = (
        first
        if above((first[0], first[1], first[2]), first[3]) < 0
        else (first[1], first[0], *first[2:])
    )
    faces = {(one, two, three), (two, one, four), (three, two, four), (one, three, four)}
    for point in range(count):
        seen = {face for face in faces if above(face, point) > 0}
        edges = {(face[i - 1], face[i]) for face in seen for i in range(3)}
        border = {(a, b) for a, b in edges if (b, a) not in edges}
        faces = faces - seen | {(a, b, point) for a, b in border}
    return sorted(faces)


def _ring(points: Floats, members: tuple[int, ...], normal: Floats) -> list[int]:
    """Return the corners of the convex hull of points of one plane, counter-clockwise."""
    along = points[members[1]] - points[members[0]]
    across = np.asarray(np.cross(normal, along), float)
    flat: Floats = np.stack([points @ along, points @ across], axis=1)
    order = sorted(members, key=lambda i: (flat[i][0], flat[i][1]))
    lower, upper = _chain(flat, order), _chain(flat, order[::-1])
    return lower[:-1] + upper[:-1]


def _chain(flat: Floats, order: list[int]) -> list[int]:
    """Return the corners that a walk along one side of points has to turn left at."""
    chain: list[int] = []
    for i in order:
        while len(chain) > 1:
            (ax, ay), (bx, by) = flat[chain[-1]] - flat[chain[-2]], flat[i] - flat[chain[-1]]
            if ax * by - ay * bx > 0:
                break
            chain.pop()
        chain.append(i)
    return chain


def _pose(shape: Shape) -> Floats:
    return pose_matrix(np.array(shape.position), np.array(shape.quaternion))


def _volume(shape: Shape) -> tuple[float, Floats]:
    """Return the volume of a shape (m³), and its centre in its own frame, (3,) (m)."""
    middle = np.zeros(3)
    match shape:
        case Box(half_size=(a, b, c)):
            return 8 * a * b * c, middle
        case Sphere(radius=r):
            return 4 / 3 * pi * r**3, middle
        case Cylinder(radius=r, half_length=h):
            return 2 * pi * r**2 * h, middle
        case Capsule(radius=r, half_length=h):
            return 2 * pi * r**2 * h + 4 / 3 * pi * r**3, middle
        case _:
            corners, triangles = _surface(shape)
            one, two, three = corners[triangles].transpose(1, 0, 2)
            volumes = np.einsum("ij,ij->i", one, np.cross(two, three)) / 6
            centres = (one + two + three) / 4
            return float(volumes.sum()), volumes @ centres / volumes.sum()


def _inertia(shape: Shape, mass: float) -> Floats:
    """Return the inertia of a shape about its centre in its own frame, (3, 3) (kg·m²)."""
    import trimesh

    match shape:
        case Sphere(radius=r):
            return np.eye(3) * mass * 2 / 5 * r**2
        case Cylinder(radius=r, half_length=h):
            across = mass * (r**2 / 4 + h**2 / 3)
            return np.diag([mass * r**2 / 2, across, across])
        case Capsule(radius=r, half_length=h):
            ends = mass * 4 * r / (6 * h + 4 * r)  # both, which are a ball together
            rod = mass - ends
            across = rod * (r**2 / 4 + h**2 / 3) + ends * (2 / 5 * r**2 + h**2 + 3 / 4 * h * r)
            return np.diag([rod * r**2 / 2 + ends * 2 / 5 * r**2, across, across])
        case _:
            found = trimesh.Trimesh(*_surface(shape), process=False)
            return np.asarray(found.moment_inertia) * mass / found.volume


def _reach(shape: Shape, way: Floats) -> float:
    """Return how far a shape reaches in a direction of the body's frame (m)."""
    own, middle = rotate(inverse(np.array(shape.quaternion)), way), way @ np.array(shape.position)
    aside = float(np.hypot(own[1], own[2]))
    match shape:
        case Box():
            far = np.abs(own) @ np.array(shape.half_size)
        case Sphere():
            far = shape.radius
        case Cylinder():
            far = shape.half_length * abs(own[0]) + shape.radius * aside
        case Capsule():
            far = shape.half_length * abs(own[0]) + shape.radius
        case _:
            far = (_surface(shape)[0] @ own).max()
    return float(middle + far)


def _surface(shape: Shape) -> tuple[Floats, NDArray[np.intp]]:
    """Return corners in a shape's own frame, (n, 3) (m), and triangles, (t, 3)."""
    match shape:
        case ConvexHull():
            return np.array(shape.corners), hull_triangles(shape.corners)
        case Box():
            return _BOX * shape.half_size, hull_triangles(tuple(map(tuple, _BOX.tolist())))
        case Mesh():
            whole = shape.collides and shape.collision == "hull"
            return _file(str(shape.path), shape.scale, whole)
        case _:
            return _round(shape)


def _round(shape: Shape) -> tuple[Floats, NDArray[np.intp]]:
    import trimesh

    match shape:
        case Sphere():
            made = trimesh.creation.icosphere(subdivisions=3, radius=shape.radius)
        case Cylinder():
            made = trimesh.creation.cylinder(shape.radius, 2 * shape.half_length, sections=SIDES)
        case Capsule():
            count = [SIDES, SIDES]
            made = trimesh.creation.capsule(2 * shape.half_length, shape.radius, count=count)
        case _:
            raise DescriptorError(f"a {type(shape).__name__} has no surface that ends")
    corners = np.asarray(made.vertices, float)[:, [2, 0, 1]]  # from along z to along x
    return corners, np.asarray(made.faces, np.intp)


@lru_cache(maxsize=64)
def _file(file: str, scale: Place, hull: bool) -> tuple[Floats, NDArray[np.intp]]:
    """Return the surface of a mesh file, or of its convex hull."""
    import trimesh

    loaded = _loaded(file)
    found: Any = trimesh.convex.convex_hull(loaded) if hull else loaded
    return np.asarray(found.vertices, float) * scale, np.asarray(found.faces, np.intp)


@lru_cache(maxsize=64)
def pieces(file: str, scale: Place) -> tuple[Floats, ...]:
    """Return the corners, (n, 3) (m), of each piece of a mesh file that hangs together.

    Pieces without a volume are left out.

    Args:
        file: The file.
        scale: Factors along x, y and z.

    Raises:
        DescriptorError: If it cannot be read as a mesh.
    """
    mesh = _loaded(file)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    parts = (np.asarray(part.vertices, float) for part in mesh.split(only_watertight=False))
    return tuple(corners * scale for corners in parts if has_volume(corners * scale))


def _loaded(file: str) -> Any:
    import trimesh

    try:
        return trimesh.load(file, force="mesh")
    except Exception as error:  # whatever the reader of this format raises
        raise DescriptorError(f"{file} cannot be read as a mesh: {error}") from error
