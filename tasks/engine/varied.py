"""What a task tells of its worlds that vary; nothing varies unless a randomization says so."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from simulation.maths import Floats
from tasks.language.randomness import EpisodeRandom
from tasks.varying.distributions import Distribution, Normal
from tasks.varying.noise import noise
from tasks.varying.varying import Varying

_NORMAL = Normal(1.0)


class Varied:
    """A part of `tasks.MultiRobotTask`: what was drawn for its environments, besides by itself."""

    layout: Layout
    num_envs: int
    _varying: Varying | None
    _rngs: Sequence[EpisodeRandom]
    _elapsed: NDArray[np.int32]

    def drawn(self, env: int = 0) -> dict[str, Any] | None:
        """Return what was drawn for an environment's episode, by axis and name, as plain data.

        Args:
            env: The number of the environment.

        Returns:
            Such as ``{"mass": {"cube": 1.31}}``; see `tasks.Randomization`. None if nothing varies.
        """
        return None if self._varying is None else self._varying.drawn(env)

    def standing(self, env: int = 0) -> Layout:
        """Return the layout as robots stand in the present episode of an environment.

        It is ``layout``, unless the bases of robots vary. What is planned is planned in this one.
        """
        return self.layout if self._varying is None else self._varying.layout(env)

    def scale(self, body: str) -> Floats:
        """Return the factor by which a body is larger than declared, (N,); 1 if sizes are fixed."""
        if self._varying is None:
            return np.ones(self.num_envs, np.float32)
        return self._varying.scale(body)

    def noise(self, name: str, width: int, drawn: Distribution = _NORMAL) -> Floats:
        """Return noise for `observe`, a function of each episode's seed and step alone.

        Args:
            name: What it is for; another name draws other numbers.
            width: How many numbers each environment gets.
            drawn: What each is drawn from; if not given, of mean 0 and deviation 1.

        Returns:
            Shape (N, width).
        """
        streams = [rng.stream for rng in self._rngs]
        return noise(streams, self._elapsed.tolist(), drawn, width, "observe", name)
