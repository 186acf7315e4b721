"""Which joints bring a link to a pose, by the search with which native's controllers drive.

It is SAPIEN's Pinocchio, on the robot's own URDF and with native's arguments: its results are
native's to the last bit. `arms` beside it takes SAPIEN's model of what was built, whose
numbers are rounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree

import numpy as np
import sapien
from numpy.typing import NDArray
from sapien.wrapper.pinocchio_model import PinocchioModel

from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.sapien3.robot import SimulatedRobot
from robots import DescriptorError, UnknownNameError
from robots.urdf.checks import link_of

_MAX_ITERATIONS = 100  # mani_skill 3.0.1, agents/controllers/utils/kinematics.py
_GRAVITY = [0, 0, -9.81]  # as there; it moves nothing here

# What Pinocchio reads of a joint, and what its parser insists on, 0 if left out; its search does
# not use limits.
_PARTS = ("parent", "child", "origin", "axis", "limit", "dynamics", "mimic")
_FIXED_PARTS = _PARTS[:4]
_DEFAULTS = {
    "limit": ("lower", "upper", "effort", "velocity"),
    "dynamics": ("damping", "friction"),
}


class PinocchioFollower:
    """Follows poses of one link of a robot; see `robot_layouts.simulation.backend.PoseFollower`."""

    def __init__(
        self,
        robot: SimulatedRobot,
        urdf: bytes,
        link: str,
        root_link: str | None,
        joints: Sequence[str],
    ) -> None:
        """Read the robot's kinematic model.

        Args:
            robot: The robot, for the order of its joints and links.
            urdf: Its URDF's contents.
            link: The link that is to follow.
            root_link: Link whose frame poses are in; the robot's root if None.
            joints: Those that may move.

        Raises:
            UnknownNameError: If the robot has no such link.
            DescriptorError: If the joints do not move the link.
        """
        for name in (link, root_link):
            if name is not None:
                robot.link(name)
        tree = _Subtree(urdf, root_link)
        active = [joint.name for joint in robot.joints if joint.name in tree.joints]
        links = [name for name in robot.links if name in tree.links]
        if link not in links:
            raise UnknownNameError(f"link beyond {root_link}", link, links)
        idle = [joint for joint in joints if joint not in tree.path(link)]
        if len(idle) == len(joints):
            raise DescriptorError(
                f"{robot.descriptor.name}: none of {', '.join(joints)} moves {link}"
            )
        self._pose: Any = sapien.Pose
        self._model: Any = PinocchioModel(tree.text, _GRAVITY)
        self._model.set_joint_order(active)
        self._model.set_link_order(links)
        self._link = links.index(link)
        declared = robot.descriptor.joints
        self._taken: NDArray[np.intp] = np.array([declared.index(joint) for joint in active])
        self._moved: NDArray[np.intp] = np.array([active.index(joint) for joint in joints])
        self._mask = np.zeros(len(active), np.int32)
        self._mask[self._moved] = 1

    def follow(
        self, position: Floats, quaternion: Floats, qpos: Floats, /
    ) -> NDArray[np.float64] | None:
        """Return the joints, or None; see `robot_layouts.simulation.backend.PoseFollower`."""
        found, solved, _ = self._model.compute_inverse_kinematics(
            self._link,
            self._pose(position, quaternion),
            initial_qpos=qpos[self._taken],
            active_qmask=self._mask,
            max_iterations=_MAX_ITERATIONS,
        )
        return found[self._moved] if solved else None


class _Subtree:
    """What a link of a URDF holds, itself the root; all of the URDF if it is None.

    Attributes:
        text: Its XML.
        links: Names of its links.
        joints: Names of its joints.
    """

    def __init__(self, urdf: bytes, root_link: str | None) -> None:
        root = ElementTree.fromstring(urdf)
        _leave_out(root)
        self._above = {link_of(joint, "child"): joint for joint in root.iterfind("joint")}
        if root_link is not None:
            for element in list(root):
                joint = element.tag == "joint"
                last = link_of(element, "child") if joint else element.get("name", "")
                beyond = root_link in self._links_above(last)
                if not beyond or (joint and last == root_link):
                    root.remove(element)
        self.text = ElementTree.tostring(root, encoding="unicode")
        self.links = {link.get("name", "") for link in root.iterfind("link")}
        self.joints = {joint.get("name", "") for joint in root.iterfind("joint")}

    def path(self, link: str) -> set[str]:
        """Return the joints that move a link."""
        return {
            self._above[name].get("name", "")
            for name in self._links_above(link)
            if name in self._above
        }

    def _links_above(self, link: str) -> list[str]:
        """Return a link and all that it hangs on."""
        chain = [link]
        while (joint := self._above.get(chain[-1])) is not None:
            chain.append(link_of(joint, "parent"))
        return chain


def _leave_out(root: ElementTree.Element) -> None:
    """Leave out what Pinocchio does not read, some of which it stumbles over, and set defaults."""
    for element in list(root):
        if element.tag not in ("link", "joint"):
            root.remove(element)
    for link in root.iterfind("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
    for joint in root.iterfind("joint"):
        used = _FIXED_PARTS if joint.get("type") == "fixed" else _PARTS
        for part in list(joint):
            if part.tag not in used:
                joint.remove(part)
            for key in _DEFAULTS.get(part.tag, ()):
                part.set(key, part.get(key, "0"))
