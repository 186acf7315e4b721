"""Pages: requests of whoever does not have the address that was printed."""

from __future__ import annotations

from collections.abc import Iterator

from tests.faults.fault import GOES_ON, Fault
from tests.faults.served_page import served, still_served
from tests.layouts.guests import WEBSOCKET, ask, talk

AREA = "pages"
EVIL = "evil.example"
OWN = "OWN"  # stands for the address and port at which the page is
TOKEN = "TOKEN"

HOSTS = (
    EVIL, f"{EVIL}:PORT", "localhost", "127.0.0.1:1", "localhost.evil.example:PORT", "0.0.0.0:PORT",
    "2130706433:PORT", "evil.example@127.0.0.1:PORT", "127.0.0.1:PORT, evil.example", "",
)  # fmt: skip
ORIGINS = (
    f"http://{EVIL}", "null", "", "http://127.0.0.1:1", "http://localhost:PORT", "file://",
    "http://127.0.0.1:PORT.evil.example", "http://127.0.0.1:PORT/",
)  # fmt: skip
QUERIES = (
    "", "?token", "?token=", "?token=x", "?Token=TOKEN", "?token=TOKENx", "?token=TOKEN&token=x",
    "?token=%00TOKEN", "?token[]=TOKEN", "?token=%ff%fe", "?token=" + "A" * 4000,
)  # fmt: skip
PATHS = (
    "/index.html", "/../../../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/..%5c..%5cetc", "//",
    "//evil.example/", "/\x00", "/%00", "/favicon.ico", "*", "http://evil.example/",
    "/" + "a/" * 2000,
)  # fmt: skip
RAW = {
    "zeros": b"\0" * 4000,
    "a request without version": b"GET /\r\n\r\n",
    "a thousand headers": b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 1000 + b"\r\n",
    "a TLS handshake": bytes.fromhex("16030100c8010000c40303") + b"\x11" * 200,
    "nothing": b"",
    "a header that begins another request": b"GET / HTTP/1.1\r\nHost: x\n\nGET /\r\n\r\n",
}
VERBS = ("POST", "HEAD", "PUT", "DELETE", "OPTIONS", "CONNECT", "TRACE", "get")


def faults() -> Iterator[Fault]:
    """Go through the requests."""
    for kind in ("page", "websocket"):
        for host in HOSTS:
            yield _request(kind, f"Host {host!r}", {"Host": host})
        for origin in ORIGINS:
            yield _request(kind, f"Origin {origin!r}", {"Origin": origin})
        for query in QUERIES:
            yield _request(kind, f"the query {query[:30]!r}", {}, f"/{query}")
        for path in PATHS:
            yield _request(kind, f"the path {path[:30]!r}", {}, f"{path}?token={TOKEN}")
        for name in ("Host", "Origin"):
            yield _request(kind, f"{name} given twice", {name: OWN, f"{name} ": EVIL})
    for verb in VERBS:
        yield _request("page", f"the method {verb}", {}, verb=verb)
    for what, sent in RAW.items():
        what = f"a stranger sends {what}"
        yield Fault(AREA, what, lambda _, sent=sent: _garbage(sent), GOES_ON)


def _request(
    kind: str,
    what: str,
    headers: dict[str, str],
    path: str = f"/?token={TOKEN}",
    verb: str = "GET",
) -> Fault:
    what = f"a request for the {kind} with {what}"
    return Fault(AREA, what, lambda _: _ask(kind, headers, path, verb), GOES_ON)


def _ask(kind: str, headers: dict[str, str], path: str, verb: str) -> str:
    """Send a request in which only one thing is wrong, and look that it is answered by nothing."""
    site = served()
    own = f"127.0.0.1:{site.port}"
    pairs = {"Host": own} | ({"Origin": f"http://{own}", **WEBSOCKET} if kind != "page" else {})
    for name, text in headers.items():
        text = f"http://{own}" if text == OWN and name == "Origin" else text.replace(OWN, own)
        pairs[name] = text.replace("PORT", str(site.port))
    lines = [(name.strip(), text) for name, text in pairs.items()]
    status, answer = ask(site.port, lines, path.replace(TOKEN, site.token), verb)
    assert status in (0, 400, 403, 404), f"answered by {status}"
    assert len(answer) < 1500
    assert b"Viser" not in answer
    still_served()
    return f"refused: {status}" if status else "the connection is closed"


def _garbage(sent: bytes) -> str:
    status, answer = talk(served().port, sent, ends=True)
    assert status in (0, 400, 403), f"answered by {status}"
    assert b"Viser" not in answer
    still_served()
    return f"refused: {status}" if status else "the connection is closed"
