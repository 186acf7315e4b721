"""Many worlds of one layout, stepped and read together."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from robots import RobotDescriptor, UnknownNameError
from simulation.controller import JointPositionController
from simulation.physics import PhysicsSettings
from simulation.state import State
from simulation.world import World


class Simulation:
    """N worlds with the same layout and bodies.

    Attributes:
        layout: The layout of every world.
        worlds: The worlds.
        substeps: Physics steps per control step.
        stamp: Counts every change, so that a stale `State` can tell that it is stale.
        index: Where each entity and joint stands in a read-out.
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
        """
        self.layout = layout
        self._build, self._physics, self._visuals = build, physics, visuals
        self.stamp = 0
        self.worlds = [self._build_world(i) for i in range(num_envs)]
        self.substeps = round(1 / (self.worlds[0].physics.timestep * control_frequency))
        self._after_build()

    def rebuild(self, env_ids: Sequence[int]) -> None:
        """Build some worlds anew; what PhysX remembered of their past is gone."""
        for i in env_ids:
            self.worlds[i] = self._build_world(i)
        self._after_build()

    def descriptor(self, robot: str) -> RobotDescriptor:
        """Return what the robot of that name is."""
        return self.layout[robot].robot

    def step(self, action: NDArray[np.float32], joint_positions: NDArray[np.float32]) -> None:
        """Advance every world by one control step.

        Args:
            action: Shape (N, A), finite.
            joint_positions: Joint positions before the step, shape (N, dof) (rad, m).
        """
        targets = self._controller.targets(action, joint_positions)
        for i, world in enumerate(self.worlds):
            self._controller.drive(targets, i)
            step = world.system.step
            for _ in range(self.substeps):
                step()
        self.stamp += 1

    def read(self) -> State:
        """Return what all worlds look like now."""
        return State(self)

    def touched(self) -> None:
        """Note that a world was changed by hand, so that earlier states count as stale."""
        self.stamp += 1

    def _build_world(self, index: int) -> World:
        world = World(self.layout, self._physics, visuals=self._visuals)
        self._build(world, index)
        world.settle()
        return world

    def _after_build(self) -> None:
        self.index = ReadoutIndex(self.worlds[0])
        self._controller = JointPositionController(self.layout, self.worlds)
        self.stamp += 1


class ReadoutIndex:
    """Where each entity and joint stands in a read-out; the same in every world of a batch.

    Attributes:
        entities: Number of entities of a world.
        dof: Number of joints of all robots of a world.
        bodies: Place of each body among the entities.
        joint_slices: Place of each robot's joints, in layout order.
        arm_joints: For each robot, the joints that are not its gripper's.
    """

    def __init__(self, world: World) -> None:
        """Index one world."""
        place = {entity: i for i, entity in enumerate(world.scene.entities)}
        self.entities = len(place)
        self.bodies = {name: place[body.entity] for name, body in world.bodies.items()}
        self._links = {
            name: {link: place[component.entity] for link, component in robot.links.items()}
            for name, robot in world.robots.items()
        }
        self._slices: dict[str, slice] = {}
        self.arm_joints: dict[str, slice | list[int]] = {}
        self.dof = 0
        for name, robot in world.robots.items():
            self._slices[name] = slice(self.dof, self.dof + len(robot.joints))
            self.dof += len(robot.joints)
            self.arm_joints[name] = _as_slice(
                sorted(
                    robot.active_index[robot.descriptor.joints.index(joint)]
                    for joint in robot.descriptor.arm_joints
                )
            )
        self.joint_slices = tuple(self._slices.values())

    def link(self, robot: str, link: str) -> int:
        """Return the place of a link among the entities."""
        if robot not in self._links:
            raise UnknownNameError("robot of this layout", robot, self._links)
        if link not in self._links[robot]:
            raise UnknownNameError(f"link of {robot}", link, self._links[robot])
        return self._links[robot][link]

    def joint_slice(self, robot: str) -> slice:
        """Return the place of a robot's joints."""
        if robot not in self._slices:
            raise UnknownNameError("robot of this layout", robot, self._slices)
        return self._slices[robot]


def _as_slice(indices: list[int]) -> slice | list[int]:
    contiguous = indices == list(range(indices[0], indices[0] + len(indices)))
    return slice(indices[0], indices[-1] + 1) if contiguous else indices
