"""Shapes that things are made of, as data, and what their surfaces are like."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Literal

from robot_layouts.core.bounds import FAR, checked_number, expect_unit
from robot_layouts.core.errors import SimulationError
from robot_layouts.core.schema import check_fields, whole, within
from robots.assets.locator import FileLocator
from robots.descriptor import IDENTITY, Quaternion
from robots.urdf.mesh_files import has_volume

Fraction = Annotated[float, within(0.0, 1.0)]
Color = tuple[Fraction, Fraction, Fraction, Fraction]  # red, green, blue, alpha

Length = Annotated[float, within(1e-6, FAR, "m")]
"""Of an edge, a radius, half of either: more than none."""
Lengths = tuple[Length, Length, Length]
Radius = Annotated[float, within(0.0, FAR, "m")]
"""Of what may be missing."""
Density = Annotated[float, within(1e-3, 1e6, "kg/m³")]
Coordinate = Annotated[float, within(-FAR, FAR, "m")]
Place = tuple[Coordinate, Coordinate, Coordinate]
Factor = Annotated[float, within(1e-6, FAR)]

MeshCollision = Literal["hull", "pieces", "surface"]

GREY: Color = (0.7, 0.7, 0.7, 1.0)
FEWEST_CORNERS, MOST_CORNERS = 4, 64  # of a hull; PhysX takes as many on any processor


@dataclass(frozen=True)
class Friction:
    """A contact material.

    Attributes:
        static: Static friction coefficient.
        dynamic: Dynamic friction coefficient.
        restitution: Coefficient of restitution, 0 … 1.
    """

    static: float = 0.3
    dynamic: float = 0.3
    restitution: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no coefficient.

        Raises:
            SimulationError: If one is no number or out of range.
        """
        for name, high in (("static", 1e3), ("dynamic", 1e3), ("restitution", 1.0)):
            value = checked_number(
                f"friction: {name}", getattr(self, name), 0, high, SimulationError
            )
            object.__setattr__(self, name, value)


@dataclass(frozen=True)
class Finish:
    """How a surface throws light back, each from 0 to 1.

    Attributes:
        metallic: 0 for paint, 1 for metal.
        roughness: 0 for a mirror, 1 for chalk.
        specular: Strength of highlights.
    """

    metallic: Fraction = 0.0
    roughness: Fraction = 1.0
    specular: Fraction = 0.0

    def __post_init__(self) -> None:
        """Refuse what no surface can be.

        Raises:
            SimulationError: If a value is of a wrong type or out of bounds.
        """
        check_fields(self, SimulationError)


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
        patch_radius: With it SAPIEN makes contacts resist that they are turned about their normal,
            the more the deeper they are (m); MuJoCo's do not.
        min_patch_radius: Radius of the patch that resists so however shallow they are (m).
        color: Colour when drawn.
        finish: Surface when drawn.
        collides: Whether it takes part in contacts.
        visible: Whether it is drawn.
    """

    position: Place = (0.0, 0.0, 0.0)
    quaternion: Quaternion = IDENTITY
    friction: Friction | None = None
    density: Density = 1000.0
    patch_radius: Radius = 0.0
    min_patch_radius: Radius = 0.0
    color: Color = GREY
    finish: Finish = MATT
    collides: bool = True
    visible: bool = True

    def __post_init__(self) -> None:
        """Refuse what no shape can be.

        Raises:
            SimulationError: If a value is of a wrong type or out of bounds.
        """
        check_fields(self, SimulationError)
        expect_unit(f"{type(self).__name__}: quaternion", self.quaternion, SimulationError)


@dataclass(frozen=True)
class Box(Shape):
    """A box.

    Attributes:
        half_size: Half its extents along x, y, z (m).
    """

    half_size: Lengths


@dataclass(frozen=True)
class Sphere(Shape):
    """A sphere.

    Attributes:
        radius: Radius (m).
    """

    radius: Length


@dataclass(frozen=True)
class Cylinder(Shape):
    """A cylinder along its own x axis.

    Attributes:
        radius: Radius (m).
        half_length: Half its length (m).
    """

    radius: Length
    half_length: Length


@dataclass(frozen=True)
class Capsule(Shape):
    """A capsule along its own x axis.

    Attributes:
        radius: Radius (m).
        half_length: Half the length of its straight part (m).
    """

    radius: Length
    half_length: Length


@dataclass(frozen=True)
class ConvexHull(Shape):
    """The convex hull of some points.

    Attributes:
        corners: The points, 4 to 64 that do not all lie in one plane (m).
    """

    corners: tuple[Place, ...]

    def __post_init__(self) -> None:
        """Refuse what no shape can be.

        Raises:
            SimulationError: If there are fewer corners or more, or they have no volume.
        """
        import numpy as np  # which declaring other shapes need not load

        super().__post_init__()
        if not FEWEST_CORNERS <= len(self.corners) <= MOST_CORNERS:
            raise SimulationError(
                f"ConvexHull: corners has {len(self.corners)} entries; it must have"
                f" {FEWEST_CORNERS} to {MOST_CORNERS}"
            )
        if not has_volume(np.array(self.corners)):
            raise SimulationError("ConvexHull: corners lie in one plane; a hull needs a volume")


@dataclass(frozen=True)
class Plane(Shape):
    """An infinite plane, such as a floor; its own +x axis is the outward normal.

    It lets the links through that a robot's ``no_floor_contact`` names.
    """


@dataclass(frozen=True)
class Mesh(Shape):
    """A mesh file.

    Attributes:
        file: Mesh file, or where the manifest lists it: then it is fetched when it is needed.
        scale: Scale along x, y, z.
        collision: What of it collides: its convex ``"hull"``, the hulls of its ``"pieces"``, each a
            part of the mesh that hangs together, or its very ``"surface"``, in a body that physics
            does not move.
        textured: Whether it is drawn as its file says; else in ``color``, with the file's finish.
    """

    file: FileLocator | Path | str
    scale: tuple[Factor, Factor, Factor] = (1.0, 1.0, 1.0)
    collision: MeshCollision = "hull"
    textured: bool = False

    @property
    def path(self) -> Path:
        """Where the file is on this machine.

        Raises:
            AssetError: If the manifest lists it, and no source has it.
            UnknownNameError: If the manifest does not list it, though it should.
        """
        return self.file.locate() if isinstance(self.file, FileLocator) else Path(self.file)


@dataclass(frozen=True)
class Floor(Shape):
    """A square of the plane z = 0 that is drawn with a texture, and touches nothing.

    Attributes:
        texture: Image file.
        size: Length of its sides (m), a whole number.
        tile: Length of the texture's sides (m).
        mipmaps: How many sizes of the texture there are, each half as large as the one before.
    """

    texture: Path | str
    size: Annotated[int, within(1, FAR, "m", "whole number")] = 100
    tile: Length = 4.0
    mipmaps: Annotated[int, whole(1, 16)] = 4
    collides: bool = field(default=False, kw_only=True)


SIZED = (Box, Sphere, Cylinder, Capsule, ConvexHull, Mesh)
"""Shapes that can be larger or smaller."""


def scaled(shape: Shape, factor: float) -> Shape:
    """Return a shape of a body that is larger by a factor, its place in the body with it.

    Raises:
        SimulationError: If the shape has no size, as a plane has none.
    """
    x, y, z = shape.position
    moved = replace(
        shape,
        position=(x * factor, y * factor, z * factor),
        patch_radius=shape.patch_radius * factor,
        min_patch_radius=shape.min_patch_radius * factor,
    )
    match moved:
        case Box(half_size=(a, b, c)):
            return replace(moved, half_size=(a * factor, b * factor, c * factor))
        case Sphere():
            return replace(moved, radius=moved.radius * factor)
        case Cylinder() | Capsule():
            radius, half_length = moved.radius * factor, moved.half_length * factor
            return replace(moved, radius=radius, half_length=half_length)
        case ConvexHull():
            corners = [[along * factor for along in corner] for corner in moved.corners]
            return replace(moved, corners=corners)
        case Mesh(scale=(a, b, c)):
            return replace(moved, scale=(a * factor, b * factor, c * factor))
        case _:
            raise SimulationError(f"a {type(shape).__name__} has no size that could be changed")
