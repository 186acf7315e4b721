"""What drives the joints of robots in MuJoCo."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from layouts import Layout
from robot_layouts.simulation.control.joint_positions import Leaders
from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.mujoco.model import Inventory
from robot_layouts.simulation.mujoco.world import MujocoWorld
from robots import JointGroup


class LedGroup:
    """The drives of a joint group with leaders; see `Leaders`.

    Attributes:
        group: The group.
        places: Where its joints stand among all that are driven.
        multipliers: What each joint multiplies the group's value by.
        offsets: What it adds to that then.
        leads: Which of them are leaders.
    """

    def __init__(self, group: JointGroup, first: int) -> None:
        """Take a group, and where its first joint stands among all that are driven."""
        self.group = group
        self.places = slice(first, first + len(group.joints))
        self._leaders = Leaders(group)
        self.multipliers, self.offsets = np.array(group.followers, float).T
        self.leads = np.array([joint in group.leaders for joint in group.joints])

    def targets(self, wanted: float, qpos: Floats, qvel: Floats) -> tuple[Floats, Floats]:
        """Return targets of position and of velocity of the group's joints, each (joints,).

        Args:
            wanted: Target of position of its first joint, which tells that of all.
            qpos: Positions of its joints.
            qvel: Their velocities.
        """
        goal, leads = (wanted - self.offsets[0]) / self.multipliers[0], self._leaders.places
        ahead, value, speed = self._leaders.moved(goal, qpos[leads], qvel[leads])
        positions = self.multipliers * np.where(self.leads, ahead, value) + self.offsets
        return positions, np.where(self.leads, 0.0, self.multipliers * speed)


class JointDrives:
    """The targets of all joints, robots in layout order, joints in the descriptors'.

    A drive pulls with stiffness · (target - position) + damping · (target - velocity), as far as
    its limit lets it; what depends on the targets is its control.

    Attributes:
        positions: Targets of position, (N, dof) (rad, m).
        velocities: Targets of velocity, (N, dof) (rad/s, m/s).
    """

    def __init__(self, worlds: Sequence[MujocoWorld], layout: Layout, index: Inventory) -> None:
        """Hold all joints where the layout starts them."""
        start = [qpos for placement in layout.values() for qpos in placement.start_qpos]
        self.positions = np.tile(np.array(start), (len(worlds), 1))
        self.velocities = np.zeros_like(self.positions)
        self._worlds, self._joints = worlds, index.joints
        self._linkages = linkages(layout)
        if self._linkages:
            for i, world in enumerate(worlds):
                world.before_each = lambda i=i: self.pull(i)

    def pull(self, env: int) -> None:
        """Set what the drives of a world do in its next step."""
        model, data = self._worlds[env].model, self._worlds[env].data
        positions, velocities = self.positions[env], self.velocities[env]
        if self._linkages:
            positions, velocities = positions.copy(), velocities.copy()
        for linkage in self._linkages:
            at = linkage.places
            qpos, qvel = data.qpos[self._joints.qpos[at]], data.qvel[self._joints.qvel[at]]
            positions[at], velocities[at] = linkage.targets(positions[at][0], qpos, qvel)
        springs, dampers = model.actuator_biasprm[:, 1], model.actuator_biasprm[:, 2]
        data.ctrl[:] = -springs * positions - dampers * velocities


def linkages(layout: Layout) -> list[LedGroup]:
    """Return the joint groups of a layout that have leaders."""
    found: list[LedGroup] = []
    first = 0
    for placement in layout.values():
        for group in placement.robot.action_split.groups.values():
            if group.leaders:
                found.append(LedGroup(group, first))
            first += len(group.joints)
    return found
