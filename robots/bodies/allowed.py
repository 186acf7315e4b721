"""Which pairs of a robot's links may overlap: one answer for checks, physics and searches."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations
from pathlib import Path

from robot_layouts.core.errors import UnknownNameError
from robots.descriptor import RobotDescriptor
from robots.urdf.model import UrdfModel
from robots.urdf.srdf import ExcludedPair, read_excluded_pairs

LinkPair = frozenset[str]
"""The names of two links."""

DEFAULT_REASON = "default"  # in an SRDF, of the pairs that ManiSkill's loader excludes


def allowed_pairs(
    robot: RobotDescriptor, model: UrdfModel, excluded: Iterable[ExcludedPair]
) -> frozenset[LinkPair]:
    """Return the pairs of links whose contacts do not count.

    Always among them are links that one joint joins, and links that are rigid with each other. To
    them come the robot's ``allowed_collisions``. A robot that does not give those takes the pairs
    of its SRDF that ManiSkill's loader takes, which have the reason ``Default``, and no others.

    Args:
        robot: The robot.
        model: What its URDF describes.
        excluded: The pairs of the SRDF beside it.

    Raises:
        UnknownNameError: If ``allowed_collisions`` names a link that the URDF lacks.
    """
    fixed = joined_pairs(model) | rigid_pairs(model)
    if robot.allowed_collisions is None:
        default = (pair for pair in excluded if pair.reason.lower() == DEFAULT_REASON)
        return fixed | srdf_pairs(default, model)
    for pair in robot.allowed_collisions:
        for link in pair:
            if link not in model.links:
                what = f"link in allowed_collisions of {robot.name}"
                raise UnknownNameError(what, link, model.links)
    return fixed | frozenset(map(frozenset, robot.allowed_collisions))


def read_allowed_pairs(robot: RobotDescriptor, model: UrdfModel, urdf: Path) -> frozenset[LinkPair]:
    """Return `allowed_pairs`, reading the SRDF beside the URDF if the robot relies on it.

    Raises:
        AssetError: If that SRDF cannot be read.
        UnknownNameError: If ``allowed_collisions`` names a link that the URDF lacks.
    """
    excluded = read_excluded_pairs(urdf) if robot.allowed_collisions is None else ()
    return allowed_pairs(robot, model, excluded)


def joined_pairs(model: UrdfModel) -> frozenset[LinkPair]:
    """Return the pairs of links that one joint joins."""
    return frozenset(frozenset((joint.parent, joint.child)) for joint in model.joints)


def rigid_pairs(model: UrdfModel) -> frozenset[LinkPair]:
    """Return the pairs of links that never move against each other."""
    return frozenset(
        frozenset(pair) for links in rigid_groups(model).values() for pair in combinations(links, 2)
    )


def rigid_groups(model: UrdfModel) -> dict[str, list[str]]:
    """Return the links that fixed joints hold together, by the first of each group.

    Groups are ordered depth first from the root; a link alone is a group too.
    """
    groups = {model.root: [model.root]}
    first = {model.root: model.root}
    for joint in model.ordered:
        first[joint.child] = joint.child if joint.moves else first[joint.parent]
        groups.setdefault(first[joint.child], []).append(joint.child)
    return groups


def srdf_pairs(excluded: Iterable[ExcludedPair], model: UrdfModel) -> frozenset[LinkPair]:
    """Return the pairs of an SRDF that are two links of the URDF; it may name others."""
    pairs = (frozenset(pair.links) for pair in excluded)
    return frozenset(pair for pair in pairs if len(pair.intersection(model.links)) == 2)
