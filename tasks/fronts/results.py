"""What the arrays of a vector say of environments, as Gymnasium's vectors return it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tasks.engine.arguments import SUCCESS
from tasks.fronts.batch import FINAL, INFO, OBSERVATION
from tasks.fronts.workers import InProcess, Workers

_Flags = NDArray[np.bool_]
Rows = slice | NDArray[np.intp]
"""Numbers of environments, in ascending order."""

ALL = slice(None)


class Results:
    """Reads the arrays; all that it returns is copied."""

    def __init__(self, holder: InProcess | Workers, num_envs: int) -> None:
        """Take who has the arrays, and how many environments they are of."""
        self._holder = holder
        self._everywhere = np.ones(num_envs, bool)
        self._names: dict[str, list[tuple[str, str]]] = {}

    def step(
        self, ids: Rows = ALL
    ) -> tuple[Any, NDArray[np.float32], _Flags, _Flags, dict[str, Any]]:
        """Return what a step has given for some environments."""
        arrays = self._holder.arrays
        info = self.info(self._everywhere[ids], ids)
        restarted = arrays.get("restarted")
        if restarted is not None and restarted[ids].any():
            info.update(self._final(restarted[ids].copy(), ids))
        flags = (arrays[name][ids].copy() for name in ("reward", "terminated", "truncated"))
        return self.observation(ids), *flags, info

    def observation(self, ids: Rows = ALL, prefix: str = "") -> Any:
        """Return what is observed of some environments, or of those that ended (`FINAL`)."""
        arrays = self._holder.arrays
        if prefix + OBSERVATION in arrays:
            return arrays[prefix + OBSERVATION][ids].copy()
        tree: dict[str, Any] = {}
        for name, array in arrays.items():
            first, *way = name.split("/")
            if first == prefix + OBSERVATION:
                branch = tree
                for key in way[:-1]:
                    branch = branch.setdefault(key, {})
                branch[way[-1]] = array[ids].copy()
        return tree or np.empty((len(self._everywhere[ids]), 0), np.float32)

    def info(self, mask: _Flags, ids: Rows = ALL, prefix: str = INFO) -> dict[str, Any]:
        """Return the info of some environments, as Gymnasium's own vectors return it.

        Args:
            mask: Which of these environments it is about.
            ids: The environments.
            prefix: What the names of the arrays begin with.
        """
        info: dict[str, Any] = {}
        everywhere = mask.all()
        for key, array in self._entries(prefix):
            info[key] = array[ids].copy()
            if not everywhere:
                info[key][~mask] = 0
            info[f"_{key}"] = mask.copy()
        return info

    def _entries(self, prefix: str) -> list[tuple[str, NDArray[Any]]]:
        """Return the arrays whose names begin with a prefix, and what info calls them."""
        if prefix not in self._names:
            found = [
                (called, name)
                for name in self._holder.arrays
                for first, _, key in [name.partition("/")]
                if first == prefix
                for called in ((key, SUCCESS) if key == "success" else (key,))
            ]
            self._names[prefix] = found
        arrays = self._holder.arrays
        return [(called, arrays[name]) for called, name in self._names[prefix]]

    def _final(self, ended: _Flags, ids: Rows) -> dict[str, Any]:
        observations = np.full(len(ended), None, object)
        batch = self.observation(ids, FINAL)
        for i in np.flatnonzero(ended).tolist():
            observations[i] = _row(batch, i)
        return {
            "final_obs": observations,
            "_final_obs": ended,
            "final_info": self.info(ended, ids, FINAL + INFO),
            "_final_info": ended.copy(),
        }


def _row(batch: Any, env: int) -> Any:
    if isinstance(batch, Mapping):
        return {key: _row(part, env) for key, part in batch.items()}
    return batch[env]
