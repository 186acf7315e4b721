"""The page that faults of pages are tried on, and whether it still works."""

from __future__ import annotations

import atexit
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import quote

_UNTIL_THE_END = ExitStack()
atexit.register(_UNTIL_THE_END.close)


@cache
def cell() -> Any:
    """Return a cell with a robot called ``arm`` and a motion."""
    import numpy as np

    from layouts.viewer import ShownCell, ShownMotion
    from tests.layouts.guests import small_cell

    bare = small_cell(Path(_UNTIL_THE_END.enter_context(TemporaryDirectory())))
    start = np.tile(bare.start["arm"], (3, 1))
    return ShownCell("cell", bare.layout, motion=ShownMotion(0.05, {"arm": start}))


@cache
def served() -> Any:
    """Serve it until this process ends."""
    from tests.layouts.guests import site

    return _UNTIL_THE_END.enter_context(site(cell()))


def still_served() -> None:
    """Look that the page is given to whoever has its address."""
    from tests.layouts.guests import ask

    running = served()
    own = f"127.0.0.1:{running.port}"
    stream = quote(f"ws://{own}/?token={running.token}", safe="")
    path = f"/?token={running.token}&websocket={stream}"
    status, answer = ask(running.port, {"Host": own}, path)
    assert status == 200
    assert b"Viser" in answer


def others_go_on() -> None:
    """Look that one client can steer and another sees it."""
    from tests.layouts.guests import Guest

    with Guest(served().address) as sees, Guest(served().address) as steers:
        steers.enter()
        box = sees.wait_for("GuiCheckboxMessage", label="Frames")["uuid"]
        sees.wait_for("ReplayDoneMessage")
        steer(steers, sees, box)


def steer(steers: Any, sees: Any, box: str) -> None:
    """Let one client uncheck and check a box, and another see both."""
    for value in (False, True):
        replayed = len(sees.received)
        steers.set(box, value)
        while not any(
            m.get("uuid") == box and m.get("updates") == {"value": value}
            for m in sees.received[replayed:]
        ):
            sees.listen()
