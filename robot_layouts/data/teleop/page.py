"""The page on which people steer: the live world, gizmos, buttons and keys over a `Session`."""

from __future__ import annotations

from collections.abc import Callable
from queue import Empty, SimpleQueue
from time import monotonic
from typing import Any, NoReturn

import numpy as np

from layouts.viewer.cell import Text, printable
from layouts.viewer.page import tell
from layouts.viewer.server import serving
from robot_layouts.data.teleop.session import Phase, Session
from robot_layouts.data.teleop.widgets import (
    KEYS,
    KEYS_TEXT,
    QUICK,
    ArmControl,
    Jog,
    Pace,
    Picture,
    Stopwatch,
    browser_name,
    gizmo_node,
)
from robot_layouts.kinematics.rotations import Floats
from robots import RobotLayoutsError
from tasks.description import read_docstring

LONGEST_UNSEEN = 0.1  # s between pictures while late steps are caught up
IDLE = 0.25  # s between updates of the page's texts while nothing happens
GIZMO_SIZE = 0.2  # m
UNDO = 1.0  # s that the key takes back
SLOW = 0.98  # of real time; below that the page says so
_GIZMO_TEXT = "The coloured axes at each gripper move and turn where it is to go."


class TeleopPage:
    """A session on a viser server.

    Everything happens in the thread that calls `run` or `tick`; what browsers send waits for it.

    Attributes:
        pace: Says when steps are due, and whether time goes slower.
    """

    def __init__(self, server: Any, session: Session) -> None:
        """Draw the world and the panel.

        Args:
            server: A viser server.
            session: What to steer; its replays are shown from now on.
        """
        self._server, self._session = server, session
        self._waiting: SimpleQueue[Callable[[], object]] = SimpleQueue()
        self._latest: dict[tuple[int, str], Floats] = {}  # where a browser has dragged a gizmo
        self._updated = self._drawn = 0.0  # when
        self.pace, self._control = Pace(session.seconds), ArmControl(session.arms)
        self._picture = Picture(server, session)
        self._gizmos = {arm: self._add_gizmo(arm) for arm in session.arms}
        self._build()
        session.on_replay = self._show_replay
        server.on_client_connect(self._connected)
        server.on_client_disconnect(self._disconnected)
        self._show_targets()

    def run(self) -> NoReturn:
        """Go on until something, such as Ctrl-C, raises."""
        while True:
            self.tick()

    def tick(self) -> None:
        """Do what browsers ask for, and take a step once it is due; wait for either till then."""
        running = self._session.phase is Phase.RUNNING
        asked = self._handle_waiting(max(self.pace.left(), 0.0) if running else IDLE)
        if self._session.phase is Phase.RUNNING and self.pace.left() <= 0:
            self._step()
        if asked or monotonic() - self._updated > IDLE:
            self._update_texts()
            self._updated = monotonic()

    # -- what happens ------------------------------------------------------------------------

    def _step(self) -> None:
        try:
            self._session.step()
        except RobotLayoutsError as error:  # of a policy
            self._session.stop()
            self._note.text = f"Stopped: {error}"
            return
        self.pace.stepped()
        if self.pace.behind and monotonic() - self._drawn < LONGEST_UNSEEN:
            return  # it catches up first
        self._drawn = monotonic()
        with self._server.atomic():
            self._picture.show()
            if not self._session.by_hand:  # gizmos stay at the grippers, where they can be taken
                self._show_targets()
            for arm, pose in self._session.targets.items():
                x, y, z = pose[:3].tolist()
                self._stopwatch.stepped(arm, (x, y, z))

    def _handle_waiting(self, patience: float) -> bool:
        """Do all that browsers have asked for so far; wait for that if they have not.

        Args:
            patience: How long to wait (s).

        Returns:
            Whether there was anything.
        """
        try:
            self._do(self._waiting.get(patience > 0, patience))
        except Empty:
            return False
        for _ in range(self._waiting.qsize()):  # what comes meanwhile must not hold up a step
            self._do(self._waiting.get())
        return True

    def _do(self, act: Callable[[], object]) -> None:
        try:
            act()
        except RobotLayoutsError as error:
            self._note.text = f"Not done: {error}"

    def _callback(self, act: Callable[[int], None]) -> Callable[[Any], Any]:
        """Return a callback of viser that queues something for the thread of this page."""

        async def ask(event: Any) -> None:  # awaited, so that nothing overtakes
            client = event.client_id
            if client is not None:  # not set by this page itself
                self._waiting.put(lambda: act(client))

        return ask

    # -- arms --------------------------------------------------------------------------------

    def _add_gizmo(self, arm: str) -> Any:
        gizmo = self._server.scene.add_transform_controls(
            gizmo_node(arm),
            GIZMO_SIZE,
            depth_test=False,
            disable_rotations=arm not in self._session.steering.turned,
        )

        async def dragged(event: Any) -> None:
            pose = np.concatenate([event.target.position, event.target.wxyz])
            client, phase = event.client_id, event.phase
            if phase == "update":
                self._latest[client, arm] = pose
            self._waiting.put(lambda: self._drag(client, arm, phase, pose))

        gizmo.on_update(dragged)
        return gizmo

    def _drag(self, client: int, arm: str, phase: str, pose: Floats) -> None:
        if phase == "start":
            self._take(client, arm)
        elif phase == "update":
            if self._latest[client, arm] is pose and self._control.steers(client, arm):
                pose[3:] /= np.linalg.norm(pose[3:])
                self._session.aim(arm, pose)
        elif phase == "end" and not self._control.steers(client, arm):
            self._show_targets()

    def _take(self, client: int, arm: str) -> None:
        """Let a browser steer an arm; if a policy has acted so far, people steer now."""
        self._control.take(client, arm)
        if not self._session.by_hand:
            self._session.take_over()
            self._show_targets()

    def _give_back(self, _: int) -> None:
        self._session.give_back()

    def _jog(self, client: int, jog: Jog) -> None:
        arm = self._control.arm_of(client)
        self._session.take_over()
        way, turn = jog.scaled(self._key_step.value / 1000, np.radians(self._key_turn.value))
        self._session.shift(arm, way, turn)
        self._show_targets()

    def _toggle(self, client: int, arm: str | None = None) -> None:
        if arm is not None:
            self._take(client, arm)
        arm = self._control.arm_of(client)
        self._session.take_over()
        self._session.grip(arm, not self._session.closed[arm])

    def _let_go(self, client: int, arm: str) -> None:
        self._take(client, arm)
        self._session.let_go(arm)
        self._show_targets()

    # -- the episode -------------------------------------------------------------------------

    def _start_or_stop(self, _: int) -> None:
        if self._session.phase is Phase.RUNNING:
            self._session.stop()
        else:
            self._session.start()
            self.pace.restart()

    def _back(self, _: int) -> None:
        steps = len(self._session.actions)
        self._undo(max(0, steps - round(UNDO / self._session.seconds)))

    def _undo(self, step: int) -> None:
        self._session.stop()
        self._session.undo(min(step, len(self._session.actions)))
        self._show_anew()

    def _keep(self, _: int) -> None:
        seed, steps = self._session.seed, len(self._session.actions)
        episode = self._session.keep()
        self._show_anew()
        how = "solved" if episode.solved else "not solved"
        self._note.text = f"Kept: seed {seed}, {steps} steps, {how}."

    def _discard(self, _: int) -> None:
        self._session.discard()
        self._show_anew()

    def _skip(self, _: int) -> None:
        self._session.skip()
        self._show_anew()

    def _show_replay(self, done: int, steps: int) -> None:
        if done % 100 == 0 and done < steps:
            self._status.text = f"Playing step {done} of {steps} again …"

    # -- what is shown -----------------------------------------------------------------------

    def _show_anew(self) -> None:
        self._picture.show_anew()
        self._show_targets()

    def _show_targets(self) -> None:
        for arm, pose in self._session.targets.items():
            gizmo = self._gizmos[arm]
            gizmo.position, gizmo.wxyz = pose[:3], pose[3:]

    def _update_texts(self) -> None:
        """Show the state of the episode; texts that stay the same are not sent again."""
        session = self._session
        steps = len(session.actions)
        solved = "solved" if session.success else "not solved"
        _write(
            self._status,
            f"Seed {session.seed}: {session.phase.value}, step {steps}"
            f" ({steps * session.seconds:.1f} s), {solved}"
            + ("" if session.by_hand else "\nThe policy acts; take an arm to steer."),
        )
        speed = f"Time runs at {self.pace.speed:.0%} of real time"
        lost = f"; it stood still for {self.pace.lost:.1f} s" if self.pace.lost else ""
        slow = self.pace.speed < SLOW or self.pace.lost
        _write(self._clock, f"{speed}{lost}; no step is left out." if slow else "Real time.")
        solved_episodes = sum(session.kept.values())
        _write(self._count, f"{len(session.kept)} episodes kept, {solved_episodes} of them solved")
        if session.phase is not Phase.RUNNING and self._earlier.max != max(steps, 1):
            self._earlier.max = max(steps, 1)
            self._earlier.value = min(self._earlier.value, steps)
        self._run.label = "Stop (P)" if session.phase is Phase.RUNNING else "Start (P)"
        for arm, text in self._arm_texts.items():
            away = np.linalg.norm(session.steering.tcp(arm)[:3] - session.targets[arm][:3])
            gripper = f", gripper {'closed' if session.closed[arm] else 'open'}"
            own = gripper if arm in session.steering.with_gripper else ""
            place = ", ".join(f"{x:.3f}" for x in session.targets[arm][:3])
            status = self._control.status(arm)
            _write(text, f"{status}{own}\ntarget ({place}) m, {away * 1000:.0f} mm away")

    # -- the panel ---------------------------------------------------------------------------

    def _build(self) -> None:
        gui, session = self._server.gui, self._session
        # viser's own share button would put the page on the internet, at one click.
        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        Text(gui, session.task.task_id, bold=True)
        Text(gui, read_docstring(session.task.task_class).summary)
        for note in self._picture.notes:
            Text(gui, note)
        self._status, self._note = Text(gui, ""), Text(gui, "")
        self._run = self._add_action("Start", "P", self._start_or_stop, "Start or stop")
        self._add_action(f"Back {UNDO:g} s", "Z", self._back, "Back")
        self._add_action("Keep", "M", self._keep)
        self._add_action("Discard", "X", self._discard)
        self._add_action("Next seed", "N", self._skip)
        if session.has_policy:
            self._add_action("Back to the policy", "B", self._give_back)
        self._arm_texts: dict[str, Text] = {}
        for arm in session.arms:
            self._build_arm(arm)
        with gui.add_folder("Times"):
            self._clock, self._count = Text(gui, ""), Text(gui, "")
            self._stopwatch = Stopwatch(self._server, session.arms)
            quick = gui.add_checkbox(QUICK, False)
            quick.on_update(lambda event: self._picture.hurry(event.target.value))
        with gui.add_folder("Back to an earlier step"):
            self._earlier = gui.add_slider("Step", 0, 1, 1, 0)
            self._add_button("Go back there", lambda _: self._undo(int(self._earlier.value)))
        with gui.add_folder("Keys"):
            Text(gui, f"{KEYS_TEXT}\n{_GIZMO_TEXT}")
            self._key_step = gui.add_slider("Move by (mm)", 1, 50, 1, 10)
            self._key_turn = gui.add_slider("Turn by (degrees)", 1, 30, 1, 5)
        self._add_keys()

    def _build_arm(self, arm: str) -> None:
        gui = self._server.gui
        robot = self._session.task.layout.arm(arm).robot.name
        with gui.add_folder(f"{printable(arm)} ({robot})"):
            self._arm_texts[arm] = Text(gui, "")
            self._add_button("Take", lambda client: self._take(client, arm))
            if arm in self._session.steering.with_gripper:
                self._add_button("Open or close (G)", lambda client: self._toggle(client, arm))
            self._add_button("Stay where it is", lambda client: self._let_go(client, arm))

    def _add_button(self, label: str, act: Callable[[int], None]) -> Any:
        button = self._server.gui.add_button(label)
        button.on_click(self._callback(act))
        return button

    def _add_action(
        self, label: str, key: str, act: Callable[[int], None], command: str | None = None
    ) -> Any:
        """Add a button, and a key whose command is called otherwise if need be."""
        self._add_key(key, command or label, act)
        return self._add_button(f"{label} ({key})", act)

    def _add_keys(self) -> None:
        for key, jog in KEYS.items():
            self._add_key(key, jog.label, lambda client, jog=jog: self._jog(client, jog), jog.shift)
        self._add_key("G", "Open or close the gripper", self._toggle)
        for number, arm in enumerate(self._session.arms[:9], start=1):
            act = lambda client, arm=arm: self._take(client, arm)  # noqa: E731
            self._add_key(str(number), f"Take {printable(arm)}", act)

    def _add_key(
        self, key: str, label: str, act: Callable[[int], None], shift: bool = False
    ) -> None:
        modifier = "shift" if shift else None
        command = self._server.gui.add_command(label, hotkey=key[-1], modifier=modifier)
        command.on_trigger(self._callback(act))

    # -- browsers ----------------------------------------------------------------------------

    async def _connected(self, client: Any) -> None:
        name = browser_name(client.client_id)
        self._waiting.put(lambda: Text(client.gui, f"This is {name}."))

    async def _disconnected(self, client: Any) -> None:
        self._waiting.put(lambda: self._control.disconnect(client.client_id))


def serve(
    session: Session,
    host: str,
    port: int,
    announce: Callable[[str], None],
) -> NoReturn:
    """Serve a page until something, such as Ctrl-C, raises.

    Args:
        session: What is steered.
        host: Address to listen at.
        port: Port to listen at; 0 takes a free one.
        announce: Called with the lines that tell where the page is.

    Raises:
        MissingPackageError: If viser is not installed.
        ViewerError: If the port is in use, or the address is none of this machine's.
    """
    title = f"Steering {session.task.task_id}"
    with serving(host, port, title) as (server, address):
        page = TeleopPage(server, session)
        tell(title, host, address, announce)
        page.run()


def _write(text: Text, words: str) -> None:
    if text.text != words:
        text.text = words
