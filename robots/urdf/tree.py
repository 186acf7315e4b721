"""The tree of links that a URDF describes, as the arrays of `robot_layouts.kinematics.tree`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from robot_layouts.core.errors import DescriptorError, UnknownNameError
from robot_layouts.kinematics.rotations import Floats
from robot_layouts.kinematics.tree import FIXED, Tree
from robots.urdf.model import ModelJoint, UrdfModel


def kinematic_tree(model: UrdfModel, driven: Sequence[str] | None = None) -> Tree:
    """Return a robot's tree; its links are ordered depth first from the root.

    Args:
        model: Its links and joints.
        driven: Names of the joints whose positions are the coordinates, in that order; every joint
            that moves must be one of them or mimic one. None takes all joints that move, each on
            its own, in the URDF's order.

    Raises:
        DescriptorError: If a driven joint does not exist, or a joint that moves has no drive.
    """
    moving = {joint.name: joint for joint in model.moving}
    coordinates = tuple(moving if driven is None else driven)
    missing = [name for name in coordinates if name not in moving]
    if missing:
        raise DescriptorError(
            f"the URDF of {model.name!r} has no moving joints {missing}; it has {list(moving)}"
        )
    links = (model.root, *(joint.child for joint in model.ordered))
    index = {link: i for i, link in enumerate(links)}
    follows = [
        _follows(joint, moving, coordinates, model.name) if joint.moves else (FIXED, 1.0, 0.0)
        for joint in model.ordered
    ]
    drivers, multipliers, offsets = zip((FIXED, 1.0, 0.0), *follows, strict=True)
    return Tree(
        links=links,
        parents=np.array([-1, *(index[joint.parent] for joint in model.ordered)]),
        origins=np.array([np.eye(4), *(joint.origin for joint in model.ordered)]),
        axes=np.array([(1.0, 0.0, 0.0), *(joint.axis for joint in model.ordered)]),
        slides=np.array([False, *(joint.type == "prismatic" for joint in model.ordered)]),
        drivers=np.array(drivers),
        multipliers=np.array(multipliers),
        offsets=np.array(offsets),
        coordinates=coordinates,
        limits=np.array([_limits(moving[name]) for name in coordinates]).reshape(-1, 2),
    )


def rest_poses(model: UrdfModel) -> dict[str, Floats]:
    """Return the pose of each link with every joint at 0, (4, 4), in the root's frame (m)."""
    tree = kinematic_tree(model)
    poses = tree.forward(np.zeros((1, len(tree.coordinates))))[0]
    return dict(zip(tree.links, poses, strict=True))


def link_index(tree: Tree, name: str) -> int:
    """Return the index of a link of a tree.

    Raises:
        UnknownNameError: If there is no such link.
    """
    if name not in tree.links:
        raise UnknownNameError("link", name, tree.links)
    return tree.link(name)


def _limits(joint: ModelJoint) -> tuple[float, float]:
    low = -math.inf if joint.lower is None else joint.lower
    return low, math.inf if joint.upper is None else joint.upper


def _follows(
    joint: ModelJoint, moving: Mapping[str, ModelJoint], driven: Sequence[str], robot: str
) -> tuple[int, float, float]:
    """Return which coordinate a joint follows, times what, plus what."""
    multiplier, offset, at = 1.0, 0.0, joint
    while at.name not in driven:
        if at.mimics is None:
            raise DescriptorError(
                f"joint {at.name!r} of {robot!r} moves, but is in no joint group and mimics no"
                " joint of one"
            )
        offset += multiplier * at.offset
        multiplier *= at.multiplier
        at = moving[at.mimics]
    return driven.index(at.name), multiplier, offset
