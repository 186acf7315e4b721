"""Damaged layout files end in a LayoutError, or in a layout that can be written again."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import HealthCheck, example, given, settings

from layouts import Layout, around_table, ring
from robots import LayoutError
from tests.faults.yaml_faults import FRAMED
from tests.mutations import damaged_bytes, damaged_text

pytestmark = pytest.mark.long

TABLE = around_table({"a": "panda", "b": "so100"}, table=(1.2, 0.8)).to_yaml()
RING = ring({"a": "panda", "b": "so100"}, radius=1.0).to_yaml()
FUZZ = settings(max_examples=3000, deadline=None, suppress_health_check=list(HealthCheck))


def read(text: str) -> str:
    """Return why a text is refused, or the layout as a table."""
    try:
        layout = Layout.from_yaml(text)
    except LayoutError as error:
        return str(error)
    assert Layout.from_yaml(layout.to_yaml()) == layout
    return str(layout)


@FUZZ
@given(damaged_text(FRAMED))
@example('"\\UFFFFFFFF"')
@example(f"%YAML 1.{'9' * 5000}\n---\na: 1")
@example("[" * 5000)
@example("? " * 5000)
@example("version: 1\nrobots: &r {a: *r}")
def test_damaged_frames(text):
    assert read(text)


@FUZZ
@given(damaged_text(TABLE))
@example(TABLE.replace("table", "a"))
def test_damaged_tables(text):
    assert read(text)


@FUZZ
@given(damaged_bytes(RING.encode()))
@example(RING.encode("utf-16"))
@example(b"\xff\xfe\0")
def test_damaged_bytes(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "damaged.yaml"
    path.write_bytes(data)
    with contextlib.suppress(LayoutError):
        layout = Layout.load(path)
        assert Layout.from_yaml(layout.to_yaml()) == layout
