"""Balls contain the bodies that they stand for, and are few, tight and always the same."""

import numpy as np
import pytest

from robot_layouts.motion.collision.spheres import clusters_of
from robots import RobotRegistry
from robots.bodies.hulls import Hull, load_model
from tests.catalogue import every_robot


def links_of(robot: str) -> list[tuple[Hull, ...]]:
    links: dict[int, list[Hull]] = {}
    for hull in load_model(RobotRegistry.load(robot)).hulls:
        links.setdefault(hull.link, []).append(hull)
    return [tuple(hulls) for hulls in links.values()]


@pytest.mark.parametrize("robot", every_robot(quick=("panda", "so100", "xarm7")))
def test_every_point_of_a_hull_is_in_a_ball_of_its_own_and_in_one_around(robot):
    random = np.random.default_rng(0)
    for hulls in links_of(robot):
        clusters = clusters_of(hulls)
        for i, hull in enumerate(hulls):
            weights = random.dirichlet(np.full(len(hull.corners), 0.02), 300)
            points = np.concatenate([hull.corners, weights @ hull.corners])
            own = [(c.middles[c.hulls == i], c.radii[c.hulls == i]) for c in clusters]
            middles, radii = (np.concatenate(column) for column in zip(*own, strict=True))
            gaps = np.linalg.norm(points[:, None] - middles, axis=-1) - radii
            assert gaps.min(axis=1).max() <= 1e-9
            around = [np.linalg.norm(points - c.middle, axis=1) - c.radius for c in clusters]
            assert np.min(around, axis=0).max() <= 1e-9


def test_balls_are_tight():
    """At least as tight as it takes to leave FCL few pairs: see ``benchmarks.motion``."""
    for hulls in links_of("panda"):
        for cluster in clusters_of(hulls):
            assert cluster.radii.max() <= cluster.radius + 1e-9
            if cluster.radius > 0.08:
                assert cluster.radii.mean() < 0.8 * cluster.radius
