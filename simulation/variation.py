"""How a world differs from what was declared, as plain numbers that a backend applies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from simulation.parts import Part


@dataclass(frozen=True)
class Variation:
    """What differs in one world, from a reset on.

    All values are of what was built, whatever an earlier variation was; a part that is varied once
    is varied at every reset.

    Attributes:
        mass: Factor on the mass of links and bodies, and on their inertia.
    """

    mass: Mapping[Part, float] = field(default_factory=dict)
