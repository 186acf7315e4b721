"""Who may see and steer a page, and what names on it are taken for; no browser needed."""

import html
import re
import socket
import urllib.request
from types import SimpleNamespace
from urllib.parse import urlsplit

import pytest

from layouts.viewer import ViewerError
from layouts.viewer.cell import as_html, node, printable
from layouts.viewer.guard import REFUSAL, Guard
from layouts.viewer.page import NO_SLIDERS, save_html
from layouts.viewer.server import serving
from tests.layouts.guests import (
    WEBSOCKET,
    Guest,
    ask,
    site,
    small_cell,
)
from tests.layouts.hostile_names import HOSTILE_NAMES
from tests.pages import wait_until

EVIL = "evil.example"


@pytest.fixture(scope="module")
def open_site(tmp_path_factory):
    with site(small_cell(tmp_path_factory.mktemp("robot"))) as running:
        yield running


@pytest.mark.parametrize("kind", ["page", "websocket"])
@pytest.mark.parametrize(
    ("host", "origin", "token"),
    [
        ("own", "absent", "right"),
        ("own", "own", "right"),
        ("localhost", "own", "right"),
        ("own", "own", "absent"),
        ("own", "own", "wrong"),
        ("own", "null", "right"),
        ("own", f"http://{EVIL}", "right"),
        ("localhost", "other port", "right"),
        ("absent", "own", "right"),
        (EVIL, "own", "right"),
        (f"{EVIL}:port", f"http://{EVIL}", "right"),
        ("other port", "own", "right"),
    ],
)
def test_only_the_page_itself_with_its_token_is_served(open_site, host, origin, token, kind):
    port, own = open_site.port, {"localhost": "localhost"}.get(host, "127.0.0.1")
    hosts = {"own": f"{own}:{port}", "localhost": f"{own}:{port}", "absent": None}
    hosts |= {f"{EVIL}:port": f"{EVIL}:{port}", "other port": f"{own}:{port + 1}"}
    origins = {"own": f"http://{own}:{port}", "other port": f"http://{own}:{port + 1}"}
    origins |= {"absent": None}
    tokens = {"absent": "", "wrong": f"?token={'A' * 43}", "right": f"?token={open_site.token}"}
    headers = {"Host": hosts.get(host, host), "Origin": origins.get(origin, origin)}
    headers |= WEBSOCKET if kind == "websocket" else {}
    status, answer = ask(
        port, {name: text for name, text in headers.items() if text}, f"/{tokens[token]}"
    )
    served = host in ("own", "localhost") and origin in ("absent", "own") and token == "right"
    if served:
        assert status == (101 if kind == "websocket" else 302)
    else:
        assert status in ((400, 403) if host == "absent" else (403,))
        assert len(answer) < 1200  # a few headers and two lines
        if status == 403:
            assert answer.endswith(REFUSAL.encode())


def test_the_printed_address_leads_to_the_page_and_tells_it_where_its_websocket_is(open_site):
    port, token = open_site.port, open_site.token
    host = {"Host": f"localhost:{port}"}
    status, answer = ask(port, host, f"/?token={token}")
    assert status == 302
    location = re.search(rb"Location: (/\S+)", answer)
    assert location
    stream = f"ws%3A%2F%2Flocalhost%3A{port}%2F%3Ftoken%3D{token}"
    assert location[1].decode() == f"/?token={token}&websocket={stream}"
    status, answer = ask(port, host, location[1].decode())
    assert status == 200
    assert b"<title>Viser</title>" in answer
    head = answer.partition(b"\r\n\r\n")[0].decode()
    assert "frame-ancestors 'none'" in head
    assert "Referrer-Policy: no-referrer" in head
    assert f"connect-src data: blob: ws://localhost:{port}" in head
    assert "Set-Cookie" not in head
    assert "Access-Control" not in head
    status, answer = ask(port, host, f"/?token={token}&websocket=ws://{EVIL}/")
    assert status == 302
    assert EVIL.encode() not in answer


@pytest.mark.parametrize("host", ["localhost", "0.0.0.0", "::1", "::"])
def test_the_printed_address_opens_wherever_the_server_listens(host, tmp_path):
    with site(small_cell(tmp_path), host) as running:
        with urllib.request.urlopen(running.address) as answer:
            assert b"<title>Viser</title>" in answer.read()
        with Guest(running.address) as guest:
            guest.wait_for("ReplayDoneMessage")
        named = urlsplit(running.address).netloc.rpartition(":")[0]
        assert named == ("[::1]" if ":" in host else "localhost")


def test_a_guest_steers_and_others_see_it(open_site):
    page = open_site.page
    with Guest(open_site.address) as steers, Guest(open_site.address) as sees:
        steers.enter()
        uuid = steers.wait_for("GuiSliderMessage", label="shoulder (rad)")["uuid"]
        steers.set(uuid, 0.25)
        sees.wait_for("GuiUpdateMessage", uuid=uuid, value=0.25)
        wait_until(lambda: page._qpos["arm"][0] == 0.25)
        steers.set(uuid, 0)
        sees.wait_for("GuiUpdateMessage", uuid=uuid, value=0.0)


def wrong_messages(slider, box):
    """Of each kind some; `make faults` sends more."""
    update = {"type": "GuiUpdateMessage", "uuid": slider}
    for value in (float("nan"), -1e300, "0.5", None, True, [0.5]):
        yield {**update, "updates": {"value": value}}
    for updates in ({"value": 0.5, "update_cb": []}, {"gui_api": 0.5}, None, []):
        yield {**update, "updates": updates}
    yield {"type": "GuiUpdateMessage", "uuid": box, "updates": {"value": 1}}
    yield {"type": "GuiUpdateMessage", "uuid": "no such", "updates": {"value": 0.5}}
    for kind in ("ShareUrlRequest", "ShareUrlDisconnect", "ViewerCameraMessage", None, []):
        yield {"type": kind}
    yield {"type": "RunJavascriptMessage", "source": "alert(1)"}
    start = {"source_component_uuid": slider, "transfer_uuid": "t", "filename": "../x"}
    yield {"type": "FileTransferStartUpload", "mime_type": "x", "part_count": 1, **start}
    yield from (b"", b"\xc1", b"\x91" * 9000, b"\x81\xa4type\xa1\xff")


def test_nothing_but_what_the_controls_send_reaches_viser(open_site, monkeypatch):
    shared: list[str] = []
    monkeypatch.setattr(open_site.server, "request_share_url", lambda: shared.append("on"))
    monkeypatch.setattr(open_site.server, "disconnect_share_url", lambda: shared.append("off"))
    before = open_site.page._qpos["arm"].copy()
    with Guest(open_site.address) as means_harm, Guest(open_site.address) as sees:
        means_harm.enter()
        slider = means_harm.wait_for("GuiSliderMessage", label="shoulder (rad)")["uuid"]
        box = means_harm.wait_for("GuiCheckboxMessage", label="Frames")["uuid"]
        for message in wrong_messages(slider, box):
            means_harm.send(message)
        means_harm.socket.send("text")
        means_harm.set(box, False)  # comes after all of them
        sees.wait_for("GuiUpdateMessage", uuid=box, value=False)
        changes = [
            m for m in sees.received if m["type"] == "GuiUpdateMessage" and m["uuid"] == slider
        ]
        means_harm.set(box, True)
        sees.wait_for("GuiUpdateMessage", uuid=box, value=True)
    updates = [m["updates"] for m in changes if m["type"] == "GuiUpdateMessage"]
    assert all(update == {"value": 0.0} for update in updates)
    assert not shared
    assert (open_site.page._qpos["arm"] == before).all()


@pytest.mark.parametrize(
    ("listens_at", "arrives_at", "host", "admitted"),
    [
        ("127.0.0.1", "127.0.0.1", "127.0.0.1:8080", True),
        ("127.0.0.1", "127.0.0.1", "localhost:8080", True),
        ("127.0.0.1", "127.0.0.1", "LocalHost:8080", True),
        ("127.0.0.1", "127.0.0.1", "127.0.0.1:80", False),
        ("127.0.0.1", "127.0.0.1", "localhost.evil.example:8080", False),
        ("127.0.0.1", "127.0.0.1", ":8080", False),
        ("127.0.0.1", "127.0.0.1", "OWN:8080", False),
        ("::1", "::1", "[::1]:8080", True),
        ("::1", "::1", "localhost:8080", True),
        ("::1", "::1", "::1:8080", False),
        ("::1", "::1", "[::1]", False),
        ("0.0.0.0", "127.0.0.1", "localhost:8080", True),
        ("0.0.0.0", "192.0.2.7", "192.0.2.7:8080", True),
        ("0.0.0.0", "192.0.2.7", "OWN:8080", True),
        ("0.0.0.0", "192.0.2.7", "OWN.local:8080", True),
        ("0.0.0.0", "192.0.2.7", "localhost:8080", False),
        ("0.0.0.0", "192.0.2.7", "192.0.2.8:8080", False),
        ("0.0.0.0", "192.0.2.7", "0.0.0.0:8080", False),
        ("0.0.0.0", "192.0.2.7", "evil.example:8080", False),
        ("::", "fe80::1%eth0", "[fe80::1]:8080", True),
        ("robots.lab.example", "192.0.2.7", "robots.lab.example:8080", True),
        ("robots.lab.example", "192.0.2.7", "192.0.2.7:8080", True),
        ("robots.lab.example", "192.0.2.7", "evil.lab.example:8080", False),
    ],
)
def test_a_request_must_name_this_machine(listens_at, arrives_at, host, admitted):
    host = host.replace("OWN", socket.gethostname())
    assert Guard.of(listens_at, 8080)._names_us(host.lower(), arrives_at) is admitted


def test_a_token_is_new_each_time_and_not_in_what_is_logged():
    one, other = Guard.of("127.0.0.1", 8080), Guard.of("127.0.0.1", 8080)
    assert one.token != other.token
    assert len(one.token) == 43  # 32 bytes
    assert one.token not in repr(one)


def test_a_viser_that_cannot_be_guarded_is_not_served(monkeypatch):
    import viser.infra._infra as viser_infra
    from websockets.asyncio.server import ServerConnection, serve

    server = SimpleNamespace(ServerConnection=ServerConnection, serve=serve)
    real = viser_infra.websockets
    changed = SimpleNamespace(
        asyncio=SimpleNamespace(server=server),
        datastructures=real.datastructures,
        exceptions=real.exceptions,
    )
    monkeypatch.setattr(viser_infra, "websockets", changed)
    with (
        pytest.raises(ViewerError, match=r"viser .* would accept any client, so no page is"),
        serving("127.0.0.1", 0, "cell"),
    ):
        pytest.fail("it is served")


@pytest.mark.parametrize("name", HOSTILE_NAMES)
def test_a_name_is_shown_as_it_is(name):
    shown = as_html(name)
    assert html.unescape(shown) == printable(name)
    assert "<" not in shown
    assert node("arm", name).count("/") == 2


def test_names_make_nodes_of_their_own():
    names = [*HOSTILE_NAMES, "a", "a/b", "a%2Fb", "a%252Fb", "a\n", "a\\n", "a\udc80", ""]
    assert len({node(name) for name in names}) == len(names)
    assert printable("a\nb\x1b[31m\udcff") == r"a\nb\x1b[31m\udcff"
    assert as_html("one\ntwo") == "one<br>two"


def test_all_text_of_a_page_is_plain(tmp_path):
    link, tip, joint = HOSTILE_NAMES[:3]
    cell = small_cell(tmp_path, HOSTILE_NAMES[1], upper=link, lower=tip, elbow=joint)
    cell.notes.append(HOSTILE_NAMES[0])
    with site(cell) as running, Guest(running.address) as guest:
        guest.wait_for("ReplayDoneMessage")
    kinds = {message["type"] for message in guest.received}
    assert "GuiMarkdownMessage" not in kinds
    texts = [m["props"]["content"] for m in guest.received if m["type"] == "GuiHtmlMessage"]
    texts += [m["updates"]["content"] for m in guest.received if "content" in m.get("updates", ())]
    for text in texts:
        assert re.fullmatch(r'(<div style="[^"<>]*">[^<>]*(<br>[^<>]*)*</div>)?', text)
    together = html.unescape("".join(texts))
    assert HOSTILE_NAMES[1] in together
    assert f"- arm.base in arm.{tip}" in together


def test_a_saved_page_says_that_it_has_no_sliders_and_shows_names_as_they_are(tmp_path):
    link, tip, joint = HOSTILE_NAMES[1], HOSTILE_NAMES[6], HOSTILE_NAMES[2]
    cell = small_cell(tmp_path, HOSTILE_NAMES[6], upper=link, lower=tip, elbow=joint)
    cell.notes.append(HOSTILE_NAMES[0])
    text = save_html(cell, tmp_path / "cell.html").read_text()
    assert f"<p>{NO_SLIDERS}</p>" in text
    assert f"<title>{html.escape(HOSTILE_NAMES[6])}</title>" in text
    assert 'http-equiv="Content-Security-Policy"' in text
    for name in HOSTILE_NAMES[:7]:
        assert f"{name}<" not in text
        assert f".{name}" not in text
    assert text.count("<iframe") == 0
    assert f"arm.base in arm.{html.escape(tip)}, " in text
