"""Which pairs of a robot's links always overlap, which never touch, and how deep bodies overlap."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_layouts.kinematics.rotations import Floats
from robot_layouts.kinematics.tree import Tree
from robots.bodies.allowed import LinkPair, joined_pairs, rigid_groups, rigid_pairs, srdf_pairs
from robots.bodies.hulls import Hull, counted_pairs, read_hulls, shape_corners
from robots.urdf.model import ModelJoint, UrdfModel
from robots.urdf.srdf import read_excluded_pairs
from robots.urdf.tree import kinematic_tree, rest_poses

POSTURES = 200  # random ones, in which overlaps are looked for
ALWAYS = 0.95  # of them; what MoveIt's setup assistant takes for always
# The same for a link and what the link after next carries: where a hull fills a hollow in which the
# joint between them turns, as at a Baxter's shoulders, they overlap wherever the arm really goes.
MOSTLY = 2 / 3
PARALLEL = 0.999  # cosine; of slides that are one telescope
MARGIN = 0.05  # m; more than the distance from which PhysX looks at a pair
NEAR_ENOUGH = 1e-9  # m; of a face of the bodies' difference
MOST_POINTS = 500  # of the polytope that grows within it


def guess_allowed(
    model: UrdfModel, urdf: Path
) -> tuple[tuple[tuple[str, str], ...], tuple[str, ...]]:
    """Return the pairs of links that may overlap, and the reasons.

    Links that a joint joins and links that are rigid with each other are left out, as they always
    may; see `robots.bodies.allowed.allowed_pairs`.

    Args:
        model: What a URDF describes.
        urdf: That URDF, for the SRDF beside it and its meshes.

    Raises:
        AssetError: If the SRDF or a mesh cannot be read, or a shape has no volume.
    """
    pairs = srdf_pairs(read_excluded_pairs(urdf), model)
    source = "the SRDF's disabled pairs"
    if not pairs:
        pairs, source = neighbours(model), "neighbours across fixed joints"
        if telescopes := sliding_inside(model):
            pairs |= telescopes
            source += ", links that slide inside each other as a telescope's"
    reasons = [f"allowed_collisions: {source}, and links that overlap wherever the joints stand"]
    fixed = joined_pairs(model) | rigid_pairs(model)
    if find_spec("fcl") is None:
        reasons = [
            f"allowed_collisions: {source}; without python-fcl no overlaps are looked for"
            " (pip install 'robot-layouts[checks]')"
        ]
    else:
        pairs |= always_overlapping(model, urdf, fixed | pairs)
    return _in_order(pairs - fixed, model), tuple(reasons)


def neighbours(model: UrdfModel) -> frozenset[LinkPair]:
    """Return the pairs of links, each rigid with one end of the same moving joint."""
    groups = rigid_groups(model)
    group = {link: links for links in groups.values() for link in links}
    return frozenset(
        frozenset(pair)
        for joint in model.moving
        for pair in product(group[joint.parent], group[joint.child])
    )


def sliding_inside(model: UrdfModel) -> frozenset[LinkPair]:
    """Return the pairs of links of telescopes: two or more joints in a row slide along one way."""
    rest, groups = rest_poses(model), rigid_groups(model)
    group = {link: links for links in groups.values() for link in links}
    pairs: set[LinkPair] = set()
    for last in model.moving:
        row: list[ModelJoint] = []
        way = rest[last.child][:3, :3] @ last.axis
        for joint in reversed([j for j in model.path_to(last.child) if j.moves]):
            along = abs(float(way @ rest[joint.child][:3, :3] @ joint.axis)) > PARALLEL
            if joint.type != "prismatic" or not along:
                break
            row.append(joint)
        carriers = {link for joint in row[1:] for link in group[joint.parent]}
        pairs |= {frozenset(pair) for pair in product(carriers, group[last.child])}
    return frozenset(pairs)


def always_overlapping(
    model: UrdfModel, urdf: Path, besides: frozenset[LinkPair]
) -> frozenset[LinkPair]:
    """Return the pairs of links that overlap in all, or nearly all, of `POSTURES` random postures.

    For links that two joints in a row join, most of them are enough. The postures are the same
    every time. Joints that mimic another follow it.

    Args:
        model: What a URDF describes.
        urdf: That URDF, for its meshes.
        besides: Pairs that are not looked at.

    Raises:
        AssetError: If a mesh cannot be read, or a shape has no volume.
        MissingPackageError: If python-fcl is not installed.
    """
    driven = [joint for joint in model.moving if joint.mimics is None]
    tree = kinematic_tree(model, [joint.name for joint in driven])
    hulls = read_hulls(model, urdf)
    waiting = np.array(counted_pairs(tree, hulls, besides), int).reshape(-1, 2)
    misses = np.zeros(len(waiting), int)
    in_a_row = _two_in_a_row(tree, [tree.bodies[hull.link] for hull in hulls], waiting)
    most = (1 - np.where(in_a_row, MOSTLY, ALWAYS)) * POSTURES
    low, high = np.array([joint.span for joint in driven]).reshape(-1, 2).T
    draws = np.random.default_rng(0).uniform(low, high, (POSTURES, len(driven)))
    for poses in tree.forward(draws):
        misses += ~overlapping(hulls, poses, waiting)
        kept = misses <= most
        waiting, misses, most = waiting[kept], misses[kept], most[kept]
    names = [tree.links[hull.link] for hull in hulls]
    return frozenset(frozenset((names[a], names[b])) for a, b in waiting.tolist())


def overlapping(hulls: Sequence[Hull], poses: Floats, pairs: ArrayLike) -> NDArray[np.bool_]:
    """Return for each pair of hulls whether they overlap, (pairs,).

    Args:
        hulls: Hulls of one robot.
        poses: Of its links, (links, 4, 4) (m).
        pairs: Indices of two hulls each, (pairs, 2).
    """
    import fcl

    indices = np.array(pairs, int).reshape(-1, 2)
    bodies = {
        i: fcl.CollisionObject(hulls[i].geometry, fcl.Transform(pose[:3, :3], pose[:3, 3]))
        for i in np.unique(indices).tolist()
        for pose in (poses[hulls[i].link],)
    }
    request = fcl.CollisionRequest()
    return np.array(
        [
            fcl.collide(bodies[a], bodies[b], request, fcl.CollisionResult()) > 0
            for a, b in indices.tolist()
        ],
        bool,
    )


def contact(hulls: Sequence[Hull], poses: Floats, pairs: ArrayLike) -> Floats | None:
    """Return the middle of where pairs of hulls touch, (3,) (m); None if none of them do.

    Args:
        hulls: Hulls of one robot.
        poses: Of its links, (links, 4, 4) (m).
        pairs: Indices of two hulls each, (pairs, 2).
    """
    import fcl

    request, places = fcl.CollisionRequest(enable_contact=True), list[Floats]()
    for pair in np.array(pairs, int).reshape(-1, 2).tolist():
        one, other = (
            fcl.CollisionObject(hulls[i].geometry, fcl.Transform(pose[:3, :3], pose[:3, 3]))
            for i in pair
            for pose in (poses[hulls[i].link],)
        )
        result = fcl.CollisionResult()
        fcl.collide(one, other, request, result)
        places += [np.array(found.pos) for found in result.contacts]
    return np.mean(places, axis=0) if places else None


def _in_order(pairs: Iterable[LinkPair], model: UrdfModel) -> tuple[tuple[str, str], ...]:
    """Return pairs of links that collide with something, ordered as the links of the URDF are."""
    place = {link: i for i, link in enumerate(model.links)}
    sorted_pairs = (sorted(pair, key=place.__getitem__) for pair in pairs)
    solid = [pair for pair in sorted_pairs if all(link in model.collisions for link in pair)]
    ordered = sorted(solid, key=lambda pair: [place[link] for link in pair])
    return tuple((one, other) for one, other in ordered)


def without_distant(pairs: Iterable[LinkPair], model: UrdfModel, urdf: Path) -> frozenset[LinkPair]:
    """Return those pairs of links that might come within `MARGIN` of each other.

    What is left out provably cannot: the one long way between two joints on the path from link to
    link is longer than all the others, and the links themselves, together.

    Args:
        pairs: Pairs of links.
        model: What a URDF describes.
        urdf: That URDF, for its meshes.

    Raises:
        AssetError: If a mesh cannot be read.
    """
    rest = rest_poses(model)
    corners = {
        link: np.concatenate([shape_corners(shape, urdf) for shape in shapes])
        for link, shapes in model.collisions.items()
    }
    return frozenset(
        pair
        for pair in pairs
        if pair <= corners.keys() and _least_distance(pair, model, rest, corners) < MARGIN
    )


def _least_distance(
    pair: LinkPair, model: UrdfModel, rest: dict[str, Floats], corners: dict[str, Floats]
) -> float:
    """Return a distance that two links keep at least (m); it may be negative."""
    one, other = sorted(pair)
    path = _moving_between(one, other, model)
    if not path:
        return 0.0
    places = [rest[joint.child][:3, 3] for joint in path]
    lengths = [float(np.linalg.norm(a - b)) for a, b in zip(places, places[1:], strict=False)]
    slides = [max(map(abs, joint.span)) if joint.unit == "m" else 0.0 for joint in path]
    loose = sum(slides)
    for link, place in ((one, places[0]), (other, places[-1])):
        points = corners[link] @ rest[link][:3, :3].T + rest[link][:3, 3]
        loose += float(np.linalg.norm(points - place, axis=1).max())
    return 2 * max(lengths, default=0.0) - sum(lengths) - loose


def _two_in_a_row(tree: Tree, bodies: Sequence[int], pairs: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return of which pairs one carries the other over two joints, (n,).

    Args:
        tree: The links.
        bodies: The body of each hull.
        pairs: Of hulls, (n, 2).
    """
    carriers = {body: tree.carrier(body) for body in set(bodies)}
    second = np.array([tree.carrier(up) if (up := carriers[b]) >= 0 else -1 for b in bodies])
    one, other = np.array(bodies)[pairs.T]
    return (second[pairs[:, 0]] == other) | (second[pairs[:, 1]] == one)


def _moving_between(one: str, other: str, model: UrdfModel) -> list[ModelJoint]:
    """Return the moving joints on the path from a link to another, in that order."""
    up, down = model.path_to(one), model.path_to(other)
    shared = sum(a is b for a, b in zip(up, down, strict=False))
    path = (*reversed(up[shared:]), *down[shared:])
    return [joint for joint in path if joint.moves]


_FIRST = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)], float)


class Penetration(NamedTuple):
    """An overlap of two bodies.

    Attributes:
        depth: The shortest way that parts them (m).
        points: The point of each that lies deepest in the other, (2, 3) (m).
    """

    depth: float
    points: Floats


def overlap(one: Floats, other: Floats) -> Penetration:
    """Measure the overlap of two convex bodies; a depth of 0 if they do not overlap.

    A polytope grows within the bodies' Minkowski difference at the face that is nearest to the
    origin, until that face is one of the difference itself (the expanding polytope algorithm).
    FCL's own answer ends the process for some bodies of a thousand corners, so it is asked only
    whether bodies overlap, and how far they are apart.

    Args:
        one: The corners of a body with a volume, (n, 3) (m).
        other: Those of the other.
    """
    from scipy.spatial import ConvexHull

    corners = [_corner(one, other, direction) for direction in _FIRST if direction.any()]
    hull: Any = ConvexHull([a - b for a, b in corners], incremental=True)
    while True:
        nearest = int(hull.equations[:, 3].argmax())
        normal, offset = hull.equations[nearest, :3], hull.equations[nearest, 3]
        a, b = _corner(one, other, normal)
        farther = float(normal @ (a - b))
        if farther <= 0.0:
            return Penetration(0.0, np.array([a, b]))
        if farther + offset < NEAR_ENOUGH or len(corners) >= MOST_POINTS:
            break
        corners.append((a, b))
        hull.add_points((a - b)[None])
    depth = float(-offset)
    ends = np.array([corners[i] for i in hull.simplices[nearest]])  # (3, 2, 3)
    triangle = (ends[:, 0] - ends[:, 1]).T
    weights = np.linalg.lstsq(np.vstack([triangle, np.ones(3)]), [*(normal * depth), 1.0])[0]
    return Penetration(depth, np.einsum("i,ijk->jk", weights, ends))


def _corner(one: Floats, other: Floats, direction: Floats) -> tuple[Floats, Floats]:
    """Return the corners whose difference lies farthest in a direction."""
    return one[(one @ direction).argmax()], other[(other @ direction).argmin()]
