"""Whether checks and physics see the same links of a robot inside each other.

Both make convex bodies of the same shapes. PhysX makes its own with fewer corners, up to 3 mm
inside, and where two edges cross it may report an overlap too shallow, or none.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from kinematics.rotations import Floats
from layouts import Placement, single
from layouts.validation.collisions import nearest
from layouts.validation.collisions import stand as stand_hulls
from robots import RobotDescriptor
from robots.bodies.hulls import RobotModel, load_model
from robots.bodies.overlaps import overlapping
from simulation import PhysicsSettings
from simulation.checks.overlaps import empty, stand
from simulation.simulation import Simulation

POSTURES = 200  # random ones
TOUCH = 1e-3  # m; overlaps that are less deep do not count
TIMESTEP = 1e-5  # s, in which nothing moves
_WIDEST = 3.0  # rad or m from 0
_NAME = "robot"

LinkPair = frozenset[str]


class Agreement(NamedTuple):
    """How many pairs of links are inside each other, over all postures.

    Attributes:
        both: For checks and for physics.
        physics: For physics alone.
        checks: For checks alone.
    """

    both: int
    physics: int
    checks: int


def compare(robot: RobotDescriptor, postures: int = POSTURES) -> Agreement:
    """Stand a robot in random postures, and count what checks and physics see.

    Args:
        robot: The robot.
        postures: How many.

    Raises:
        RobotLayoutsError: If it cannot be built.
    """
    model = load_model(robot)
    low, high = np.clip(model.kinematics.limits, -_WIDEST, _WIDEST).T
    drawn = np.random.default_rng(1).uniform(low, high, (postures, len(low)))
    both = physics = checks = 0
    for qpos, seen in zip(drawn, _in_physics(robot, drawn), strict=True):
        found = _in_checks(model, qpos)
        missing = found.keys() - seen.keys()
        both += len(found.keys() & seen.keys())
        physics += sum(seen[pair] > TOUCH for pair in seen.keys() - found.keys())
        checks += sum(_depth(robot, model, qpos, found[pair]) > TOUCH for pair in missing)
    return Agreement(both, physics, checks)


def _in_physics(robot: RobotDescriptor, drawn: Floats) -> Iterator[dict[LinkPair, float]]:
    """Yield the overlaps in each posture, and how deep they are (m)."""
    settings = PhysicsSettings(timestep=TIMESTEP)
    simulation = Simulation(
        single({_NAME: robot}), empty, 1, settings, control_frequency=1 / TIMESTEP
    )
    stand(simulation)
    still = np.zeros((1, robot.action_dim), np.float32)
    for qpos in drawn:
        simulation.worlds[0].stand(_NAME, qpos)
        simulation.touched()
        simulation.step(still, simulation.read().joint_positions)
        overlaps = simulation.backend.overlaps(0)
        yield {frozenset((lap.one.name, lap.other.name)): lap.depth for lap in overlaps}


def _in_checks(model: RobotModel, qpos: Floats) -> dict[LinkPair, list[tuple[int, int]]]:
    """Return the overlaps in a posture, each with the hulls that overlap."""
    poses = model.kinematics.forward(qpos[None])[0]
    found: dict[LinkPair, list[tuple[int, int]]] = {}
    hits = overlapping(model.hulls, poses, model.self_pairs)
    for pair, hit in zip(model.self_pairs, hits, strict=True):
        if hit:
            found.setdefault(frozenset(map(model.link_name, pair)), []).append(pair)
    return found


def _depth(
    robot: RobotDescriptor, model: RobotModel, qpos: Floats, pairs: list[tuple[int, int]]
) -> float:
    """Return how deep the deepest of some pairs of hulls are inside each other (m)."""
    standing = stand_hulls(_NAME, Placement(robot), model, qpos[None])
    approach = nearest(standing, standing, pairs)
    return 0.0 if approach is None else -approach.distance
