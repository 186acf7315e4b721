"""Repairs the XML of a URDF itself: where it begins, and its namespaces."""

from __future__ import annotations

import re
from xml.etree.ElementTree import Element

from robots.common.errors import AssetError
from robots.urdf.xml_text import parse_xml

_PREFIX = re.compile(rb"[<\s/]([A-Za-z_][\w.-]*):[A-Za-z_]")
_ROBOT = re.compile(rb"<robot(?=[\s>])")


def parse_damaged(xml: bytes, urdf: str) -> tuple[Element, list[str]]:
    """Return the root element of a URDF, and what had to be repaired to read it.

    Args:
        xml: The URDF's contents.
        urdf: Its path, for messages.

    Raises:
        AssetError: If it is no XML all the same.
    """
    repairs: list[str] = []
    if xml[:1].isspace():
        xml = xml.lstrip()
        if xml.startswith(b"<?xml"):
            repairs.append("blank lines before <?xml …?>, left out")
    try:
        root = parse_xml(xml, urdf, "a URDF")
    except AssetError as error:
        if "unbound prefix" not in str(error):
            raise
        xml, prefixes = _with_namespaces(xml)
        root = parse_xml(xml, urdf, "a URDF")
        repairs.append(f"namespaces that were not declared: {', '.join(prefixes)}")
    repairs += _without_own_namespace(root)
    return root, repairs


def _with_namespaces(xml: bytes) -> tuple[bytes, list[str]]:
    """Declare every prefix that an element has and nobody declared."""
    used = {match.decode("ascii", "replace") for match in _PREFIX.findall(xml)}
    prefixes = sorted(p for p in used - {"xml", "xmlns"} if f"xmlns:{p}=".encode() not in xml)
    declared = "".join(f' xmlns:{p}="{_address(p)}"' for p in prefixes)
    return _ROBOT.sub(lambda found: found[0] + declared.encode(), xml, count=1), prefixes


def _address(prefix: str) -> str:
    return "http://www.ros.org/wiki/xacro" if prefix == "xacro" else f"undeclared:{prefix}"


def _without_own_namespace(root: Element) -> list[str]:
    """Take the namespace of ``<robot xmlns=…>`` from all elements that have it."""
    space, closed, name = root.tag.partition("}")
    if not closed or name != "robot":
        return []
    for element in root.iter():
        element.tag = element.tag.removeprefix(f"{space}}}")
    return [f"the namespace {space[1:]!r} of <robot>, left out"]
