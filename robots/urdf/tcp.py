"""Where the tool centre point of a robot is among the links of a tree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robot_layouts.kinematics.rotations import Floats
from robot_layouts.kinematics.tree import Tree
from robots.descriptor import RobotDescriptor
from robots.parts import Limb, Vector3
from robots.urdf.tree import link_index


@dataclass(frozen=True, eq=False)
class Tcp:
    """A tool centre point.

    Attributes:
        links: Indices of the links whose mean origin it is, or lies beside.
        turned: Index of the link that orients it.
        offset: From that mean to it, in the frame of ``turned``, (3,) (m).
    """

    links: tuple[int, ...]
    turned: int
    offset: Floats

    @property
    def needed(self) -> tuple[int, ...]:
        """All links that it hangs on."""
        return (*self.links, self.turned)

    def places(self, poses: Floats) -> Floats:
        """Return where it is, (n, 3) (m), where the tree's links have some poses.

        Args:
            poses: (n, links, 4, 4) (m).
        """
        origins = poses[:, list(self.links)][..., :3, 3].mean(axis=1)
        return origins + poses[:, self.turned, :3, :3] @ self.offset


def find_tcp(robot: RobotDescriptor | Limb, tree: Tree) -> Tcp:
    """Return the tool centre point of a robot or a limb on a tree that has its links.

    Raises:
        UnknownNameError: If the tree lacks one of them.
    """
    return place_tcp(tree, robot.tcp_link, robot.tcp_position_links, robot.tcp_offset)


def place_tcp(tree: Tree, link: str, links: Sequence[str], offset: Vector3) -> Tcp:
    """Return a tool centre point on a tree; see `robots.RobotDescriptor` for what describes it.

    Args:
        tree: The links.
        link: The one that orients it.
        links: Those whose mean origin it is; ``link`` if empty.
        offset: From there to it, in the frame of ``link`` (m).

    Raises:
        UnknownNameError: If the tree lacks one of the links.
    """
    origins = tuple(link_index(tree, name) for name in links or (link,))
    return Tcp(origins, link_index(tree, link), np.array(offset))
