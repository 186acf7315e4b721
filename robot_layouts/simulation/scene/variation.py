"""How a world differs from what was declared, as plain numbers that a backend applies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from robot_layouts.simulation.scene.looks import Looks
from robot_layouts.simulation.scene.parts import Part
from robots.descriptor import Quaternion, Vector3

Factors = Mapping[Part, float]


@dataclass(frozen=True)
class Variation:
    """What differs in one world from a reset on, without building it anew.

    All values are of what was built, whatever an earlier variation was; a part that is varied once
    is varied at every reset. What cannot be changed in place, sizes and gravity, stands in the
    `robot_layouts.simulation.world.World` that is built.

    Attributes:
        mass: Factor on the mass of links and bodies, and on their inertia.
        friction: Coefficient of friction of links and bodies, static and dynamic.
        stiffness: Factor on the stiffness of joints' drives; joints are parts of robots, too.
        damping: Factor on their damping.
        joint_friction: Friction coefficient of joints.
        bases: Where robots stand: position (m, world) and quaternion (wxyz).
        weightless: Whether bodies feel no gravity.
        looks: What differs in its pictures; None leaves them as they are.
    """

    mass: Factors = field(default_factory=dict[Part, float])
    friction: Factors = field(default_factory=dict[Part, float])
    stiffness: Factors = field(default_factory=dict[Part, float])
    damping: Factors = field(default_factory=dict[Part, float])
    joint_friction: Factors = field(default_factory=dict[Part, float])
    bases: Mapping[str, tuple[Vector3, Quaternion]] = field(
        default_factory=dict[str, tuple[Vector3, Quaternion]]
    )
    weightless: Mapping[Part, bool] = field(default_factory=dict[Part, bool])
    looks: Looks | None = None
