"""What steers arms on the page: the browser that took an arm, and the keys that move it.

Keys that move viser's camera are left alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robot_layouts.kinematics.rotations import Floats
from robots import TaskError


class ArmControl:
    """Which browser steers which arm, and which arm the keys of a browser move."""

    def __init__(self, arms: Sequence[str]) -> None:
        """Let no browser steer any arm yet."""
        self._browsers: dict[str, int | None] = dict.fromkeys(arms)
        self._chosen: dict[int, str] = {}

    def disconnect(self, browser: int) -> None:
        """Free the arms of a browser that is no longer connected."""
        self._chosen.pop(browser, None)
        freed = {arm: None for arm, own in self._browsers.items() if own == browser}
        self._browsers.update(freed)

    def take(self, browser: int, arm: str) -> None:
        """Let a browser steer an arm, whichever did before; its keys move this one from now on."""
        self._browsers[arm] = browser
        self._chosen[browser] = arm

    def steers(self, browser: int, arm: str) -> bool:
        """Return whether a browser steers an arm."""
        return self._browsers[arm] == browser

    def arm_of(self, browser: int) -> str:
        """Return the arm that the keys of a browser move; if it has none, it takes a free one.

        Raises:
            TaskError: If other browsers have all of them.
        """
        arm = self._chosen.get(browser)
        if arm is not None and self.steers(browser, arm):
            return arm
        free = [arm for arm, own in self._browsers.items() if own in (None, browser)]
        if not free:
            raise TaskError("others steer all arms; press the number of one to take it over")
        self.take(browser, free[0])
        return free[0]

    def status(self, arm: str) -> str:
        """Return which browser steers an arm, in words."""
        browser = self._browsers[arm]
        return "not steered" if browser is None else f"steered by {browser_name(browser)}"


def browser_name(browser: int) -> str:
    """Return what a browser is called on the page."""
    return f"browser {browser + 1}"


@dataclass(frozen=True)
class Jog:
    """What a key does to the target of a TCP, in the world.

    Attributes:
        label: What it is called on the page.
        axis: Along which it moves, or about which it turns, of length 1.
        shift: Whether it is pressed together with shift, and turns.
    """

    label: str
    axis: tuple[float, float, float]
    shift: bool = False

    def scaled(self, metres: float, angle: float) -> tuple[Floats | None, Floats | None]:
        """Return way (m) and turn (rad) of one key press, each (3,) or None.

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
