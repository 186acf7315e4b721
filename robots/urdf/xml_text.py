"""Reads XML that may come from anyone: in any encoding, without entities, of bounded depth."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

from robots.common.errors import AssetError

MAX_DEPTH = 100  # elements inside one another; the deepest Collada meshes have about 20


class _RefusedError(Exception):
    """Why a text is refused that is XML all the same."""


class _Builder(ElementTree.TreeBuilder):
    """Builds a tree, and stops where a document type begins: entities are declared in one."""

    def __init__(self) -> None:
        super().__init__()
        self._depth = 0

    def doctype(self, *_: Any) -> None:
        raise _RefusedError("declares XML entities; {kind} has no use for them")

    def start(self, tag: Any, attrs: Any, /) -> Any:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise _RefusedError(f"nests elements deeper than {MAX_DEPTH} levels")
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> ElementTree.Element:
        self._depth -= 1
        return super().end(tag)


def parse_xml(xml: bytes, file: str, kind: str) -> ElementTree.Element:
    """Return the root element of an XML file.

    Args:
        xml: The file's contents, in any encoding that they declare.
        file: Its path, for messages.
        kind: What it should be, for messages, such as ``"a URDF"``.

    Raises:
        AssetError: If it is no XML, has a document type, which is where entities are declared,
            or nests elements deeper than `MAX_DEPTH`.
    """
    try:
        return ElementTree.fromstring(xml, ElementTree.XMLParser(target=_Builder()))
    except _RefusedError as error:
        raise AssetError(f"{file} {str(error).format(kind=kind)}") from None
    except (ElementTree.ParseError, LookupError, ValueError) as error:  # unknown encodings
        raise AssetError(f"{file} is not {kind}: {error}") from None
