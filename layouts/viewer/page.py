"""A page with a panel of sliders, served; or one without, saved as a file that needs no server."""

from __future__ import annotations

import html
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from threading import Event, RLock
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from layouts.viewer.cell import LinkContact, ShownCell, ShownMotion, Text, as_html, printable
from layouts.viewer.guard import is_loopback, policy
from layouts.viewer.scene import OVERLAYS, CellScene
from layouts.viewer.server import ViewerError, serving
from robot_layouts.core.commands import LOOPBACK
from robot_layouts.core.writing import write_whole
from robot_layouts.kinematics.rotations import Floats
from robots import JointGroup

PAUSE = 0.02  # s between looks at what has changed
SPEEDS = ("0.1 ×", "0.25 ×", "0.5 ×", "1 ×", "2 ×", "4 ×")
SPOKEN = 6  # contacts that the panel names
UNBOUNDED = 2 * np.pi  # rad or m; the range of a slider where a joint has no limits
LABELS = {
    "meshes": "Meshes",
    "frames": "Frames",
    "reach": "Reach, circle",
    "reach sphere": "Reach, sphere",
    "collision": "Collision shapes",
}

NO_SLIDERS = "A saved page has no sliders for joints; one that is served has."
NOTE_STYLE = (  # above the bar that plays a motion
    "position: fixed; left: 0.75rem; bottom: 4.5rem; z-index: 1000; max-width: 24rem;"
    " padding: 0.5rem 0.75rem; border-radius: 0.25rem; background: #fffd; color: #222;"
    " box-shadow: 0 0 4px #0004; font: 0.8rem/1.4 sans-serif; overflow-wrap: anywhere"
)


@dataclass(frozen=True, eq=False)
class _SliderJoints:
    """Joints that one slider moves.

    Attributes:
        joints: Their places among the descriptor's joints, (n,).
        followers: Multiplier and offset of each, (n, 2).
    """

    joints: NDArray[np.intp]
    followers: Floats

    def positions(self, first: float) -> Floats:
        """Return where all of them are if the first one is at ``first`` (rad or m), (n,)."""
        multipliers, offsets = self.followers.T
        return (first - offsets[0]) / multipliers[0] * multipliers + offsets


class CellPage:
    """A cell with its panel, on a viser server."""

    def __init__(self, server: Any, cell: ShownCell) -> None:
        """Draw the cell and its panel.

        Args:
            server: A viser server.
            cell: What to show.
        """
        self._cell = cell
        self._lock = RLock()
        self._stale = Event()  # what the panel says of collisions is of other joint positions
        self._stale.set()
        self._qpos = {name: start.copy() for name, start in cell.start.items()}
        server.scene.set_up_direction("+z")
        self.scene = CellScene(server.scene, cell)
        self.scene.aim(server.initial_camera)
        self._sliders: dict[str, list[tuple[Any, _SliderJoints]]] = {}
        self._timeline: Any = None
        self._playing: Any = None
        self._moment = 0.0  # steps since the start, with fractions while it plays
        self._build(server.gui)

    def tick(self, seconds: float) -> None:
        """Go on playing, and look for collisions if something has moved.

        Args:
            seconds: Time since the last call (s).
        """
        motion = self._cell.motion
        if motion is not None and self._playing.value:
            speed = float(self._speed.value.split()[0])
            self._moment = (self._moment + speed * seconds / motion.step_seconds) % len(motion)
            if int(self._moment) != self._timeline.value:
                self._timeline.value = int(self._moment)
        if self._stale.is_set():
            self._stale.clear()
            with self._lock:
                qpos = {name: positions.copy() for name, positions in self._qpos.items()}
            contacts = self._cell.contacts(qpos)
            self.scene.mark(contacts)
            self._verdict.text = contacts_text(contacts)

    def go_to(self, moment: int) -> None:
        """Show robots and things at a moment of the motion."""
        motion = self._cell.motion
        if motion is None:
            return
        for name, rows in motion.poses.items():
            self.scene.place(name, rows[moment])
        for name, rows in motion.qpos.items():
            self._take(name, np.asarray(rows[moment], float))
        self._clock.text = (
            f"step {moment} of {len(motion) - 1}, {moment * motion.step_seconds:.2f} s"
        )

    def _build(self, gui: Any) -> None:
        # viser's own share button would put the page on the internet, at one click.
        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        Text(gui, self._cell.title, bold=True)
        for note in self._cell.notes:
            Text(gui, note)
        if self._cell.motion is not None:
            self._build_timeline(gui, self._cell.motion)
        with gui.add_folder("Collisions"):
            self._verdict = Text(gui, "…")
        with gui.add_folder("Show"):
            for overlay, visible in OVERLAYS.items():
                shown = visible and overlay not in self._cell.hidden
                box = gui.add_checkbox(LABELS[overlay], shown)
                box.on_update(
                    lambda event, overlay=overlay: self.scene.show(overlay, event.target.value)
                )
            if self._cell.ways:
                box = gui.add_checkbox("Paths", True)
                box.on_update(lambda event: self.scene.show_ways(event.target.value))
        for name in self._cell.layout:
            self._build_robot(gui, name)

    def _build_timeline(self, gui: Any, motion: ShownMotion) -> None:
        with gui.add_folder(printable(motion.name)):
            self._timeline = gui.add_slider("Step", 0, max(len(motion) - 1, 1), 1, 0)
            self._clock = Text(gui, "")
            self._playing = gui.add_checkbox("Play", False)
            self._speed = gui.add_dropdown("Speed", SPEEDS, initial_value="1 ×")
        self._timeline.on_update(lambda event: self._scrub(event.target.value))
        self.go_to(0)

    def _scrub(self, step: int) -> None:
        if not self._playing.value:
            self._moment = float(step)
        motion = self._cell.motion
        self.go_to(min(step, len(motion) - 1) if motion is not None else 0)

    def _build_robot(self, gui: Any, name: str) -> None:
        robot = self._cell.layout[name].robot
        with gui.add_folder(f"{name} ({robot.name})", expand_by_default=len(self._cell.layout) < 3):
            sliders: list[tuple[Any, _SliderJoints]] = []
            for group in robot.action_split.groups.values():
                joints = [robot.joints.index(joint) for joint in group.joints]
                followers = np.array(group.followers)
                together = [slice(None)] if group.mimic else [[i] for i in range(len(joints))]
                for some in together:
                    driven = _SliderJoints(np.array(joints)[some], followers[some])
                    sliders.append((self._add_slider(gui, name, driven.joints[0], group), driven))
            start = gui.add_button("Back to the start")
        self._sliders[name] = sliders
        for slider, driven in sliders:
            slider.on_update(lambda event, driven=driven: self._slide(event, name, driven))
        start.on_click(lambda _: self._take(name, self._cell.start[name]))

    def _add_slider(self, gui: Any, name: str, joint: int, group: JointGroup) -> Any:
        label = self._cell.layout[name].robot.joints[joint]
        low, high = self._cell.models[name].kinematics.limits[joint].tolist()
        low, high = max(low, -UNBOUNDED), min(high, UNBOUNDED)
        value = min(max(float(self._qpos[name][joint]), low), high)
        step = 0.0001 if group.unit == "m" else 0.001
        return gui.add_slider(f"{printable(label)} ({group.unit})", low, high, step, value)

    def _slide(self, event: Any, name: str, driven: _SliderJoints) -> None:
        if event.client_id is None:  # set by this page, not by a person
            return
        with self._lock:
            self._qpos[name][driven.joints] = driven.positions(event.target.value)
            self.scene.pose(name, self._qpos[name])
            self._stale.set()

    def _take(self, name: str, qpos: Floats) -> None:
        """Show a robot at joint positions, and let its sliders say so."""
        with self._lock:
            self._qpos[name] = qpos.copy()
            self.scene.pose(name, qpos)
            for slider, driven in self._sliders.get(name, []):
                slider.value = min(max(float(qpos[driven.joints[0]]), slider.min), slider.max)
            self._stale.set()


def serve(cell: ShownCell, host: str, port: int, announce: Callable[[str], None]) -> NoReturn:
    """Serve a page until something, such as Ctrl-C, raises.

    Args:
        cell: What to show.
        host: Address to listen at.
        port: Port to listen at; 0 takes a free one.
        announce: Called with the lines that tell where the page is.

    Raises:
        MissingPackageError: If viser is not installed.
        ViewerError: If the port is in use, or the address is none of this machine's.
    """
    with serving(host, port, cell.title) as (server, address):
        page = CellPage(server, cell)
        tell(cell.title, host, address, announce)
        before = time.monotonic()
        while True:
            time.sleep(PAUSE)
            now = time.monotonic()
            page.tick(now - before)
            before = now


def tell(title: str, host: str, address: str, announce: Callable[[str], None]) -> None:
    """Tell where a page is, and who else may open it.

    Args:
        title: What the page calls itself.
        host: Address at which it listens.
        address: What to open in a browser.
        announce: Called with each line.
    """
    if not is_loopback(host):
        announce(
            f"listening at {host}: others on this network can open and move it, too, at this"
            " machine's name or address and with the token; nothing is encrypted"
        )
    announce(f"{title}: {address} (Ctrl-C ends it)")


def contacts_text(contacts: list[LinkContact]) -> str:
    """Say which links overlap."""
    if not contacts:
        return "No robot touches another or itself."
    lines = [
        printable(f"- {'.'.join(one)} in {'.'.join(other)}, {c.depth * 100:.1f} cm")
        for c in contacts[:SPOKEN]
        for one, other in [zip(c.robots, c.links, strict=True)]
    ]
    rest = len(contacts) - len(lines)
    return "\n".join([*lines, *([f"- and {rest} more"] if rest else [])])


def save_html(cell: ShownCell, path: str | os.PathLike[str]) -> Path:
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
    rules = f'<meta http-equiv="Content-Security-Policy" content="{html.escape(policy())}">'
    page = _with(page, "<head>", f"<head>\n{rules}")
    page = _with(page, '<div id="root"></div>', f'<div id="root"></div>\n{_note(cell)}')
    write_whole(target, page, ViewerError)
    return target


def _recorded(server: Any, cell: ShownCell) -> Any:
    """Draw a cell, and return viser's recording of it."""
    server.scene.set_up_direction("+z")
    scene = CellScene(server.scene, cell)
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


def _note(cell: ShownCell) -> str:
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
