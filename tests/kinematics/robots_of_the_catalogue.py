"""Every robot of the catalogue as a tree, and as the physics engine has it."""

import functools

import numpy as np

from layouts import Layout, Placement
from robot_layouts.kinematics.tree import Tree
from robot_layouts.simulation.sapien3.world import BuiltWorld
from robots import RobotRegistry
from robots.urdf.reading import read_model
from robots.urdf.summary import read_cleaned
from robots.urdf.tree import kinematic_tree


@functools.cache
def tree_of(robot: str) -> Tree:
    descriptor = RobotRegistry.load(robot)
    urdf = descriptor.urdf.locate()
    return kinematic_tree(read_model(read_cleaned(urdf).xml, urdf.name), descriptor.joints)


@functools.cache
def world_of(robot: str) -> BuiltWorld:
    """Make a world with the robot's base at the origin."""
    placement = Placement(RobotRegistry.load(robot), (0, 0, 0), (1, 0, 0, 0))
    return BuiltWorld(Layout({"arm": placement}))


def simulated(robot: str):
    """Return the robot in SAPIEN."""
    return world_of(robot).robots["arm"]


def engine_poses(robot: str, qpos: np.ndarray) -> dict[str, np.ndarray]:
    """Pose of every link at joint positions in the descriptor's order, (4, 4), by SAPIEN."""
    arm = simulated(robot)
    active = np.zeros(len(arm.joints))
    active[arm.active_index] = qpos
    arm.articulation.set_qpos(active)
    return {name: made.entity_pose.to_transformation_matrix() for name, made in arm.links.items()}


def random_qpos(robot: str, seed: int, count: int = 1) -> np.ndarray:
    """Joint positions within the limits, (count, dof)."""
    low, high = np.clip(tree_of(robot).limits, -4.0, 4.0).T  # some bases slide for 20 m
    return np.random.default_rng(seed).uniform(low, high, (count, len(low)))
