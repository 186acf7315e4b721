"""Contact forces of declared pairs of a link and a body, in SAPIEN."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from simulation.backend import Overlap, Pair, Part
from simulation.maths import Floats
from simulation.sapien3.world import BuiltWorld

_Table = dict[tuple[int, int], tuple[int, int]]


class PairForces:
    """Reads the contact forces of the same pairs, step after step.

    PhysX refreshes contacts only in a step: after a teleport they are still those of the last one.
    """

    def __init__(self, worlds: Sequence[BuiltWorld], pairs: Sequence[Pair]) -> None:
        """Look the pairs up in every world."""
        self._contacts = [world.system.get_contacts for world in worlds]
        self._tables = [_table(world, pairs) for world in worlds]
        self._shape = len(pairs), len(worlds), 3
        self._timestep = np.array(worlds[0].physics.timestep, np.float32)

    def read(self) -> Floats | None:
        """Return the forces, (P, N, 3) (N, world frame), or None if no pair touches."""
        forces: Floats | None = None
        for env, contacts in enumerate(self._contacts):
            for pair, impulse in _impulses(contacts(), self._tables[env]).items():
                if forces is None:
                    forces = np.zeros(self._shape, np.float32)
                forces[pair, env] = impulse.astype(np.float32) / self._timestep
        return forces


def _table(world: BuiltWorld, pairs: Sequence[Pair]) -> _Table:
    """Return each pair's number and the sign of its impulses, by the identity of the bodies."""
    table: _Table = {}
    for number, pair in enumerate(pairs):
        link = id(world.robots[pair.robot].links[pair.link])
        body = id(world.bodies[pair.body].component)
        table[link, body] = number, 1  # an impulse acts on the first
        table[body, link] = number, -1
    return table


def _impulses(contacts: Sequence[Any], table: _Table) -> dict[int, Any]:
    """Return the impulse on each link that is touched, (3,) (N·s), by the pair's number."""
    impulses: dict[int, Any] = {}
    for contact in contacts:
        first, second = contact.bodies
        found = table.get((id(first), id(second)))
        if found is not None:
            pair, sign = found
            # Native adds them up in float64.
            total = np.sum([point.impulse for point in contact.points], axis=0) * sign
            impulses[pair] = impulses.get(pair, np.zeros(3)) + total
    return impulses


def overlaps_in(world: BuiltWorld) -> list[Overlap]:
    """Return which parts of a world are inside each other, by the contacts of the last step."""
    parts: dict[int, Part] = {}
    for robot in world.robots.values():
        parts.update((id(link), Part(robot.name, name)) for name, link in robot.links.items())
    parts.update((id(body.component), Part(None, name)) for name, body in world.bodies.items())
    found: list[Overlap] = []
    for contact in world.system.get_contacts():
        depth = max((-point.separation for point in contact.points), default=0.0)
        if depth > 0:
            one, other = (parts[id(body)] for body in contact.bodies)
            found.append(Overlap(one, other, float(depth)))
    return found


def presses_on_object(contacts: Sequence[Any]) -> bool:
    """Tell whether a contact that carries force joins a link and a body that physics moves."""
    return any(
        sorted(map(_kind, contact.bodies)) == ["link", "movable"]
        and any(np.any(point.impulse) for point in contact.points)
        for contact in contacts
    )


def _kind(body: Any) -> str:
    if hasattr(body, "articulation"):
        return "link"
    return "fixed" if getattr(body, "kinematic", True) else "movable"
