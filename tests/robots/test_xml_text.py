"""XML from anyone: no entities in any encoding, no depth without end."""

from __future__ import annotations

import pytest

from robots import AssetError, LocalUrdf
from robots.urdf.srdf import read_excluded_pairs
from robots.urdf.text import MAX_DEPTH, parse_xml

ENTITY = '<?xml version="1.0" encoding="{}"?><!DOCTYPE robot [<!ENTITY a "b">]><robot name="&a;"/>'


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-8-sig", "iso-8859-1", "cp1252"])
def test_entities_are_refused_in_every_encoding(encoding):
    with pytest.raises(AssetError, match="toy declares XML entities; a URDF has no use for them"):
        parse_xml(ENTITY.format(encoding).encode(encoding), "toy", "a URDF")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "iso-8859-1"])
def test_every_encoding_is_read(encoding):
    text = f'<?xml version="1.0" encoding="{encoding}"?><robot name="é"/>'
    assert parse_xml(text.encode(encoding), "toy", "a URDF").get("name") == "é"


@pytest.mark.parametrize(
    "xml", [b"", b"<a", b"\xff\xfe", b'<?xml version="1.0" encoding="x"?><a/>']
)
def test_what_is_no_xml_is_refused(xml):
    with pytest.raises(AssetError, match="toy is not a URDF: "):
        parse_xml(xml, "toy", "a URDF")


def test_depth_is_bounded():
    assert parse_xml(b"<a>" * MAX_DEPTH + b"</a>" * MAX_DEPTH, "toy", "a URDF").tag == "a"
    with pytest.raises(AssetError, match=f"nests elements deeper than {MAX_DEPTH} levels"):
        parse_xml(b"<a>" * 100_000 + b"</a>" * 100_000, "toy", "a URDF")


@pytest.mark.parametrize("ending", ["urdf", "srdf"])
def test_a_urdf_and_an_srdf_are_read_alike(ending, tmp_path):
    path = tmp_path / f"toy.{ending}"
    path.write_bytes(ENTITY.format("utf-16").encode("utf-16"))
    read = LocalUrdf(path).locate if ending == "urdf" else lambda: read_excluded_pairs(path)
    with pytest.raises(AssetError, match="declares XML entities"):
        read()
