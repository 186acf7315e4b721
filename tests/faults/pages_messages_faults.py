"""Pages: messages of clients that have the token, and mean harm or are broken."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.faults.fault import GOES_ON, Fault
from tests.faults.served_page import others_go_on, served, steer, still_served
from tests.layouts.guests import Guest

AREA = "pages"
OTHER_KINDS = (  # which viser knows, and no page of ours needs
    "RunJavascriptMessage", "ResetGuiMessage", "GuiRemoveMessage", "RemoveSceneNodeMessage",
    "FileTransferStartUpload", "FileTransferPart", "ScenePointerMessage", "SetPositionMessage",
    "GetRenderResponseMessage", "CommandTriggerMessage", "LocalStorageClearMessage",
    "ShareUrlDisconnect", "GuiFormSubmitMessage", "GuiButtonHoldMessage",
)  # fmt: skip


def faults() -> Iterator[Fault]:
    """Go through the messages, then through what clients do besides."""
    for number, (what, _) in enumerate(_messages("slider", "box", "choice")):
        what = f"a client sends {what}"
        yield Fault(AREA, what, lambda _, number=number: _message(number), GOES_ON)
    for what, run in {
        "a client asks for a share tunnel": _tunnel,
        "a client sends 10 MB": _large,
        "a client vanishes without a word": _vanishes,
        "a client of another version of viser": _other_version,
        "a hundred strangers open connections and say nothing": _silent,
    }.items():
        yield Fault(AREA, what, run, GOES_ON)


def _messages(slider: str, box: str, choice: str) -> Iterator[tuple[str, Any]]:
    """Go through what no control sends, given the controls' uuids."""
    nan, infinite = float("nan"), float("inf")
    for value in (nan, infinite, 1e300, 1 << 63, "0.5", None, [0.5], {}):
        yield f"a slider to {value!r}", _update(slider, {"value": value})
    for value in (1, 0, "yes", None, 0.5, []):
        yield f"a box to {value!r}", _update(box, {"value": value})
    for value in ("fast", "1e999 ×", None, 1, ["1 ×"]):
        yield f"a choice to {value!r}", _update(choice, {"value": value})
    for name in ("update_cb", "removed", "uuid", "__class__"):
        yield f"an update of {name!r}", _update(slider, {name: 0.5})
        yield f"an update of the value and {name!r}", _update(slider, {"value": 0.5, name: 0.5})
    for updates in (None, [], "value", 5, {}):
        yield f"updates that are {updates!r}", _update(slider, updates)
    for uuid in ("", "no such", None, 5, [slider], {}):
        yield f"an update of control {uuid!r}", _update(uuid, {"value": 0.5})
    yield "a field more", {**_update(slider, {"value": 0.5}), "excluded_self_client": 0}
    yield "a field less", {"type": "GuiUpdateMessage", "uuid": slider}
    for kind in (None, 5, [], "Message", "__init__"):
        yield f"a message of type {kind!r}", {"type": kind, "uuid": slider}
    for kind in OTHER_KINDS:
        yield f"a {kind}", {"type": kind, "uuid": slider, "name": "/arm", "source": "alert(1)"}
    for wrong in ({}, {"wxyz": "x"}, {"position": [0, 0]}, {"fov": None}, {"more": 1}):
        yield f"a camera with {wrong!r}", {"type": "ViewerCameraMessage", **wrong}
    yield "nothing", b""
    yield "text", "text"
    yield "an opcode that is none", b"\xc1"
    yield "half a message", b"\x82\xa4type"
    yield "text that is no UTF-8", b"\x81\xa4type\xa1\xff"
    yield "lists in lists", b"\x91" * 10_000
    yield "maps in maps", b"\x81\xa1a" * 5_000
    yield "a list that says it has 4 billion entries", b"\xdd\xff\xff\xff\xff"
    yield "a map with a list as key", b"\x81\x90\x01"
    yield "two messages in one", b"\x80\x80"


def _update(uuid: object, updates: object) -> dict[str, object]:
    return {"type": "GuiUpdateMessage", "uuid": uuid, "updates": updates}


def _message(number: int) -> str:
    """Send a wrong message, then a right one; nothing but the right one may have an effect."""
    site = served()
    before = site.page._qpos["arm"].copy()
    with Guest(site.address) as sees, Guest(site.address) as means_harm:
        means_harm.enter()
        slider = sees.wait_for("GuiSliderMessage", label="shoulder (rad)")["uuid"]
        choice = sees.wait_for("GuiDropdownMessage", label="Speed")["uuid"]
        box = sees.wait_for("GuiCheckboxMessage", label="Frames")
        sees.wait_for("ReplayDoneMessage")
        _, message = list(_messages(slider, box["uuid"], choice))[number]
        replayed = len(sees.received)
        if isinstance(message, str):
            means_harm.socket.send(message)
        else:
            means_harm.send(message)
        steer(means_harm, sees, box["uuid"])
        changes = [m for m in sees.received[replayed:] if m.get("uuid") in (slider, choice)]
    assert not changes, f"others see {changes}"
    assert (site.page._qpos["arm"] == before).all()
    site.page.tick(0.0)
    return "the message has no effect, the client goes on"


def _tunnel(_: Path) -> str:
    server, calls = served().server, []
    server.request_share_url = lambda *_: calls.append("a tunnel")
    try:
        with Guest(served().address) as sees, Guest(served().address) as asks:
            asks.enter()
            box = sees.wait_for("GuiCheckboxMessage", label="Frames")["uuid"]
            sees.wait_for("ReplayDoneMessage")
            asks.send({"type": "ShareUrlRequest"})
            steer(asks, sees, box)
    finally:
        del server.request_share_url
    assert not calls
    assert server._share_tunnel is None
    return "there is no tunnel"


def _large(_: Path) -> str:
    from websockets.exceptions import ConnectionClosed

    with Guest(served().address) as means_harm:
        try:
            means_harm.send(b"\0" * 10_000_000)
            means_harm.wait_for("nothing")
        except ConnectionClosed as error:
            others_go_on()
            return f"the client is sent away: {error}"
    raise AssertionError("the message is taken")


def _vanishes(_: Path) -> None:
    for _ in range(5):
        client = Guest(served().address)
        client.enter()
        client.socket.socket.shutdown(socket.SHUT_RDWR)
        client.socket.socket.close()
    others_go_on()


def _other_version(_: Path) -> str:
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect

    site = served()
    with connect(site.address.replace("http", "ws", 1), subprotocols=["viser-v0.0.1"]) as old:
        try:
            old.recv(timeout=60)
        except ConnectionClosed as error:
            others_go_on()
            return str(error)
    raise AssertionError("it is given the scene")


def _silent(_: Path) -> None:
    strangers = [socket.create_connection(("127.0.0.1", served().port)) for _ in range(100)]
    still_served()
    others_go_on()
    for stranger in strangers:
        stranger.close()
