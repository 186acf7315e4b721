"""The page of ``teleop`` as clients see it that speak its protocol; no browser needed."""

import threading
from contextlib import contextmanager
from time import monotonic
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest

import tasks
from layouts.viewer.server import REST, serving
from robot_layouts.data.reading.recording import FILE
from robot_layouts.data.recording.recorder import Recorder
from robot_layouts.data.teleop.page import TeleopPage
from robot_layouts.data.teleop.session import Phase, Session
from tests.layouts.guests import WEBSOCKET, Guest, ask
from tests.pages import wait_until

pytestmark = pytest.mark.xdist_group("teleop_page")  # they share one session

LEFT, RIGHT = "/(gizmos)/left", "/(gizmos)/right"


class Site:
    def __init__(self, page, session, server, address):
        self.page, self.session, self.server, self.address = page, session, server, address
        self.port = urlsplit(address).port
        self.token = parse_qs(urlsplit(address).query)["token"][0]


@contextmanager
def site(session):
    """Serve the page of a session, whose thread is another one."""
    with serving("127.0.0.1", 0, "steering") as (server, address):
        page, ended = TeleopPage(server, session), threading.Event()
        running = Site(page, session, server, address)

        def go_on():
            while not ended.is_set():
                page.tick()

        thread = threading.Thread(target=go_on)
        thread.start()
        try:
            yield running
        finally:
            ended.set()
            thread.join()


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    task = tasks.make("TwoRobotPickCube-v1")
    path = tmp_path_factory.mktemp("kept") / FILE
    with Recorder(path, task, source="human") as recorder, site(Session(task, recorder)) as running:
        yield running
    task.close()


@contextmanager
def browsers(cell, count):
    guests = [Guest(cell.address) for _ in range(count)]
    try:
        for guest in guests:
            guest.enter()
        yield guests
    finally:
        for guest in guests:
            guest.socket.close()


def press(guest, label):
    """Press a button or, if there is none of that name, the key of a command."""
    guest.wait_for("ReplayDoneMessage")
    for message in guest.received:
        if message.get("props", {}).get("label", "").startswith(label):
            if message["type"] == "GuiButtonMessage":
                return guest.set(message["uuid"], True)
            if message["type"] == "RegisterCommandMessage":
                return guest.send({"type": "CommandTriggerMessage", "uuid": message["uuid"]})
    raise AssertionError(f"there is no {label!r}")


def drag(guest, name, pose):
    guest.send({"type": "TransformControlsDragStartMessage", "name": name, "owner": ""})
    guest.send(moved(name, pose))


def moved(name, pose):
    place, turn = [float(x) for x in pose[:3]], [float(x) for x in pose[3:]]
    update = {"name": name, "position": place, "wxyz": turn, "owner": ""}
    return {"type": "TransformControlsUpdateMessage", **update}


def shifted(session, arm, way):
    return session.targets[arm] + [*way, 0, 0, 0, 0]


def at(session, arm, pose):
    return np.allclose(session.targets[arm], pose, atol=1e-6)


@pytest.mark.long
def test_two_browsers_steer_an_arm_each_and_one_takes_it_from_the_other(cell):
    session = cell.session
    with browsers(cell, 2) as (one, other):
        left = shifted(session, "left", (0.0, 0.03, 0.02))
        right = shifted(session, "right", (0.02, 0.0, 0.02))
        drag(one, LEFT, left)
        drag(other, RIGHT, right)
        wait_until(lambda: at(session, "left", left) and at(session, "right", right))
        press(one, "Start (P)")
        wait_until(lambda: len(session.actions) > 25)
        np.testing.assert_allclose(session.steering.tcp("left")[:3], left[:3], atol=0.003)
        np.testing.assert_allclose(session.steering.tcp("right")[:3], right[:3], atol=0.003)

        taken = shifted(session, "left", (0.0, -0.02, 0.0))
        drag(other, LEFT, taken)
        wait_until(lambda: at(session, "left", taken))
        one.send(moved(LEFT, left))  # it is not its arm any more
        press(other, "Open or close the gripper")  # of the arm it took last
        wait_until(lambda: session.closed["left"])
        assert at(session, "left", taken)
        assert not session.closed["right"]
        press(one, "Move +z")  # which has no arm, and all are taken
        one.wait_for("GuiUpdateMessage")
        wait_until(lambda: "others steer all arms" in str(received(one)))
        press(one, "Take left")
        press(one, "Move +z")
        wait_until(lambda: at(session, "left", taken + [0, 0, 0.01, 0, 0, 0, 0]))

        press(one, "Keep (M)")
        wait_until(lambda: session.seed == 1)
        assert session.phase is Phase.READY
        press(one, "Next seed (N)")
        wait_until(lambda: session.seed == 2)
        press(one, "Keep (M)")
        wait_until(lambda: "there is nothing to keep" in str(received(one)))
    wait_until(lambda: not cell.server.get_clients())


def received(guest):
    guest.listen()
    return [message for message in guest.received if "content" in message.get("updates", ())]


@pytest.mark.parametrize("kind", ["page", "websocket"])
@pytest.mark.parametrize(
    ("origin", "token"),
    [("http://evil.example", True), ("null", True), (None, False), ("own", False)],
)
def test_a_foreign_page_and_a_wrong_token_are_refused(cell, origin, token, kind):
    own = f"127.0.0.1:{cell.port}"
    headers = {"Host": own} | ({"Origin": f"http://{own}" if origin == "own" else origin or ""})
    headers = {name: text for name, text in headers.items() if text}
    headers |= WEBSOCKET if kind == "websocket" else {}
    status, _ = ask(cell.port, headers, f"/?token={cell.token if token else 'A' * 43}")
    assert status == 403


def wrong_messages(session, command):
    pose = shifted(session, "left", (0.0, 0.0, 0.1))
    update = moved(LEFT, pose)
    yield {**update, "name": "/(gizmos)/nobody"}
    yield {**update, "owner": "1"}
    yield {**update, "position": [0.0, float("nan"), 0.0]}
    yield {**update, "position": [0.0, 1e9, 0.0]}
    yield {**update, "position": [0.0, 0.0]}
    yield {**update, "wxyz": [2.0, 0.0, 0.0, 0.0]}
    yield {**update, "wxyz": [0.0, 0.0, 0.0, 0.0]}
    yield {**update, "more": 1}
    yield {"type": "TransformControlsDragStartMessage", "name": "/left", "owner": ""}
    yield {"type": "TransformControlsDragEndMessage", "name": LEFT}
    yield {"type": "CommandTriggerMessage", "uuid": "none"}
    yield {"type": "CommandTriggerMessage", "uuid": command, "more": 1}
    yield {"type": "SceneNodeClickMessage", "name": LEFT, "instance_index": None}
    yield {"type": "CommandUpdateMessage", "uuid": command, "updates": {"label": "owned"}}


def test_nothing_but_gizmos_keys_and_buttons_is_taken(cell):
    session = cell.session
    with browsers(cell, 1) as (guest,):
        command = guest.wait_for("RegisterCommandMessage", label="Move +z")["uuid"]
        press(guest, "Take left")
        before = session.targets["left"].copy()
        right = shifted(session, "right", (0.0, 0.0, 0.01))
        for message in wrong_messages(session, command):
            guest.send(message)
        press(guest, "Take right")
        press(guest, "Move +z")
        wait_until(lambda: at(session, "right", right) or not at(session, "left", before))
        assert at(session, "left", before)


def test_of_many_poses_that_wait_the_last_one_counts(cell, monkeypatch):
    session, aimed, came = cell.session, [], threading.Event()

    def aim(arm, pose):
        aimed.append(pose)
        came.wait()
        type(session).aim(session, arm, pose)

    monkeypatch.setattr(session, "aim", aim)
    with browsers(cell, 1) as (guest,):
        last = shifted(session, "left", (0.0, 0.0, 0.03))
        drag(guest, LEFT, shifted(session, "left", (0.0, 0.0, 0.01)))
        wait_until(lambda: aimed)
        began = monotonic()
        for height in np.linspace(-0.02, 0.0, 100):
            guest.send(moved(LEFT, last + [0, 0, height, 0, 0, 0, 0]))
        wait_until(lambda: cell.page._waiting.qsize() == 100)
        assert monotonic() - began >= 100 * REST  # a flood leaves time for other things
        came.set()
        wait_until(lambda: at(session, "left", last))
    assert len(aimed) == 2


def test_a_step_is_taken_though_messages_never_end(cell):
    session, rounds = cell.session, iter(range(10_000))

    def flood():
        if next(rounds, None) is not None and not session.actions:
            cell.page._waiting.put(flood)

    with browsers(cell, 1) as (guest,):
        press(guest, "Discard (X)")
        wait_until(lambda: not session.actions)
        press(guest, "Start (P)")
        cell.page._waiting.put(flood)
        wait_until(lambda: session.actions)
        assert next(rounds, None) is not None
        press(guest, "Start (P)")
        wait_until(lambda: session.phase is Phase.STOPPED)
