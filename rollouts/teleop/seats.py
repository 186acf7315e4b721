"""Which browser steers which arm: the one that took it last."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from layouts.viewer.text import Text
from robots import TaskError


class Seats:
    """Who steers which arm, and which one the keys of a browser move."""

    def __init__(self, arms: Sequence[str]) -> None:
        """Leave all arms to whoever comes first."""
        self._holders: dict[str, int | None] = dict.fromkeys(arms)
        self._chosen: dict[int, str] = {}

    def enter(self, client: Any) -> None:
        """Tell a browser which one it is."""
        Text(client.gui, f"This is {_name(client.client_id)}.")

    def leave(self, client: int) -> None:
        """Take the arms of a browser that has gone away from it."""
        self._chosen.pop(client, None)
        for arm, holder in self._holders.items():
            if holder == client:
                self._holders[arm] = None

    def take(self, client: int, arm: str) -> None:
        """Let a browser steer an arm, whoever did before; its keys move this one from now on."""
        self._holders[arm] = client
        self._chosen[client] = arm

    def owns(self, client: int, arm: str) -> bool:
        """Return whether a browser steers an arm."""
        return self._holders[arm] == client

    def arm_of(self, client: int) -> str:
        """Return the arm that the keys of a browser move; if it has none, it gets one that is free.

        Raises:
            TaskError: If others have all of them.
        """
        arm = self._chosen.get(client)
        if arm is not None and self.owns(client, arm):
            return arm
        free = [arm for arm, holder in self._holders.items() if holder in (None, client)]
        if not free:
            raise TaskError("others steer all arms; press the number of one to take it over")
        self.take(client, free[0])
        return free[0]

    def holder(self, arm: str) -> str:
        """Return who steers an arm, in words."""
        holder = self._holders[arm]
        return "not steered" if holder is None else f"steered by {_name(holder)}"


def _name(client: int) -> str:
    return f"browser {client + 1}"
