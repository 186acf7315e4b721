"""Things by what a user writes on a command line: a name, a mesh file, or an MJCF."""

from __future__ import annotations

from pathlib import PurePath

from objects.descriptor import ObjectDescriptor
from objects.registry import ObjectRegistry
from robots.urdf.mesh_files import ENDINGS


def named_object(word: str, seed: int | None = None) -> ObjectDescriptor:
    """Return the thing that a word names.

    Args:
        word: A name of the registry, or the path of a mesh or an MJCF.
        seed: Draws a member of the family of that name.

    Raises:
        RobotLayoutsError: If there is no such thing, or its file can be none.
    """
    ending = PurePath(word).suffix.lower()
    if ending in ENDINGS:
        return ObjectDescriptor.from_mesh(word)
    if ending in (".xml", ".mjcf"):
        return ObjectDescriptor.from_mjcf(word)
    return ObjectRegistry.load(word, seed)
