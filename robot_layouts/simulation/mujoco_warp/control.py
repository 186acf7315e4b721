"""Control of worlds on a device: actions become targets of all joints, world by world at once."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from layouts import Layout
from robot_layouts.simulation.control.joint_positions import JointPositionController
from robot_layouts.simulation.control.modes import ModeController
from robot_layouts.simulation.mujoco_warp.state import DeviceIndex, DeviceState, move_arrays
from robot_layouts.simulation.mujoco_warp.tcp import DeviceTcp


class DevicePositions(JointPositionController):
    """Drive targets of joint positions, as tensors of a device."""

    def __init__(self, layout: Layout, device: torch.device) -> None:
        """Lay out the robots' action numbers and joints."""
        super().__init__(layout)
        move_arrays(self, device)

    def targets(self, action: Any, qpos: Any) -> Any:
        """Return the drive targets of a batch of actions; see `JointPositionController`."""
        highest: Any = self._highest
        clipped = torch.clamp(action, -highest, highest)
        driving = clipped if self._one_to_one else clipped[:, self._source]
        return self._centre + self._half_range * driving + qpos * self._relative


class DeviceControl(ModeController):
    """Control in any mode, in all worlds of a device at once."""

    def __init__(self, layout: Layout, device: torch.device) -> None:
        """Sort out what is driven in which way.

        Raises:
            SimulationError: If an arm goes as near to poses of its TCP as it gets.
        """
        super().__init__(layout, DevicePositions(layout, device))
        self._arms = {
            key: DeviceTcp(control.tool, layout, device) for key, control in self._tools.items()
        }
        self._tools.update(self._arms)
        move_arrays(self, device)

    def find(self, index: DeviceIndex) -> None:
        """Find frames in worlds that were built."""
        for arm in self._arms.values():
            arm.find(index)

    def restart(self, state: DeviceState, where: Tensor) -> None:
        """Let what is remembered of some worlds, (N,) bool, be how they are."""
        present: Any = state.joint_positions
        if len(self.targets) != state.num_envs:
            self.targets = present.clone()
        before: Any = self.targets
        vars(self)["targets"] = torch.where(where[:, None], present, before)
        for arm in self._arms.values():
            if arm.tool.group.target:
                arm.restart(state, where)

    def driven(self, action: Any, state: DeviceState) -> tuple[Any, Any | None]:
        """Return what joints are driven to, and remember it; see `ModeController.command`."""
        present: Any = state.joint_positions
        before: Any = self.targets
        from_target: Any = self._from_target
        base: Any = torch.where(from_target, before, present) if self._any_target else present
        targets: Any = self._positions.targets(action, base)
        scaled = self._scaled(action)
        for arm in self._arms.values():
            targets[:, arm.tool.joints] = arm.sent(action, scaled, state)
        self.targets = targets
        return targets, self._velocities(present, scaled) if self.moves else None
