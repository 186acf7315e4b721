"""What a task remembers of each environment until its next reset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

from robot_layouts.simulation.maths import Array, copy
from robots import UnknownNameError


class Memory(SimpleNamespace):
    """Arrays by name, (N, …) each, as attributes."""

    def __getattr__(self, name: str) -> Any:
        """Refuse what is not there.

        Raises:
            NotRememberedError: Always.
        """
        if name.startswith("__"):
            raise AttributeError(name)
        raise NotRememberedError("array that remember() returned", name, vars(self))

    def renew(self, fresh: Mapping[str, Array], env_ids: Sequence[int]) -> None:
        """Take the rows of environments that were reset; the others stay.

        Args:
            fresh: Every array, with all rows; those of ``env_ids`` are taken.
            env_ids: Which environments.
        """
        for name, rows in fresh.items():
            if name not in vars(self) or len(env_ids) == len(rows):
                setattr(self, name, copy(rows))
            else:
                kept = copy(getattr(self, name))  # somebody may hold the earlier one
                kept[list(env_ids)] = rows[list(env_ids)]
                setattr(self, name, kept)


class NotRememberedError(UnknownNameError, AttributeError):
    """An array that the task does not remember (also an ``AttributeError``)."""
