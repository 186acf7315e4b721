"""Manifests and records of anything at all: refused in words, or read such that nothing escapes."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from robots import AssetError
from robots.assets.manifest import LARGEST_FILE, AssetPackage, Manifest, load_manifest
from robots.assets.store import AssetStore

PANDA = load_manifest().package("maniskill_panda")
PACKAGE = AssetPackage(PANDA.origin, PANDA.files[:3], ("panda_pinch.urdf",))
GOOD = json.loads(Manifest({PACKAGE.origin.name: PACKAGE}).to_json())
FIRST = PACKAGE.files[0].path

TEXT = st.text(st.characters(), max_size=12) | st.sampled_from(
    ["", ".", "..", "/", "../x", "a/../b", "~", "C:\\x", "a\0b", "mani_skill==3.0.1", "0" * 64]
)
NUMBER = st.integers() | st.floats() | st.sampled_from([10**400, -(10**400), 2**63])
ANYTHING = st.recursive(
    st.none() | st.booleans() | NUMBER | TEXT,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXT, inner, max_size=3),
    max_leaves=8,
)
PLACES = [
    ("packages",),
    ("packages", PACKAGE.origin.name),
    *(("packages", PACKAGE.origin.name, key) for key in GOOD["packages"][PACKAGE.origin.name]),
    ("packages", PACKAGE.origin.name, "files", FIRST),
    *(
        ("packages", PACKAGE.origin.name, "files", FIRST, key)
        for key in ("bytes", "sha256", "physics", "pictures")
    ),
]
QUICK = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@st.composite
def damaged(draw: st.DrawFn) -> Any:
    """A good manifest in which one or two values are exchanged, left out, or called otherwise."""
    value = copy.deepcopy(GOOD)
    for place in draw(st.lists(st.sampled_from(PLACES), min_size=1, max_size=2)):
        inner = value
        for key in place[:-1]:
            inner = inner.get(key) if isinstance(inner, dict) else None
        if isinstance(inner, dict):
            before = inner.pop(place[-1], None)
            how = draw(st.sampled_from(["exchange", "leave out", "rename"]))
            if how != "leave out":
                key = draw(TEXT) if how == "rename" else place[-1]
                inner[key] = before if how == "rename" else draw(ANYTHING)
    return value


def read(text: str) -> None:
    """Read a manifest, which is refused in words or stays inside the local copy."""
    try:
        manifest = Manifest.from_json(text)
    except AssetError as error:
        message = str(error)
    else:
        expect_inside(manifest)
        return
    assert len(message.encode()) < 2000


def expect_inside(manifest: Manifest) -> None:
    """Assert that nothing of a manifest leaves the local copy."""
    root = Path("/srv/robot_files")
    for package in manifest.packages.values():
        for file in package.files:
            path = root / file.origin.name / file.path
            assert Path(path.as_posix()).resolve().is_relative_to(root)
            assert path.resolve() != root
            assert 0 <= file.limit(trust=False) <= LARGEST_FILE
    assert Manifest.from_json(manifest.to_json()) == manifest


@QUICK
@given(damaged())
def test_a_damaged_manifest_is_refused_or_stays_inside(value):
    read(json.dumps(value))


@QUICK
@given(ANYTHING.map(json.dumps) | st.text() | st.integers(1, 10**5).map(lambda n: "[" * n))
def test_a_manifest_of_anything_is_refused(text):
    read(text)


@QUICK
@given(
    ANYTHING.map(json.dumps).map(str.encode)
    | st.binary(max_size=60)
    | st.dictionaries(
        TEXT,
        ANYTHING
        | st.fixed_dictionaries({"source": TEXT, "sha256": TEXT, "trusted": st.booleans()}),
        max_size=4,
    )
    .map(json.dumps)
    .map(str.encode)
)
def test_a_record_of_anything_is_read(tmp_path, data):
    path = tmp_path / "fetched.json"
    path.write_bytes(data)
    record = AssetStore(tmp_path).record()
    path.write_text(json.dumps(record))
    assert AssetStore(tmp_path).record() == record
