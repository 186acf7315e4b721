"""What is told of workers of a vector that died, hung or failed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from tasks.processes import process as processes
from tasks.processes.process import WorkerTraceback


@dataclass(frozen=True)
class Failure:
    """A worker that is gone.

    Attributes:
        worker: Its number.
        env_ids: The environments that are gone with it.
        reason: What happened to it, in words.
        traceback: Where an error came up in it; empty if there was none.
    """

    worker: int
    env_ids: range
    reason: str
    traceback: str = ""


class WorkerError(processes.WorkerError):
    """Workers of a vector that died, hung or failed; the others have done what they were asked.

    If tasks raised something in them, the ``__cause__`` says where.

    Attributes:
        failures: The workers that are gone.
        env_ids: The numbers of the environments that are gone with them.
        seeds: The last seed that each of them was given.
        results: What the call would have returned; the rows of ``env_ids`` mean nothing. None
            if there was nothing to return.
    """

    def __init__(
        self,
        message: str,
        failures: Iterable[Failure] = (),
        seeds: Iterable[int] = (),
        results: Any = None,
    ) -> None:
        """Take what is known of the failure."""
        super().__init__(message)
        self.failures = tuple(failures)
        self.env_ids = [i for failure in self.failures for i in failure.env_ids]
        self.seeds = list(seeds)
        self.results = results


class WorkersFailed(Exception):
    """Some workers failed; says which. The vector turns it into a `WorkerError`."""

    def __init__(self, failures: list[Failure]) -> None:
        """Take the failures, at least one."""
        super().__init__(failures)
        self.failures = failures

    @property
    def where(self) -> WorkerTraceback | None:
        """Where the errors came up; None if there were none."""
        texts = dict.fromkeys(failure.traceback for failure in self.failures if failure.traceback)
        return WorkerTraceback("\n\n".join(texts)) if texts else None
