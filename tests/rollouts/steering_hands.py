"""Hands on the page of ``teleop``: they drag gizmos by the mouse and press keys, and read."""

import re
from typing import Any

import numpy as np

from kinematics.rotations import multiply, quaternion_about, rotate
from rollouts.teleop.page import GIZMO_SIZE
from rollouts.teleop.picture import FIELD_OF_VIEW, viewpoint
from rollouts.teleop.session import Session
from rollouts.teleop.stopwatch import HTML_ID, QUICK
from tests.pages import wait_until

ARROW = 0.85 * GIZMO_SIZE  # where to press, from the middle of a gizmo (m)
STROKE = 0.01  # m, of a key
TURN = np.radians(5)  # of a key
KEYS = {0: "ik", 1: "jl", 2: "uo"}  # by axis: forward, backward
PLACE = re.compile(r"to \((\S+), (\S+), (\S+)\) m, (\d+) mm to go")


class Hands:
    """Mouse and keyboard on a page that shows a session.

    Attributes:
        page: The page.
    """

    def __init__(self, page: Any, address: str, model: Session) -> None:
        """Open the page.

        Args:
            page: An empty page of a browser.
            address: Of the page.
            model: A session that stands as the one on the page does; says where arms begin.
        """
        self.page, self._arms = page, model.arms
        self.camera, self._aim = viewpoint(model)
        self.turns = {arm: pose[3:] for arm, pose in model.targets.items()}
        page.goto(address)
        page.get_by_label(QUICK).wait_for(state="attached")
        wait_until(lambda: (page.wait_for_timeout(100), page.get_by_label(QUICK).is_checked())[1])
        page.evaluate(
            "() => new Promise((done) => { let n = 0; const f = () =>"
            " ++n > 30 ? done() : requestAnimationFrame(f); f(); })"
        )
        page.get_by_role("alert").get_by_role("button").click()  # that there is no graphics card
        box = page.locator("canvas").first.bounding_box()
        self._size = np.array([box["width"], box["height"]])

    def press(self, keys: str, times: int = 1) -> None:
        for _ in range(times):
            self.page.keyboard.press(keys)
            self.page.wait_for_timeout(60)

    def wait(self, seconds: float) -> None:
        self.page.wait_for_timeout(1000 * seconds)

    def read(self) -> str:
        return self.page.inner_text("body")

    def measured(self) -> str:
        """Return what the page says of the time from drag to picture."""
        return self.page.locator(f"#{HTML_ID}").inner_text()

    def wait_for(self, text: str) -> None:
        self.page.get_by_text(text).first.wait_for()

    def target(self, arm: str) -> np.ndarray:
        """Return where the page says that an arm is to go, once that stands still."""
        before = None
        while True:
            found = PLACE.findall(self.read())[self._arms.index(arm)]
            if found[:3] == before:
                return np.array(found[:3], float)
            before = found[:3]
            self.wait(0.7)

    def arrive(self) -> None:
        """Wait until all arms are where they are to go, nearly."""

        def there() -> bool:
            self.wait(0.3)
            return all(int(row[3]) <= 4 for row in PLACE.findall(self.read()))

        wait_until(there)

    def project(self, point: np.ndarray) -> np.ndarray:
        """Return where a point of the world is on the page (pixels)."""
        ahead = self._aim - self.camera
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, [0, 0, 1])
        right /= np.linalg.norm(right)
        way = point - self.camera
        seen = np.array([way @ right, -way @ np.cross(right, ahead)]) / (way @ ahead)
        return self._size / 2 + seen * self._size[1] / 2 / np.tan(FIELD_OF_VIEW / 2)

    def drag(self, arm: str, axis: int, way: float, moves: int = 12) -> None:
        """Drag an arrow of the gizmo of an arm.

        Args:
            arm: Its name.
            axis: Of the gizmo: 0, 1 or 2.
            way: How far (m).
            moves: In how many moves of the mouse.
        """
        along = rotate(self.turns[arm], np.eye(3)[axis])
        grip = self.target(arm) + ARROW * along
        mouse = self.page.mouse
        mouse.move(*self.project(grip))
        self.wait(0.3)
        mouse.down()
        for share in np.linspace(0, 1, moves + 1)[1:]:
            mouse.move(*self.project(grip + share * way * along))
            self.wait(0.06)
        self.wait(0.3)
        mouse.up()

    def bring(self, arm: str, place: np.ndarray) -> None:
        """Drag an arm to a place along the axes of its gizmo, and then by keys, (3,) (m)."""
        local = rotate(self.turns[arm] * [1, -1, -1, -1], place - self.target(arm))
        for axis in np.argsort(-abs(local)):
            if abs(local[axis]) > 2 * STROKE:
                self.drag(arm, int(axis), local[axis])
        self.press(str(self._arms.index(arm) + 1))
        for axis, away in enumerate(place - self.target(arm)):
            self.press(KEYS[axis][int(away < 0)], round(abs(away) / STROKE))
        self.arrive()

    def turn(self, arm: str, angle: float) -> None:
        """Turn an arm about the vertical by keys (rad)."""
        count = round(angle / TURN)
        self.press(str(self._arms.index(arm) + 1))
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
