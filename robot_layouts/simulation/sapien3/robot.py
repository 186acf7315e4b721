"""A robot in a world: its articulation, links and joints, built from its descriptor."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
import sapien

from layouts import Placement
from robot_layouts.simulation.control.joint_positions import Leaders, joint_speeds
from robot_layouts.simulation.sapien3.blueprint import Blueprint
from robots import DescriptorError, JointGroup, RobotDescriptor, UnknownNameError


class DrivenLinkage:
    """The drives of a joint group with leaders; see `Leaders`."""

    def __init__(self, group: JointGroup, joints: Sequence[Any], articulation: Any) -> None:
        """Take a group, its joints as SAPIEN has them, and what they are joints of."""
        active = articulation.active_joints
        self._articulation, self._leaders = articulation, Leaders(group)
        laws = dict(zip(group.joints, zip(joints, group.followers, strict=True), strict=True))
        leading = [laws[name] for name in group.leaders]
        self._places = [active.index(joint) for joint, _ in leading]
        self._leading = [(joint.set_drive_target, *law) for joint, law in leading]
        self._others = [
            (joint.set_drive_target, joint.set_drive_velocity_target, *laws[name][1])
            for name, (joint, _) in laws.items()
            if name not in group.leaders
        ]
        first, (multiplier, offset) = joints[0], group.followers[0]
        self._wanted = (float(first.drive_target[0]) - offset) / multiplier
        self.setters: list[Callable[[float], None]] = [
            partial(self._want, multiplier, offset),
            *[_ignore] * (len(joints) - 1),
        ]

    def pull(self) -> None:
        """Set the targets of all joints for the next step of physics."""
        qpos, qvel = self._articulation.qpos, self._articulation.qvel
        ahead, value, speed = self._leaders.moved(
            self._wanted, qpos[self._places], qvel[self._places]
        )
        for go, multiplier, offset in self._leading:
            go(multiplier * ahead + offset)
        for go, move, multiplier, offset in self._others:
            go(multiplier * value + offset)
            move(multiplier * speed)

    def _want(self, multiplier: float, offset: float, target: float) -> None:
        """Take the target of the group's first joint, which tells that of all."""
        self._wanted = (target - offset) / multiplier


def _ignore(target: float) -> None:
    """Leave a joint's own target aside."""


_STILL = np.zeros(3, np.float32)


class SimulatedRobot:
    """One robot of one world.

    Attributes:
        name: Its name in the layout.
        descriptor: What it is.
        articulation: SAPIEN's articulation.
        links: Link by name.
        joints: Active joints, in SAPIEN's order, which is that of the articulation's qpos and qvel.
        driven: Active joints in the order of the descriptor's joints.
        active_index: For each joint of the descriptor, its place in SAPIEN's order.
        loaded_order: For each active joint in SAPIEN's order, its place in the descriptor.
        setters: What sets the drive target of each of these (rad, m).
        linkages: Joint groups whose fingers lead.
        speeds: What is taken as the limits of the descriptor's joints' speeds, (dof,) (rad/s, m/s).
        root: The root link.
    """

    def __init__(
        self,
        scene: sapien.Scene,
        name: str,
        placement: Placement,
        blueprint: Blueprint,
        number: int = 0,
        *,
        links_pass: bool = False,
    ) -> None:
        """Build it in ``scene``, stand it at its placement and set its drives.

        Args:
            scene: SAPIEN's scene.
            name: Its name in the layout.
            placement: What it is and where it stands.
            blueprint: What `robot_layouts.simulation.sapien3.blueprint.read_blueprint` made of it.
            number: Which of the scene's robots it is.
            links_pass: See `robot_layouts.simulation.World`.

        Raises:
            AssetError: If SAPIEN left out a collision shape.
            DescriptorError: If the descriptor names joints or links that the URDF lacks.
        """
        descriptor = placement.robot
        self.name, self.descriptor = name, descriptor
        self.base_pose = sapien.Pose(list(placement.base_position), list(placement.base_quaternion))
        self.articulation: Any = blueprint.build(
            scene, self.base_pose, number, links_pass=links_pass
        )
        self.links = {link.name: link for link in self.articulation.links}
        self.joints: list[Any] = list(self.articulation.active_joints)
        self.active_index = _active_index(descriptor, [joint.name for joint in self.joints])
        self.loaded_order = [descriptor.joints.index(joint.name) for joint in self.joints]
        self.root: Any = self.articulation.links[0]
        self.driven = [self.joints[i] for i in self.active_index]
        self.speeds = joint_speeds(descriptor, blueprint.model)
        self._set_drives()
        self.linkages: list[DrivenLinkage] = []
        self.setters = list(self._setters())
        for link in self.links.values():
            link.disable_gravity = True

    def link(self, name: str) -> Any:
        """Return a link by name.

        Raises:
            UnknownNameError: If the robot has no such link.
        """
        if name not in self.links:
            raise UnknownNameError(f"link of {self.descriptor.name}", name, self.links)
        return self.links[name]

    def reset(self, qpos: Sequence[float] | np.ndarray) -> None:
        """Stand at the base pose with joint positions ``qpos``, all velocities and forces zero.

        Args:
            qpos: Positions in the order of the descriptor's joints, shape (dof,) (rad, m).
        """
        still = np.zeros(len(self.joints), np.float32)
        active = np.zeros(len(self.joints))
        active[self.active_index] = qpos
        self.articulation.set_qpos(active)
        self.articulation.set_qvel(still)
        self.articulation.set_qf(still)
        # The literal pose, never one that was read back: reading rounds, and moves the links.
        self.articulation.set_root_pose(self.base_pose)

    def restore(self, row: np.ndarray) -> None:
        """Take over a state row.

        Args:
            row: Root pose (m, wxyz), linear (m/s) and angular velocity (rad/s), qpos and qvel in
                the order of the descriptor's joints; shape (13 + 2 · dof,).
        """
        dof = len(self.joints)
        qpos, qvel = np.empty((2, dof), row.dtype)
        qpos[self.active_index], qvel[self.active_index] = row[13 : 13 + dof], row[13 + dof :]
        self.articulation.set_root_pose(sapien.Pose(row[:3].tolist(), row[3:7].tolist()))
        self.articulation.set_root_linear_velocity(row[7:10])
        self.articulation.set_root_angular_velocity(row[10:13])
        self.articulation.set_qpos(qpos)
        self.articulation.set_qvel(qvel)

    def stop(self) -> None:
        """Zero every velocity and force, leaving positions alone."""
        still = np.zeros(len(self.joints), np.float32)
        self.articulation.set_qvel(still)
        self.articulation.set_root_linear_velocity(_STILL)
        self.articulation.set_root_angular_velocity(_STILL)
        self.articulation.set_qf(still)

    def _set_drives(self) -> None:
        joints = iter(self.driven)
        for group in self.descriptor.action_split.groups.values():
            for drive, armature in zip(group.drives, group.armatures, strict=True):
                joint = next(joints)
                joint.set_drive_properties(*drive, "force")
                joint.set_friction(group.friction)
                if armature:
                    joint.set_armature(np.array([armature], np.float32))

    def _setters(self) -> Iterator[Callable[[float], None]]:
        first = 0
        for group in self.descriptor.action_split.groups.values():
            joints = self.driven[first : first + len(group.joints)]
            if group.leaders:
                self.linkages.append(DrivenLinkage(group, joints, self.articulation))
                yield from self.linkages[-1].setters
            else:
                yield from (joint.set_drive_target for joint in joints)
            first += len(joints)


def _active_index(descriptor: RobotDescriptor, active: list[str]) -> list[int]:
    missing = [joint for joint in descriptor.joints if joint not in active]
    if missing:
        raise DescriptorError(
            f"{descriptor.name}: its URDF has no active joints {missing}; it has {active}"
        )
    undriven = [joint for joint in active if joint not in descriptor.joints]
    if undriven:
        raise DescriptorError(
            f"{descriptor.name}: joints {undriven} of its URDF are in no joint group;"
            " every active joint needs a drive"
        )
    return [active.index(joint) for joint in descriptor.joints]
