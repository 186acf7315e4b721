"""Pages that commands serve, looked at in a browser."""

import io
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from PIL import Image

from benchmarks.teleop import PATIENCE, SOFTWARE_WEBGL, running_browser

SIZE = {"width": 900, "height": 560}
PLAN = 580  # pixels from the left that no panel covers


@contextmanager
def browser_page() -> Iterator[tuple[Any, list[str]]]:
    """Yield an empty page of a browser, and the list of all addresses that it asks for."""
    with running_browser(*SOFTWARE_WEBGL) as browser:
        page = browser.new_page(viewport=SIZE)
        page.set_default_timeout(1000 * PATIENCE)
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.on("websocket", lambda socket: asked.append(socket.url))
        yield page, asked


def wait_until(holds: Callable[[], bool]) -> None:
    """Wait until something holds."""
    deadline = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < deadline, "it never holds"
        time.sleep(0.01)


def picture(page: Any) -> np.ndarray:
    """Return what no panel covers, (560, 580, 3) int."""
    image = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    return np.asarray(image, int)[:, :PLAN]


def settled(page: Any, after: Callable[[np.ndarray], bool] = lambda picture: True) -> np.ndarray:
    """Return the picture once it stands still and is as it should be."""
    deadline = time.monotonic() + PATIENCE
    before = picture(page)
    while time.monotonic() < deadline:
        page.wait_for_timeout(400)
        now = picture(page)
        if changed(before, now) < 20 and after(now):
            return now
        before = now
    raise AssertionError("the page does not come to rest as it should")


def changed(one: np.ndarray, other: np.ndarray) -> int:
    """Return how many pixels differ visibly."""
    return int((np.abs(one - other).max(axis=-1) > 24).sum())


def coloured(picture: np.ndarray, rgb: tuple[int, int, int], tolerance: int = 45) -> int:
    """Return how many pixels have nearly a colour."""
    return int((np.abs(picture - np.array(rgb)).max(axis=-1) < tolerance).sum())
