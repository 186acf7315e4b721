"""Which links of a robot can never touch each other, however its joints stand."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from kinematics.rotations import Floats
from robots.bodies.allowed import LinkPair
from robots.bodies.hulls import shape_corners
from robots.urdf.model import ModelJoint, UrdfModel

MARGIN = 0.05  # m; more than the distance from which PhysX looks at a pair


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
    rest = _rest_poses(model)
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


def _moving_between(one: str, other: str, model: UrdfModel) -> list[ModelJoint]:
    """Return the moving joints on the path from a link to another, in that order."""
    up, down = model.path_to(one), model.path_to(other)
    shared = sum(a is b for a, b in zip(up, down, strict=False))
    path = (*reversed(up[shared:]), *down[shared:])
    return [joint for joint in path if joint.moves]


def _rest_poses(model: UrdfModel) -> dict[str, Floats]:
    """Return the pose of each link where every joint is at 0, in the frame of the root."""
    poses = {model.root: np.eye(4)}
    for joint in model.ordered:
        poses[joint.child] = poses[joint.parent] @ joint.origin
    return poses
