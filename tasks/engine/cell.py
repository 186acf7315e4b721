"""What the tasks of several arms share that work in stages: what is seen, and the reward."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import atan2, hypot
from typing import Any, ClassVar

from robot_layouts.simulation import PhysicsSettings, State, World
from robot_layouts.simulation.maths import Array, Flags, Floats, floats, norm
from robots.descriptor import Vector3
from tasks.engine.env import MultiRobotTask
from tasks.engine.task import Info
from tasks.language.bodies import Body, Object, WideTable
from tasks.language.fitting import TASK
from tasks.language.randomness import EpisodeRandom
from tasks.language.terms import closeness, inverse, is_at_rest, transform

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

    def before(self, arm: str, out: float, aside: float = 0.0) -> tuple[float, float]:
        """Return a place before an arm of a ring, x and y (m, as declared).

        It is before the task's own arm where the layout says where the task lies.

        Args:
            arm: The arm.
            out: How far the place is from the origin towards the arm's base (m).
            aside: How far it is from that line, to the right of who looks along it (m).
        """
        if TASK in self.layout.frames and arm in type(self).layout.places:
            x, y, _ = type(self).layout.arm(arm).base_position
        else:
            x, y, _ = self.fit.declared(self.layout.arm(arm).base_position)
        x, y = x / hypot(x, y), y / hypot(x, y)
        return out * x + aside * y, out * y - aside * x

    def lay_before(
        self,
        world: World,
        rng: EpisodeRandom,
        arm: str,
        body: str,
        low: tuple[float, float],
        high: tuple[float, float],
        turned: tuple[float, float] | None = None,
    ) -> None:
        """Lay a body before an arm of a ring.

        Args:
            world: The world.
            rng: What its place is drawn from.
            arm: The arm.
            body: The body.
            low: The least ``out`` and ``aside`` of `before` (m).
            high: The largest (m).
            turned: How far its x axis is turned from the way to the arm's base, the least and the
                largest (rad); None for any angle if physics moves it, else for how it rests.
        """
        out, aside = rng.uniform_between(low, high).tolist()
        x, y = self.before(arm, out, aside)
        thing: Any = self.bodies[body]
        turn = thing.lying
        if turned is not None:
            towards = atan2(*self.before(arm, 1.0)[::-1])
            turn = rng.yaw_quaternion(towards + turned[0], towards + turned[1])
        elif thing.kind == "dynamic":
            turn = rng.yaw_quaternion()
        world.set_pose(body, (x, y, thing.height), turn)

    @property
    def phrasings(self) -> Any:
        """Which of its instructions each environment's episode has, (N,) whole numbers."""
        return self._chosen_phrasings(len(self.instruction))

    def told(self, state: State, table: tuple[Any, ...]) -> Any:
        """Return what the episodes' instructions stand for, (N, …).

        Args:
            state: The state.
            table: What each choice stands for, a number or a tuple of numbers. The instructions
                are one phrase with every choice after the other.
        """
        return state.array(table)[self.phrasings % len(table)]

    @property
    def arms(self) -> tuple[str, ...]:
        """The arms by their names, in order."""
        return tuple(self.layout.arms)

    def is_within(self, state: State, body: str, other: str, low: Vector3, high: Vector3) -> Flags:
        """Tell whether a body's origin is between two corners in another one's frame, (N,) bool.

        Args:
            state: The state.
            body: The body.
            other: Whose frame counts, such as a container's.
            low: The one corner (m).
            high: The other (m).
        """
        place = transform(inverse(state.pose(other)), state.position(body))
        inside: Any = (place >= state.array((low,))) & (place <= state.array((high,)))
        return inside.all(1)

    def is_left_in(
        self, state: State, arm: str, body: str, other: str, low: Vector3, high: Vector3
    ) -> Flags:
        """Tell whether a body is inside another one and an arm holds it no more, (N,) bool.

        Args:
            state: The state.
            arm: The arm that is to have let go.
            body: The body.
            other: What it is inside of; this and the corners are those of `is_within`.
            low: The one corner (m).
            high: The other (m).
        """
        return self.is_within(state, body, other, low, high) & ~state.is_grasping(arm, body)

    def held_and_left(
        self, state: State, bodies: Mapping[str, str], near: float
    ) -> tuple[Floats, Floats]:
        """Return how many bodies arms hold, and how many rest at the ends of `ways`, let go, (N,).

        Args:
            state: The state.
            bodies: By arm, what it brings, in the order of `ways`.
            near: How near to its end a way is to be (m).
        """
        held = [state.is_grasping(arm, body) for arm, body in bodies.items()]
        ended = zip(bodies.values(), self.ways(state), held, strict=True)
        left = [(way <= near) & is_at_rest(state, body) & ~holds for body, way, holds in ended]
        return self.count(held), self.count(left)

    def count(self, flags: Iterable[Array]) -> Floats:
        """Return how many of some flags, each (N,) bool, are true, (N,)."""
        total: Any = sum(map(floats, flags))
        return total

    def passed(self, count: Floats, *least: float) -> dict[str, Flags]:
        """Return the last stages, one for each number: passed where the count is at least that."""
        stages = [*self.stages][-len(least) :]
        return {stage: count >= number for stage, number in zip(stages, least, strict=True)}

    def tip_distance(self, state: State, arm: str, part: str, point: Vector3) -> Floats:
        """Return how far an arm's TCP is from a point in a body's frame, (N,) (m)."""
        return norm(transform(state.pose(part), state.array((point,))) - state.tcp_position(arm))
