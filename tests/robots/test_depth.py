"""How deep convex bodies overlap, beside the whole Minkowski difference."""

import numpy as np
import pytest
import trimesh

from robots.bodies.overlaps import overlap

CUBE = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)


def body(rng, size):
    return np.asarray(trimesh.convex.convex_hull(rng.normal(size=(30, 3)) * size).vertices)


def depth_of(one, other):
    difference = trimesh.convex.convex_hull((one[:, None] - other[None]).reshape(-1, 3))
    offsets = (difference.face_normals * difference.triangles_center).sum(1)
    return max(offsets.min(), 0.0)


@pytest.mark.parametrize("seed", range(20))
def test_it_is_the_nearest_face_of_the_difference(seed):
    rng = np.random.default_rng(seed)
    one, other = body(rng, (0.1, 0.05, 0.03)), body(rng, 0.1) + rng.normal(size=3) * 0.1
    depth, points = overlap(one, other)
    assert depth == pytest.approx(depth_of(one, other), abs=1e-9)
    if depth:
        way = points[0] - points[1]
        assert np.linalg.norm(way) == pytest.approx(depth, abs=1e-9)
        assert overlap(one, other + way * 1.001).depth == 0.0
        assert overlap(one, other + way * 0.9).depth > 0.0


@pytest.mark.parametrize(
    ("shift", "depth"),
    [
        ((0, 0, 0), 2.0),
        ((1.5, 0, 0), 0.5),
        ((2, 0, 0), 0.0),
        ((2.5, 0, 0), 0.0),
        ((0.3, 0, 1.99), 0.01),
    ],
)
def test_cubes(shift, depth):
    assert overlap(CUBE, CUBE + np.array(shift)).depth == pytest.approx(depth, abs=1e-12)


def test_bodies_of_very_many_corners():
    """FCL's own signed distance ends the process for some of these."""
    ball = np.asarray(trimesh.creation.icosphere(subdivisions=4).vertices)
    shift = np.array((0.3, 0.2, 0.1))
    assert overlap(ball, ball + shift).depth == pytest.approx(2 - np.linalg.norm(shift), abs=0.01)
