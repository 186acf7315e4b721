"""Geometry of shapes: volumes, reach, surfaces."""

import math
from collections import Counter

import mujoco
import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull as QhullsHull

from objects.shapes import Box, Capsule, ConvexHull, Cylinder, Friction, Mesh, Plane, Sphere
from objects.solids import (
    bounds,
    hull_triangles,
    inertia_of,
    lowest,
    mass_of,
    pieces,
    reach,
    sampled,
    surface,
)
from robot_layouts.kinematics.quaternions import normalised
from robot_layouts.kinematics.rotations import pose_matrix
from robot_layouts.simulation.mujoco.bodies import BodyMaker
from robot_layouts.simulation.world import WorldBody
from robots import DescriptorError, SimulationError

TURNED = normalised((0.8, 0.1, -0.4, 0.3))
CORNERS = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
SHAPES = (
    Box((0.1, 0.2, 0.3), position=(1.0, 2.0, 3.0), quaternion=TURNED),
    Sphere(0.2, position=(0.1, 0.0, 0.0)),
    Cylinder(0.1, 0.3, quaternion=TURNED),
    Capsule(0.1, 0.3, position=(0.0, 0.5, 0.0), quaternion=TURNED),
    ConvexHull(CORNERS, quaternion=TURNED),
)


def _kind(shape):
    return type(shape).__name__


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        (CORNERS[:3], "ConvexHull: corners has 3 entries; it must have 4 to 64"),
        (CORNERS * 17, "ConvexHull: corners has 68 entries"),
        ((*CORNERS[:3], (1, 1, 0)), "ConvexHull: corners lie in one plane"),
        (((0, 0, 0), (1, 1, 1), (2, 2, 2), (3, 3, 3)), "ConvexHull: corners lie in one plane"),
        (((1, 1, 1),) * 4, "ConvexHull: corners lie in one plane"),
        ((*CORNERS[:3], (0, 0, math.nan)), r"ConvexHull: corners\[3\]\[2\] is nan"),
    ],
)
def test_what_has_no_volume_is_no_hull(corners, message):
    with pytest.raises(SimulationError, match=f"^{message}"):
        ConvexHull(corners)


@pytest.mark.parametrize("seed", range(20))
def test_the_surface_of_a_hull_is_closed_faces_outwards_and_has_the_volume_that_qhull_finds(seed):
    points = np.random.default_rng(seed).normal(size=(8 + 2 * seed, 3))
    if seed % 2:
        points = points.round(0)  # corners of one plane, edges with points on them, repeated ones
    corners = tuple(map(tuple, points.tolist()))
    triangles = hull_triangles(corners)
    ways = Counter((t[i], t[(i + 1) % 3]) for t in triangles.tolist() for i in range(3))
    places = {corner: tuple(corners[corner]) for way in ways for corner in way}
    edges = Counter((places[a], places[b]) for a, b in ways.elements())
    assert all(edges[a, b] == edges[b, a] for a, b in edges)
    assert mass_of([ConvexHull(corners)]).volume == pytest.approx(QhullsHull(points).volume)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_a_surface_reaches_as_far_as_its_shape_and_holds_nearly_its_volume(shape):
    found = surface(shape)
    for way in np.random.default_rng(0).normal(size=(20, 3)):
        way /= np.linalg.norm(way)
        assert (found.corners @ way).max() == pytest.approx(reach([shape], way), abs=0.005)
    one, two, three = found.corners[found.triangles].transpose(1, 0, 2)
    volume = np.einsum("ij,ij->", one, np.cross(two, three)) / 6
    assert volume == pytest.approx(mass_of([shape]).volume, rel=0.03)
    points = sampled(found, 200, np.random.default_rng(1))
    ways = found.normals / np.linalg.norm(found.normals, axis=1, keepdims=True)
    heights = np.einsum("nti,ti->nt", points[:, None] - one, ways)
    assert np.abs(heights.max(axis=1)).max() < 1e-9


@pytest.mark.parametrize(
    "shapes", [*((shape,) for shape in SHAPES), SHAPES], ids=lambda s: "+".join(map(_kind, s))
)
def test_what_shapes_weigh_and_how_hard_they_turn_is_as_in_mujoco(shapes):
    spec = mujoco.MjSpec()
    maker = BodyMaker(spec, Friction(), [0.02, 1.0], drawn=False)
    maker.add(WorldBody("whole", shapes))
    model = spec.compile()
    body, found = model.body("/whole"), mass_of(shapes)
    assert found.mass == pytest.approx(body.mass[0])
    assert found.centre == pytest.approx(body.ipos)
    turn = pose_matrix(body.ipos, body.iquat)[:3, :3]
    theirs = turn @ np.diag(body.inertia) @ turn.T
    assert inertia_of(shapes, found.centre) == pytest.approx(theirs, rel=1e-6)


def test_bounds_and_the_lowest_point_count_what_collides():
    shapes = (Box((0.1, 0.2, 0.3)), Sphere(9.0, collides=False))
    low, high = bounds(shapes)
    assert low == pytest.approx([-0.1, -0.2, -0.3])
    assert high == pytest.approx([0.1, 0.2, 0.3])
    quarter = math.sqrt(0.5)
    assert lowest(shapes, (quarter, quarter, 0.0, 0.0)) == pytest.approx(-0.2)


def test_a_mesh_counts_as_its_convex_hull(tmp_path):
    trimesh.creation.annulus(0.1, 0.2, 0.3).export(tmp_path / "ring.stl")
    found = mass_of([Mesh(tmp_path / "ring.stl", scale=(2.0, 2.0, 2.0))])
    assert found.volume == pytest.approx(8 * math.pi * 0.2**2 * 0.3, rel=0.02)


def test_the_pieces_of_a_mesh_are_told_apart_and_flat_ones_left_out(tmp_path):
    ball, block = trimesh.creation.icosphere(), trimesh.creation.box((1.0, 2.0, 3.0))
    block.apply_translation((5.0, 0.0, 0.0))
    sheet = trimesh.Trimesh([(9, 0, 0), (9, 1, 0), (9, 0, 1)], [(0, 1, 2)])
    trimesh.util.concatenate([ball, block, sheet]).export(tmp_path / "three.stl")
    first, second = sorted(pieces(str(tmp_path / "three.stl"), (2.0, 1.0, 1.0)), key=len)
    assert np.ptp(first, axis=0) == pytest.approx([2.0, 2.0, 3.0])
    assert first.mean(0) == pytest.approx([10.0, 0.0, 0.0], abs=1e-6)
    assert np.ptp(second, axis=0) == pytest.approx([4.0, 2.0, 2.0])
    with pytest.raises(DescriptorError, match=r"gone.stl cannot be read as a mesh"):
        pieces(str(tmp_path / "gone.stl"), (1.0, 1.0, 1.0))


def test_a_mesh_whose_surface_collides_has_its_hollows(tmp_path):
    trimesh.creation.annulus(0.1, 0.2, 0.3).export(tmp_path / "ring.stl")
    for collision in ("pieces", "surface"):
        ring = surface(Mesh(tmp_path / "ring.stl", collision=collision))
        assert (np.hypot(ring.corners[:, 0], ring.corners[:, 1]) < 0.15).any()


def test_what_never_ends_has_no_surface(tmp_path):
    with pytest.raises(DescriptorError, match="a Plane has no surface that ends"):
        surface(Plane())
    with pytest.raises(DescriptorError, match=r"gone.stl cannot be read as a mesh"):
        surface(Mesh(tmp_path / "gone.stl"))
    with pytest.raises(DescriptorError, match="no shape of this body collides, so that it weighs"):
        mass_of([Box((1, 1, 1), collides=False)])
    with pytest.raises(DescriptorError, match="no shape of this body collides, so that it rests"):
        lowest([], (1.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("seed", range(4))
def test_corners_near_one_plane_make_a_surface_without_holes(seed):
    """A bottom of 24 corners that are flat to a fifth of a micrometre, and a tip."""
    random = np.random.default_rng(seed)
    bottom = np.column_stack([random.uniform(-0.02, 0.02, (24, 2)), random.uniform(0, 2e-7, 24)])
    corners = np.vstack([np.round(bottom, 8), [(0.0, 0.0, 0.03)]])
    hull = tuple(map(tuple, corners.tolist()))
    edges = Counter((t[i - 1], t[i]) for t in hull_triangles(hull).tolist() for i in range(3))
    assert set(edges.values()) == {1}
    assert {(b, a) for a, b in edges} == set(edges)
    assert mass_of([ConvexHull(hull)]).volume == pytest.approx(QhullsHull(corners).volume)


def test_a_mesh_that_does_not_collide_is_drawn_with_its_hole(tmp_path):
    trimesh.creation.annulus(0.1, 0.2, 0.3).export(tmp_path / "ring.stl")
    ring = surface(Mesh(tmp_path / "ring.stl", collides=False))
    inside = np.hypot(ring.corners[:, 0], ring.corners[:, 1]) < 0.15
    assert inside.any()
