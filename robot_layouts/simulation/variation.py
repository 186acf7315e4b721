"""How a world differs from what was declared, as plain numbers that a backend applies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from robot_layouts.simulation.world import Part
from robots.descriptor import Quaternion, Vector3

LIGHTS = ("side", "top", "ambient")
"""What lights every world: a lamp that shines down and sideways, one that shines straight down, and
light from everywhere."""

PATTERNS = ("checker", "stripes", "noise", "wood")


@dataclass(frozen=True)
class CameraOffset:
    """How a camera is off its place, in its own frame: x is where it looks, y left, z up.

    Attributes:
        position: By how much it is moved (m).
        rotation: How it is turned then, about x, y and z (rad).
        fov: Factor on its vertical field of view.
    """

    position: Vector3 = (0.0, 0.0, 0.0)
    rotation: Vector3 = (0.0, 0.0, 0.0)
    fov: float = 1.0


@dataclass(frozen=True)
class Glow:
    """How a light differs from its own.

    Attributes:
        turn: By how much its direction is turned about the vertical (rad).
        tilt: By how much more it shines sideways (rad).
        color: Factors on its red, green and blue.
    """

    turn: float = 0.0
    tilt: float = 0.0
    color: Vector3 = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Paint:
    """How a surface differs from its own; what is None stays as it is.

    Where a file paints the surface with an image, a colour replaces that image.

    Attributes:
        red: From 0 to 1, of light.
        green: Likewise.
        blue: Likewise.
        share: How much of it there is: 0 leaves the surface's own colour, 1 replaces it.
        roughness: 0 for a mirror, 1 for chalk.
        metallic: 0 for paint, 1 for metal.
        specular: Strength of highlights.
    """

    red: float | None = None
    green: float | None = None
    blue: float | None = None
    share: float = 1.0
    roughness: float | None = None
    metallic: float | None = None
    specular: float | None = None


@dataclass(frozen=True)
class Pattern:
    """What a body is covered with.

    Attributes:
        kind: One of `PATTERNS`.
        cells: How often it repeats along the body's longest side.
        first: One of its two colours, red, green and blue from 0 to 1, of light.
        second: The other one.
        seed: Of what looks irregular in it.
    """

    kind: str
    cells: int
    first: Vector3
    second: Vector3
    seed: int = 0


@dataclass(frozen=True)
class Looks:
    """What differs in the pictures of one world.

    Always of the same things: each is set from what was built, not from what was set before.

    Attributes:
        cameras: How cameras are off their places, by `camera_name`.
        lights: By their names in `LIGHTS`.
        paints: By link or body.
        patterns: By body.
    """

    cameras: Mapping[str, CameraOffset] = field(default_factory=dict)
    lights: Mapping[str, Glow] = field(default_factory=dict)
    paints: Mapping[Part, Paint] = field(default_factory=dict)
    patterns: Mapping[str, Pattern] = field(default_factory=dict)


AS_DECLARED = Looks()


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
