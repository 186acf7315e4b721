"""Which environments of a vector each worker holds, and which of these are stepped together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots import TaskError


class Sharing:
    """How the environments of a vector are shared among its workers.

    Every worker holds some consecutive ones, in parts no larger than what `recv` returns. A worker
    with several parts goes on with the next one while the results of the last are looked at. Parts
    are as large as that allows: what a step costs beside its physics, most of it once per part.

    Attributes:
        shares: For each worker, the environments of each of its parts.
    """

    def __init__(self, num_envs: int, num_workers: int, batch_size: int) -> None:
        """Share the environments.

        Args:
            num_envs: How many there are.
            num_workers: Worker processes; 0 is this process.
            batch_size: How many environments are received at once.
        """
        count = max(num_workers, 1)
        bounds = [(i * num_envs) // count for i in range(count + 1)]
        self.shares = [
            [range(i, min(i + batch_size, stop)) for i in range(start, stop, batch_size)]
            for start, stop in zip(bounds, bounds[1:], strict=False)
        ]
        self._num_envs = num_envs
        self._parts = [ids for share in self.shares for ids in share]

    def checked(self, env_ids: Any) -> NDArray[np.intp]:
        """Return numbers of environments as an array.

        Raises:
            TaskError: If they are none, one is none, or named twice.
        """
        ids = np.asarray(env_ids)
        if ids.ndim != 1 or ids.dtype.kind not in "iu" or not len(ids):
            raise TaskError(
                f"env_ids must be a list of integers, at least one, not {env_ids!r}; recv() tells"
                " them in info['env_id']"
            )
        if ids.min() < 0 or ids.max() >= self._num_envs:
            wrong = ids[(ids < 0) | (ids >= self._num_envs)].tolist()
            raise TaskError(f"env_ids {wrong} must lie from 0 to {self._num_envs - 1}")
        if np.count_nonzero(self._among(ids)) < len(ids):
            raise TaskError(f"env_ids names environments more than once: {ids.tolist()}")
        return ids.astype(np.intp, copy=False)

    def by_part(self, env_ids: NDArray[np.intp]) -> Iterator[tuple[int, Sequence[int]]]:
        """Yield the parts that environments are in, by number, and which of them are in each."""
        chosen = self._among(env_ids)
        for number, ids in enumerate(self._parts):
            own = chosen[ids.start : ids.stop].nonzero()[0]
            if len(own):
                yield number, (own + ids.start).tolist()

    def _among(self, env_ids: NDArray[np.intp]) -> NDArray[np.bool_]:
        chosen = np.zeros(self._num_envs, bool)
        chosen[env_ids] = True
        return chosen
