"""Steps worlds in several threads: MuJoCo lets Python's lock go while it steps."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import torch


class Threads:
    """As many threads as torch may use in this process; those of a fork are its own."""

    def __init__(self) -> None:
        """Begin without threads."""
        self._pool: ThreadPoolExecutor | None = None
        self._made_for = (0, 0)

    def run(self, works: Sequence[Callable[[], None]]) -> None:
        """Do all of it, and return when all is done."""
        count = torch.get_num_threads()
        if count < 2 or len(works) < 2:
            for work in works:
                work()
            return
        if self._pool is None or self._made_for != (os.getpid(), count):
            self._pool, self._made_for = ThreadPoolExecutor(count), (os.getpid(), count)
        for _ in self._pool.map(lambda work: work(), works):
            pass
