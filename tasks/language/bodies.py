"""Bodies of a task, declared once: shape, colour, and where episodes begin with them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import cos, isfinite, sin
from typing import Annotated, Any, ClassVar, Literal, TypeAlias, TypedDict

from layouts import Layout
from objects import ObjectDescriptor, ObjectRegistry
from objects.shapes import (
    Color,
    Coordinate,
    Density,
    Factor,
    Length,
    Lengths,
    Place,
)
from robot_layouts.core.schema import check_fields, whole
from robot_layouts.kinematics.quaternions import multiplied
from robot_layouts.simulation import (
    Box,
    Friction,
    Mesh,
    Shape,
    Sphere,
    World,
    add_ground,
    add_table,
)
from robot_layouts.simulation.world import TABLE_OUTLINE, BodyKind
from robots import TaskError
from robots.assets.locator import KITCHEN, FileLocator
from robots.descriptor import IDENTITY, Quaternion
from tasks.language.props import (
    FACE_UP,
    GREEN,
    RED,
    TARGET_HEIGHT,
    add_kitchen_counter,
    add_slab,
    add_wide_table,
    before_robots,
    peg_shapes,
    target_shapes,
    wide_table_outline,
)
from tasks.language.randomness import EpisodeRandom

Rectangle = tuple[float, float, float, float]
Range: TypeAlias = "float | tuple[float, float]"
"""A number, or the smallest and the largest that may be drawn."""


@dataclass(frozen=True, kw_only=True)
class Area:
    """Where a body may be when an episode begins, drawn evenly.

    Attributes:
        x: Of its origin (m, world).
        y: Of its origin (m, world).
        z: Of its origin (m, world); None lays the body on the table.
        yaw: How it is turned about z (rad), or ``"any"`` angle.
    """

    x: Range = 0.0
    y: Range = 0.0
    z: Range | None = None
    yaw: Range | Literal["any"] = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no range.

        Raises:
            TaskError: If a bound is not finite, or the lower one is the larger.
        """
        for name, value in (("x", self.x), ("y", self.y), ("z", self.z), ("yaw", self.yaw)):
            if value is None or value == "any":
                continue
            _bounds(f"an area's {name}", value)

    def draw(self, rng: EpisodeRandom, height: float) -> tuple[list[float], Quaternion]:
        """Draw a pose: first what varies of x, y and z, at once, then the angle.

        Args:
            rng: The environment's random streams.
            height: Of a body's origin when it lies on the table (m).

        Returns:
            Position (m, world) and quaternion (wxyz).
        """
        sides = [self.x, self.y, height if self.z is None else self.z]
        varying = [side for side in sides if isinstance(side, tuple)]
        if varying:
            lows, highs = zip(*varying, strict=True)
            drawn = iter(rng.uniform_between(lows, highs).tolist())
            sides = [next(drawn) if isinstance(side, tuple) else side for side in sides]
        place = [float(side) for side in sides if not isinstance(side, tuple)]
        return place, self._turn(rng)

    def _turn(self, rng: EpisodeRandom) -> Quaternion:
        if self.yaw == "any":
            return tuple(rng.yaw_quaternion().tolist())
        if isinstance(self.yaw, tuple):
            return tuple(rng.yaw_quaternion(*self.yaw).tolist())
        return (cos(self.yaw / 2), 0.0, 0.0, sin(self.yaw / 2)) if self.yaw else IDENTITY


def _bounds(what: str, value: object) -> tuple[float, float]:
    match value:
        case (int() | float() as low, int() | float() as high):
            pass
        case int() | float() as low:
            high = low
        case _:
            raise TaskError(
                f"{what} is {value!r}; it takes a number, or the smallest and the largest"
            )
    if not (isfinite(low) and isfinite(high) and low <= high):
        raise TaskError(
            f"{what} is {value!r}; it takes a finite number, or two of them, the smaller first"
        )
    return float(low), float(high)


@dataclass(frozen=True, kw_only=True)
class Body(ABC):
    """A body of a task: a class attribute, under the name by which the state knows it.

    Attributes:
        spawn: Where episodes begin with it; None leaves that to the task's `sample`.
        start: Where it is built (m, world); None takes the origin of the table's top.
        kind: ``"dynamic"`` moves by physics, ``"kinematic"`` by the task, ``"static"`` never.
    """

    spawn: Area | None = None
    start: Place | None = None
    kind: BodyKind = "dynamic"

    marker: ClassVar[bool] = False
    """Whether it is there for people only: cameras that observe do not see it."""

    def __post_init__(self) -> None:
        """Refuse what no body can be.

        Raises:
            TaskError: If a value is of a wrong type or out of bounds.
        """
        check_fields(self, TaskError)

    @property
    @abstractmethod
    def shapes(self) -> tuple[Shape, ...]:
        """What it is made of, in its own frame."""

    @property
    def height(self) -> float:
        """Of its origin above the table when it lies there (m)."""
        return 0.0

    @property
    def lying(self) -> Quaternion:
        """How it is turned when it lies on the table, wxyz, before any yaw."""
        return IDENTITY

    def add_to(self, world: World, name: str) -> None:
        """Build it in a world."""
        start = (0.0, 0.0, self.height) if self.start is None else self.start
        world.add(name, *self.shapes, kind=self.kind, position=start, marker=self.marker)

    def place(self, world: World, name: str, rng: EpisodeRandom) -> None:
        """Put it where its area says, if it has one."""
        if self.spawn is not None:
            position, turn = self.spawn.draw(rng, self.height)
            world.set_pose(name, position, _turned(self.lying, turn))


class _Matter(TypedDict):
    density: float
    friction: Friction | None


@dataclass(frozen=True, kw_only=True)
class Solid(Body, ABC):
    """A body of one matter.

    Attributes:
        density: Density (kg/m³).
        friction: Contact material; None takes the world's.
    """

    density: Density = 1000.0
    friction: Friction | None = None

    @property
    def matter(self) -> _Matter:
        """What its shapes are made of."""
        return {"density": self.density, "friction": self.friction}


@dataclass(frozen=True)
class Cuboid(Solid):
    """A solid box.

    Attributes:
        half_size: Half its extents along x, y, z (m).
        color: Red, green, blue, alpha.
    """

    half_size: Lengths
    color: Color = RED

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """The box."""
        return (Box(half_size=self.half_size, color=self.color, **self.matter),)

    @property
    def height(self) -> float:
        """Half its height (m)."""
        return self.half_size[2]


@dataclass(frozen=True)
class Cube(Solid):
    """A solid cube.

    Attributes:
        half_size: Half its edge (m).
        color: Red, green, blue, alpha.
    """

    half_size: Length
    color: Color = RED

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """The box."""
        edges = (self.half_size, self.half_size, self.half_size)
        return (Box(half_size=edges, color=self.color, **self.matter),)

    @property
    def height(self) -> float:
        """Half its edge (m)."""
        return self.half_size


@dataclass(frozen=True)
class Ball(Solid):
    """A solid ball.

    Attributes:
        radius: Its radius (m).
        color: Red, green, blue, alpha.
    """

    radius: Length
    color: Color = RED

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """The sphere."""
        return (Sphere(radius=self.radius, color=self.color, **self.matter),)

    @property
    def height(self) -> float:
        """Its radius (m)."""
        return self.radius


@dataclass(frozen=True)
class Peg(Body):
    """A square peg along its own x axis.

    Attributes:
        half_length: Half its length (m).
        half_width: Half its width and height (m).
        tail: Colour of the half at negative x.
        head: Colour of the half at positive x.
    """

    half_length: Length
    half_width: Length
    tail: Color = GREEN
    head: Color = RED

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """One solid box, drawn in two colours."""
        return peg_shapes(self.half_length, self.half_width, tail=self.tail, head=self.head)

    @property
    def height(self) -> float:
        """Half its width (m)."""
        return self.half_width


@dataclass(frozen=True)
class Compound(Body):
    """A body of shapes, at least one.

    Attributes:
        parts: Its shapes, in its own frame.
        rest_height: Of its origin above the table when it lies there (m).
    """

    parts: tuple[Shape, ...]
    rest_height: Coordinate = 0.0

    def __post_init__(self) -> None:
        """Refuse what no body can be.

        Raises:
            TaskError: If there are no parts, or a value is of a wrong type or out of bounds.
        """
        super().__post_init__()
        if not self.parts:
            raise TaskError("Compound: parts is empty; a body is made of one shape or more")

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """Its parts."""
        return self.parts

    @property
    def height(self) -> float:
        """What ``rest_height`` says (m)."""
        return self.rest_height


@dataclass(frozen=True)
class Object(Body):
    """A thing of `objects.ObjectRegistry`, lying as it rests.

    The parts that its joints move are bodies of the world, too: the drawer of ``cabinet`` is
    ``cabinet.drawer``. A ``kind`` that is not dynamic holds the rest of it where it stands.

    Attributes:
        thing: Its name there, or a descriptor.
        rest: Which of its ``rests`` it lies in; None for the first.
        seed: Draws a member of its family; None takes the usual one.
        scale: Factor on its lengths.
        joints: Where episodes begin with its joints, by name: a number, or the smallest and the
            largest that may be drawn (rad; m in a thing of scale 1). Those that are left out begin
            at their own start.
    """

    thing: ObjectDescriptor | str
    rest: str | None = field(default=None, kw_only=True)
    seed: int | None = field(default=None, kw_only=True)
    scale: Factor = field(default=1.0, kw_only=True)
    joints: Mapping[str, Any] = field(default_factory=dict[str, Any], kw_only=True)

    def __post_init__(self) -> None:
        """Refuse what no body can be.

        Raises:
            TaskError: If a value is of a wrong type or out of bounds.
            UnknownNameError: If there is no such thing, it does not rest so, or has no such joint.
            DescriptorError: If a seed is given, and it has no family; or a joint cannot be there.
        """
        super().__post_init__()
        self.descriptor.rest(self.rest)
        for name, value in self.joints.items():
            for end in _bounds(f"Object: joint {name}", value):
                _loaded(self.thing, self.seed, 1.0).joint(name).check(end)

    @property
    def descriptor(self) -> ObjectDescriptor:
        """What it is, as large as it is here."""
        return _loaded(self.thing, self.seed, self.scale)

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """Its parts."""
        return self.descriptor.parts

    @property
    def height(self) -> float:
        """Of its origin when it rests on the table (m)."""
        return self.descriptor.height(self.rest)

    @property
    def lying(self) -> Quaternion:
        """How it is turned when it rests."""
        return self.descriptor.rest(self.rest)

    def add_to(self, world: World, name: str) -> None:
        """Build it in a world, turned as it rests."""
        place = (0.0, 0.0, self.height) if self.start is None else self.start
        turn, joints = self.lying, self.descriptor.joints
        world.add(
            name, *self.shapes, kind=self.kind, position=place, quaternion=turn, joints=joints
        )

    def place(self, world: World, name: str, rng: EpisodeRandom) -> None:
        """Put it where its area says, and its joints where they begin."""
        super().place(world, name, rng)
        if self.joints:
            lows, highs = zip(*(_bounds(*each) for each in self.joints.items()), strict=True)
            drawn = zip(self.joints, rng.uniform_between(lows, highs).tolist(), strict=True)
            scale = self.scale * world.body(name).size
            world.set_joints(name, **{j: self._scaled(j, at, scale) for j, at in drawn})

    def _scaled(self, joint: str, position: float, scale: float) -> float:
        return position * scale if self.descriptor.joint(joint).kind == "slide" else position


@lru_cache(maxsize=256)
def _loaded(thing: ObjectDescriptor | str, seed: int | None, scale: float) -> ObjectDescriptor:
    if isinstance(thing, ObjectDescriptor):
        if seed is not None:
            raise TaskError(
                f"Object: {thing.name} is given as a descriptor and with seed={seed}; a seed draws"
                f" a member where the name is given, as in Object({thing.name!r}, seed={seed})"
            )
        found = thing
    else:
        found = ObjectRegistry.load(thing, seed)
    return found if scale == 1.0 else found.scaled(scale)


@dataclass(frozen=True)
class Goal(Body):
    """A green ball that marks a place in the air, touches nothing, and hides from cameras.

    Attributes:
        radius: Its radius (m).
    """

    radius: Length
    kind: BodyKind = field(default="kinematic", kw_only=True)
    marker: ClassVar[bool] = True

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """The ball."""
        return (Sphere(radius=self.radius, color=GREEN, collides=False),)


@dataclass(frozen=True)
class Target(Body):
    """A disc of red and white rings that lies on the table and touches nothing.

    Attributes:
        radius: Its radius (m).
    """

    radius: Length
    kind: BodyKind = field(default="kinematic", kw_only=True)
    start: Place | None = field(default=(0.0, 0.0, 0.0), kw_only=True)

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """The rings."""
        return target_shapes(self.radius)

    @property
    def height(self) -> float:
        """Just above the table (m)."""
        return TARGET_HEIGHT

    @property
    def lying(self) -> Quaternion:
        """Face up."""
        return FACE_UP


@dataclass(frozen=True)
class Surroundings(ABC):
    """What robots stand in, under a task's ``table``: a table, a counter, or nothing but ground."""

    def outline(self, layout: Layout) -> Rectangle | None:
        """Return the outline of a table's top at z = 0: x_min, y_min, x_max, y_max (m).

        None where there is no table that robots could stand in.
        """
        return None

    def under(self, layout: Layout, places: Sequence[tuple[float, float]]) -> Surroundings:
        """Return what robots stand in that also lies under places, x and y (m); mostly the same."""
        return self

    @abstractmethod
    def add_to(self, world: World, name: str) -> None:
        """Build it; every reset finds it where it is."""


@dataclass(frozen=True)
class Table(Surroundings):
    """ManiSkill's table, 2.4 m × 1.2 m, its top at z = 0, and the floor below it.

    Attributes:
        textured: Whether pictures show wood; else the table is white.
    """

    textured: bool = True

    def __post_init__(self) -> None:
        """Refuse what is no answer.

        Raises:
            TaskError: If ``textured`` is neither True nor False.
        """
        check_fields(self, TaskError)

    def outline(self, layout: Layout) -> Rectangle:
        """Return the outline of its top: x_min, y_min, x_max, y_max (m)."""
        return before_robots(TABLE_OUTLINE, layout)

    def add_to(self, world: World, name: str) -> None:
        """Build it; its body is called ``table-workspace``, as in native.

        A smaller one, before robots that stand lower, is a plain slab called ``table``.
        """
        outline = self.outline(world.layout)
        if outline == TABLE_OUTLINE:
            add_table(world, textured=self.textured)
        else:
            add_slab(world, outline)


@dataclass(frozen=True)
class WideTable(Surroundings):
    """A table under all robots of a layout, its top at z = 0, and the floor below it.

    Attributes:
        others: Places that it lies under like under robots, x and y (m).
    """

    others: tuple[tuple[float, float], ...] = ()

    def outline(self, layout: Layout) -> Rectangle:
        """Return the outline of its top: x_min, y_min, x_max, y_max (m)."""
        return wide_table_outline(layout, self.others)

    def under(self, layout: Layout, places: Sequence[tuple[float, float]]) -> Surroundings:
        """Return the table that also lies under places, x and y (m)."""
        x_min, y_min, x_max, y_max = self.outline(layout)
        on_it = all(x_min <= x <= x_max and y_min <= y <= y_max for x, y in places)
        return self if on_it else replace(self, others=(*places,))

    def add_to(self, world: World, name: str) -> None:
        """Build it; its body is called ``table``."""
        add_wide_table(world, self.others)


@dataclass(frozen=True)
class Ground(Surroundings):
    """ManiSkill's floor at z = 0, and no table: what robots work at are bodies of the task.

    Attributes:
        mipmaps: How many sizes of the floor's texture there are; see `objects.shapes.Floor`.
    """

    mipmaps: Annotated[int, whole(1, 16)] = 4

    def __post_init__(self) -> None:
        """Refuse what is no number of sizes.

        Raises:
            TaskError: If ``mipmaps`` is no whole number from 1 to 16.
        """
        check_fields(self, TaskError)

    def add_to(self, world: World, name: str) -> None:
        """Build it; its body is called ``ground``."""
        add_ground(world, mipmaps=self.mipmaps)


@dataclass(frozen=True)
class KitchenCounter(Surroundings):
    """ManiSkill's kitchen counter with a sink, and the floor at z = 0.

    Attributes:
        scale: How much larger it is than its file.
    """

    scale: Factor = 1.0

    def __post_init__(self) -> None:
        """Refuse what is no scale.

        Raises:
            TaskError: If ``scale`` is no number, or out of bounds.
        """
        check_fields(self, TaskError)

    def add_to(self, world: World, name: str) -> None:
        """Build it; its body is called ``kitchen-counter``."""
        add_kitchen_counter(world, self.scale)


Declared: TypeAlias = Body | Surroundings


def _turned(lying: Quaternion, turn: Quaternion) -> Quaternion:
    if IDENTITY in (lying, turn):  # exactly the other one
        return turn if lying == IDENTITY else lying
    return multiplied(turn, lying)


def declared_bodies(task: type) -> dict[str, Declared]:
    """Return the bodies that a task's class declares, by name, its bases' first."""
    return dict(_bodies(task))


def packages_of(bodies: Iterable[Declared]) -> set[str]:
    """Return the packages of the manifest whose files bodies are made of."""
    named = [shape.file for body in bodies for shape in _shapes(body) if isinstance(shape, Mesh)]
    packages = {file.package for file in named if isinstance(file, FileLocator)}
    return packages | {KITCHEN for body in bodies if isinstance(body, KitchenCounter)}


def _shapes(body: Declared) -> tuple[Shape, ...]:
    return body.shapes if isinstance(body, Body) else ()


def _bodies(task: type) -> Iterator[tuple[str, Declared]]:
    names = dict.fromkeys(name for cls in reversed(task.__mro__) for name in vars(cls))
    for name in names:
        value = getattr(task, name, None)
        if isinstance(value, Body | Surroundings):
            yield name, value
