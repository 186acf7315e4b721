"""What an executor reports of the episodes that it plays, and how it fails."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from tasks.processes.process import WorkerError

__all__ = ["Event", "Play", "WorkerError", "WorkersDied"]

Play = Callable[[int], Any]
"""Plays the episode of a seed and returns what is to be known of it (it can be pickled)."""


class WorkersDied(WorkerError):
    """Workers that died at one episode, as often as is allowed."""


@dataclass(frozen=True)
class Event:
    """What happened to the episode of a seed.

    Attributes:
        seed: Its seed; None if it is about a worker that was not playing yet, or about none.
        result: What was returned when it was played to the end, else None.
        error: Why it could not be played, else None; `WorkersDied` if workers died of it.
        died: How its worker died, in words, else None; the episode will be played again.
        machine_lost: Whether its machine is out of reach; such a death is not counted.
        note: What came meanwhile: from `report` if there is a seed, else from the executor, in
            words.
        worker: Who played it, in words.
    """

    seed: int | None
    result: Any = None
    error: Exception | None = None
    died: str | None = None
    machine_lost: bool = False
    note: Any = None
    worker: str = ""

    @property
    def death(self) -> str:
        """How its worker died, and what that was doing, in words."""
        if self.seed is None:
            return f"{self.died} before it could play anything"
        return f"{self.died} at seed {self.seed}"

    @property
    def news(self) -> str | None:
        """What is to be told of workers, in words; None if nothing."""
        if self.died is not None:
            return f"{self.death}; another takes its place"
        return None if self.seed is not None else self.note
