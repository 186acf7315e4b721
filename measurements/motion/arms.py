"""Arms that cells may hold besides those of the catalogue: from URDFs of installed packages.

An arm is what `RobotDescriptor.from_urdf` takes for one arm, with or without a gripper, and nothing
else (no legs, wheels, heads or slides), of the size and number of joints that manipulators have.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from measurements.robots.sources import Robot, find_robots, package_folder
from robots import RobotDescriptor, RobotLayoutsError

GROUPS = {"arm", "gripper"}
JOINTS = range(5, 9)  # of an arm
MOST_JOINTS = 16  # of arm and gripper; URDFs with more are not looked at
REACHES = (0.35, 1.5)  # m; flying and toy arms are smaller or larger

_MOVING = re.compile(rb"""<joint\s[^>]*type\s*=\s*["'](?:revolute|continuous|prismatic)["']""")


@dataclass(frozen=True)
class Arm:
    """An arm and where it comes from.

    Attributes:
        source: Its package and its path there.
        robot: What its URDF was taken for; called as there, with ``_urdf`` behind.
    """

    source: str
    robot: RobotDescriptor


@lru_cache(maxsize=4)
def arms_of(packages: tuple[str, ...]) -> tuple[Arm, ...]:
    """Return the arms of installed packages; see `arms_in`.

    Raises:
        MissingPackageError: If a package is not installed.
        UnknownNameError: If it is none in which robots are known to lie.
    """
    return tuple(arms_in([(name, package_folder(name)) for name in packages]))


def arms_in(folders: Iterable[tuple[str, Path]]) -> list[Arm]:
    """Return the arms whose URDFs lie in folders, the first of each name in each, sorted by path.

    Args:
        folders: What each is called, and where it is.
    """
    found: dict[tuple[str, str], Arm] = {}
    for file in find_robots(folders):
        robot = _arm(file)
        if robot is not None:
            found.setdefault((file.source, robot.name), Arm(file.key, robot))
    return list(found.values())


def _arm(file: Robot) -> RobotDescriptor | None:
    """Return the arm that a URDF holds, or None."""
    count = len(_MOVING.findall(file.urdf.read_bytes()))
    if not JOINTS.start <= count <= MOST_JOINTS or file.missing_meshes():
        return None
    try:
        robot = RobotDescriptor.from_urdf(file.urdf, quiet=True)
    except RobotLayoutsError:
        return None
    groups = robot.action_split.groups
    is_arm = set(groups) <= GROUPS and len(robot.arm_joints) in JOINTS
    if not is_arm or not REACHES[0] <= robot.reach <= REACHES[1]:
        return None
    return replace(robot, name=f"{robot.name}_urdf")
