"""Paths with rounded corners, and how fast they are followed."""

import numpy as np
import pytest

from layouts import Layout, single
from robot_layouts.motion import MotionError
from robot_layouts.motion.timing.paths import Path, way, without_straight_points
from robot_layouts.motion.timing.velocities import largest_accelerations, largest_velocities, timed
from tests.motion.two_pandas import cell

SPEEDS = np.array([1.0, 2.0, 0.5])
POINTS = np.array([[0.0, 0, 0], [1.0, 1, 0], [1.0, -1, 0.5], [0.2, 0, 1]])


def path(share=0.8):
    lengths = way(POINTS, SPEEDS)
    inner = share * np.minimum(lengths[:-1], lengths[1:]) / 2
    return Path(POINTS, np.array([0.0, *inner, 0.0]), SPEEDS)


def test_a_rounded_path_has_continuous_slopes_and_bends():
    rounded = path()
    s, step = np.linspace(0.0, rounded.length, 3001), 1e-6
    places, slopes, bends = (rounded.at(s, order) for order in range(3))
    ahead = rounded.at(np.minimum(s + step, rounded.length))
    assert np.allclose((ahead - places)[:-1] / step, slopes[:-1], atol=1e-4)
    assert np.abs(np.diff(slopes, axis=0)).max() < 0.05
    assert np.abs(np.diff(bends, axis=0)).max() < 0.2
    assert np.allclose(places[[0, -1]], POINTS[[0, -1]], atol=1e-12)


def test_points_on_a_line_are_left_out():
    points = np.array([[0.0, 0, 0], [0.5, 0.5, 0], [0.5, 0.5, 0], *POINTS[1:]])
    assert np.allclose(without_straight_points(points, SPEEDS), POINTS)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_times_keep_velocities_and_accelerations_within_their_limits(share):
    limits = np.array([2.0, 5.0, 1.5])
    times, positions, velocities = timed(path(share), limits)
    assert np.allclose(np.diff(times), 0.02)
    assert np.array_equal(positions[[0, -1]], POINTS[[0, -1]])
    assert not velocities[[0, -1]].any()
    assert (np.abs(velocities) <= SPEEDS).all()
    accelerations = np.diff(velocities, axis=0) / np.diff(times)[:, None]
    assert (np.abs(accelerations) <= limits).all()
    # Some joint is always driven to a limit: it is not merely slow.
    used = np.abs(velocities[:-1]) / SPEEDS
    pushed = np.abs(accelerations) / limits
    assert (np.maximum(used.max(axis=1), pushed.max(axis=1)) > 0.9).mean() > 0.85


def test_a_path_without_blends_stops_at_its_corners():
    times, positions, velocities = timed(path(0.0), np.full(3, 5.0))
    at_corner = np.abs(positions - POINTS[1]).max(axis=1).argmin()
    assert np.allclose(velocities[at_corner], 0.0, atol=1e-9)
    assert times[-1] > timed(path(1.0), np.full(3, 5.0))[0][-1]


def test_the_control_mode_limits_velocities():
    by_mode = {
        mode: largest_velocities(cell(), mode)["left"][0]
        for mode in ("pd_joint_delta_pos", "pd_joint_pos", "pd_joint_vel")
    }
    # 39 % of 0.1 rad per step at 20 Hz, as a drive of 1000/100 follows; the URDF's limit; 1 rad/s
    relative = pytest.approx(2.0 * (1 - np.exp(-0.5)))
    assert by_mode == {"pd_joint_delta_pos": relative, "pd_joint_pos": 2.175, "pd_joint_vel": 1.0}
    assert largest_velocities(cell(), "pd_joint_target_delta_pos")["left"][0] == 2.0


def test_the_mode_of_the_layout_counts_unless_another_is_asked_for():
    layout = Layout(single({"arm": "panda"})).in_control_mode("pd_joint_vel")
    assert largest_velocities(layout)["arm"][0] == 1.0


def test_velocities_are_scaled_and_accelerations_follow_them():
    half = largest_velocities(cell(), "pd_joint_target_delta_pos", factor=0.5)
    assert half["left"][0] == 1.0
    assert largest_accelerations(cell(), half)["left"][0] == pytest.approx(2.5)
    given = largest_accelerations(cell(), half, {"right": 3.0})
    assert given["right"].tolist() == [3.0] * 9


def test_an_acceleration_that_makes_no_sense_is_refused():
    with pytest.raises(MotionError, match="positive number"):
        largest_accelerations(cell(), largest_velocities(cell()), {"left": [1.0, 2.0]})
