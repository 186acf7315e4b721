"""Bodies that are there to distract: how many, what they are, and where each episode puts them.

A world has all of them, always the same ones in the same order, so that its states have the same
shape whatever is drawn. Those that an episode leaves out wait far away, where no camera sees them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import cos, hypot, inf, pi, sin
from typing import Annotated, Any, Literal, NamedTuple, get_args

import numpy as np

from objects.shapes import Capsule
from robot_layouts.core.bounds import checked_choice, checked_number, checked_whole
from robot_layouts.simulation import Box, Cylinder, Shape, Simulation, Sphere, State, World
from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.variation import Paint, Variation
from robot_layouts.simulation.world import BodyKind, Part, WorldBody
from robots import TaskError
from robots.descriptor import Vector3
from tasks.randomization.distributions import Distribution, Stream, Uniform, as_whole
from tasks.randomization.groups import (
    COLORS,
    TONES,
    Angle,
    Declared,
    Fraction,
    Group,
    Limits,
    Metres,
    some_of,
)

SHAPES = ("box", "ball", "cylinder")
Kind = Literal["dynamic", "static", "visual"]
KINDS = get_args(Kind)

Rectangle = tuple[float, float, float, float]

_MOST = 64
_AROUND = 0.35  # m; how far from the point that people look at, if nothing is declared
_WAITING = 1000.0  # m; beyond what cameras see
_UPRIGHT = (cos(pi / 4), 0.0, -sin(pi / 4), 0.0)  # wxyz; turns an axis along x to z
_LEAST_SHARE = 0.5  # of the shorter sides of one, of the longest
_TRIES = 64  # places that are tried for each
_GROUND = 1e-3  # m; what ends below this height is what things stand on


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

    count: Annotated[Declared, Limits(0, _MOST, "bodies", whole=True)]
    kind: Kind = "dynamic"
    bodies: int | None = None
    shapes: Sequence[str] = SHAPES
    size: Annotated[Declared, Limits(1e-3, 1.0, "m")] = Uniform(0.015, 0.035)
    x: Metres = None
    y: Metres = None
    yaw: Angle = Uniform(-pi, pi)
    red: Fraction = TONES
    green: Fraction = TONES
    blue: Fraction = TONES
    gap: float = 0.02

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn.

        Raises:
            TaskError: If a field is not what it must be, or may draw invalid values.
            UnknownNameError: If there is no such shape.
        """
        super().__post_init__()
        checked_choice("Distractors: kind", self.kind, KINDS, TaskError)
        gap = checked_number("Distractors: gap", self.gap, 0.0, 1.0, TaskError, "m")
        least = int(self.declared["count"].bounds[1])
        bodies = least if self.bodies is None else as_whole(self.bodies)
        checked_whole("Distractors: bodies", bodies, least, _MOST, TaskError)
        shapes = some_of("Distractors: shapes", self.shapes, SHAPES, "shape of distractors")
        for name, value in {"gap": gap, "bodies": bodies, "shapes": shapes}.items():
            object.__setattr__(self, name, value)

    @property
    def drawn(self) -> dict[str, Any]:
        """What is drawn: how many there are, and for each of them its rank, turn and colour."""
        own = {name: self.declared[name] for name in ("yaw", *COLORS)}
        chance = {"rank": Uniform(0.0, 1.0), **own}
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
        world.add(one.name, one.shape, kind=kind, position=_waiting(number))


def _waiting(number: int) -> Vector3:
    """Return where one of them is while an episode does without it (m, world)."""
    return (_WAITING + number, 0.0, _WAITING)


def area_of(outline: Rectangle | None, looked_at: Vector3) -> Rectangle:
    """Return where distractors are put if nothing is declared: x_min, y_min, x_max, y_max (m).

    Args:
        outline: Of the table; None if there is none, so that they stand on the ground.
        looked_at: The point in the middle of what people see.
    """
    x, y, _ = looked_at
    x_min, y_min, x_max, y_max = (-inf, -inf, inf, inf) if outline is None else outline
    near = max(x_min, x - _AROUND), max(y_min, y - _AROUND)
    return (*near, min(x_max, x + _AROUND), min(y_max, y + _AROUND))


# -- where they stand when an episode begins -------------------------------------------------------


class Scattering:
    """Puts distractors into worlds, clear of everything that is there."""

    def __init__(self, declared: Distractors, area: Rectangle) -> None:
        """Remember what they are, and where they go if nothing is declared."""
        self._declared, self._every = declared, declared.every()
        x_min, y_min, x_max, y_max = area
        self._x: Distribution = declared.declared.get("x", Uniform(x_min, x_max))
        self._y: Distribution = declared.declared.get("y", Uniform(y_min, y_max))

    def paints(self, drawn: Mapping[str, Any]) -> dict[Part, Paint]:
        """Return the colours that were drawn."""
        return {
            Part(None, one.name): Paint(*(drawn[one.name][c] for c in COLORS))
            for one in self._every
        }

    def scatter(
        self,
        simulation: Simulation,
        state: State,
        drawn: Mapping[int, dict[str, Any]],
        streams: Sequence[Stream],
    ) -> None:
        """Put them where they are clear of everything; the task's bodies are placed already.

        Args:
            simulation: The worlds.
            state: What they look like.
            drawn: What was drawn for them, by world; where they are is added to it.
            streams: Of every world.
        """
        variations: dict[int, Variation] = {}
        for env, own in drawn.items():
            taken = _taken(simulation, state, env, {one.name for one in self._every})
            self._place(simulation.worlds[env], own, taken, streams[env])
            waits = {Part(None, one.name): not own[one.name]["there"] for one in self._every}
            variations[env] = Variation(weightless=waits)
        if self._declared.kind == "dynamic":
            simulation.vary(variations)

    def _place(self, world: World, drawn: dict[str, Any], taken: Floats, stream: Stream) -> None:
        ranked = sorted(self._every, key=lambda one: drawn[one.name]["rank"])
        chosen = {one.name for one in ranked[: drawn["count"]]}
        drawn["count"] = 0
        for number, one in enumerate(self._every):
            place = self._find(one, taken, stream) if one.name in chosen else None
            x, y, z = _waiting(number) if place is None else (*place, one.height)
            yaw = drawn[one.name]["yaw"]
            world.set_pose(one.name, (x, y, z), (cos(yaw / 2), 0.0, 0.0, sin(yaw / 2)))
            drawn[one.name] |= {"there": int(place is not None), "x": x, "y": y}
            if place is not None:
                drawn["count"] += 1
                taken = np.concatenate([taken, _box(one, *place)[None]])

    def _find(self, one: Distractor, taken: Floats, stream: Stream) -> tuple[float, float] | None:
        numbers = stream.numbers(2 * _TRIES, "distractors", one.name, "place")
        gap = self._declared.gap
        for u, v in zip(numbers[::2], numbers[1::2], strict=True):
            x, y = self._x.value(u), self._y.value(v)
            own = _box(one, x, y)
            apart = (own[0] > taken[:, 1] + gap) | (own[1] < taken[:, 0] - gap)
            if apart.any(1).all():
                return x, y
        return None


def _box(one: Distractor, x: float, y: float) -> Floats:
    """Return the box around one of them at a place: its lowest and its highest corner, (2, 3)."""
    low = x - one.reach, y - one.reach, 0.0
    return np.array([low, (x + one.reach, y + one.reach, 2 * one.height)], np.float32)


def _taken(simulation: Simulation, state: State, env: int, without: set[str]) -> Floats:
    """Return the boxes around everything in a world that rises above the table, (K, 2, 3)."""
    boxes = [
        box for part, box in simulation.backend.extents(env).items() if part.name not in without
    ]
    for body in simulation.worlds[env].bodies.values():
        if body.name not in without and not any(shape.collides for shape in body.shapes):
            boxes += _around(body, state.pose(body.name)[env])
    found = np.array(boxes, np.float32).reshape(-1, 2, 3)
    return found[found[:, 1, 2] > _GROUND]


def _around(body: WorldBody, pose: Floats) -> list[Floats]:
    """Return a box around a body that touches nothing: a goal, say."""
    reach = [hypot(*shape.position) + length for shape in body.shapes if (length := _length(shape))]
    return [np.array([pose[:3] - max(reach), pose[:3] + max(reach)])] if reach else []


def _length(shape: Shape) -> float:
    """Return how far a shape reaches from its middle (m); 0 for what has no end, and for meshes."""
    match shape:
        case Box():
            return hypot(*shape.half_size)
        case Sphere():
            return shape.radius
        case Cylinder():
            return hypot(shape.radius, shape.half_length)
        case Capsule():
            return shape.radius + shape.half_length
        case _:
            return 0.0
