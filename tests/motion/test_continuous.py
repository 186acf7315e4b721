"""Nothing collides between the moments that a certificate looks at."""

from dataclasses import replace

import numpy as np
import pytest

from layouts import single
from robot_layouts.kinematics.rotations import rotation_about
from robot_layouts.motion import Motion, MotionError
from robot_layouts.motion.collision.cell import Cell
from robot_layouts.motion.model.obstacles import Obstacle, Track, box
from robots import LayoutError
from tests import three_links
from tests.layouts.small_robots import robot
from tests.motion.random_scenes import MISSED, missed

GRAZING = (13, 14, 69, 82, 135, 139, 149)  # whoever looks at the ends of pieces alone misses these


def out_and_back(seconds=2.0, speed=1.5):
    """A Panda that turns its first joint out and back between two knots, and a box on its way."""
    layout = single({"arm": "panda"})
    start = np.array(layout["arm"].start_qpos)
    velocities = np.zeros((2, len(start)))
    velocities[:, 0] = speed, -speed
    knots = {"arm": np.array([start, start])}
    farthest = start.copy()
    farthest[0] += seconds * speed / 4
    cell = Cell(layout)
    hand = cell.poses(farthest[None])[0, cell.links.index(("arm", "panda_hand")), :3, 3]
    in_the_way = box("box", (0.05, 0.05, 0.05), hand)
    return Motion(
        layout, np.array([0.0, seconds]), knots, {"arm": velocities}, obstacles=(in_the_way,)
    )


def full_turn(folder):
    """An arm that turns all the way round between two knots, past a post."""
    text = three_links.arm().replace("3.1", "7")
    layout = single({"arm": robot(folder, text, ("j1", "j2", "j3"), tcp="l3")})
    knots = np.zeros((2, 3))
    knots[1, 0] = 2 * np.pi
    post = box("post", (0.02, 0.02, 0.4), (-0.3, 0.0, 0.0))
    times, still = np.array([0.0, 10.0]), {"arm": np.zeros((2, 3))}
    limits = {"arm": np.ones(3)}
    return Motion(
        layout, times, {"arm": knots}, still, obstacles=(post,), largest_velocities=limits
    )


def standing_past(cart):
    """A robot that stands still while a body moves past it."""
    layout = single({"arm": "so100"})
    still = np.array([layout["arm"].start_qpos] * 2)
    times, speeds = np.array([0.0, 2.0]), {"arm": np.zeros_like(still)}
    return Motion(layout, times, {"arm": still}, speeds, obstacles=(cart,))


def through_the_base():
    ends = np.tile(np.eye(4), (2, 1, 1))
    ends[:, :3, 3] = (-0.65, -0.6, 0.15), (-0.65, 0.6, 0.15)
    return box("cart", (0.2, 0.2, 0.2)).moved(Track(np.array([0.0, 2.0]), ends))


def turning_into_it():
    """A long bar beside the robot that turns all the way round about its own middle."""
    poses = np.tile(np.eye(4), (4, 1, 1))
    for pose, angle in zip(poses, (0.25, 0.75, 1.25, 1.75), strict=True):
        pose[:3, :3] = rotation_about(np.array([0.0, 0.0, 1.0]), np.array(angle * np.pi))
        pose[:3, 3] = -0.68, 0.4, 0.05
    return box("bar", (0.9, 0.05, 0.05)).moved(Track(np.linspace(0.0, 2.0, 4), poses))


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda folder: out_and_back(), "box"),
        (full_turn, "post"),
        (lambda folder: standing_past(through_the_base()), "cart"),
        (lambda folder: standing_past(turning_into_it()), "bar"),
    ],
    ids=["out and back", "a full turn", "a cart", "a bar that turns"],
)
def test_what_is_hit_between_two_knots_is_found(make, name, tmp_path):
    certificate = make(tmp_path).certify(step=0.01, turn=0.1)
    assert not certificate.ok
    assert any(name in collision.names for collision in certificate.collisions)


@pytest.mark.parametrize("seed", GRAZING)
def test_what_is_certified_is_free_at_ten_times_as_many_moments(seed):
    depth = missed(seed)
    assert depth is None or depth <= MISSED


@pytest.mark.long
@pytest.mark.parametrize("first", range(0, 10_000, 500))
def test_ten_thousand_that_are_certified_are_free(first):
    found = [missed(seed) for seed in range(first, first + 500)]
    certified = [depth for depth in found if depth is not None]
    assert len(certified) > 200
    assert max(certified) <= MISSED


def test_what_takes_too_many_moments_is_refused():
    once, times = out_and_back(), np.arange(101.0)
    rows = np.arange(101) % 2
    often = Motion(
        once.layout,
        times,
        {"arm": once.positions["arm"][rows]},
        {"arm": once.velocities["arm"][rows]},
    )
    with pytest.raises(MotionError, match="takes about .* moments.*larger step"):
        often.certify(step=1e-6)


def test_bodies_that_overlap_are_never_certified():
    certificate = standing_past(box("wall", (0.1, 0.1, 0.1), (0.0, 2.0, 0.0))).certify()
    assert certificate.ok
    assert certificate.clearance is not None
    overlapping = replace(certificate.clearance, distance=-1e-3)
    assert not replace(certificate, clearance=overlapping).ok


@pytest.mark.parametrize("speed", [20.0, 1e6])
def test_what_is_too_fast_is_refused_before_collisions_are_looked_for(speed):
    certificate = out_and_back(speed=speed).certify()
    assert (certificate.ok, certificate.moments) == (False, 0)
    assert any("arm.panda_joint1 has" in text for text in certificate.too_fast)
    assert any("arm.panda_joint1 is" in text for text in certificate.joint_limits)
    assert "collisions were not looked for" in str(certificate)


def test_limits_are_looked_at_between_the_knots_too():
    certificate = out_and_back(seconds=8.0).certify()
    assert any("arm.panda_joint1 is 0.1" in text for text in certificate.joint_limits)


def test_too_many_obstacles_are_refused():
    crate = box("crate", (0.1, 0.1, 0.1)).shapes * 2001
    with pytest.raises(LayoutError, match="2001 convex parts together; it takes 2000 at most"):
        standing_past(Obstacle("crate", crate)).certify()


@pytest.mark.parametrize("step", [0.0, -1.0, float("nan"), "1"])
def test_steps_that_are_no_lengths_are_refused(step):
    with pytest.raises(MotionError, match="step is"):
        out_and_back().certify(step=step)
    with pytest.raises(MotionError, match="turn is"):
        out_and_back().certify(turn=step)
