"""What a world looks like beyond what was declared: paint, patterns, lamps, places of cameras.

All in place: SAPIEN takes other colours, textures and light in a world that is built. Every value
is set from the one that was built, so it does not depend on what was set before.
"""

from __future__ import annotations

from math import atan2, cos, hypot, pi, sin
from typing import Any

import sapien

from robot_layouts.simulation.sapien3.pictures.wrapping import cover, materials, wrap
from robot_layouts.simulation.sapien3.world import BuiltWorld
from robot_layouts.simulation.scene.looks import Glow, Looks, Paint, Shift
from robot_layouts.simulation.scene.parts import Part
from robots.descriptor import Vector3

_MOST_TILT = 1.4  # rad from the vertical; light from the horizon and below lights no table


class Wardrobe:
    """Dresses one world."""

    def __init__(self, world: BuiltWorld) -> None:
        """Begin with a world as it was built."""
        self._world = world
        self._surfaces: dict[Part, list[tuple[Any, list[float]]]] = {}
        self._covers: dict[str, list[Any]] = {}

    def dress(self, looks: Looks) -> None:
        """Let bodies and robots look so."""
        for name, pattern in looks.patterns.items():
            cover(self._cover(name), pattern)
        for part, paint in looks.paints.items():
            covered = part.robot is None and part.name in looks.patterns
            for material, surface in self._surface(part):
                _finish(material, paint)
                if not covered:
                    _paint(material, surface, paint)

    def _surface(self, part: Part) -> list[tuple[Any, list[float]]]:
        found = self._surfaces.get(part)
        if found is None:
            drawn = materials(_entity(self._world, part))
            found = self._surfaces[part] = [(m, list(m.base_color)) for m in drawn]
        return found

    def _cover(self, name: str) -> list[Any]:
        """Return the materials of a body whose shapes a pattern fits, made when first asked for."""
        found = self._covers.get(name)
        if found is None:
            body = self._world.bodies[name]
            found = self._covers[name] = wrap(body.entity, body.declared.shapes)
        return found


def _entity(world: BuiltWorld, part: Part) -> sapien.Entity:
    if part.robot is None:
        return world.bodies[part.name].entity
    return world.robots[part.robot].link(part.name).entity


def _finish(material: Any, paint: Paint) -> None:
    for name in ("roughness", "metallic", "specular"):
        wanted = getattr(paint, name)
        if wanted is not None:
            getattr(material, f"set_{name}")(wanted)


def _paint(material: Any, own: list[float], paint: Paint) -> None:
    color = list(own)
    for i, wanted in enumerate((paint.red, paint.green, paint.blue)):
        if wanted is not None:
            color[i] += (wanted - color[i]) * paint.share
            material.set_base_color_texture(None)
    material.set_base_color(color)


# -- light ---------------------------------------------------------------------------------------


def lamp_pose(direction: Vector3, glow: Glow) -> sapien.Pose:
    """Return the pose of a lamp that shines along its +x, by its own direction."""
    ahead: Any = [1.0, 0.0, 0.0]
    return sapien.Pose(q=sapien.math.shortest_rotation(ahead, _turned(direction, glow)))


def _turned(direction: Vector3, glow: Glow) -> Any:
    if not glow.turn and not glow.tilt:
        return list(direction)
    x, y, z = direction
    around = atan2(y, x) + glow.turn
    down = min(max(atan2(hypot(x, y), -z) + glow.tilt, -_MOST_TILT), _MOST_TILT)
    return [sin(down) * cos(around), sin(down) * sin(around), -cos(down)]


def light_color(color: Vector3, glow: Glow) -> list[float]:
    """Return a light's colour."""
    return [own * factor for own, factor in zip(color, glow.color, strict=True)]


# -- cameras -------------------------------------------------------------------------------------


def shifted(pose: sapien.Pose, shift: Shift) -> sapien.Pose:
    """Return where a camera is, off its place."""
    roll, pitch, yaw = shift.rotation
    turn = sapien.Pose(list(shift.position))
    for axis, angle in ((2, yaw), (1, pitch), (0, roll)):
        quaternion = [cos(angle / 2), 0.0, 0.0, 0.0]
        quaternion[1 + axis] = sin(angle / 2)
        turn = turn * sapien.Pose(q=quaternion)
    return pose * turn


def widened(fov: float, shift: Shift) -> float:
    """Return a camera's field of view (rad), which stays below a half-turn."""
    return min(fov * shift.fov, pi - 1e-3)
