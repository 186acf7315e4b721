"""A check of a layout and physics see the same contacts between the links of a robot.

Both make convex bodies of the same shapes. PhysX makes its own with fewer corners, up to 3 mm
inside, and where two edges cross it may report an overlap too shallow, or none. So in some of the
overlaps that the check sees physics sees none, but never the other way round.
"""

from __future__ import annotations

import numpy as np
import pytest

from layouts import Layout, Placement
from layouts.validation.collisions import nearest, stand
from robot_layouts.simulation.sapien3.world import BuiltWorld
from robots import RobotDescriptor, RobotRegistry
from robots.assets.manifest import find_package
from robots.bodies.allowed import allowed_pairs, rigid_pairs
from robots.bodies.hulls import load_model
from robots.urdf.reading import read_model
from robots.urdf.srdf import read_excluded_pairs
from robots.urdf.summary import read_urdf
from tests.catalogue import QUICK, every_robot

POSTURES = 200
TOUCH = 1e-3  # m; contacts that are nearer than this to one are one
DEEP = 1e-2  # m; an overlap that physics does not miss
MISSED = 0.03  # of the overlaps deeper than TOUCH, at most, by physics

UNKNOWN = (
    "allegro/allegro_hand_left.urdf",
    "dclaw/dclaw_gripper_glb.urdf",
    "panda/panda_v3.urdf",
    "trifinger/robot_properties_fingers/urdf/pro/trifingerpro.urdf",
    "xarm7/xarm7_ability_right_hand.urdf",
)


def postures(model):
    limits = np.clip(model.kinematics.limits, -3.0, 3.0)
    return np.random.default_rng(1).uniform(*limits.T, (POSTURES, len(limits)))


def in_physics(world, qpos):
    """Return by pair of links the least separation of its contacts (m)."""
    world.robots["arm"].reset(qpos)
    world.system.step()
    separations = {}
    for contact in world.scene.get_contacts():
        pair = frozenset(body.entity.name for body in contact.bodies)
        depths = [separations.get(pair, np.inf), *(point.separation for point in contact.points)]
        separations[pair] = min(depths)
    return separations


def in_checks(descriptor, model, qpos):
    """Return by pair of links the least distance of their hulls (m), where it is small."""
    standing = stand("arm", Placement(descriptor).base_pose, model, qpos[None])
    by_links = {}
    for pair in model.self_pairs:
        links = frozenset(model.link_name(hull) for hull in pair)
        by_links.setdefault(links, []).append(pair)
    found = {links: nearest(standing, standing, pairs) for links, pairs in by_links.items()}
    return {links: approach.distance for links, approach in found.items() if approach}


def compare(descriptor):
    """Return pairs of separation and distance of all pairs of links where either is small (m)."""
    world = BuiltWorld(Layout({"arm": Placement(descriptor)}))
    world.system.timestep = 1e-5
    model = load_model(descriptor)
    urdf = read_model(read_urdf(descriptor.urdf.locate()), "")
    ignored = rigid_pairs(urdf) if descriptor.allowed_collisions is None else frozenset()
    numbers = []
    for qpos in postures(model):
        physics, checks = in_physics(world, qpos), in_checks(descriptor, model, qpos)
        for pair in (physics.keys() | checks.keys()) - ignored:
            numbers.append((physics.get(pair, np.inf), checks.get(pair, np.inf)))
    return np.array(numbers)


def expect_agreement(descriptor):
    separations, distances = compare(descriptor).T
    assert (separations < -TOUCH).any()
    assert (distances[separations < -TOUCH] < TOUCH).all()
    assert (separations[distances < -DEEP] < TOUCH).all()
    overlaps = distances < -TOUCH
    assert (separations[overlaps] >= TOUCH).sum() <= MISSED * overlaps.sum() + 1


@pytest.mark.long
@pytest.mark.parametrize(
    "name", every_robot(sorted({*QUICK} - {"floating_panda_gripper"}), quick=("panda", "so100"))
)
def test_robots_of_the_catalogue(name):
    expect_agreement(RobotRegistry.load(name))


@pytest.mark.native
@pytest.mark.parametrize("file", UNKNOWN)
def test_what_may_overlap_never_collides(file):
    """Whatever the posture, physics reports no contact of a pair that checks leave out."""
    path = find_package("mani_skill") / "mani_skill" / "assets" / "robots" / file
    descriptor = RobotDescriptor.from_urdf(path, quiet=True)
    world = BuiltWorld(Layout({"arm": Placement(descriptor)}))
    urdf = descriptor.urdf.locate()
    allowed = allowed_pairs(
        descriptor, read_model(read_urdf(urdf), str(urdf)), read_excluded_pairs(urdf)
    )
    for qpos in postures(load_model(descriptor)):
        assert not in_physics(world, qpos).keys() & allowed
