"""Hands on the page of ``teleop``: they drag gizmos by the mouse, press keys, and read."""

import re

import numpy as np

from benchmarks.teleop import Gizmos
from robot_layouts.kinematics.rotations import multiply, quaternion_about, rotate

STROKE = 0.01  # m, of a key
TURN = np.radians(5)  # of a key
KEYS = {0: "ik", 1: "jl", 2: "uo"}  # by axis: forward, backward


class Hands(Gizmos):
    """Mouse and keyboard on a page that shows a session."""

    def press(self, keys: str, times: int = 1) -> None:
        for _ in range(times):
            self.page.keyboard.press(keys)
            self.page.wait_for_timeout(60)

    def wait_for(self, text: str) -> None:
        self.page.get_by_text(text).first.wait_for()

    def arrive(self) -> None:
        """Wait until all arms are where they are to go, nearly."""

        def there() -> bool:
            self.wait(0.3)
            return all(away <= 4 for _, away in self.targets().values())

        self.wait_until(there, "arms that arrive")

    def bring(self, arm: str, place: np.ndarray) -> None:
        """Drag an arm to a place along the axes of its gizmo, and then by keys, (3,) (m)."""
        local = rotate(self.turns[arm] * [1, -1, -1, -1], place - self.target(arm))
        for axis in np.argsort(-abs(local)):
            if abs(local[axis]) > 2 * STROKE:
                self.drag(arm, int(axis), local[axis])
        self.press(str(self.arms.index(arm) + 1))
        for axis, away in enumerate(place - self.target(arm)):
            self.press(KEYS[axis][int(away < 0)], round(abs(away) / STROKE))
        self.arrive()

    def turn(self, arm: str, angle: float) -> None:
        """Turn an arm about the vertical by keys (rad)."""
        count = round(angle / TURN)
        self.press(str(self.arms.index(arm) + 1))
        self.press("Shift+U" if count > 0 else "Shift+O", abs(count))
        turned = quaternion_about((0.0, 0.0, 1.0), np.array(count * TURN))
        self.turns[arm] = multiply(turned, self.turns[arm])
        self.arrive()

    def keep(self) -> None:
        """Wait until the task is solved; stop, and keep the episode."""
        self.page.get_by_text(re.compile(r"running, step \d+ \(\S+ s\), solved")).wait_for()
        self.press("p")
        self.wait_for("stopped, step")
        self.press("m")
        self.wait_for("Kept: seed")


def yaw_between(hand: np.ndarray, body: np.ndarray) -> float:
    """Return the least turn about the vertical after which a gripper holds a cube by its faces.

    Args:
        hand: Quaternion (wxyz) of a gripper that points down.
        body: That of a cube on the table.
    """
    opens, face = (np.arctan2(*rotate(q, (0, 1.0, 0))[1::-1]) for q in (hand, body))
    return float((face - opens + np.pi / 4) % (np.pi / 2) - np.pi / 4)
