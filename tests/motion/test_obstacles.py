"""Obstacles contain what they stand for, move as their tracks say, and refuse what is none."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from robot_layouts.kinematics.rotations import pose_matrix, quaternion_about, rotation_vector
from robot_layouts.motion.model.obstacles import Held, Obstacle, Track, box, cylinder, mesh, sphere
from robots import LayoutError

FLAT = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 1.0, 0.0)])


def inside(obstacle: Obstacle, points: np.ndarray) -> bool:
    """Whether the first shape contains points of its own frame."""
    hull = trimesh.convex.convex_hull(obstacle.shapes[0])
    heights = np.einsum("fi,pfi->pf", hull.face_normals, points[:, None] - hull.triangles[:, 0])
    return bool((heights <= 1e-12).all())


def test_a_ball_and_a_cylinder_are_contained_and_little_more():
    ways = np.random.default_rng(0).normal(size=(2000, 3))
    ball = ways / np.linalg.norm(ways, axis=1)[:, None] * 0.3
    assert inside(sphere("ball", 0.3), ball)
    assert not inside(sphere("ball", 0.3), ball * 1.01)
    round_ = np.column_stack(
        [ways[:, :2] / np.linalg.norm(ways[:, :2], axis=1)[:, None], ways[:, 2]]
    )
    round_[:, 2] = np.sign(ways[:, 2]) * 0.5
    assert inside(cylinder("post", 1.0, 1.0), round_)
    assert not inside(cylinder("post", 1.0, 1.0), round_ * (1.006, 1.006, 1.0))


def test_a_box_has_its_size_where_it_stands():
    obstacle = box(
        "crate", (0.2, 0.4, 0.6), (1.0, 2.0, 3.0), quaternion_about((0, 0, 1), np.pi / 2)
    )
    corners = obstacle.shapes[0] @ obstacle.pose[:3, :3].T + obstacle.pose[:3, 3]
    np.testing.assert_allclose(corners.min(axis=0), (0.8, 1.9, 2.7), atol=1e-12)
    np.testing.assert_allclose(corners.max(axis=0), (1.2, 2.1, 3.3), atol=1e-12)


def test_a_mesh_is_read_with_its_scale(tmp_path):
    trimesh.creation.box((2.0, 2.0, 2.0)).export(tmp_path / "cube.stl")
    obstacle = mesh("cube", tmp_path / "cube.stl", scale=(0.1, 0.2, 0.3))
    np.testing.assert_allclose(np.abs(obstacle.hulls[0].corners).max(axis=0), (0.1, 0.2, 0.3))


turns = st.floats(-3.0, 3.0)


@given(first=turns, second=turns, share=st.floats(0.0, 1.0))
def test_a_track_turns_evenly_the_short_way(first, second, share):
    ends = [
        pose_matrix((0, 0, x), quaternion_about((0, 0, 1), turn))
        for x, turn in ((0.0, first), (1.0, second))
    ]
    pose = Track(np.array([2.0, 4.0]), np.array(ends)).at([2.0 + 2.0 * share])[0]
    whole = rotation_vector(ends[0][:3, :3].T @ ends[1][:3, :3])[2]
    if abs(abs(whole) - np.pi) > 1e-3:
        assert rotation_vector(ends[0][:3, :3].T @ pose[:3, :3])[2] == pytest.approx(
            share * whole, abs=1e-6
        )
    assert pose[2, 3] == pytest.approx(share)


def test_a_track_stands_still_beyond_its_ends():
    poses = np.array([pose_matrix((x, 0, 0), (1, 0, 0, 0)) for x in (1.0, 2.0, 4.0)])
    track = Track(np.array([0.0, 1.0, 2.0]), poses)
    places = track.at([-1.0, 0.0, 0.5, 1.0, 1.5, 2.0, 9.0])[:, 0, 3]
    np.testing.assert_allclose(places, (1.0, 1.0, 1.5, 2.0, 3.0, 4.0, 4.0), atol=1e-12)
    still = Track(np.array([3.0]), poses[:1])
    np.testing.assert_allclose(still.at([0.0, 5.0])[:, 0, 3], 1.0)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: box("crate", (0.1, -0.1, 0.1)), "a length of crate is -0.1 m"),
        (lambda: box("crate", (0.1, 0.1)), "the size of crate"),
        (lambda: box("crate", (1, 1, 1), quaternion=(1, 1, 0, 0)), "has length 1.41421"),
        (lambda: sphere("ball", float("nan")), "the radius of ball is nan"),
        (lambda: cylinder("post", 0.1, 0.0), "the length of post is 0"),
        (lambda: box("", (1, 1, 1)), "an obstacle's name is ''"),
        (lambda: Obstacle("none", ()), "'none' has no shape"),
        (lambda: Obstacle("flat", (FLAT,)).hulls, "obstacle 'flat': .* without a volume"),
        (lambda: Obstacle("o", (FLAT,), np.eye(3)), "4 x 4 finite numbers"),
        (lambda: Obstacle("o", (FLAT,), np.diag([2.0, 1, 1, 1])), "a rotation matrix"),
        (lambda: Obstacle("o", (FLAT,), np.diag([-1.0, 1, 1, 1])), "mirrors"),
        (lambda: Track(np.zeros(2), np.tile(np.eye(4), (2, 1, 1))), "increase and be finite"),
        (lambda: Track(np.zeros(2), np.eye(4)[None]), r"\(T,\) and \(T, 4, 4\)"),
        (
            lambda: Held("left", box("b", (1, 1, 1)).moved(Track(np.zeros(1), np.eye(4)[None]))),
            "'b' follows a track",
        ),
    ],
)
def test_what_is_no_obstacle_is_refused_in_words(make, words):
    with pytest.raises(LayoutError, match=words):
        make()


def test_poses_of_single_precision_are_taken():
    """SAPIEN's quaternions of bodies that tumble are 1 to a few units of their last place."""
    crate = box("crate", (0.1, 0.2, 0.3))
    turn = quaternion_about((0.6, 0.0, 0.8), 2.9)
    for wrong in (1 - 4e-7, 1 + 4e-7):
        crate.moved(pose_matrix((0.1, 0.2, 0.3), np.float32(turn * wrong)))
    with pytest.raises(LayoutError, match="takes a rotation matrix"):
        crate.moved(pose_matrix((0.1, 0.2, 0.3), turn * (1 + 1e-3)))
