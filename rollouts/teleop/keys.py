"""Which keys move an arm, and where to; those that move viser's camera are left alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kinematics.rotations import Floats


@dataclass(frozen=True)
class Jog:
    """What a key does to where a TCP is to be, in the world.

    Attributes:
        label: The same in words.
        axis: Along which it moves, or about which it turns, of length 1.
        shift: Whether it is pressed together with shift, and turns.
    """

    label: str
    axis: tuple[float, float, float]
    shift: bool = False

    def scaled(self, metres: float, angle: float) -> tuple[Floats | None, Floats | None]:
        """Return way (m) and turn (rad) of one stroke, each (3,) or None.

        Args:
            metres: Length of a way (m).
            angle: Size of a turn (rad).
        """
        axis = np.array(self.axis)
        return (None, axis * angle) if self.shift else (axis * metres, None)


_AXES: Mapping[str, tuple[str, tuple[float, float, float]]] = {
    "I": ("+x", (1.0, 0.0, 0.0)),
    "K": ("-x", (-1.0, 0.0, 0.0)),
    "J": ("+y", (0.0, 1.0, 0.0)),
    "L": ("-y", (0.0, -1.0, 0.0)),
    "U": ("+z", (0.0, 0.0, 1.0)),
    "O": ("-z", (0.0, 0.0, -1.0)),
}
KEYS: Mapping[str, Jog] = {
    **{key: Jog(f"Move {name}", axis) for key, (name, axis) in _AXES.items()},
    **{
        f"shift+{key}": Jog(f"Turn about {name}", axis, shift=True)
        for key, (name, axis) in _AXES.items()
    },
}
KEYS_TEXT = """\
I K: along x, J L: along y, U O: up and down, with shift: turn about that axis of the world.
G: open or close the gripper. 1 to 9: take that arm; the keys move the one you took last.
P: start or stop. Z: back. M: keep. X: discard. N: next seed."""
