"""What a batch of worlds looks like after a step: poses, joints, contacts, grasps, as tensors."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from robots import SimulationError, UnknownNameError
from simulation.contacts import grasped, pairwise_forces

if TYPE_CHECKING:
    from simulation.simulation import Simulation


class State:
    """A read-out of N worlds right after a step or a reset.

    Poses and joints are read at once; velocities and contacts on first use, which must be before
    the simulation moves on. Poses are position (m) and quaternion (wxyz), in the world frame.
    Tensors are float32 and never change afterwards.

    Attributes:
        num_envs: Number of worlds N.
    """

    def __init__(self, simulation: Simulation) -> None:
        """Read poses and joints of every world."""
        self._simulation = simulation
        self._stamp = simulation.stamp
        self._memo: dict[object, Tensor] = {}
        self.num_envs = len(simulation.worlds)
        index = simulation.index
        poses = np.empty((self.num_envs, index.entities, 7), np.float32)
        joints = np.empty((self.num_envs, 2, index.dof), np.float32)
        for i, world in enumerate(simulation.worlds):
            packed = np.frombuffer(world.scene.pack_poses(), np.float32).reshape(-1, 7)
            poses[i, :, :3] = packed[:, 4:]  # SAPIEN packs the quaternion first
            poses[i, :, 3:] = packed[:, :4]
            for robot, part in zip(world.robots.values(), index.joint_slices, strict=True):
                joints[i, 0, part] = robot.articulation.qpos
                joints[i, 1, part] = robot.articulation.qvel
        self.joint_positions = joints[:, 0]
        self._poses = torch.from_numpy(poses)
        self._joints = torch.from_numpy(joints)

    # -- bodies ------------------------------------------------------------------------------

    def pose(self, body: str) -> Tensor:
        """Pose of a body, shape (N, 7)."""
        return self._once(("pose", body), lambda: self._poses[:, self._entity(body)])

    def position(self, body: str) -> Tensor:
        """Position of a body, shape (N, 3) (m)."""
        return self._once(("position", body), lambda: self.pose(body)[:, :3])

    def quaternion(self, body: str) -> Tensor:
        """Orientation of a body, wxyz, shape (N, 4)."""
        return self._once(("quaternion", body), lambda: self.pose(body)[:, 3:])

    def linear_velocity(self, body: str) -> Tensor:
        """Linear velocity of a body in the world frame, shape (N, 3) (m/s)."""
        return self._once(
            ("linear", body), lambda: self._velocity(body, lambda c: c.linear_velocity)
        )

    def angular_velocity(self, body: str) -> Tensor:
        """Angular velocity of a body in the world frame, shape (N, 3) (rad/s)."""
        return self._once(
            ("angular", body), lambda: self._velocity(body, lambda c: c.angular_velocity)
        )

    # -- robots ------------------------------------------------------------------------------

    def qpos(self, robot: str) -> Tensor:
        """Joint positions of a robot in SAPIEN's joint order, shape (N, dof) (rad, m)."""
        return self._once(("qpos", robot), lambda: self._joints[:, 0, self._joint_slice(robot)])

    def qvel(self, robot: str) -> Tensor:
        """Joint velocities of a robot in SAPIEN's joint order, shape (N, dof) (rad/s, m/s)."""
        return self._once(("qvel", robot), lambda: self._joints[:, 1, self._joint_slice(robot)])

    def arm_qvel(self, robot: str) -> Tensor:
        """Joint velocities of a robot without its gripper, shape (N, arm joints) (rad/s)."""
        return self._once(
            ("arm_qvel", robot),
            lambda: self.qvel(robot)[:, self._simulation.index.arm_joints[robot]],
        )

    def link_pose(self, robot: str, link: str) -> Tensor:
        """Pose of a link, shape (N, 7)."""
        return self._once(
            ("link", robot, link),
            lambda: self._poses[:, self._simulation.index.link(robot, link)],
        )

    def link_position(self, robot: str, link: str) -> Tensor:
        """Position of a link, shape (N, 3) (m)."""
        return self._once(
            ("link_position", robot, link), lambda: self.link_pose(robot, link)[:, :3]
        )

    def tcp_pose(self, robot: str) -> Tensor:
        """Pose of a robot's tool centre point, shape (N, 7)."""
        return self._once(("tcp", robot), lambda: self._tcp_pose(robot))

    def tcp_position(self, robot: str) -> Tensor:
        """Position of a robot's tool centre point, shape (N, 3) (m)."""
        return self._once(("tcp_position", robot), lambda: self.tcp_pose(robot)[:, :3])

    def finger_positions(self, robot: str) -> tuple[Tensor, Tensor] | None:
        """Positions of a robot's two finger links, each (N, 3) (m), or None if it has none."""
        fingers = self._simulation.descriptor(robot).fingers
        if fingers is None:
            return None
        first, second = fingers.links
        return self.link_position(robot, first), self.link_position(robot, second)

    def is_static(self, robot: str, threshold: float = 0.2) -> Tensor:
        """Whether no arm joint is faster than ``threshold`` (rad/s), shape (N,) bool."""
        return self.arm_qvel(robot).abs().amax(1) <= threshold

    # -- contacts ----------------------------------------------------------------------------

    def contact_force(self, robot: str, link: str, body: str) -> Tensor:
        """Sum of the contact forces of a body on a link, shape (N, 3) (N, world frame)."""
        return self._once(
            ("force", robot, link, body), lambda: self._contact_forces(robot, (link,), body)[:, 0]
        )

    def is_grasping(self, robot: str, body: str) -> Tensor:
        """Whether a robot's two fingers hold a body, shape (N,) bool; see `robots.Fingers`."""
        return self._once(("grasp", robot, body), lambda: self._is_grasping(robot, body))

    # -- distances ---------------------------------------------------------------------------

    def distance(self, a: str, b: str) -> Tensor:
        """Distance between the origins of two bodies, shape (N,) (m)."""
        return self._once(
            ("distance", a, b),
            lambda: torch.linalg.vector_norm(self.position(b) - self.position(a), dim=1),
        )

    def planar_distance(self, a: str, b: str) -> Tensor:
        """Distance between the origins of two bodies seen from above, shape (N,) (m)."""
        return self._once(
            ("planar_distance", a, b),
            lambda: torch.linalg.vector_norm((self.position(b) - self.position(a))[:, :2], dim=1),
        )

    def tcp_distance(self, robot: str, body: str) -> Tensor:
        """Distance from a robot's tool centre point to a body's origin, shape (N,) (m)."""
        return self._once(
            ("tcp_distance", robot, body),
            lambda: torch.linalg.vector_norm(
                self.position(body) - self.tcp_position(robot), dim=1
            ),
        )

    # -- inside ------------------------------------------------------------------------------

    def _once(self, key: object, compute: Callable[[], Tensor]) -> Tensor:
        found = self._memo.get(key)
        if found is None:
            found = self._memo[key] = compute()
        return found

    def _entity(self, body: str) -> int:
        bodies = self._simulation.index.bodies
        if body not in bodies:
            raise UnknownNameError("body of this world", body, bodies)
        return bodies[body]

    def _joint_slice(self, robot: str) -> slice:
        return self._simulation.index.joint_slice(robot)

    def _tcp_pose(self, robot: str) -> Tensor:
        descriptor = self._simulation.descriptor(robot)
        frame = self.link_pose(robot, descriptor.tcp_link)
        if not descriptor.tcp_position_links:
            return frame
        points = [self.link_position(robot, link) for link in descriptor.tcp_position_links]
        return torch.cat([sum(points[1:], points[0]) / len(points), frame[:, 3:]], 1)

    def _velocity(self, body: str, read: Callable[..., np.ndarray]) -> Tensor:
        self._expect_current()
        bodies = [world.body(body) for world in self._simulation.worlds]
        if bodies[0].kind != "dynamic":
            return torch.zeros(self.num_envs, 3)
        return torch.from_numpy(np.stack([read(found.component) for found in bodies]))

    def _contact_forces(self, robot: str, links: tuple[str, ...], body: str) -> Tensor:
        self._expect_current()
        forces = [
            pairwise_forces(world, robot, links, body) for world in self._simulation.worlds
        ]
        return torch.from_numpy(np.stack(forces))

    def _is_grasping(self, robot: str, body: str) -> Tensor:
        fingers = self._simulation.descriptor(robot).fingers
        if fingers is None:
            return torch.zeros(self.num_envs, dtype=torch.bool)
        forces = self._contact_forces(robot, fingers.links, body)
        return grasped(fingers, forces, [self.link_pose(robot, link) for link in fingers.links])

    def _expect_current(self) -> None:
        if self._stamp != self._simulation.stamp:
            raise SimulationError(
                "velocities and contacts were asked of a state that is no longer the present one;"
                " read them before the next step or reset"
            )
