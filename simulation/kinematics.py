"""Inverse kinematics: which arm joints bring a robot's tool centre point to a pose."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import sapien
from numpy.typing import NDArray

from robots import SimulationError
from simulation.world import World

Floats = NDArray[np.float64]
Numbers = Sequence[float] | NDArray[np.floating[Any]]

_MAX_ITERATIONS = 200  # converges in 40 … 80 where a solution exists
_STEP = 0.3  # of the way to the linearised solution, per iteration
_DAMPING = 1e-6
_CONVERGED = 1e-4  # norm of the pose error (m and rad together)
_NEARBY_STARTS, _SPREAD = 16, 0.5  # number, standard deviation (rad)
_SEED = 0  # the nearby starts are the same for every request


class InverseKinematics:
    """Solves for the arm of one robot of a world; fingers stay where they are.

    Attributes:
        joints: The arm's joints, in the order of the solutions.
    """

    def __init__(self, world: World, robot: str) -> None:
        """Take the robot's kinematic model.

        Args:
            world: The world it stands in; only its placement and joints are read.
            robot: Its name in the layout.

        Raises:
            UnknownNameError: If the layout has no such robot, or the robot no such TCP link.
            SimulationError: If the robot's TCP is not a link but a mean of several.
        """
        placement = world.layout[robot]
        simulated, descriptor = world.robots[robot], placement.robot
        if descriptor.tcp_position_links:
            raise SimulationError(
                f"inverse kinematics needs a TCP that is a link; that of {descriptor.name} is the"
                f" mean of {', '.join(descriptor.tcp_position_links)}"
            )
        self.joints = descriptor.arm_joints
        self._base = simulated.base_pose
        self._model: Any = simulated.articulation.create_pinocchio_model()
        self._tcp = simulated.articulation.links.index(simulated.link(descriptor.tcp_link))
        names = [joint.name for joint in simulated.joints]
        self._arm = np.array([names.index(joint) for joint in self.joints])
        self._mask = np.isin(np.arange(len(names)), self._arm).astype(np.int32)
        limits = np.concatenate([joint.limits for joint in simulated.joints])
        self._low, self._high = limits[self._arm].astype(float).T
        keyframes = np.zeros((len(descriptor.keyframes), len(names)))
        keyframes[:, simulated.active_index] = list(descriptor.keyframes.values())
        self._keyframes = keyframes

    def solve(self, position: Numbers, quaternion: Numbers, start_qpos: Numbers) -> Floats | None:
        """Return arm joints that bring the TCP to a pose, or None if none were found.

        Tries from where the robot is, from its keyframes, and from the same few places around
        where it is. Of the solutions within the joint limits it takes the one whose farthest
        joint has the shortest way to go.

        Args:
            position: Of the TCP in the world (m).
            quaternion: Of the TCP in the world, wxyz.
            start_qpos: All joints in SAPIEN's order, shape (dof,) (rad, m); the solution is
                sought near them.

        Returns:
            Positions in the order of ``joints``, shape (arm joints,) (rad).
        """
        target = self._base.inv() * sapien.Pose(list(position), list(quaternion))
        all_joints = np.asarray(start_qpos, float)
        found: list[Floats] = []
        for start in self._starts(all_joints):
            qpos, converged, _ = self._model.compute_inverse_kinematics(
                self._tcp,
                target,
                initial_qpos=start,
                active_qmask=self._mask,
                eps=_CONVERGED,
                max_iterations=_MAX_ITERATIONS,
                dt=_STEP,
                damp=_DAMPING,
            )
            arm = self._within_limits(qpos[self._arm])
            if converged and arm is not None:
                found.append(arm)
        now = all_joints[self._arm]
        return min(found, key=lambda arm: np.abs(arm - now).max(), default=None)

    def forward(self, arm_qpos: Numbers) -> tuple[Floats, Floats]:
        """Return where arm joints bring the TCP: position (3,) (m) and quaternion (4,) wxyz, world.

        Args:
            arm_qpos: Positions in the order of ``joints``, shape (arm joints,) (rad).
        """
        qpos = np.zeros(len(self._mask))
        qpos[self._arm] = arm_qpos
        self._model.compute_forward_kinematics(qpos)
        pose = self._base * self._model.get_link_pose(self._tcp)
        return np.array(pose.p, float), np.array(pose.q, float)

    def _starts(self, qpos: Floats) -> Iterator[Floats]:
        yield qpos
        yield from self._keyframes
        random = np.random.default_rng(_SEED)
        for _ in range(_NEARBY_STARTS):
            start = qpos.copy()
            start[self._arm] += random.normal(0, _SPREAD, len(self._arm))
            yield start

    def _within_limits(self, arm: Floats) -> Floats | None:
        """Turn joints by whole turns into their limits, or return None."""
        turns = np.ceil((self._low - arm) / (2 * np.pi))
        arm = np.where((arm < self._low) | (arm > self._high), arm + turns * 2 * np.pi, arm)
        return arm if ((arm >= self._low) & (arm <= self._high)).all() else None
