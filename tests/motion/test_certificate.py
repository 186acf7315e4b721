"""Certificates: what a dense check of a motion finds."""

import numpy as np
import pytest

from robot_layouts.motion import Motion, plan
from robot_layouts.motion.collision.cell import Cell
from tests.motion.two_pandas import aside, cell, in_the_middle, turned


def sweep():
    return plan(cell(), aside(), {"left": turned("left", -1.4)})


def test_a_plan_is_certified_and_says_who_came_how_near():
    certificate = sweep().certify()
    assert certificate.ok
    assert str(certificate).startswith("certified: ")
    assert "least clearance: at" in str(certificate)
    assert certificate.velocity <= 1.01
    assert certificate.acceleration == pytest.approx(1.0, abs=0.02)


def test_the_least_clearance_is_that_of_fine_samples():
    motion = sweep()
    near = motion.certify().clearance
    assert near is not None
    whole = Cell(cell())
    states = np.concatenate(list(motion.sample(np.linspace(0, motion.duration, 400)).values()), 1)
    assert near.distance == pytest.approx(whole.checker(own=None).distance(states).min(), abs=2e-4)


def test_moments_are_as_dense_as_asked():
    motion = sweep()
    coarse, fine = motion.certify(step=0.01, turn=0.1), motion.certify(step=0.001, turn=0.1)
    assert 5 * coarse.moments < fine.moments
    assert (coarse.step, fine.step) == (0.01, 0.001)


def test_a_robot_that_is_too_fast_is_named():
    motion = sweep()
    fast = Motion(
        motion.layout,
        motion.times / 1.5,
        motion.positions,
        {name: 1.5 * speeds for name, speeds in motion.velocities.items()},
        largest_velocities=motion.largest_velocities,
        largest_accelerations=motion.largest_accelerations,
    )
    certificate = fast.certify()
    assert not certificate.ok
    assert any("left.panda_joint1 has" in text for text in certificate.too_fast)
    assert any("acceleration" in text for text in certificate.too_fast)


def test_a_joint_beyond_its_limit_is_named():
    motion = plan(cell(), aside(), {"right": in_the_middle()})
    positions = {name: qpos.copy() for name, qpos in motion.positions.items()}
    positions["left"][:, 0] += np.linspace(0.0, 3.0, len(motion.times))
    velocities = dict(motion.velocities)
    velocities["left"] = np.gradient(positions["left"], motion.times, axis=0)
    certificate = Motion(motion.layout, motion.times, positions, velocities).certify()
    assert any("left.panda_joint1 is" in text for text in certificate.joint_limits)
    assert certificate.acceleration is None
