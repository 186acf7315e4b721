"""Gizmos on the page of ``teleop``, dragged by the mouse of a browser."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from kinematics.rotations import Floats, rotate
from layouts.viewer.server import ViewerError
from measurements.browser import PATIENCE
from rollouts.teleop.page import GIZMO_SIZE
from rollouts.teleop.picture import FIELD_OF_VIEW, viewpoint
from rollouts.teleop.session import Session
from rollouts.teleop.stopwatch import HTML_ID, QUICK

ARROW = 0.85 * GIZMO_SIZE  # where to press, from the middle of a gizmo (m)
PLACE = re.compile(r"target \((\S+), (\S+), (\S+)\) m, (\d+) mm away")
CLOCK = re.compile(r"Real time\.|Time runs at .* no step is left out\.")
_MEASURED = "(id) => [document.getElementById(id).innerText, window.dragsSeen]"
_THIRTY_FRAMES = (
    "() => new Promise((done) => { let n = 0; const f = () =>"
    " ++n > 30 ? done() : requestAnimationFrame(f); f(); })"
)


class Gizmos:
    """The gizmos on a page that shows a session.

    Attributes:
        page: The page.
        arms: Names of the arms that can be steered.
        turns: How each gizmo is turned, quaternion (wxyz), by arm.
    """

    def __init__(self, page: Any, address: str, model: Session) -> None:
        """Open the page, and wait until it draws.

        Args:
            page: An empty page of a browser without a graphics card.
            address: Of the page.
            model: A session that stands as the one on the page does; says where arms begin.

        Raises:
            ViewerError: If it never draws the quick picture.
        """
        self.page, self.arms = page, model.arms
        self.turns = {arm: pose[3:] for arm, pose in model.targets.items()}
        self._camera, self._aim = viewpoint(model)
        page.goto(address)
        page.get_by_label(QUICK).wait_for(state="attached")
        self.wait_until(lambda: page.get_by_label(QUICK).is_checked(), "quick picture")
        page.evaluate(_THIRTY_FRAMES)
        page.get_by_role("alert").get_by_role("button").click()  # that there is no graphics card
        box = page.locator("canvas").first.bounding_box()
        self._size = np.array([box["width"], box["height"]])

    def wait(self, seconds: float) -> None:
        """Let the page go on for a while (s)."""
        self.page.wait_for_timeout(1000 * seconds)

    def wait_until(self, holds: Callable[[], bool], what: str) -> None:
        """Wait until something holds.

        Args:
            holds: Tells whether it does.
            what: It is, in words.

        Raises:
            ViewerError: If it does not for two minutes.
        """
        deadline = time.monotonic() + PATIENCE
        while not holds():
            if time.monotonic() > deadline:
                raise ViewerError(f"the page shows no {what} within {PATIENCE:.0f} s")
            self.wait(0.1)

    def measured(self) -> tuple[str, tuple[float, ...]]:
        """Return what the page says of its times from drag to picture, and these times (ms)."""
        return tuple(self.page.evaluate(_MEASURED, HTML_ID))

    def clock(self) -> str:
        """Return what the page says of real time."""
        return CLOCK.findall(self.page.inner_text("body"))[0]

    def targets(self) -> dict[str, tuple[Floats, int]]:
        """Return where the page says that arms are to go, (3,) (m), and how far it is (mm)."""
        found = PLACE.findall(self.page.inner_text("body"))
        return {
            arm: (np.array(row[:3], float), int(row[3]))
            for arm, row in zip(self.arms, found, strict=True)
        }

    def target(self, arm: str) -> Floats:
        """Return where the page says that an arm is to go, once that stands still, (3,) (m)."""
        before, now = None, self.targets()[arm][0]
        while before is None or not np.array_equal(before, now):
            self.wait(0.7)
            before, now = now, self.targets()[arm][0]
        return now

    def project(self, point: Floats) -> Floats:
        """Return where a point of the world, (3,) (m), is on the page, (2,) (pixels)."""
        ahead = self._aim - self._camera
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, [0, 0, 1])
        right /= np.linalg.norm(right)
        way = point - self._camera
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
