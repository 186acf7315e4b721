"""Damaged records of what was fetched."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from robots.assets.store import AssetStore, FileState
from tests.faults.fault import GOES_ON, Fault
from tests.faults.tiny_files import (
    MESH,
    another_copy,
    deadline,
    expect_all,
    fetch,
    fill,
)

AREA = "fetching"

NUMBERS: dict[str, Any] = {"0": 0, "-1": -1, "2.5": 2.5, "NaN": float("nan"), "1e309": 10**309}
TEXTS: dict[str, Any] = {"an empty text": "", "blanks": "  ", "a null character": "a\0b"}
OTHERS: dict[str, Any] = {
    "null": None,
    "true": True,
    "a list": [[]],
    "an object": {"a": 1},
    "half a character": "\ud800",
}
DAMAGED_TEXTS: dict[str, bytes] = {
    "empty": b"",
    "half": b'{"packages": {',
    "not json": b"packages: []",
    "null": b"null",
    "a list": b"[]",
    "a number": b"5",
    "a text": b'"packages"',
    "a hundred thousand levels": b"[" * 100_000,
    "closed levels": b'{"a":' * 500 + b"1" + b"}" * 500,
    "a key twice": b'{"a": {}, "a": {}}',
    "null characters": bytes(100),
    "no UTF-8": b'{"\xff": 1}',
    "UTF-16": "{}".encode("utf-16"),
    "seventeen megabytes": b" " * 17_000_000,
    "an integer of 5000 digits": b'{"a": ' + b"9" * 5000 + b"}",
}
PLACES: dict[str, Callable[[Path], object]] = {
    "a FIFO": os.mkfifo,
    "a link to itself": lambda path: path.symlink_to(path),
    "/dev/zero": lambda path: path.symlink_to("/dev/zero"),
    "a link to /etc/passwd": lambda path: path.symlink_to("/etc/passwd"),
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for what, text in DAMAGED_TEXTS.items():
        yield _of_record(what, lambda path, text=text: path.write_bytes(text))
    for what, put in PLACES.items():
        yield _of_record(f"{what} in its place", put)
    yield from _entries_of_records()


def _entries_of_records() -> Iterator[Fault]:
    right = {"source": "a friend", "sha256": MESH.sha256, "trusted": False}
    wrong = {**NUMBERS, **TEXTS, **OTHERS}
    for what, value in wrong.items():
        yield _of_record(f"an entry is {what}", _record({str(MESH): value}))
    for field in right:
        for what, value in wrong.items():
            if field == "trusted" and what == "true":
                continue
            yield _of_record(f"{field} is {what}", _record({str(MESH): {**right, field: value}}))
        less = {name: value for name, value in right.items() if name != field}
        yield _of_record(f"no {field}", _record({str(MESH): less}))
    yield _of_record("an unknown field", _record({str(MESH): {**right, "extra": 1}}))
    yield Fault(AREA, "fetched.json: trusts other bytes than are there", _other_trust, GOES_ON)


def _record(value: Any) -> Callable[[Path], object]:
    return lambda path: path.write_text(json.dumps(value))


def _of_record(what: str, put: Callable[[Path], object]) -> Fault:
    def run(folder: Path) -> str:
        store = fill(AssetStore(folder / "assets"))
        put(store.root / "fetched.json")
        with deadline():
            expect_all(store)
            store.path(MESH).write_bytes(b"damaged")
            assert store.state(MESH) is FileState.WRONG
            fetch(store, [another_copy(folder)])
        record = json.loads((store.root / "fetched.json").read_text())
        assert record[str(MESH)]["sha256"] == MESH.sha256
        return "set aside, and written anew; every file is there and right"

    return Fault(AREA, f"fetched.json: {what}", run, GOES_ON)


def _other_trust(folder: Path) -> None:
    store = fill(AssetStore(folder / "assets"))
    entry = {"source": "a friend", "sha256": "0" * 64, "trusted": True}
    _record({str(MESH): entry})(store.root / "fetched.json")
    store.path(MESH).write_bytes(b"what nobody trusts")
    assert store.state(MESH) is FileState.WRONG
    fetch(store, [another_copy(folder)])
