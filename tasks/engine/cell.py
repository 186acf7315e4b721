"""What the tasks of several arms share that work in stages: what is seen, and the reward."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from robot_layouts.simulation import PhysicsSettings, State
from robot_layouts.simulation.maths import Array, Floats, floats
from tasks.engine.env import MultiRobotTask
from tasks.engine.task import Info
from tasks.language.bodies import Body, Object, WideTable
from tasks.language.terms import closeness

OF_STAGES = 0.6  # of the reward


class CellTask(MultiRobotTask):
    """A task in stages, on a table under all its arms; a class says no more than what it is about.

    It fits its robots: with others than its own, places and sizes are as much larger or smaller.
    Observed are every TCP, and every declared body with its joints. The dense reward, at most 1, is
    the score of the stage (0.6) and how near the distances of `ways` are to nothing (0.4). What the
    setting ``"varied"`` varies are masses, by a quarter, and the stiffness of drives, by a tenth.
    """

    physics = PhysicsSettings()
    table = WideTable()
    fits_robots = True
    stages: ClassVar = {"success": 1.0}
    varied: ClassVar = {
        "mass": {"*": {"uniform": (0.8, 1.25)}},
        "stiffness": {"*": {"uniform": (0.9, 1.1)}},
    }

    def ways(self, state: State) -> Sequence[Floats]:
        """Return what is to become nothing, each (N,) (m): a body's way to its place, say."""
        raise NotImplementedError

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCPs, declared bodies, and the positions of their joints."""
        parts: dict[str, Array] = {f"{arm}_tcp_pose": state.tcp_pose(arm) for arm in self.arms}
        for name, body in self.bodies.items():
            if isinstance(body, Body):
                parts[f"{name}_pose"] = state.pose(name)
            if isinstance(body, Object):
                for joint in body.descriptor.joints:
                    parts[f"{name}_{joint.name}"] = state.joint(name, joint.name)
        return parts

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Stages (0.6) and ways (0.4)."""
        near = closeness(*self.ways(state))
        mean: Any = sum(near[1:], near[0]) / len(near)
        return OF_STAGES * info["stage_score"] + (1.0 - OF_STAGES) * mean

    @property
    def arms(self) -> tuple[str, ...]:
        """The arms by their names, in order."""
        return tuple(self.layout.arms)

    def count(self, flags: Sequence[Array]) -> Floats:
        """Return how many of some flags, each (N,) bool, are true, (N,)."""
        total: Any = sum(map(floats, flags))
        return total
