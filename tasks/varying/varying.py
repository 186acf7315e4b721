"""Draws what varies in a task's worlds, and lets them differ by it."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simulation import Simulation
from simulation.variation import Variation
from tasks.varying.axes import Group
from tasks.varying.randomization import Randomization
from tasks.varying.streams import Stream
from tasks.varying.targets import Target, heavy_parts, targets

_OFFERED = {"mass": heavy_parts}

DRAWN = "drawn"  # what the names of what was drawn begin with in ``info``


class Varying:
    """What varies in N worlds, and what was last drawn for each of them."""

    def __init__(self, randomization: Randomization, simulation: Simulation) -> None:
        """Look up what the names of a randomization mean.

        Raises:
            UnknownNameError: If one means nothing.
        """
        declared = randomization.declared
        self._targets: dict[str, dict[str, Target]] = {
            axis: targets(axis, declared[axis], offered(simulation))
            for axis, offered in _OFFERED.items()
            if axis in declared
        }
        self._drawn: list[dict[str, Any]] = [{} for _ in range(simulation.num_envs)]

    def draw(self, env: int, stream: Stream) -> None:
        """Draw what varies in the coming episode of an environment."""
        self._drawn[env] = {
            axis: {name: _draw(target.takes, stream, axis, name) for name, target in named.items()}
            for axis, named in self._targets.items()
        }

    def drawn(self, env: int) -> dict[str, Any]:
        """Return what was drawn for an environment, by axis and name, as plain data."""
        return copy.deepcopy(self._drawn[env])

    def info(self) -> dict[str, NDArray[np.float32]]:
        """Return what was drawn for all environments, (N,) each: ``drawn/mass/cube``."""
        rows = [dict(_leaves(DRAWN, drawn)) for drawn in self._drawn]
        return {name: np.array([row[name] for row in rows], np.float32) for name in rows[0]}

    def apply(self, simulation: Simulation, env_ids: Sequence[int]) -> None:
        """Let worlds differ by what was drawn; their reset has begun."""
        simulation.vary({env: self._variation(env) for env in env_ids})

    def _variation(self, env: int) -> Variation:
        return Variation(mass=self._values(env, "mass"))

    def _values(self, env: int, axis: str) -> dict[Any, Any]:
        """Return what was drawn for each single thing."""
        named = self._targets.get(axis, {})
        drawn = self._drawn[env].get(axis, {})
        return {thing: drawn[name] for name, target in named.items() for thing in target.means}


def _draw(takes: Any, stream: Stream, *names: str) -> Any:
    if isinstance(takes, Group):
        fields = takes.declared.items()
        return {name: _draw(drawn, stream, *names, name) for name, drawn in fields}
    return takes.value(stream.number(*names))


def _leaves(name: str, tree: Any) -> Iterator[tuple[str, float]]:
    if isinstance(tree, Mapping):
        for key, part in tree.items():
            yield from _leaves(f"{name}/{key}", part)
    else:
        yield name, tree
