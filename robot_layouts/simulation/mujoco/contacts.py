"""Contacts of the last step of physics, in MuJoCo."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from robot_layouts.simulation.backend import Overlap, Pair, Part
from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.mujoco import mujoco
from robot_layouts.simulation.mujoco.world import MujocoWorld


class ForceReader:
    """Reads the contact forces of the same pairs, step after step."""

    def __init__(self, world: MujocoWorld, pairs: Sequence[Pair]) -> None:
        """Look the pairs up; all worlds have the same numbers of bodies."""
        find = world.index.body
        self._count = len(pairs)
        self._pairs: dict[tuple[int, int], tuple[int, int]] = {}
        self._alone: dict[int, int] = {}
        for number, (robot, link, body) in enumerate(pairs):
            pressed = find(robot, link)
            if body is None:
                self._alone[pressed] = number
            else:
                pressing = find(None, body)
                self._pairs[pressing, pressed] = number, 1  # a force acts on the second
                self._pairs[pressed, pressing] = number, -1

    def read(self, worlds: Sequence[MujocoWorld]) -> Floats | None:
        """Return the forces, (P, N, 3) (N, world frame), or None if no pair touches."""
        forces: NDArray[np.float64] | None = None
        for env, world in enumerate(worlds):
            for contact, bodies in _touching(world):
                counted = list(self._counted(*bodies))
                if counted:
                    if forces is None:
                        forces = np.zeros((self._count, len(worlds), 3))
                    force = force_of(world, contact)
                    for number, sign in counted:
                        forces[number, env] += sign * force
        return None if forces is None else forces.astype(np.float32)

    def _counted(self, first: int, second: int) -> Iterator[tuple[int, int]]:
        if (first, second) in self._pairs:
            yield self._pairs[first, second]
        if second in self._alone:
            yield self._alone[second], 1
        if first in self._alone:
            yield self._alone[first], -1


def _touching(world: MujocoWorld) -> list[tuple[int, list[int]]]:
    """Return the numbers of the contacts that carry forces, with those of both bodies."""
    found = world.data.contact
    bodies = world.model.geom_bodyid[found.geom].tolist()
    rows = enumerate(zip(found.efc_address.tolist(), bodies, strict=True))
    return [(contact, both) for contact, (row, both) in rows if row >= 0]


def force_of(world: MujocoWorld, contact: int) -> NDArray[np.float64]:
    """Return the force on the second body of a contact, (3,) (N, world frame)."""
    wrench = np.zeros(6)
    mujoco.mj_contactForce(world.model, world.data, contact, wrench)
    return wrench[:3] @ world.data.contact.frame[contact].reshape(3, 3)


def presses_on_object(world: MujocoWorld) -> bool:
    """Tell whether a contact that carries force joins a link and a body that physics moves."""
    for contact, bodies in _touching(world):
        kinds = sorted(_kind(world, body) for body in bodies)
        if kinds == ["link", "movable"] and force_of(world, contact).any():
            return True
    return False


def _kind(world: MujocoWorld, body: int) -> str:
    if world.index.parts[body].robot is not None:
        return "link"
    return "movable" if world.model.body_weldid[body] else "fixed"


def overlaps_in(world: MujocoWorld) -> list[Overlap]:
    """Return which parts of a world are inside each other, by the contacts of the last step."""
    deepest: dict[tuple[Part, Part], float] = {}
    found = world.data.contact
    bodies = world.model.geom_bodyid[found.geom].tolist()
    for both, distance in zip(bodies, found.dist.tolist(), strict=True):
        if distance < 0:
            one, other = (world.index.parts[body] for body in both)
            deepest[one, other] = max(-distance, deepest.get((one, other), 0.0))
    return [Overlap(one, other, depth) for (one, other), depth in deepest.items()]


class ArmWatcher:
    """Looks after each of MuJoCo's steps at which links of different arms touch.

    Attributes:
        seen: Which did.
    """

    def __init__(self, world: MujocoWorld, arms: Mapping[Part, tuple[str, str]]) -> None:
        """Take the arm of each link."""
        self._world, parts = world, world.index.parts
        self._arms = {number: arms[part] for number, part in parts.items() if part in arms}
        self.seen: dict[tuple[Part, Part], None] = {}

    def look(self) -> None:
        """Remember what touches now."""
        world = self._world
        for _, (first, second) in _touching(world):
            one, other = self._arms.get(first), self._arms.get(second)
            if one and other and one != other:
                self.seen[world.index.parts[first], world.index.parts[second]] = None
