"""What pictures of worlds can vary in: cameras, light, paint and patterns."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from layouts import Layout
from robot_layouts.simulation import Camera, Simulation
from robot_layouts.simulation.scene.cameras import AnyCamera, RobotCamera, camera_name
from robot_layouts.simulation.scene.looks import (
    LIGHTS,
    PATTERNS,
    Glow,
    Looks,
    Paint,
    Pattern,
    Shift,
)
from robot_layouts.simulation.scene.parts import Part
from robots.descriptor import Vector3
from tasks.randomization.distributions import Choice, Distribution, Whole
from tasks.randomization.groups import (
    ANGLE,
    COLORS,
    FRACTION,
    METRES,
    TONES,
    Declared,
    Group,
    Limits,
    some_of,
)
from tasks.randomization.targets import linked_parts

_STRENGTH = Limits(0.0, 100.0, "factor on what is declared")
_SEEDS = 10**6


@dataclass(frozen=True, kw_only=True)
class CameraShift(Group):
    """How cameras are off their places, in their own frame: x is where one looks, y left, z up.

    Attributes:
        x: By how much it is moved (m).
        y: Likewise.
        z: Likewise.
        roll: How it is turned about its x (rad).
        pitch: About its y.
        yaw: About its z.
        fov: Factor on its vertical field of view.
    """

    x: Declared = None
    y: Declared = None
    z: Declared = None
    roll: Declared = None
    pitch: Declared = None
    yaw: Declared = None
    fov: Declared = None

    limits: ClassVar[Mapping[str, Limits]] = {
        **dict.fromkeys(("x", "y", "z"), METRES),
        **dict.fromkeys(("roll", "pitch", "yaw"), ANGLE),
        "fov": Limits(0.01, 10.0, "factor on what is declared"),
    }


@dataclass(frozen=True, kw_only=True)
class Light(Group):
    """How a light differs from its own; that from everywhere has no direction.

    Attributes:
        turn: How its direction is turned about the vertical (rad).
        tilt: By how much more it shines sideways (rad).
        strength: Factor on its colour.
        red: Factor on the red of it.
        green: Likewise.
        blue: Likewise.
    """

    turn: Declared = None
    tilt: Declared = None
    strength: Declared = None
    red: Declared = None
    green: Declared = None
    blue: Declared = None

    limits: ClassVar[Mapping[str, Limits]] = {
        **dict.fromkeys(("turn", "tilt"), ANGLE),
        **dict.fromkeys(("strength", *COLORS), _STRENGTH),
    }


@dataclass(frozen=True, kw_only=True)
class Surface(Group):
    """What a body or a robot is painted with; what is left out stays as it is.

    Attributes:
        red: From 0 to 1, of light.
        green: Likewise.
        blue: Likewise.
        share: Of the paint in what is seen: 0 leaves the own colour, and 1, which it is if left
            out, leaves none of it.
        roughness: 0 for a mirror, 1 for chalk.
        metallic: 0 for paint, 1 for metal.
        specular: Strength of highlights.
    """

    red: Declared = None
    green: Declared = None
    blue: Declared = None
    share: Declared = None
    roughness: Declared = None
    metallic: Declared = None
    specular: Declared = None

    limits: ClassVar[Mapping[str, Limits]] = dict.fromkeys(
        (*COLORS, "share", "roughness", "metallic", "specular"), FRACTION
    )


@dataclass(frozen=True, kw_only=True)
class Texture(Group):
    """A pattern in two colours that covers a body, computed and not read from any file.

    Attributes:
        kinds: Patterns to choose from: ``"checker"``, ``"stripes"``, ``"noise"`` and ``"wood"``.
        cells: How often it repeats along the body's longest side, or along 4 m of it.
        red: Of either colour, from 0 to 1, of light; each has a draw of its own.
        green: Likewise.
        blue: Likewise.
    """

    kinds: Sequence[str] = PATTERNS
    cells: Declared = Whole(1, 6)
    red: Declared = TONES
    green: Declared = TONES
    blue: Declared = TONES

    limits: ClassVar[Mapping[str, Limits]] = {
        "cells": Limits(1, 64, "repeats", whole=True),
        **dict.fromkeys(COLORS, FRACTION),
    }

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn.

        Raises:
            TaskError: If there is nothing to choose from, a field is no distribution, or may draw
                what makes no sense.
            UnknownNameError: If there is no such pattern.
        """
        super().__post_init__()
        kinds = some_of("Texture: kinds", self.kinds, PATTERNS, "pattern")
        object.__setattr__(self, "kinds", kinds)

    @property
    def drawn(self) -> dict[str, Distribution]:
        """What is drawn: which pattern, by its number in `PATTERNS`, two colours, and a seed."""
        colors = {name: self.declared[name] for name in COLORS}
        return {
            "kind": Choice(tuple(PATTERNS.index(kind) for kind in self.kinds)),
            "cells": self.declared["cells"],
            **colors,
            **{f"{name}_2": drawn for name, drawn in colors.items()},
            "seed": Whole(0, _SEEDS),
        }

    def to_json(self) -> Any:
        """Return it as plain data, which `read` turns into an equal one."""
        return {"kinds": list(self.kinds), **super().to_json()}

    def __str__(self) -> str:
        """Show what is varied."""
        return f"{' or '.join(self.kinds)}, {super().__str__()}"


# -- what they can be declared for ---------------------------------------------------------------


def look_targets(
    cameras: Sequence[Camera], painted: Container[str]
) -> dict[str, Callable[[Simulation], Mapping[str, tuple[Any, ...]]]]:
    """Return what returns the things that each axis can be declared for, by name.

    Args:
        cameras: The task's own cameras.
        painted: Names of bodies whose colour is drawn with something else.
    """
    return {
        "cameras": lambda simulation: _cameras(simulation.layout, cameras),
        "lights": lambda simulation: {name: (name,) for name in LIGHTS},
        "colors": lambda simulation: _surfaces(simulation, painted),
        "textures": lambda simulation: {name: (name,) for name in simulation.worlds[0].bodies},
    }


def _cameras(layout: Layout, cameras: Sequence[Camera]) -> dict[str, tuple[str, ...]]:
    """Return the names of the cameras that observe: a task's own, and those of its robots."""
    every: list[AnyCamera] = [*cameras]
    every += [RobotCamera(n, m) for n, place in layout.items() for m in place.robot.cameras]
    return {name: (name,) for name in map(camera_name, every)}


def _surfaces(simulation: Simulation, painted: Container[str]) -> dict[str, tuple[Part, ...]]:
    """Return everything that can be painted: bodies, robots, and each of their links."""
    names = (name for name in simulation.worlds[0].bodies if name not in painted)
    bodies = {name: (Part(None, name),) for name in names}
    return {**bodies, **linked_parts(simulation)}


# -- what was drawn of them ----------------------------------------------------------------------


def looks(
    values: Callable[[str], Mapping[Any, Mapping[str, float]]], paints: Mapping[Part, Paint]
) -> Looks:
    """Return how a world looks by what was drawn.

    Args:
        values: Returns what was drawn of an axis, for each thing.
        paints: Other paint, of what nothing was drawn for.
    """
    return Looks(
        {name: _shift(drawn) for name, drawn in values("cameras").items()},
        {name: _glow(drawn) for name, drawn in values("lights").items()},
        {**paints, **{part: Paint(**drawn) for part, drawn in values("colors").items()}},
        {name: _pattern(drawn) for name, drawn in values("textures").items()},
    )


def _shift(drawn: Mapping[str, float]) -> Shift:
    moved = _vector(drawn, ("x", "y", "z"), 0.0)
    turned = _vector(drawn, ("roll", "pitch", "yaw"), 0.0)
    return Shift(moved, turned, drawn.get("fov", 1.0))


def _glow(drawn: Mapping[str, float]) -> Glow:
    strength = drawn.get("strength", 1.0)
    red, green, blue = _vector(drawn, COLORS, 1.0)
    color = strength * red, strength * green, strength * blue
    return Glow(drawn.get("turn", 0.0), drawn.get("tilt", 0.0), color)


def _pattern(drawn: Mapping[str, float]) -> Pattern:
    first, second = _vector(drawn, COLORS), _vector(drawn, [f"{name}_2" for name in COLORS])
    kind, cells, seed = (int(drawn[name]) for name in ("kind", "cells", "seed"))
    return Pattern(PATTERNS[kind], cells, first, second, seed)


def _vector(drawn: Mapping[str, float], names: Sequence[str], default: float = 0.0) -> Vector3:
    """Return three of the numbers that were drawn; those that do not vary are the default."""
    first, second, third = (drawn.get(name, default) for name in names)
    return first, second, third
