"""Shapes that bodies are made of, as data."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from robots.descriptor import IDENTITY, Quaternion, Vector3
from simulation.physics import Friction

Color = tuple[float, float, float, float]  # red, green, blue, alpha in 0 … 1

GREY: Color = (0.7, 0.7, 0.7, 1.0)


@dataclass(frozen=True)
class Finish:
    """How a surface throws light back, each from 0 to 1.

    Attributes:
        metallic: 0 for paint, 1 for metal.
        roughness: 0 for a mirror, 1 for chalk.
        specular: Strength of highlights.
    """

    metallic: float = 0.0
    roughness: float = 1.0
    specular: float = 0.0


MATT = Finish()
POLISHED = Finish(metallic=1.0, roughness=0.0, specular=1.0)


def linear(code: str) -> Color:
    """Return the colour of a code like ``"#FFD289"``, which is of light as screens encode it."""
    red, green, blue = ((int(code[i : i + 2], 16) / 255) ** 2.2 for i in (1, 3, 5))
    return red, green, blue, 1.0


@dataclass(frozen=True, kw_only=True)
class Shape:
    """What all shapes share.

    Attributes:
        position: Centre in the body's frame (m).
        quaternion: Orientation in the body's frame, wxyz.
        friction: Contact material; None takes the world's.
        density: Density (kg/m³).
        color: Colour when drawn.
        finish: Surface when drawn.
        collides: Whether it takes part in contacts.
        visible: Whether it is drawn.
    """

    position: Vector3 = (0.0, 0.0, 0.0)
    quaternion: Quaternion = IDENTITY
    friction: Friction | None = None
    density: float = 1000.0
    color: Color = GREY
    finish: Finish = MATT
    collides: bool = True
    visible: bool = True


@dataclass(frozen=True)
class Box(Shape):
    """A box.

    Attributes:
        half_size: Half its extents along x, y, z (m).
    """

    half_size: Vector3


@dataclass(frozen=True)
class Sphere(Shape):
    """A sphere.

    Attributes:
        radius: Radius (m).
    """

    radius: float


@dataclass(frozen=True)
class Cylinder(Shape):
    """A cylinder along its own x axis.

    Attributes:
        radius: Radius (m).
        half_length: Half its length (m).
    """

    radius: float
    half_length: float


@dataclass(frozen=True)
class Capsule(Shape):
    """A capsule along its own x axis.

    Attributes:
        radius: Radius (m).
        half_length: Half the length of its straight part (m).
    """

    radius: float
    half_length: float


@dataclass(frozen=True)
class Plane(Shape):
    """An infinite plane; its own +x axis is the outward normal."""


@dataclass(frozen=True)
class Mesh(Shape):
    """A mesh file; its convex hull collides.

    Attributes:
        file: Mesh file.
        scale: Scale along x, y, z.
        textured: Whether it is drawn as its file says; else in ``color``, with the file's finish.
    """

    file: Path
    scale: Vector3 = (1.0, 1.0, 1.0)
    textured: bool = False


@dataclass(frozen=True)
class Floor(Shape):
    """A square of the plane z = 0 that is drawn with a texture, and touches nothing.

    Attributes:
        texture: Image file.
        size: Length of its sides (m), a whole number.
        tile: Length of the texture's sides (m).
    """

    texture: Path
    size: int = 100
    tile: float = 4.0
    collides: bool = field(default=False, kw_only=True)
