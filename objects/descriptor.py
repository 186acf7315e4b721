"""What a thing is: shapes, how it rests, where it is grasped; data that checks itself, no more."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar, Protocol

from objects.joints import Joint, checked_joints
from objects.shapes import SIZED, Color, Coordinate, Friction, Length, Place, Shape, scaled
from robot_layouts.core.bounds import checked_number, expect_unit
from robot_layouts.core.errors import DescriptorError, UnknownNameError
from robot_layouts.core.schema import check_fields, within
from robots.descriptor import IDENTITY, Quaternion
from robots.parts import Frozen

Opening = Annotated[float, within(1e-4, 1.0, "m")]


@dataclass(frozen=True)
class NamedPoint:
    """A point of a thing that tasks speak of, such as its spout.

    Attributes:
        position: In the thing's frame (m).
        quaternion: Of a frame there, wxyz; its z axis points away from the thing.
    """

    position: tuple[Coordinate, Coordinate, Coordinate]
    quaternion: Quaternion = IDENTITY

    def __post_init__(self) -> None:
        """Refuse what is no frame."""
        check_fields(self, DescriptorError)
        expect_unit("NamedPoint: quaternion", self.quaternion, DescriptorError)


@dataclass(frozen=True)
class Grasp:
    """A pose of a gripper with two jaws that holds a thing.

    Its frame is that of `robots.gripper_motion`, in which experts speak: z is the way in which the
    gripper approaches, y the way in which its fingers part.

    Attributes:
        position: Of the tool centre point in the thing's frame (m).
        quaternion: Of the gripper's frame in the thing's, wxyz.
        opening: How far apart the fingers are when they hold it (m).
        part: What is held, such as ``"handle"``. If it is the name of a joint, the grasp moves with
            the part of that joint.
    """

    position: tuple[Coordinate, Coordinate, Coordinate]
    quaternion: Quaternion
    opening: Opening
    part: str = "body"

    def __post_init__(self) -> None:
        """Refuse what is no grasp."""
        check_fields(self, DescriptorError)
        expect_unit("Grasp: quaternion", self.quaternion, DescriptorError)


class ThingFromMesh(Protocol):
    """The type of `ObjectDescriptor.from_mesh`."""

    def __call__(
        self,
        path: str | os.PathLike[str],
        name: str | None = None,
        *,
        scale: float = 1.0,
        up: str | None = None,
        mass: float | None = None,
        density: float = 1000.0,
        friction: Friction | None = None,
        color: Color | None = None,
        most_parts: int = 24,
        most_grasps: int = 48,
        **fields: Any,
    ) -> ObjectDescriptor:
        """Return a thing that looks as a mesh file says.

        It collides with convex parts that fill the mesh, rests on the sides that are steady, and is
        grasped where two of its sides face each other. All of that is worked out once, and kept in
        the folder of the local copy of robot files. Whether grasps hold, physics tells:
        `robot_layouts.simulation.checks.objects.holding`.

        Args:
            path: An OBJ, STL, PLY, DAE, GLB or glTF file.
            name: Registry name; None takes that of the file.
            scale: Factor on the file's lengths; 0.001 reads millimetres.
            up: Which axis of the file points up: ``"x"``, ``"y"`` or ``"z"``; None takes y for GLB
                and glTF, else z.
            mass: What it weighs (kg); None goes by the density.
            density: Of all of it (kg/m³).
            friction: Contact material; None takes the world's.
            color: Colour; None draws it as its file says.
            most_parts: How many convex parts a hollow thing may be taken apart into; 1 takes the
                convex hull of all, for which CoACD is not needed.
            most_grasps: How many grasps may be proposed; more than 48 may be nearer to each other.
            **fields: Fields of `ObjectDescriptor` that are known better, such as ``licence``,
                ``points``, ``rests`` or ``grasps``.

        Raises:
            AssetError: If the file cannot be read.
            DescriptorError: If it has no volume, is more than 5 m long, or an argument is out of
                bounds.
            MissingPackageError: If CoACD or SciPy is needed, and not installed:
                ``pip install 'robot-layouts[objects]'``.
            UnwritableFileError: If the local copy cannot be written.
        """
        ...


class ThingFromMjcf(Protocol):
    """The type of `ObjectDescriptor.from_mjcf`."""

    def __call__(
        self,
        path: str | os.PathLike[str],
        name: str | None = None,
        *,
        body: str | int | None = None,
        mass: float | None = None,
        folder: str | os.PathLike[str] | None = None,
        most_grasps: int = 48,
        **fields: Any,
    ) -> ObjectDescriptor:
        """Return a thing that is a body of an MJCF, with all that it carries.

        MuJoCo compiles the file; what it makes of it is kept in the folder of the local copy of
        robot files. Hinges and slides become joints, with their stops, damping and springs; those
        of the body itself are left out, and so is dry friction, which MuJoCo means otherwise. Sites
        become points. Of a mesh its convex hull collides, as in MuJoCo. Grasps are proposed as by
        `from_mesh`: of a thing with joints, those of its moving parts.

        Args:
            path: An MJCF.
            name: Registry name; None takes that of the body, or of the model.
            body: Name of the body, or the number of one directly in the world, from 0 on; None
                takes the only one that is.
            mass: What all of it weighs (kg); None goes by the file.
            folder: A folder whose files may be read, too.
            most_grasps: As in `from_mesh`; half of them for each joint of a thing with joints.
            **fields: Fields of `ObjectDescriptor` that are known better.

        Raises:
            AssetError: If a file cannot be read, or MuJoCo refuses it.
            UnknownNameError: If it has no such body.
            DescriptorError: If the body can be no thing: a part has several joints or a ball joint,
                or nothing of it collides.
            MissingPackageError: If MuJoCo or SciPy is needed, and not installed:
                ``pip install 'robot-layouts[objects]'``.
        """
        ...


@dataclass(frozen=True, kw_only=True)
class ObjectDescriptor:
    """Everything the library knows about one thing; frozen, and checked when made.

    Variants are made with `dataclasses.replace` and `scaled`. It is one rigid body, and the parts
    that its joints move.

    Attributes:
        name: Registry name.
        about: What it is, in a few words.
        parts: Its shapes in its own frame; those that collide weigh what their densities say.
        joints: What slides or turns against these, each after the one that carries it.
        rests: How it lies on a table: orientation, wxyz, by name; the first is the usual one.
        source: Where its numbers come from.
        points: Points of it that tasks speak of, by name.
        grasps: Where a gripper with two jaws holds it.
        licence: Of its files or numbers, as SPDX writes it.
        sizes: The lengths that its family made it with, by name (m).
        seed: The seed that drew them; None for those of the family itself.
    """

    name: str
    about: str
    parts: tuple[Shape, ...]
    joints: tuple[Joint, ...] = ()
    rests: Mapping[str, Quaternion] = field(default_factory=lambda: {"upright": IDENTITY})
    source: str
    points: Mapping[str, NamedPoint] = field(default_factory=dict[str, NamedPoint])
    grasps: tuple[Grasp, ...] = ()
    licence: str = "Apache-2.0"
    sizes: Mapping[str, Length] = field(default_factory=dict[str, Length])
    seed: int | None = None

    # Bound in `objects`: what reads files is built on descriptors.
    from_mesh: ClassVar[ThingFromMesh]
    """Make a thing of a mesh file."""
    from_mjcf: ClassVar[ThingFromMjcf]
    """Make a thing of a body of an MJCF."""

    def __post_init__(self) -> None:
        """Freeze the mappings and refuse contradictions."""
        named = isinstance(self.name, str) and self.name.isprintable()
        check_fields(self, DescriptorError, owner=self.name if named else None)
        if re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", self.name) is None:
            raise DescriptorError(
                f"object name {self.name!r} must be a letter followed by letters, digits and _"
            )
        if not any(part.collides for part in self.parts):
            raise DescriptorError(
                f"{self.name}: no part collides; one at least must, so that it has a mass"
            )
        checked_joints(self.name, self.joints)
        for part in self.all_parts:
            if not isinstance(part, SIZED):
                raise DescriptorError(
                    f"{self.name}: parts holds a {type(part).__name__}, which has no size; parts"
                    f" are {', '.join(kind.__name__ for kind in SIZED)}"
                )
        if not self.rests:
            raise DescriptorError(f"{self.name}: rests is empty; it lies on a table in some way")
        for name, quaternion in self.rests.items():
            expect_unit(f"{self.name}: rests[{name!r}]", quaternion, DescriptorError)
        for name in ("rests", "points", "sizes"):
            object.__setattr__(self, name, Frozen(getattr(self, name)))

    @property
    def all_parts(self) -> tuple[Shape, ...]:
        """Its shapes, those that its joints move included, as they are with all joints at zero."""
        return (*self.parts, *(part for joint in self.joints for part in joint.parts))

    @property
    def mass(self) -> float:
        """What it weighs (kg)."""
        from objects.solids import mass_of

        return mass_of(self.all_parts).mass

    @property
    def centre_of_mass(self) -> Place:
        """Its centre of mass, in its own frame (m)."""
        from objects.solids import mass_of

        x, y, z = mass_of(self.all_parts).centre.tolist()
        return x, y, z

    @property
    def extent(self) -> Place:
        """Its lengths along the axes of its own frame (m)."""
        from objects.solids import bounds

        low, high = bounds(self.all_parts)
        x, y, z = (high - low).tolist()
        return x, y, z

    def rest(self, name: str | None = None) -> Quaternion:
        """Return how it is turned when it lies on a table, wxyz.

        Args:
            name: Which of its ``rests``; None takes the first.

        Raises:
            UnknownNameError: If it does not rest so.
        """
        if name is None:
            return next(iter(self.rests.values()))
        if name not in self.rests:
            raise UnknownNameError(f"rest of {self.name}", name, self.rests)
        return self.rests[name]

    def height(self, rest: str | None = None) -> float:
        """Return the height of its origin above the table that it lies on (m).

        Args:
            rest: Which of its ``rests``; None takes the first.

        Raises:
            UnknownNameError: If it does not rest so.
        """
        from objects.solids import lowest

        return round(-lowest(self.all_parts, self.rest(rest)), 9) + 0.0

    def point(self, name: str) -> NamedPoint:
        """Return one of its points.

        Raises:
            UnknownNameError: If it has no such point.
        """
        if name not in self.points:
            raise UnknownNameError(f"point of {self.name}", name, self.points)
        return self.points[name]

    def joint(self, name: str) -> Joint:
        """Return one of its joints.

        Raises:
            UnknownNameError: If it has no such joint.
        """
        joints = {joint.name: joint for joint in self.joints}
        if name not in joints:
            raise UnknownNameError(f"joint of {self.name}", name, joints)
        return joints[name]

    def grasps_for(self, opening: float, clearance: float = 0.006) -> tuple[Grasp, ...]:
        """Return the grasps that a gripper opens wide enough for.

        Args:
            opening: How far its fingers part (m).
            clearance: By how much wider than what it holds it must open (m).
        """
        return tuple(grasp for grasp in self.grasps if grasp.opening + clearance <= opening)

    def scaled(self, factor: float) -> ObjectDescriptor:
        """Return it larger by a factor, of the same density.

        Raises:
            DescriptorError: If the factor is not from 0.01 to 100.
        """
        times = checked_number(f"{self.name}: scale", factor, 0.01, 100.0, DescriptorError)
        return replace(
            self,
            parts=tuple(scaled(part, times) for part in self.parts),
            joints=tuple(joint.scaled(times) for joint in self.joints),
            points={
                name: replace(point, position=_times(point.position, times))
                for name, point in self.points.items()
            },
            grasps=tuple(
                replace(
                    grasp,
                    position=_times(grasp.position, times),
                    opening=grasp.opening * times,
                )
                for grasp in self.grasps
            ),
            sizes={name: size * times for name, size in self.sizes.items()},
        )

    def __repr__(self) -> str:
        """Show name and counts; the fields are many."""
        member = "" if self.seed is None else f", seed {self.seed}"
        joints = f"{len(self.joints)} joints, " if self.joints else ""
        counts = f"{len(self.parts)} parts, {joints}{len(self.grasps)} grasps"
        return f"ObjectDescriptor({self.name!r}{member}: {counts})"


def _times(place: Place, factor: float) -> Place:
    x, y, z = place
    return x * factor, y * factor, z * factor
