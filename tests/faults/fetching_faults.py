"""Servers that fail or lie while robot files are fetched: the Hub, and an index with the wheel."""

from __future__ import annotations

import io
import os
import shutil
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from unittest import mock

from huggingface_hub import constants

from robots.assets import sources
from robots.assets.manifest import MANI_SKILL
from robots.assets.sources import HubSource, PackageWheel
from robots.assets.store import AssetStore
from tests.faults.fault import GOES_ON, REFUSED, Fault, sparse
from tests.faults.tiny_files import (
    CONTENTS,
    MESH,
    ORIGIN,
    another_copy,
    deadline,
    expect_all,
    fetch,
    settings,
)
from tests.robots import hub_server
from tests.robots.hub_server import COMMIT, HubServer, headers, page, redirect, status
from tests.robots.wheel_index import WHEEL, WheelIndex, build_wheel

AREA = "fetching"
TIMEOUT = 2  # s
API = "/api/datasets/"
NOBODY = "http://127.0.0.1:9/x"


def _silence(handler: hub_server.Handler, body: bytes) -> None:
    handler.rfile.read(1)  # returns when the client goes away


# What a server does to requests of a file (HEAD and GET), or to GET alone.
TO_FILES: dict[str, hub_server.Fault] = {
    "a login page": hub_server.login_page,
    "no HTTP": hub_server.nonsense,
    "a reset": hub_server.reset,
    "a redirect to itself": redirect(f"/datasets/{hub_server.DATASET}/resolve/{COMMIT}/x"),
    "a redirect to nobody": redirect(NOBODY),
    "a redirect to a file here": redirect("file:///etc/passwd"),
    "an ETag of 5000 letters": headers(ETag=f'"{"x" * 5000}"'),
    **{f"status {code}": status(code) for code in (401, 403, 404, 451)},
}
TO_BODIES: dict[str, hub_server.Fault] = {
    "other bytes of the same size": hub_server.corrupt,
    "more than it says": headers(Content_Length="5"),
    "a compression that it is not": headers(Content_Encoding="gzip"),
    "status 500": status(500),
}
TO_API: dict[str, hub_server.Fault] = {
    "a login page": hub_server.login_page,
    "nothing": _silence,
    "no HTTP": hub_server.nonsense,
    "null": page(200, "null"),
    "a commit that is a number": page(200, '{"id": "x", "sha": 5}'),
    "a hundred thousand levels": page(200, "[" * 100_000),
    "status 503": status(503),
}
ENDPOINTS = {
    "of no scheme": "huggingface.co",
    "of a file": "file:///etc",
    "of port 99999": "http://127.0.0.1:99999",
    "that does not exist": "http://no.such.host.invalid",
    "where nobody listens": "http://127.0.0.1:9",
}
REVISIONS = {
    "that leads up": "../../etc",
    "with blanks": "a b",
    "of 200,000 letters": "x" * 200_000,
    "that does not exist": "v9",
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for what, fault in TO_FILES.items():
        yield _of_hub(f"answers {what} for a file", fault, methods=("HEAD", "GET"))
    for what, fault in TO_BODIES.items():
        yield _of_hub(f"sends {what} for a file", fault)
    for what, fault in TO_API.items():
        yield _of_hub(f"answers {what} for the dataset", fault, part=API)
    what = "sends other bytes of the same size, a copy has it"
    yield _of_hub(what, hub_server.corrupt, copy=True, promise=GOES_ON)
    yield _of_hub("sends half of it once", hub_server.truncate, times=1, promise=GOES_ON)
    for what, fault in {
        "less than it says, and closes": headers(Content_Length="10000000", Connection="close"),
        "an unknown compression": headers(Content_Encoding="lzw"),
        "a weak ETag": headers(ETag='W/"abc"'),
    }.items():
        what = f"sends {what}, with the right bytes"
        yield _of_hub(what, fault, copy=True, promise=GOES_ON)
    for what, endpoint in ENDPOINTS.items():
        yield _of_hub(f"is at an HF_ENDPOINT {what}", endpoint=endpoint)
    for what, revision in REVISIONS.items():
        yield _of_hub(f"is asked for a revision {what}", revision=revision)
    for what, home in {"a file": "/etc/passwd", "in a device": "/dev/null/x"}.items():
        yield _of_hub(f"has an HF_HOME that is {what}", HF_HUB_CACHE=f"{home}/hub")
    yield _of_hub("is not asked: HF_HUB_OFFLINE=1", HF_HUB_OFFLINE=True)
    yield Fault(AREA, "Hub behind TLS that nobody has signed", _tls)
    yield Fault(
        AREA, "Hub redirects to another host that has it", partial(_elsewhere, right=True), GOES_ON
    )
    yield Fault(AREA, "Hub redirects to another host that lies", partial(_elsewhere, right=False))
    yield Fault(AREA, "the Hub's cache has a FIFO", partial(_in_hub_cache, os.mkfifo), GOES_ON)
    yield Fault(AREA, "the Hub's cache has 5 GB", partial(_in_hub_cache, sparse), GOES_ON)
    yield Fault(AREA, "the Hub's cache has other bytes", partial(_in_hub_cache, _other), GOES_ON)
    yield from _of_wheel()


def _of_hub(
    what: str,
    fault: hub_server.Fault | None = None,
    *,
    methods: tuple[str, ...] = ("GET",),
    part: str = "a.stl",
    times: int = 1000,
    copy: bool = False,
    endpoint: str | None = None,
    revision: str | None = None,
    promise: str = REFUSED,
    **constants: object,
) -> Fault:
    """Fetch from a Hub that answers some requests otherwise, or then from a copy, if asked."""

    def run(folder: Path) -> None:
        with _hub(folder, **constants) as server:
            for method in methods if fault else ():
                server.fail(method, part, fault, times)
            os.environ["HF_ENDPOINT"] = endpoint or server.endpoint
            hub = HubSource() if revision is None else HubSource(revision=revision)
            fetch(AssetStore(folder / "assets"), [hub, another_copy(folder)] if copy else [hub])

    return Fault(AREA, f"Hub {what}", run, promise)


@contextmanager
def _hub(folder: Path, **given: object) -> Iterator[HubServer]:
    """Serve the files; settings of the Hub's client are given as it keeps them."""
    files = {f"{ORIGIN.hub_folder}/{path}": data for path, data in CONTENTS.items()}
    own = {
        "HF_HUB_CACHE": str(folder / "hf_home" / "hub"),
        "HF_HUB_ETAG_TIMEOUT": TIMEOUT,
        "HF_HUB_DOWNLOAD_TIMEOUT": TIMEOUT,
    }
    with HubServer(files) as server, deadline(), settings(folder, HF_ENDPOINT=server.endpoint):
        with mock.patch.multiple(constants, **{**own, **given}):
            yield server


def _tls(folder: Path) -> None:
    with _hub(folder) as server:
        os.environ["HF_ENDPOINT"] = server.endpoint.replace("http:", "https:")
        fetch(AssetStore(folder / "assets"), [HubSource()])


def _elsewhere(folder: Path, *, right: bool) -> None:
    path = f"/datasets/{hub_server.DATASET}/resolve/{COMMIT}/{ORIGIN.hub_folder}/{MESH.path}"
    data = CONTENTS[MESH.path] if right else b"x" * MESH.bytes
    with (
        HubServer({f"{ORIGIN.hub_folder}/{MESH.path}": data}) as other,
        _hub(folder) as server,
    ):
        server.fail("GET", "a.stl", redirect(f"{other.endpoint}{path}"))
        fetch(AssetStore(folder / "assets"), [HubSource()])


def _in_hub_cache(put: Callable[[Path], object], folder: Path) -> None:
    with _hub(folder):
        store = AssetStore(folder / "assets")
        fetch(store, [HubSource()])
        (cached,) = (folder / "hf_home").rglob("snapshots/*/robots/*/meshes/a.stl")
        blob = cached.resolve()
        blob.unlink()
        put(blob)
        shutil.rmtree(store.root)
        fetch(store, [HubSource()])


def _other(path: Path) -> None:
    path.write_bytes(b"x" * MESH.bytes)


# --- the wheel ---------------------------------------------------------------------------------


def _members(**changes: bytes) -> dict[str, bytes]:
    return {f"{ORIGIN.folder}/{path}": data for path, data in {**CONTENTS, **changes}.items()}


def _of_wheel() -> Iterator[Fault]:
    for what, text in {
        "no links": "<html></html>",
        "another version": '<a href="/mani_skill-9-py3-none-any.whl">w</a>',
        "a link to a file here": f'<a href="file:///etc/{WHEEL}">{WHEEL}</a>',
        "a hash that is wrong": f'<a href="/f/{WHEEL}#sha256={"0" * 64}">{WHEEL}</a>',
    }.items():
        yield _of_index(f"index page has {what}", page=_send(200, text.encode()))
    for code in (404, 500):
        yield _of_index(f"index page answers {code}", page=_send(code, b""))
        yield _of_index(f"wheel answers {code}", wheel=_send(code, b""))
    yield _of_index("wheel is a login page", wheel=_send(200, b"<html>Room number?</html>"))
    yield _of_index("wheel is half", wheel=lambda h, body: h.send(200, body[: len(body) // 2], "x"))
    yield _of_index("wheel lacks a file", contents={"meshes/a.stl": None})
    yield _of_index("wheel has another file", contents={"meshes/a.stl": b"x" * MESH.bytes})
    yield _of_index("wheel has a bomb", contents={"meshes/a.stl": bytes(10**8)})
    yield _of_index("wheel has a wrong checksum", edit=_turn_bits)
    yield _of_index("wheel has an encrypted file", edit=_encrypt)
    yield Fault(AREA, "no pip, and no uv", _no_pip)
    yield _of_index("wheel has names that lead up", contents={"../../../x": b""}, promise=GOES_ON)


def _of_index(
    what: str,
    *,
    page: Callable[..., None] | None = None,
    wheel: Callable[..., None] | None = None,
    contents: dict[str, bytes | None] | None = None,
    edit: Callable[[bytes], bytes] = lambda archive: archive,
    promise: str = REFUSED,
) -> Fault:
    def run(folder: Path) -> None:
        members = {k: v for k, v in _members(**(contents or {})).items() if v is not None}
        with WheelIndex(edit(build_wheel(members))) as index, deadline(60):
            index.page_fault, index.wheel_fault = page, wheel
            own = {"PIP_NO_INDEX": "", **index.settings()}
            with settings(folder, **own):
                store = AssetStore(folder / "assets")
                fetch(store, [PackageWheel(MANI_SKILL)])
        expect_all(store)

    return Fault(AREA, f"wheel: {what}", run, promise)


def _send(code: int, body: bytes) -> Callable[..., None]:
    return lambda handler, _: handler.send(code, body, "text/html")


def _turn_bits(archive: bytes) -> bytes:
    with zipfile.ZipFile(io.BytesIO(archive)) as wheel:
        info = wheel.getinfo(next(iter(_members())))
        at = info.header_offset + 30 + len(info.filename) + 4
    return archive[:at] + bytes([archive[at] ^ 255]) + archive[at + 1 :]


def _encrypt(archive: bytes) -> bytes:
    """Set that flag of a member in the central directory of an archive."""
    at = archive.rindex(b"PK\x01\x02", 0, archive.rindex(next(iter(_members())).encode())) + 8
    return archive[:at] + b"\x01\x00" + archive[at + 2 :]


def _no_pip(folder: Path) -> None:
    with (
        settings(folder, PATH=""),
        mock.patch.object(sources, "find_spec", return_value=None),
    ):
        fetch(AssetStore(folder / "assets"), [PackageWheel(MANI_SKILL)])
