"""Contact forces of declared pairs of a link and a body, in SAPIEN."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from operator import add
from typing import Any

import numpy as np
import sapien.physx as physx

from robot_layouts.simulation.backend import Overlap, Pair, Part
from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.sapien3.world import BuiltWorld

_Table = dict[tuple[int, int], tuple[int, int]]
_Alone = dict[int, int]
_NOTHING = (0.0, 0.0, 0.0)


class PairForces:
    """Reads the contact forces of the same pairs, step after step.

    PhysX refreshes contacts only in a step: after a teleport they are still those of the last one.
    """

    def __init__(self, worlds: Sequence[BuiltWorld], pairs: Sequence[Pair]) -> None:
        """Look the pairs up in every world."""
        self._contacts = [world.system.get_contacts for world in worlds]
        self._tables = [_table(world, pairs) for world in worlds]
        self._alone = [_alone(world, pairs) for world in worlds]
        self._shape = len(pairs), len(worlds), 3
        self._timestep = np.array(worlds[0].physics.timestep, np.float32)

    def read(self) -> Floats | None:
        """Return the forces, (P, N, 3) (N, world frame), or None if no pair touches."""
        forces: Floats | None = None
        for env, contacts in enumerate(self._contacts):
            impulses = _impulses(contacts(), self._tables[env], self._alone[env])
            for pair, impulse in impulses.items():
                if forces is None:
                    forces = np.zeros(self._shape, np.float32)
                forces[pair, env] = impulse
        return None if forces is None else forces / self._timestep


def _table(world: BuiltWorld, pairs: Sequence[Pair]) -> _Table:
    """Return each pair's number and the sign of its impulses, by the identity of the bodies."""
    table: _Table = {}
    for number, pair in enumerate(pairs):
        if pair.body is not None:
            link = id(world.robots[pair.robot].links[pair.link])
            body = id(world.bodies[pair.body].component)
            table[link, body] = number, 1  # an impulse acts on the first
            table[body, link] = number, -1
    return table


def _alone(world: BuiltWorld, pairs: Sequence[Pair]) -> _Alone:
    """Return the number of each link whose every contact counts, by the link's identity."""
    return {
        id(world.robots[pair.robot].links[pair.link]): number
        for number, pair in enumerate(pairs)
        if pair.body is None
    }


def _impulses(contacts: Sequence[Any], table: _Table, alone: _Alone) -> dict[int, list[float]]:
    """Return the impulse on each link that is pressed, (3,) (N·s), by the pair's number."""
    impulses: dict[int, list[float]] = {}
    for contact in contacts:
        first, second = contact.bodies
        found = table.get((id(first), id(second)))
        counted = () if found is None else (found,)
        if alone:
            signs = ((id(first), 1), (id(second), -1))
            counted += tuple((alone[link], sign) for link, sign in signs if link in alone)
        if not counted:
            continue
        points = [point.impulse for point in contact.points]
        pressing = [impulse for impulse in points if any(impulse.tolist())]
        if pressing:  # most are of bodies that are only near
            # As native does: the points of a contact in float32, contacts in float64.
            total = reduce(add, pressing).tolist()
            for pair, sign in counted:
                so_far = impulses.get(pair, _NOTHING)
                impulses[pair] = [a + sign * b for a, b in zip(so_far, total, strict=True)]
    return impulses


class ArmContacts:
    """Steps the physics of a world and remembers which links of different arms touch.

    Attributes:
        seen: Which did.
    """

    def __init__(self, world: BuiltWorld, arms: Mapping[Part, tuple[str, str]]) -> None:
        """Take the arm of each link."""
        self._advance, self._contacts = world.stepper(), world.system.get_contacts
        self._links = {
            id(link): (arms[part], part) for part, link in components_of(world) if part in arms
        }
        self.seen: dict[tuple[Part, Part], None] = {}

    def step(self) -> None:
        """Advance by one step of physics."""
        self._advance()
        links = self._links
        for contact in self._contacts():
            one, other = (links.get(id(body)) for body in contact.bodies)
            if one and other and one[0] != other[0] and _touch(contact):
                self.seen[one[1], other[1]] = None


def _touch(contact: Any) -> bool:
    """Tell whether two bodies that are near each other touch."""
    return any(point.separation <= 0 or np.any(point.impulse) for point in contact.points)


def overlaps_in(world: BuiltWorld) -> list[Overlap]:
    """Return which parts of a world are inside each other, by the contacts of the last step."""
    parts = {id(component): part for part, component in components_of(world)}
    found: list[Overlap] = []
    for contact in world.system.get_contacts():
        depth = max((-point.separation for point in contact.points), default=0.0)
        if depth > 0:
            one, other = (parts[id(body)] for body in contact.bodies)
            found.append(Overlap(one, other, float(depth)))
    return found


def presses_on_object(contacts: Sequence[Any], robots: Sequence[Any]) -> bool:
    """Tell whether a contact that carries force joins a robot and a body that physics moves.

    Args:
        contacts: SAPIEN's.
        robots: Articulations of the robots; the links of others are bodies, or parts of some.
    """
    return any(
        sorted(_kind(body, robots) for body in contact.bodies) == ["link", "movable"]
        and any(np.any(point.impulse) for point in contact.points)
        for contact in contacts
    )


def _kind(body: Any, robots: Sequence[Any]) -> str:
    if (articulation := getattr(body, "articulation", None)) is not None:
        if articulation in robots:
            return "link"
        return "fixed" if body.joint.type == "fixed" else "movable"
    return "fixed" if getattr(body, "kinematic", True) else "movable"


def extents_of(world: BuiltWorld) -> dict[Part, Floats]:
    """Return the box around each link and body that collides; see `Backend`."""
    return {
        part: component.get_global_aabb_fast()
        for part, component in components_of(world)
        if any(
            not isinstance(s, physx.PhysxCollisionShapePlane) for s in component.collision_shapes
        )
    }


def components_of(world: BuiltWorld) -> Iterator[tuple[Part, Any]]:
    """Yield each link and body with SAPIEN's component of it."""
    for robot in world.robots.values():
        for link in robot.links.values():
            yield Part(robot.name, link.name), link
    for body in world.bodies.values():
        yield Part(None, body.declared.name), body.component
