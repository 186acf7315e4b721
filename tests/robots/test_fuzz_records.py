"""Records of anything at all are read."""

from __future__ import annotations

import json

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from robots.assets.store import AssetStore

TEXT = st.text(st.characters(), max_size=12) | st.sampled_from(
    ["", ".", "..", "/", "../x", "a/../b", "~", "C:\\x", "a\0b", "mani_skill==3.0.1", "0" * 64]
)
NUMBER = st.integers() | st.floats() | st.sampled_from([10**400, -(10**400), 2**63])
ANYTHING = st.recursive(
    st.none() | st.booleans() | NUMBER | TEXT,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXT, inner, max_size=3),
    max_leaves=8,
)
QUICK = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


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
    (tmp_path / "fetched.json").write_bytes(data)
    record = AssetStore(tmp_path).record()
    assert all(entry["sha256"] for entry in record.values())
