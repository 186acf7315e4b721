"""How far the tool centre point of a limb gets from the base."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from kinematics.rotations import Floats, inverse_pose, transform
from kinematics.solve import farthest
from kinematics.tree import Tree
from robots.guessing.anatomy import FARTHEST_SLIDE, Limb
from robots.guessing.tool import Tool
from robots.parts import Vector3
from robots.urdf.model import ModelJoint, UrdfModel
from robots.urdf.tree import kinematic_tree

STARTS = 8  # of the search for the largest distance


def find_base(model: UrdfModel, limb: Limb, rest: Mapping[str, float]) -> Vector3:
    """Return where a limb's first joint is, in the robot's frame (m).

    Args:
        model: What the robot's URDF describes.
        limb: The limb.
        rest: Where the joints are (rad, m).
    """
    tree = kinematic_tree(model)
    start = np.array([rest.get(joint, 0.0) for joint in tree.coordinates])
    first = (*limb.arm, *limb.fingers)[0]
    x, y, z = tree.forward(start[None])[0][tree.link(first.child), :3, 3].round(4).tolist()
    return x, y, z


def find_reach(
    model: UrdfModel,
    limb: Limb,
    tool: Tool,
    rest: Mapping[str, float],
    base: Vector3 = (0.0, 0.0, 0.0),
) -> tuple[float, str]:
    """Return a limb's reach (m), and how it was found.

    Args:
        model: What the robot's URDF describes.
        limb: The limb.
        tool: Its tool centre point.
        rest: Where the other joints are (rad, m).
        base: Where the vertical is that the reach is measured from, in the robot's frame (m).
    """
    tree = kinematic_tree(model)
    start = np.array([rest.get(joint, 0.0) for joint in tree.coordinates])
    origins = tree.origins.copy()
    origins[tree.parents == 0, :2, 3] -= base[:2]
    tree = replace(tree, origins=origins)
    poses = tree.forward(start[None])
    palm = tree.link(limb.palm)
    point = transform(inverse_pose(poses[0, palm]), tool.on(tree).places(poses)[0])
    moving = [joint for joint in limb.arm if not _flies(joint)]
    starts = _postures(tree, start, moving)
    free = [tree.coordinates.index(joint.name) for joint in moving]
    limits = tree.limits.copy()
    limits[free] = np.array([joint.span for joint in moving]).reshape(-1, 2)
    found = farthest(replace(tree, limits=limits), palm, point, starts, free)
    if found < 0.01 or len(moving) < len(limb.arm):
        return 1.0, "reach: 1 m, without ground, as nothing stands fixed or nothing reaches out"
    return round(found, 3), (
        "reach: the TCP's largest distance from the base's z axis within the joint limits;"
        " data sheets, which measure to the flange, give less"
    )


def _postures(tree: Tree, rest: Floats, moving: Sequence[ModelJoint]) -> Floats:
    """Return where the search for the reach starts: in the joints' middle, and in random places."""
    starts = np.tile(rest, (STARTS, 1))
    generator = random.Random(0)  # the same answer every time
    for i, start in enumerate(starts):
        for joint in moving:
            position = generator.uniform(*joint.span) if i else sum(joint.span) / 2
            start[tree.coordinates.index(joint.name)] = position
    return starts


def _flies(joint: ModelJoint) -> bool:
    low, high = joint.span
    return joint.unit == "m" and high - low > FARTHEST_SLIDE
