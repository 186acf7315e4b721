"""The declaration of what varies from episode to episode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from robots import TaskError, UnknownNameError
from robots.common.bounds import shown
from tasks.varying.axes import AXES
from tasks.varying.distributions import Distribution


def _by_name() -> Any:
    return field(default_factory=dict[str, Any])


@dataclass(frozen=True, kw_only=True)
class Randomization:
    """What varies from episode to episode, and from which distributions it is drawn.

    It is drawn at every reset from the episode's seed, in streams of its own: the task's draws stay
    what they are. Things go by name; in a name ``*`` stands for any letters, and of several names
    that mean the same thing the last one counts. Each thing that a name with ``*`` means gets a
    draw of its own.

    Attributes:
        mass: Factor on the mass and the inertia of a body (``"cube"``), of all links of a robot
            alike (``"left"``), or of one link (``"left.panda_hand"``).
    """

    mass: Mapping[str, Distribution] = _by_name()

    def __post_init__(self) -> None:
        """Refuse what makes no sense.

        Raises:
            TaskError: If something is no distribution, or may draw what cannot be.
        """
        for name, axis in AXES.items():
            object.__setattr__(self, name, axis.read(getattr(self, name), name))

    def __bool__(self) -> bool:
        """Tell whether anything varies."""
        return bool(self.declared)

    @property
    def declared(self) -> dict[str, Any]:
        """What is declared of each axis that varies, by axis."""
        given = {name: getattr(self, name) for name in AXES}
        return {name: value for name, value in given.items() if value}

    def to_json(self) -> dict[str, Any]:
        """Return it as plain data for a file; `from_json` returns an equal one."""
        return {
            name: {key: drawn.to_json() for key, drawn in value.items()}
            if AXES[name].named
            else value.to_json()
            for name, value in self.declared.items()
        }

    @classmethod
    def from_json(cls, data: Any) -> Randomization:
        """Return what plain data describes.

        Args:
            data: By axis, such as ``{"mass": {"cube": {"uniform": [0.5, 2.0]}}}``.

        Raises:
            TaskError: If it makes no sense.
            UnknownNameError: If there is no such axis.
        """
        if not isinstance(data, Mapping):
            raise TaskError(f"a randomization is given by axis, a mapping; given: {shown(data)}")
        for name in data:
            if name not in AXES:
                raise UnknownNameError("axis of a randomization", name, AXES)
        return cls(**data)

    def __str__(self) -> str:
        """Show a line for each thing that varies."""
        lines: list[str] = []
        for name, value in self.declared.items():
            named = value.items() if AXES[name].named else [("", value)]
            lines += [f"{' '.join(filter(None, (name, key)))}: {drawn}" for key, drawn in named]
        return "\n".join(lines) or "nothing varies"


assert {field.name for field in fields(Randomization)} == AXES.keys()
