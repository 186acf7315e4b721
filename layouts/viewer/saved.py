"""A page as one file that needs no server."""

from __future__ import annotations

import html
import os
from pathlib import Path
from typing import Any

import numpy as np

from layouts.viewer.cell import Cell
from layouts.viewer.guard import policy
from layouts.viewer.page import contacts_text
from layouts.viewer.scene import Scene
from layouts.viewer.server import ViewerError, serving
from layouts.viewer.text import as_html
from robot_layouts.core.commands import LOOPBACK
from robot_layouts.core.writing import write_whole

NO_SLIDERS = "A saved page has no sliders for joints; without --html, view serves one that has."
NOTE_STYLE = (  # above the bar that plays a motion
    "position: fixed; left: 0.75rem; bottom: 4.5rem; z-index: 1000; max-width: 24rem;"
    " padding: 0.5rem 0.75rem; border-radius: 0.25rem; background: #fffd; color: #222;"
    " box-shadow: 0 0 4px #0004; font: 0.8rem/1.4 sans-serif; overflow-wrap: anywhere"
)


def save_html(cell: Cell, path: str | os.PathLike[str]) -> Path:
    """Save a page as one file that needs no server and fetches nothing.

    It has no sliders for joints, and says so: robots stand as they start, or play the motion. What
    is shown can be chosen in its scene tree.

    Args:
        cell: What to show.
        path: Where to save; must end in ``.html``.

    Raises:
        MissingPackageError: If viser is not installed.
        ViewerError: If the path ends otherwise, nothing can be written there, or the page of this
            version of viser is of another make.
    """
    target = Path(path)
    if target.suffix.lower() not in (".html", ".htm"):
        raise ViewerError(f"cannot save a page as {target.name!r}; the name must end in .html")
    with serving(LOOPBACK, 0, cell.title) as (server, _):
        page = _recorded(server, cell).as_html()
    page = _with(page, "<title>Viser</title>", f"<title>{html.escape(cell.title)}</title>")
    page = _with(page, "<head>", f"<head>\n{_policy()}")
    page = _with(page, '<div id="root"></div>', f'<div id="root"></div>\n{_note(cell)}')
    write_whole(target, page, ViewerError)
    return target


def _recorded(server: Any, cell: Cell) -> Any:
    """Draw a cell, and return viser's recording of it."""
    server.scene.set_up_direction("+z")
    scene = Scene(server.scene, cell)
    scene.aim(server.initial_camera)
    scene.mark(cell.contacts(cell.start))
    recording = server.get_scene_serializer()
    if (motion := cell.motion) is not None:
        for moment in range(len(motion)):
            qpos = {name: np.asarray(rows[moment]) for name, rows in motion.qpos.items()}
            for name, positions in qpos.items():
                scene.pose(name, positions)
            for name, rows in motion.poses.items():
                scene.place(name, rows[moment])
            scene.mark(cell.contacts(qpos))
            recording.insert_sleep(motion.step_seconds)
    return recording


def _policy() -> str:
    return f'<meta http-equiv="Content-Security-Policy" content="{html.escape(policy())}">'


def _note(cell: Cell) -> str:
    """Return what the panel of a served page says, as far as it holds without sliders."""
    start = "Where the robots start:\n" + contacts_text(cell.contacts(cell.start))
    paragraphs = "".join(f"<p>{as_html(text)}</p>" for text in (*cell.notes, start, NO_SLIDERS))
    return (
        f'<details open style="{NOTE_STYLE}"><summary><b>{as_html(cell.title)}</b></summary>'
        f"{paragraphs}</details>"
    )


def _with(page: str, old: str, new: str) -> str:
    """Put something in the place of a part of viser's page.

    Raises:
        ViewerError: If the page does not have that part once.
    """
    if page.count(old) != 1:
        raise ViewerError(f"a page of this version of viser has {old} {page.count(old)} times")
    return page.replace(old, new)
