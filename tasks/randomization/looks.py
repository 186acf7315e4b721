"""What pictures of worlds can vary in: cameras, light, paint and patterns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias

from robot_layouts.simulation.variation import (
    PATTERNS,
    CameraOffset,
    Glow,
    Looks,
    Paint,
    Pattern,
)
from robot_layouts.simulation.world import Part
from robots.descriptor import Vector3
from tasks.randomization.distributions import Choice, Distribution, Whole
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

_Strength: TypeAlias = Annotated[Declared, Limits(0.0, 100.0, "factor on what is declared")]
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

    x: Metres = None
    y: Metres = None
    z: Metres = None
    roll: Angle = None
    pitch: Angle = None
    yaw: Angle = None
    fov: Annotated[Declared, Limits(0.01, 10.0, "factor on what is declared")] = None


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

    turn: Angle = None
    tilt: Angle = None
    strength: _Strength = None
    red: _Strength = None
    green: _Strength = None
    blue: _Strength = None


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

    red: Fraction = None
    green: Fraction = None
    blue: Fraction = None
    share: Fraction = None
    roughness: Fraction = None
    metallic: Fraction = None
    specular: Fraction = None


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
    cells: Annotated[Declared, Limits(1, 64, "repeats", whole=True)] = Whole(1, 6)
    red: Fraction = TONES
    green: Fraction = TONES
    blue: Fraction = TONES

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn.

        Raises:
            TaskError: If there is nothing to choose from, a field is not a distribution, or may
                draw invalid values.
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


def _shift(drawn: Mapping[str, float]) -> CameraOffset:
    moved = _vector(drawn, ("x", "y", "z"), 0.0)
    turned = _vector(drawn, ("roll", "pitch", "yaw"), 0.0)
    return CameraOffset(moved, turned, drawn.get("fov", 1.0))


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
