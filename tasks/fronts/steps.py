"""Steps of a vector's environments that were begun and whose results nobody has taken yet."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Generic, Protocol, TypeVar


class Begun(Protocol):
    """A step that was begun."""

    @property
    def done(self) -> bool:
        """Whether its results are there."""
        ...


AnyStep = TypeVar("AnyStep", bound=Begun)


class Steps(Generic[AnyStep]):
    """Such steps, in the order in which they were begun; each is one of some environments."""

    def __init__(self) -> None:
        """Begin without any."""
        self._begun: list[tuple[AnyStep, list[int]]] = []

    def add(self, env_ids: Sequence[int], begin: Callable[[], AnyStep]) -> None:
        """Begin a step of environments, and keep it."""
        self._begun.append((begin(), list(env_ids)))

    def __iter__(self) -> Iterator[AnyStep]:
        """Go through the steps."""
        return iter([step for step, _ in self._begun])

    @property
    def away(self) -> list[int]:
        """The environments whose results nobody has taken."""
        return [i for _, env_ids in self._begun for i in env_ids]

    @property
    def ready(self) -> int:
        """How many of them can be taken now."""
        return sum(len(env_ids) for step, env_ids in self._begun if step.done)

    def take(self, count: int) -> list[int]:
        """Return so many environments that are ready, those begun first, in ascending order."""
        taken: list[int] = []
        left: list[tuple[AnyStep, list[int]]] = []
        for step, env_ids in self._begun:
            room = count - len(taken) if step.done else 0
            taken += env_ids[:room]
            if env_ids[room:]:
                left.append((step, env_ids[room:]))
        self._begun = left  # at once: an interrupt before leaves all where it was
        return sorted(taken)

    def forget(self, env_ids: Iterable[int]) -> None:
        """Let nobody wait for some environments any more."""
        gone = set(env_ids)
        left = [(step, [i for i in own if i not in gone]) for step, own in self._begun]
        self._begun = [(step, own) for step, own in left if own]
