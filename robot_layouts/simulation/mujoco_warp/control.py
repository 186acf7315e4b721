"""Control of worlds on a device: actions become targets of all joints, world by world at once."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from layouts import Layout
from robot_layouts.simulation.control.joint_positions import JointPositionController
from robot_layouts.simulation.control.modes import ModeController
from robot_layouts.simulation.state import State
from robots import SimulationError


class DevicePositions(JointPositionController):
    """Drive targets of joint positions, as tensors of a device."""

    def __init__(self, layout: Layout, device: torch.device) -> None:
        """Lay out the robots' action numbers and joints."""
        super().__init__(layout)
        _move_arrays(self, device)

    def targets(self, action: Any, qpos: Any) -> Any:
        """Return the drive targets of a batch of actions; see `JointPositionController`."""
        highest: Any = self._highest
        clipped = torch.clamp(action, -highest, highest)
        driving = clipped if self._one_to_one else clipped[:, self._source]
        return self._centre + self._half_range * driving + qpos * self._relative


class DeviceControl(ModeController):
    """Control in any mode but poses of TCPs, in all worlds of a device at once."""

    def __init__(self, layout: Layout, device: torch.device) -> None:
        """Sort out what is driven in which way.

        Raises:
            SimulationError: If an arm is driven by poses of its TCP.
        """
        super().__init__(layout, DevicePositions(layout, device))
        if self._tools:
            raise SimulationError(
                f"the arms {', '.join(tool.arm for tool in self._tools.values())} are driven by"
                " poses of their TCPs, which simulator 'mujoco_warp' does not do yet; take a"
                " control_mode of joints, such as 'pd_joint_delta_pos'"
            )
        _move_arrays(self, device)

    def restart(self, state: State, where: Tensor) -> None:
        """Let what is remembered of some worlds, (N,) bool, be how they are."""
        present: Any = state.joint_positions
        if len(self.targets) != state.num_envs:
            self.targets = present.clone()
        self.targets = torch.where(where[:, None], present, self.targets)

    def driven(self, action: Any, state: State) -> tuple[Any, Any | None]:
        """Return what joints are driven to, and remember it; see `ModeController.command`."""
        present: Any = state.joint_positions
        base = torch.where(self._from_target, self.targets, present) if self._any_target else present
        targets = self.targets = self._positions.targets(action, base)
        if not self.moves:
            return targets, None
        scaled: Any = self._device_scaled(action)
        velocities = torch.zeros_like(targets)
        velocities[:, self._velocity_joints] = scaled[:, self._velocity_numbers]
        for joint, number in self._bases:
            heading, forward = present[:, joint + 2], scaled[:, number]
            velocities[:, joint] = torch.cos(heading) * forward
            velocities[:, joint + 1] = torch.sin(heading) * forward
            velocities[:, joint + 2] = scaled[:, number + 1]
        return targets, velocities

    def _device_scaled(self, action: Any) -> Any:
        low, high, centre, half = self._scale
        return centre + half * torch.clamp(action, low, high)


def _move_arrays(holder: object, device: torch.device) -> None:
    """Let the NumPy arrays that an object holds be tensors of a device."""
    vars(holder).update(
        {
            name: torch.from_numpy(np.ascontiguousarray(array)).to(device)
            for name, array in vars(holder).items()
            if isinstance(array, np.ndarray)
        }
    )
