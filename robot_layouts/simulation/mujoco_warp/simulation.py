"""Many worlds of one layout on a device, as tasks see `Simulation`."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from robot_layouts.simulation.maths import like
from robot_layouts.simulation.mujoco.world import MujocoWorld
from robot_layouts.simulation.mujoco_warp.control import DeviceControl
from robot_layouts.simulation.mujoco_warp.state import DeviceIndex, DeviceState
from robot_layouts.simulation.mujoco_warp.worlds import DeviceWorlds, Starts
from robot_layouts.simulation.readout import Moment
from robot_layouts.simulation.simulation import Simulation
from robots import SimulationError
from robots.descriptor import IDENTITY, Quaternion


class DeviceSimulation:
    """N worlds with the same layout and bodies on a device.

    Attributes:
        layout: The layout of every world.
        num_envs: Number of worlds N.
        device: Where they are.
        worlds: What each of them holds: the first, which is as all are.
        index: Where each frame and joint stands in a read-out.
        control: What turns actions into targets.
        bodies: The worlds themselves.
    """

    def __init__(
        self,
        host: Simulation,
        starts: Starts,
        num_envs: int,
        *,
        contacts: int | None = None,
    ) -> None:
        """Put the first world of a simulation in MuJoCo on the device of its starts.

        Args:
            host: The simulation.
            starts: How episodes begin in it.
            num_envs: How many worlds there are to be.
            contacts: How many contacts there is room for in each; None for enough for hands.

        Raises:
            SimulationError: If the device lacks memory, or MuJoCo Warp something of the model.
        """
        world: MujocoWorld = host.backend.worlds[0]  # pyright: ignore[reportAttributeAccessIssue]
        device = starts.rows["qpos"].device
        self.layout, self.num_envs, self.device = host.layout, num_envs, device
        self.worlds = host.worlds[:1]
        self.control = DeviceControl(host.layout, device)
        self.index = DeviceIndex(host.layout, world.index.built, device)
        self.control.find(self.index)
        self.bodies = DeviceWorlds(world, starts, num_envs, contacts=contacts)
        self._steps = host.substeps * world.inner
        self._moment = self._present()

    @property
    def modes(self) -> DeviceControl:
        """What drives the robots; see `Simulation`."""
        return self.control

    def step(self, action: Tensor, state: DeviceState) -> None:
        """Advance all worlds by one control step.

        Args:
            action: (N, A).
            state: The worlds before the step.
        """
        targets, velocities = self.control.driven(action, state)
        self._change()
        self.bodies.drive(targets, velocities)
        self.bodies.step(self._steps)

    def begin(self, where: Tensor, starts: Starts) -> None:
        """Let some worlds, (N,) bool, stand as episodes begin, N rows; see `DeviceWorlds`."""
        self._change()
        self.bodies.begin(where, starts)

    def hold(self, state: DeviceState, where: Tensor) -> None:
        """End a reset of some worlds: targets that are remembered are where the robots are."""
        self.control.restart(state, where)

    def place(
        self,
        body: str,
        positions: Any,
        quaternion: Quaternion = IDENTITY,
        *,
        where: Tensor,
    ) -> None:
        """Move a body in some worlds; `read` sees it.

        Args:
            body: Its name, the same in all of them.
            positions: (N, 3) (m, world).
            quaternion: How it is turned, wxyz.
            where: In which worlds, (N,) bool.

        Raises:
            SimulationError: If there is a name for each world.
        """
        if not isinstance(body, str):
            raise SimulationError(
                "a task moves another body in each world; simulator 'mujoco_warp' moves one body"
                " in all of them: place(name, positions, where=…)"
            )
        self._change()
        turns = like(positions, quaternion).expand(self.num_envs, 4)
        self.bodies.place(body, torch.cat((positions, turns), 1), where)

    def read(self) -> DeviceState:
        """Return what all worlds look like now."""
        return DeviceState(self.bodies.read(), self.index, self._moment)

    def _change(self) -> None:
        """Let states that were read be past."""
        self._moment.past = True
        self._moment = self._present()

    def _present(self) -> Moment:
        backend: Any = self.bodies  # which has the verbs that a moment asks for
        return Moment(backend)
