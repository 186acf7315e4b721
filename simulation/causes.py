"""Why a robot may have been thrown about: what to look at first when physics diverges."""

from __future__ import annotations

from collections.abc import Sequence

from simulation.backend import Overlap
from simulation.overlaps import deepest, starting_overlaps
from simulation.simulation import Simulation

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
        present = [] if env is None else deepest(self._simulation.overlaps(env), 0.0)
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
