"""Elements of a URDF under other names, and the files that they refer to by other paths."""

from __future__ import annotations

from collections.abc import Callable
from xml.etree.ElementTree import Element


def rename(element: Element, name: Callable[[str], str], file: Callable[[str], str]) -> None:
    """Give a link, joint or material, and what it refers to, other names.

    Args:
        element: An element directly below ``<robot>``; it is changed.
        name: Returns the new name of a link, joint or material.
        file: Returns the new path of a mesh or texture.
    """
    names = [(element, "name"), *((part, "name") for part in element.iter("material"))]
    names += [(part, "link") for part in element if part.tag in ("parent", "child")]
    names += [(part, "joint") for part in element.iterfind("mimic")]
    for part, key in {id(part): (part, key) for part, key in names}.values():
        if old := part.get(key):
            part.set(key, name(old))
    for part in (*element.iter("mesh"), *element.iter("texture")):
        part.set("filename", file(part.get("filename", "")))
