"""Damaged manifests, and damaged records of what was fetched."""

from __future__ import annotations

import copy
import json
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from robots import AssetError
from robots.assets import manifest
from robots.assets.manifest import AssetPackage, Manifest, load_manifest
from robots.assets.store import AssetStore, FileState
from tests.faults.fault import GOES_ON, Fault
from tests.faults.tiny_files import (
    FILES,
    MESH,
    ORIGIN,
    another_copy,
    deadline,
    expect_all,
    fetch,
    fill,
)

AREA = "fetching"

GOOD: dict[str, Any] = json.loads(
    Manifest({ORIGIN.name: AssetPackage(ORIGIN, FILES, ("no.urdf",))}).to_json()
)
PACKAGE = ("packages", ORIGIN.name)
FILE = (*PACKAGE, "files", MESH.path)

NUMBERS: dict[str, Any] = {"0": 0, "-1": -1, "2.5": 2.5, "NaN": float("nan"), "1e309": 10**309}
TEXTS: dict[str, Any] = {"an empty text": "", "blanks": "  ", "a null character": "a\0b"}
OTHERS: dict[str, Any] = {
    "null": None,
    "true": True,
    "a list": [[]],
    "an object": {"a": 1},
    "half a character": "\ud800",
}
HOSTILE_PATHS = {
    "../up": "../x.stl",
    "up in the middle": "a/../../x.stl",
    "absolute": "/etc/passwd",
    "home": "~/../x/",
    "double slash": "a//b.stl",
    "trailing slash": "a/",
    "a dot": "./a.stl",
    "backslashes": "..\\..\\x.stl",
    "a line break": "a\nb.stl",
    "an escape": "\x1b[31m.stl",
    "reversed text": "a\u202elts.b",
    "a long name": "x" * 300,
    "nothing": "",
}
# Every field, and the kinds of wrong values that are wrong for it.
FIELDS: dict[tuple[str, ...], tuple[Mapping[str, Any], ...]] = {
    ("packages",): (NUMBERS, TEXTS, OTHERS),
    PACKAGE: (NUMBERS, TEXTS, OTHERS),
    (*PACKAGE, "folder"): (NUMBERS, TEXTS, OTHERS, HOSTILE_PATHS),
    (*PACKAGE, "hub_dataset"): (NUMBERS, TEXTS, OTHERS, HOSTILE_PATHS),
    (*PACKAGE, "hub_folder"): (NUMBERS, TEXTS, OTHERS, HOSTILE_PATHS),
    (*PACKAGE, "wheel"): (
        NUMBERS,
        TEXTS,
        OTHERS,
        {"an option": "--pre", "a range": "x>=1", "an address": "x @ http://x"},
    ),
    (*PACKAGE, "licence"): (NUMBERS, TEXTS, OTHERS),
    (*PACKAGE, "licence_note"): (NUMBERS, TEXTS, OTHERS),
    (*PACKAGE, "undrawable"): (NUMBERS, TEXTS, OTHERS),
    (*PACKAGE, "files"): (NUMBERS, TEXTS, OTHERS),
    FILE: (NUMBERS, TEXTS, OTHERS),
    (*FILE, "bytes"): (
        {name: value for name, value in NUMBERS.items() if name != "0"},
        TEXTS,
        OTHERS,
        {"a number as text": "12", "a terabyte": 10**12},
    ),
    (*FILE, "sha256"): (NUMBERS, TEXTS, OTHERS, {"too short": "ab", "capitals": "A" * 64}),
    (*FILE, "physics"): (NUMBERS, TEXTS, OTHERS),
    (*FILE, "pictures"): (NUMBERS, TEXTS, OTHERS),
}
OPTIONAL = ("undrawable",)

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
    "a directory": lambda path: (path / "inside").mkdir(parents=True),
    "a link to itself": lambda path: path.symlink_to(path),
    "/dev/zero": lambda path: path.symlink_to("/dev/zero"),
    "a link to /etc/passwd": lambda path: path.symlink_to("/etc/passwd"),
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for field, kinds in FIELDS.items():
        for what, value in {k: v for kind in kinds for k, v in kind.items()}.items():
            yield _of_manifest(f"{_dotted(field)} is {what}", _with(field, value))
        if field[-1] not in OPTIONAL and field not in (PACKAGE, FILE):
            yield _of_manifest(f"no {_dotted(field)}", _without(field))
    for field in ((), PACKAGE, FILE):
        yield _of_manifest(f"an unknown field in {_dotted(field)}", _with((*field, "extra"), 1))
    for what, path in HOSTILE_PATHS.items():
        entry = GOOD["packages"][ORIGIN.name]["files"][MESH.path]
        yield _of_manifest(f"a file's path is {what}", _with((*PACKAGE, "files", path), entry))
        package = GOOD["packages"][ORIGIN.name]
        yield _of_manifest(f"a package's name is {what}", _with(("packages", path), package))
    yield _of_manifest(
        "a file in another file",
        _with(
            (*PACKAGE, "files", f"{MESH.path}/x"), GOOD["packages"][ORIGIN.name]["files"][MESH.path]
        ),
    )
    for what, text in DAMAGED_TEXTS.items():
        yield Fault(
            AREA, f"manifest: {what}", lambda f, t=text: _load(f, lambda p: p.write_bytes(t))
        )
        yield _of_record(what, lambda path, text=text: path.write_bytes(text))
    for what, put in PLACES.items():
        yield Fault(AREA, f"manifest: {what} in its place", lambda f, put=put: _load(f, put))
        if what != "a directory":  # which nobody may remove, and whose name the record has
            yield _of_record(f"{what} in its place", put)
    yield Fault(AREA, "manifest: there is none", lambda folder: _load(folder, lambda path: None))
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


def _of_manifest(what: str, value: Any) -> Fault:
    def run(folder: Path) -> None:
        _load(folder, lambda path: path.write_text(json.dumps(value)))

    return Fault(AREA, f"manifest: {what}", run)


def _load(folder: Path, put: Callable[[Path], object]) -> None:
    """Load a manifest that stands where a checkout has it."""
    assert GOOD == json.loads(Manifest.from_json(json.dumps(GOOD)).to_json())
    put(folder / "manifest.json")
    load_manifest.cache_clear()
    try:
        with (
            mock.patch.object(manifest, "CHECKOUT_CACHE", folder),
            deadline(),
            pytest.raises(AssetError, match="install robot-layouts again") as caught,
        ):
            load_manifest()
    finally:
        load_manifest.cache_clear()
    assert len(str(caught.value)) < 700, "a message that nobody reads"
    raise caught.value


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
        return "written anew; every file is there and right"

    return Fault(AREA, f"fetched.json: {what}", run, GOES_ON)


def _other_trust(folder: Path) -> None:
    store = fill(AssetStore(folder / "assets"))
    entry = {"source": "a friend", "sha256": "0" * 64, "trusted": True}
    _record({str(MESH): entry})(store.root / "fetched.json")
    store.path(MESH).write_bytes(b"what nobody trusts")
    assert store.state(MESH) is FileState.WRONG
    fetch(store, [another_copy(folder)])


def _dotted(field: tuple[str, ...]) -> str:
    short = {ORIGIN.name: "NAME", MESH.path: "PATH"}
    return ".".join(short.get(part, part) for part in field) or "itself"


def _with(field: tuple[str, ...], value: Any) -> Any:
    changed = copy.deepcopy(GOOD)
    place = changed
    for part in field[:-1]:
        place = place[part]
    place[field[-1]] = value
    return changed


def _without(field: tuple[str, ...]) -> Any:
    changed = copy.deepcopy(GOOD)
    place = changed
    for part in field[:-1]:
        place = place[part]
    del place[field[-1]]
    return changed
