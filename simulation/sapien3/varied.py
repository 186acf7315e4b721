"""Changes worlds in place, as far as SAPIEN can: masses.

Every value is set from the one that was built, so it does not depend on what was set before.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from simulation.parts import Part
from simulation.variation import Variation

if TYPE_CHECKING:
    from simulation.sapien3.world import BuiltWorld


def vary(world: BuiltWorld, variation: Variation) -> None:
    """Let a world differ from what was built."""
    for part, factor in variation.mass.items():
        component = _component(world, part)
        mass, inertia = _as_built(world, part, "mass", lambda c=component: (c.mass, c.inertia))
        component.set_mass(mass * factor)
        component.set_inertia(inertia * factor)


def _component(world: BuiltWorld, part: Part) -> Any:
    if part.robot is None:
        return world.bodies[part.name].component
    return world.robots[part.robot].link(part.name)


def _as_built(world: BuiltWorld, part: Part, what: str, read: Callable[[], Any]) -> Any:
    """Return what a part was built with: what it has when it is asked for the first time."""
    known = world.built
    if (part, what) not in known:
        known[part, what] = read()
    return known[part, what]
