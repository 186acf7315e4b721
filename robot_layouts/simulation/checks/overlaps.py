"""Bodies that are inside each other: what physics drives apart, however hard that hits."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from layouts import Layout
from robot_layouts.simulation.backend import Joints, Overlap
from robot_layouts.simulation.physics import SAPIEN_DEFAULTS, PhysicsSettings
from robot_layouts.simulation.simulation import Simulation
from robot_layouts.simulation.world import World

DEPTH = 1e-3  # m; what rests on something sinks in by less


def empty(world: World, number: int) -> None:
    """Add nothing to a world."""


class RobotsAlone:
    """A layout's robots in a world of their own, to try postures in."""

    def __init__(
        self,
        layout: Layout,
        physics: PhysicsSettings | None = None,
        build: Callable[[World, int], None] = empty,
        *,
        simulator: str = "sapien3",
    ) -> None:
        """Build the world.

        Args:
            layout: The robots.
            physics: Solver settings; None is SAPIEN's own defaults.
            build: Adds what else is there.
            simulator: What builds it; see `robot_layouts.simulation.Simulation`.

        Raises:
            RobotLayoutsError: If a robot cannot be built.
        """
        timestep = (physics or SAPIEN_DEFAULTS).timestep
        self._simulation = Simulation(
            layout, build, 1, physics, control_frequency=1 / timestep, simulator=simulator
        )
        self._still = np.zeros((1, layout.action_dim), np.float32)

    def overlaps(
        self,
        postures: Mapping[str, Joints] | None = None,
        poses: Mapping[str, tuple[Joints, Joints]] = MappingProxyType({}),
        than: float = DEPTH,
    ) -> list[Overlap]:
        """Return what overlaps by more than a length, the deepest first.

        Takes one step of physics.

        Args:
            postures: Joint positions of robots, each (dof,) in its descriptor's order (rad, m); the
                others stand where the layout starts them.
            poses: Where bodies are put, by name: position, (3,) (m), and quaternion, wxyz.
            than: The length (m).
        """
        alone = self._simulation
        stand(alone)
        for name, pose in poses.items():
            alone.worlds[0].set_pose(name, *pose)
        for name, qpos in (postures or {}).items():
            alone.worlds[0].stand(name, qpos)
        alone.step(self._still, alone.read().joint_positions)
        return deepest(alone.backend.overlaps(0), than)


def starting_overlaps(
    layout: Layout,
    physics: PhysicsSettings | None = None,
    build: Callable[[World, int], None] = empty,
) -> list[Overlap]:
    """Return what overlaps by more than `DEPTH` where a layout's robots start, the deepest first.

    Builds a world of its own, and takes one step of physics in it.

    Args:
        layout: The robots.
        physics: Solver settings; None is SAPIEN's own defaults.
        build: Adds what else is there.

    Raises:
        RobotLayoutsError: If a robot cannot be built.
    """
    return RobotsAlone(layout, physics, build).overlaps()


def stand(simulation: Simulation) -> None:
    """Stand the robots of every world where its layout starts them, at rest."""
    simulation.clear(range(simulation.num_envs))
    for world in simulation.worlds:
        for name, placement in simulation.layout.items():
            world.stand(name, placement.start_qpos)


def deepest(overlaps: Iterable[Overlap], than: float = DEPTH) -> list[Overlap]:
    """Return the overlaps deeper than some length (m), the deepest first."""
    deep = (overlap for overlap in overlaps if overlap.depth > than)
    return sorted(deep, key=lambda overlap: -overlap.depth)


def between_robots(overlaps: Iterable[Overlap]) -> list[Overlap]:
    """Return the overlaps of a robot with another one."""
    return [
        overlap
        for overlap in overlaps
        if None not in (overlap.one.robot, overlap.other.robot)
        and overlap.one.robot != overlap.other.robot
    ]


DEEP = 5e-3  # m; what is grasped or hit sinks in by less


class Causes:
    """The likely causes in one simulation; its start is looked at when that is first needed."""

    def __init__(self, simulation: Simulation) -> None:
        """Take a simulation."""
        self._simulation = simulation
        self._start: list[Overlap] | None = None

    def of(self, robot: str, joint: str, env: int | None = None) -> str:
        """Return the likely cause of a joint's speed, in words.

        Args:
            robot: The robot's name in the layout.
            joint: Its joint.
            env: Environment in which it may still be seen what the robot is in; None if nothing
                is to be seen any more.
        """
        if self._start is None:
            physics = self._simulation.worlds[0].physics
            self._start = starting_overlaps(self._simulation.layout, physics)
        if (overlap := _of_robot(self._start, robot)) is not None:
            return f"at the start {overlap}"
        present = [] if env is None else deepest(self._simulation.backend.overlaps(env), 0.0)
        if (overlap := _of_robot(present, robot)) is not None:
            return str(overlap) if overlap.depth > DEEP else f"a hit: {overlap}"
        return self._drive(robot, joint)

    def _drive(self, robot: str, joint: str) -> str:
        groups = self._simulation.descriptor(robot).action_split.groups.values()
        group = next(group for group in groups if joint in group.joints)
        stiffness, damping, force = group.drives[group.joints.index(joint)]
        unit = "N·m" if group.unit == "rad" else "N"
        return (
            f"the drive of {joint} is too stiff for what it moves (stiffness {stiffness:g}, damping"
            f" {damping:g}, up to {force:g} {unit})"
        )


def _of_robot(overlaps: Sequence[Overlap], robot: str) -> Overlap | None:
    """Return the first overlap that a robot takes part in."""
    parts = (overlap for overlap in overlaps if robot in (overlap.one.robot, overlap.other.robot))
    return next(parts, None)
