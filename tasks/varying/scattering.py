"""Where distractors stand when an episode begins: clear of everything that is there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import cos, hypot, sin
from typing import Any

import numpy as np

from robot_layouts.simulation import Box, Cylinder, Shape, Simulation, Sphere, State, World
from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.scene.looks import Paint
from robot_layouts.simulation.scene.parts import Part
from robot_layouts.simulation.scene.shapes import Capsule
from robot_layouts.simulation.scene.variation import Variation
from robot_layouts.simulation.world import Body
from tasks.varying.distractors import Distractor, Distractors, Rectangle, waiting
from tasks.varying.distributions import Distribution, Uniform
from tasks.varying.streams import Stream

_TRIES = 64  # places that are tried for each
_GROUND = 1e-3  # m; what ends below this height is what things stand on


class Scattering:
    """Puts distractors into worlds."""

    def __init__(self, declared: Distractors, area: Rectangle) -> None:
        """Remember what they are, and where they go if nothing is declared."""
        self._declared, self._every = declared, declared.every()
        x_min, y_min, x_max, y_max = area
        self._x: Distribution = declared.declared.get("x", Uniform(x_min, x_max))
        self._y: Distribution = declared.declared.get("y", Uniform(y_min, y_max))

    def paints(self, drawn: Mapping[str, Any]) -> dict[Part, Paint]:
        """Return the colours that were drawn."""
        return {
            Part(None, one.name): Paint(*(drawn[one.name][c] for c in ("red", "green", "blue")))
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
            x, y, z = waiting(number) if place is None else (*place, one.height)
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


def _around(body: Body, pose: Floats) -> list[Floats]:
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
