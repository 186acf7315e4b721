"""Names of what a world is made of."""

from __future__ import annotations

from typing import NamedTuple


class Part(NamedTuple):
    """A link of a robot, or a body of its own.

    Attributes:
        robot: The robot's name in the layout, or None.
        name: Name of the link or the body.
    """

    robot: str | None
    name: str

    def __str__(self) -> str:
        """Return ``robot.link``, or the body's name."""
        return self.name if self.robot is None else f"{self.robot}.{self.name}"
