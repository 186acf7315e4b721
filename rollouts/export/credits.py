"""Who acted in the episodes of a dataset, numbered over all of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollouts.reading.recording import Recording, Trajectory
from rollouts.sources.actors import EXPERT

_FIELDS = ("kind", "name", "sha256")


class Credits:
    """Who acted in a recording.

    Attributes:
        actors: Everybody who acted, each once, as plain data; nobody if no episode says it.
        corrected: Whether all episodes hold what a corrector would have done.
    """

    def __init__(self, file: Recording) -> None:
        """Read who it was in each episode."""
        said = [_acted(source) for source in file.sources] if any(file.sources) else []
        self.actors: list[dict[str, Any]] = []
        for actor in (actor for actors in said for actor in actors):
            if actor not in self.actors:
                self.actors.append(actor)
        self.corrected = file.corrected

    def numbers(self, trajectory: Trajectory) -> NDArray[np.int64] | None:
        """Return which of the actors acted at each step, (T,); None if there are not several.

        A converted recording may not know it for each step: then it is the first of its actors.
        """
        if len(self.actors) < 2:
            return None
        acted = [self.actors.index(actor) for actor in _acted(trajectory.source)]
        if trajectory.actor is None:
            return np.full(len(trajectory.actions), acted[0])
        return np.array(acted)[trajectory.actor]


def _acted(source: Mapping[str, Any] | None) -> list[dict[str, Any]]:
    """Return who acted in an episode; experts say it in the header alone."""
    if source is None:
        return [{"kind": EXPERT}]
    said: list[Mapping[str, Any]] = source.get("actors") or [source.get("corrects") or source]
    return [{name: actor[name] for name in _FIELDS if name in actor} for actor in said]
