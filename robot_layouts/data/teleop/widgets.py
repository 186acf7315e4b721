"""What the page for steering is made of: arms and keys, the clock, the live picture, the stopwatch.

The stopwatch measures in the page how long it takes from a drag of the mouse to the picture that
shows it. Its script notes when the mouse moved whose place the page sends, and waits for the step
that went by this very place: the server puts a node of the scene there, together with all poses of
that step. The picture counts as shown when the browser begins the frame after the one that draws
them. Where a browser has no graphics card, the script asks for the quick picture, as a hand would.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from time import monotonic
from typing import Any

import numpy as np

from layouts.viewer.cell import STYLE, node
from layouts.viewer.scene import COARSE, CellScene
from robot_layouts.data.teleop.session import Session
from robot_layouts.kinematics.rotations import Floats
from robots import TaskError
from tasks.view import live_thing, task_cell

_AXES: Mapping[str, tuple[str, tuple[float, float, float]]] = {
    "I": ("+x", (1.0, 0.0, 0.0)),
    "K": ("-x", (-1.0, 0.0, 0.0)),
    "J": ("+y", (0.0, 1.0, 0.0)),
    "L": ("-y", (0.0, -1.0, 0.0)),
    "U": ("+z", (0.0, 0.0, 1.0)),
    "O": ("-z", (0.0, 0.0, -1.0)),
}
KEYS_TEXT = """\
I K: along x, J L: along y, U O: up and down, with shift: turn about that axis of the world.
G: open or close the gripper. 1 to 9: take that arm; the keys move the one you took last.
P: start or stop. Z: back. M: keep. X: discard. N: next seed."""

MOST_BEHIND = 1.0  # s; what is later than that is not caught up: time goes slower instead
_WINDOW = 2.0  # s, over which the speed is measured

FIELD_OF_VIEW = np.radians(60)  # from the upper to the lower edge
VIEW, NEAREST = (0.9, -0.55, 0.6), 0.9  # from the TCPs to the camera: direction, and least way (m)

HTML_ID = "from-drag-to-picture"
QUICK = "Quick picture"  # a box on the panel
MOST = 200  # drags that count
NOTHING_YET = "Time from drag to picture: not measured yet"
GIZMOS, STEERED = "(gizmos)", "(steered)"


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


KEYS: Mapping[str, Jog] = {
    **{key: Jog(f"Move {name}", axis) for key, (name, axis) in _AXES.items()},
    **{
        f"shift+{key}": Jog(f"Turn about {name}", axis, shift=True)
        for key, (name, axis) in _AXES.items()
    },
}


class Pace:
    """The clock of an episode: a step is never left out.

    Steps that are late are taken one right after the other until they have caught up. Where that
    would take too long the clock stands still meanwhile, which counts as lost.

    Attributes:
        lost: For how long the clock has stood still so far (s).
        speed: Of the episode, as a share of real time, over the last two seconds.
    """

    def __init__(self, seconds: float, clock: Callable[[], float] = monotonic) -> None:
        """Take the time between steps.

        Args:
            seconds: From one step to the next (s).
            clock: Returns the time (s).
        """
        self._seconds, self._clock = seconds, clock
        self.restart()

    def restart(self) -> None:
        """Let the next step be due now."""
        now = self._clock()
        self._due, self.lost, self.speed = now, 0.0, 1.0
        self._since, self._steps = now, 0

    def left(self) -> float:
        """Return the time until the next step is due (s); 0 or less: it is."""
        return self._due - self._clock()

    @property
    def behind(self) -> bool:
        """Whether more than one step is due."""
        return self.left() < -self._seconds

    def stepped(self) -> None:
        """Count a step that was taken."""
        now = self._clock()
        self._due += self._seconds
        if now - self._due > MOST_BEHIND:
            self.lost += now - self._due - MOST_BEHIND
            self._due = now - MOST_BEHIND
        self._steps += 1
        if now - self._since >= _WINDOW:
            self.speed = self._steps * self._seconds / (now - self._since)
            self._since, self._steps = now, 0


class Picture:
    """A session's world on a viser server.

    Attributes:
        notes: Remarks on the robots' files, for a person.
    """

    def __init__(self, server: Any, session: Session) -> None:
        """Draw the world as it is, and let cameras begin at `viewpoint`.

        Args:
            server: A viser server.
            session: What is shown.
        """
        self._session = session
        cell = task_cell(session.task, session.task.task_id)
        self.notes = cell.notes
        server.scene.set_up_direction("+z")
        self._scene = CellScene(server.scene, cell, drawn=("meshes", COARSE))
        self.hurry = self._scene.hurry
        camera = server.initial_camera
        camera.fov = FIELD_OF_VIEW
        camera.position, camera.look_at = viewpoint(session)
        self._shapes = {name: body.shapes for name, body in self._bodies.items()}
        self._shown: dict[str, Floats] = {}
        self.show()

    def show_anew(self) -> None:
        """Show a world that was built anew, whose bodies may have other shapes."""
        for name, body in self._bodies.items():
            if body.shapes != self._shapes.get(name):
                thing = live_thing(self._session.task, name)
                if thing is not None:
                    self._scene.draw(name, thing)
                self._shapes[name] = body.shapes
        self._shown.clear()
        self.show()

    def show(self) -> None:
        """Show where robots and bodies are; what has not moved is not sent again."""
        state = self._session.task.simulation.read()
        for name in self._session.task.layout:
            if self._moved(f"base of {name}", base := state.base_pose(name)[0]):
                self._scene.stand(name, base.astype(float))
            if self._moved(f"joints of {name}", qpos := state.qpos(name)[0]):
                self._scene.pose(name, qpos.astype(float))
        for name in self._scene.things:
            if self._moved(f"body {name}", pose := state.pose(name)[0]):
                self._scene.place(name, pose.astype(float))

    # -- inside ------------------------------------------------------------------------------

    @property
    def _bodies(self) -> Any:
        return self._session.task.simulation.worlds[0].bodies

    def _moved(self, what: str, now: Floats) -> bool:
        before = self._shown.get(what)
        self._shown[what] = now.copy()
        return before is None or not np.array_equal(before, now)


def viewpoint(session: Session) -> tuple[Floats, Floats]:
    """Return the first place of the camera, and its target amid the TCPs; each (3,) (m, world)."""
    places = np.array([pose[:3] for pose in session.targets.values()])
    middle = places.mean(axis=0)
    distance = NEAREST + 1.2 * float(np.linalg.norm(np.ptp(places, axis=0)))
    return middle + distance * np.array(VIEW) / np.linalg.norm(VIEW), middle


class Stopwatch:
    """Lets pages show how long drags take to be seen."""

    def __init__(self, server: Any, arms: tuple[str, ...]) -> None:
        """Send the script to all browsers that open the page, and add the line that it fills in.

        Args:
            server: A viser server.
            arms: What is dragged; their gizmos are called as `gizmo_node` says.
        """
        from viser import _messages

        source = (files("robot_layouts.data.teleop") / "stopwatch.js").read_text(encoding="utf-8")
        for name in ("HTML_ID", "QUICK", "MOST", "GIZMOS", "STEERED"):
            source = source.replace(name, str(globals()[name]))
        server.gui.add_html(f'<div style="{STYLE}" id="{HTML_ID}">{NOTHING_YET}</div>')
        server.gui._websock_interface.queue_message(_messages.RunJavascriptMessage(source))
        self._nodes = {
            arm: server.scene.add_frame(node(STEERED, arm), show_axes=False) for arm in arms
        }

    def stepped(self, arm: str, place: tuple[float, float, float]) -> None:
        """Tell browsers where an arm was to go in the step whose poses are sent along."""
        self._nodes[arm].position = place


def gizmo_node(arm: str) -> str:
    """Return what the gizmo of an arm is called in the scene."""
    return node(GIZMOS, arm)
