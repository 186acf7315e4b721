"""Kills a process in its own thread, so to speak: at a change of the disk that a test chooses."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import pytest


class Killed(BaseException):
    """Raised where the process would have died; nothing of the product catches it."""


class Kill:
    """Lets so many calls of some functions pass, and raises `Killed` at the next one.

    Attributes:
        remaining: How many more calls pass; below 0 once it has struck.
    """

    def __init__(self, after: int) -> None:
        """Let ``after`` calls pass."""
        self.remaining = after

    def watch(self, patch: pytest.MonkeyPatch, calls: Iterable[tuple[Any, str]]) -> None:
        """Count calls of functions, each given by who owns it and its name."""
        for owner, name in calls:
            patch.setattr(owner, name, self._counted(getattr(owner, name)))

    def _counted(self, call: Callable[..., Any]) -> Callable[..., Any]:
        def replacement(*arguments: Any, **keywords: Any) -> Any:
            self.remaining -= 1
            if self.remaining < 0:
                raise Killed
            return call(*arguments, **keywords)

        return replacement
