"""Many worlds of one layout, stepped and read together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from robots import RobotDescriptor
from robots.descriptor import IDENTITY, Quaternion
from simulation.blueprint import Blueprint
from simulation.controller import JointPositionController
from simulation.maths import Array
from simulation.physics import SAPIEN_DEFAULTS, PhysicsSettings, substeps
from simulation.readout import ReadoutIndex
from simulation.state import State
from simulation.world import World


class Simulation:
    """N worlds with the same layout and bodies.

    Attributes:
        layout: The layout of every world.
        worlds: The worlds.
        substeps: Physics steps per control step.
        stamp: Counts every change, so that a stale `State` can tell that it is stale.
        index: Where each frame and joint stands in a read-out.
    """

    def __init__(
        self,
        layout: Layout,
        build: Callable[[World, int], None],
        num_envs: int,
        physics: PhysicsSettings | None = None,
        *,
        control_frequency: float = 20.0,
        visuals: bool = False,
    ) -> None:
        """Build the worlds.

        Args:
            layout: Which robots stand where.
            build: Called with each world and its number; adds the task's bodies.
            num_envs: Number of worlds.
            physics: Solver settings; None keeps SAPIEN's own defaults.
            control_frequency: Control steps per second (Hz).
            visuals: Whether to build what pictures need.

        Raises:
            SimulationError: If a control step is not a whole number of physics steps.
            AssetError: If robot files cannot be found.
        """
        self.substeps = substeps(physics or SAPIEN_DEFAULTS, control_frequency)
        self.layout = layout
        self._physics, self._visuals = physics, visuals
        self._blueprints: dict[str, Blueprint] = {}
        self.stamp = 0
        self.worlds = [self._build_world(i, build) for i in range(num_envs)]
        self._after_build()

    def rebuild(self, env_ids: Sequence[int], build: Callable[[World, int], None]) -> None:
        """Build some worlds anew; what PhysX remembered of their past is gone.

        Args:
            env_ids: Which worlds.
            build: As when the simulation was made. It is not kept from then: a task's own would
                keep the task, and with it these worlds, until Python looks for circles.
        """
        for i in env_ids:
            self.worlds[i] = self._build_world(i, build)
        self._after_build()

    def descriptor(self, robot: str) -> RobotDescriptor:
        """Return what the robot of that name is."""
        return self.layout[robot].robot

    def step(
        self,
        action: NDArray[np.float32],
        joint_positions: NDArray[np.float32],
        env_ids: Iterable[int] | None = None,
    ) -> None:
        """Advance worlds by one control step.

        Args:
            action: Shape (N, A), finite.
            joint_positions: Joint positions before the step, shape (N, dof) (rad, m).
            env_ids: Which worlds; all if None. The others stand still.
        """
        targets = self._controller.targets(action, joint_positions)
        moving = range(len(self.worlds)) if env_ids is None else list(env_ids)
        for i in moving:  # all before any physics, which drives this code out of the caches
            self._controller.drive(targets, i)
        for i in moving:
            step = self.worlds[i].system.step
            for _ in range(self.substeps):
                step()
        self.stamp += 1

    def timed_step(
        self, action: NDArray[np.float32], clock: Callable[[], float] = perf_counter
    ) -> float:
        """Advance like `step` and return the time that physics alone took (s).

        The floor that any task's step is measured against.

        Args:
            action: Shape (N, A), finite.
            clock: Tells the time (s).
        """
        targets = self._controller.targets(action, self.read().joint_positions)
        seconds = 0.0
        for i, world in enumerate(self.worlds):
            self._controller.drive(targets, i)
            start = clock()
            for _ in range(self.substeps):
                world.system.step()
            seconds += clock() - start
        self.stamp += 1
        return seconds

    def place(
        self,
        bodies: str | Sequence[str],
        positions: Array,
        quaternion: Quaternion = IDENTITY,
        *,
        where: Array,
    ) -> None:
        """Move a body in some worlds; `read` sees it.

        Args:
            bodies: Its name, or one name for each world.
            positions: Shape (N, 3) (m, world).
            quaternion: How it is turned, wxyz.
            where: In which worlds, (N,) bool.
        """
        names = [bodies] * len(self.worlds) if isinstance(bodies, str) else bodies
        rows = zip(self.worlds, names, positions.tolist(), where.tolist(), strict=True)
        for world, name, position, moved in rows:
            if moved:
                world.set_pose(name, position, quaternion)
        self.stamp += 1

    def read(self) -> State:
        """Return what all worlds look like now."""
        return State(self)

    def touched(self) -> None:
        """Note that a world was changed by hand, so that earlier states count as stale."""
        self.stamp += 1

    def _build_world(self, index: int, build: Callable[[World, int], None]) -> World:
        world = World(
            self.layout, self._physics, visuals=self._visuals, blueprints=self._blueprints
        )
        build(world, index)
        world.settle()
        return world

    def _after_build(self) -> None:
        self.index = ReadoutIndex(self.worlds[0])
        self._controller = JointPositionController(self.layout, self.worlds)
        self.stamp += 1
