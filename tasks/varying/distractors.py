"""Bodies that are there to distract: how many, what they are, and where each episode puts them.

A world has all of them, always the same ones in the same order, so that its states have the same
shape whatever is drawn. Those that an episode leaves out wait far away, where no camera sees them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import cos, hypot, inf, pi, sin
from typing import Any, ClassVar, Literal, NamedTuple, get_args

from robot_layouts.core.bounds import checked_choice, checked_number, checked_whole, shown
from robot_layouts.simulation import Box, Cylinder, Shape, Sphere, World
from robot_layouts.simulation.world import BodyKind
from robots import TaskError, UnknownNameError
from robots.descriptor import Vector3
from tasks.varying.distributions import Uniform, as_whole
from tasks.varying.groups import Declared, Group, Limits
from tasks.varying.looks import TONES
from tasks.varying.streams import Stream

SHAPES = ("box", "ball", "cylinder")
Kind = Literal["dynamic", "static", "visual"]
KINDS = get_args(Kind)

Rectangle = tuple[float, float, float, float]

_MOST = 64
_AROUND = 0.35  # m; how far from the point that people look at, if nothing is declared
_WAITING = 1000.0  # m; beyond what cameras see
_UPRIGHT = (cos(pi / 4), 0.0, -sin(pi / 4), 0.0)  # wxyz; turns an axis along x to z
_LEAST_SHARE = 0.5  # of the shorter sides of one, of the longest

_FRACTION = Limits(0.0, 1.0, "a fraction")
_METRES = Limits(-inf, inf, "m")


class Distractor(NamedTuple):
    """One of them.

    Attributes:
        name: Its name among the bodies.
        shape: What it is.
        reach: How far it reaches from its middle, seen from above (m).
        height: Of its middle where it stands (m).
    """

    name: str
    shape: Shape
    reach: float
    height: float


@dataclass(frozen=True, kw_only=True)
class _Chance(Group):
    """What is drawn for one of them, besides its place."""

    rank: Declared
    yaw: Declared
    red: Declared
    green: Declared
    blue: Declared

    limits: ClassVar[Mapping[str, Limits]] = {
        **dict.fromkeys(("rank", "red", "green", "blue"), _FRACTION),
        "yaw": Limits(-inf, inf, "rad"),
    }


@dataclass(frozen=True, kw_only=True)
class Distractors(Group):
    """Bodies that stand on the table and have nothing to do with the task.

    What they are follows from this declaration alone; which of them are there, where and in what
    colour is drawn for each episode. None is nearer than ``gap`` to a robot, to a body of the task
    or to another one when the episode begins; one that finds no such place is left out.

    Attributes:
        count: How many are there.
        kind: ``"dynamic"`` ones can be pushed and are in the state, as ``distractor_0`` and so on;
            ``"static"`` ones stand fast; ``"visual"`` ones are seen and touch nothing.
        bodies: Of how many they are taken; None for the most that ``count`` may draw.
        shapes: What they may be: ``"box"``, ``"ball"`` and ``"cylinder"``, in turn.
        size: Half their length (m).
        x: Of their middles (m, world); None for places on the table near the point that the task's
            ``viewpoint`` looks at.
        y: Likewise.
        yaw: How they are turned (rad).
        red: From 0 to 1, of light.
        green: Likewise.
        blue: Likewise.
        gap: How far each is from everything else (m).
    """

    count: Declared
    kind: Kind = "dynamic"
    bodies: int | None = None
    shapes: Sequence[str] = SHAPES
    size: Declared = Uniform(0.015, 0.035)
    x: Declared = None
    y: Declared = None
    yaw: Declared = Uniform(-pi, pi)
    red: Declared = TONES
    green: Declared = TONES
    blue: Declared = TONES
    gap: float = 0.02

    limits: ClassVar[Mapping[str, Limits]] = {
        "count": Limits(0, _MOST, "bodies", whole=True),
        "size": Limits(1e-3, 1.0, "m"),
        "x": _METRES,
        "y": _METRES,
        "yaw": Limits(-inf, inf, "rad"),
        **dict.fromkeys(("red", "green", "blue"), _FRACTION),
    }

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn.

        Raises:
            TaskError: If a field is not what it must be, or may draw what makes no sense.
            UnknownNameError: If there is no such shape.
        """
        super().__post_init__()
        checked_choice("Distractors: kind", self.kind, KINDS, TaskError)
        gap = checked_number("Distractors: gap", self.gap, 0.0, 1.0, TaskError, "m")
        least = int(self.declared["count"].bounds[1])
        bodies = least if self.bodies is None else as_whole(self.bodies)
        checked_whole("Distractors: bodies", bodies, least, _MOST, TaskError)
        shapes = (self.shapes,) if isinstance(self.shapes, str) else self.shapes
        if not isinstance(shapes, Sequence) or not shapes:
            raise TaskError(
                f"Distractors: shapes is {shown(self.shapes)}; it takes some of {', '.join(SHAPES)}"
            )
        for shape in shapes:
            if shape not in SHAPES:
                raise UnknownNameError("shape of distractors", shape, SHAPES)
        for name, value in {"gap": gap, "bodies": bodies, "shapes": tuple(shapes)}.items():
            object.__setattr__(self, name, value)

    @property
    def drawn(self) -> dict[str, Any]:
        """What is drawn: how many there are, and for each of them its rank, turn and colour."""
        own = {name: self.declared[name] for name in ("yaw", "red", "green", "blue")}
        chance = _Chance(rank=Uniform(0.0, 1.0), **own)
        return {"count": self.declared["count"], **dict.fromkeys(self.names_of_bodies, chance)}

    @property
    def names_of_bodies(self) -> list[str]:
        """What all of them are called."""
        return [f"distractor_{i}" for i in range(self.bodies or 0)]

    def every(self) -> list[Distractor]:
        """Return all of them, those that wait as well."""
        return [_distractor(self, *item) for item in enumerate(self.names_of_bodies)]

    def to_json(self) -> Any:
        """Return it as plain data, which `read` turns into an equal one."""
        plain = {"kind": self.kind, "bodies": self.bodies, "shapes": list(self.shapes)}
        return {**plain, "gap": self.gap, **super().to_json()}

    def __str__(self) -> str:
        """Show what is varied."""
        kinds = f"{self.kind} {' or '.join(self.shapes)}"
        return f"{kinds} of {self.bodies}, {super().__str__()}, gap {self.gap:g}"


def _distractor(declared: Distractors, number: int, name: str) -> Distractor:
    """Return one of them; its numbers are the declaration's, whatever the episode."""
    size, first, second = (
        distribution.value(Stream(0).number("distractors", name, what))
        for what, distribution in (
            ("size", declared.declared["size"]),
            ("width", Uniform(_LEAST_SHARE, 1.0)),
            ("height", Uniform(_LEAST_SHARE, 1.0)),
        )
    )
    solid = declared.kind != "visual"
    match declared.shapes[number % len(declared.shapes)]:
        case "box":
            sides = size, size * first, size * second
            reach = hypot(sides[0], sides[1])
            return Distractor(name, Box(half_size=sides, collides=solid), reach, sides[2])
        case "ball":
            return Distractor(name, Sphere(radius=size, collides=solid), size, size)
        case _:
            radius = size * first
            shape = Cylinder(radius=radius, half_length=size, quaternion=_UPRIGHT, collides=solid)
            return Distractor(name, shape, radius, size)


def add_distractors(world: World, declared: Distractors) -> None:
    """Add all of them to a world, after the task's own bodies."""
    kind: BodyKind = "dynamic" if declared.kind == "dynamic" else "static"
    for number, one in enumerate(declared.every()):
        world.add(one.name, one.shape, kind=kind, position=waiting(number))


def waiting(number: int) -> Vector3:
    """Return where one of them is while an episode does without it (m, world)."""
    return (_WAITING + number, 0.0, _WAITING)


def area_of(outline: Rectangle, looked_at: Vector3) -> Rectangle:
    """Return where distractors are put if nothing is declared: x_min, y_min, x_max, y_max (m).

    Args:
        outline: Of the table.
        looked_at: The point in the middle of what people see.
    """
    x, y, _ = looked_at
    x_min, y_min, x_max, y_max = outline
    near = max(x_min, x - _AROUND), max(y_min, y - _AROUND)
    return (*near, min(x_max, x + _AROUND), min(y_max, y + _AROUND))
