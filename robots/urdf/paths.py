"""Which files a URDF may refer to, and where they are.

A URDF may refer to files in

- its own folder and below,
- the package it is part of: the nearest folder around it with a ``package.xml`` or ``.git``, or
  one that a ``package://NAME`` names,
- the folder around its own if that is called ``urdf`` or the like, else the folders called
  ``meshes`` there,
- the local copy of robot files, which are checked against the manifest.

Everything else is refused before it is opened. Paths are compared as they are written: a link
inside these folders may lead anywhere, as those of Hugging Face's cache and of a workspace built
with ``colcon build --symlink-install`` do.
"""

from __future__ import annotations

import posixpath
from collections.abc import Callable, Iterator
from urllib.parse import unquote

from robot_layouts.core.errors import AssetError
from robot_layouts.core.paths import default_root
from robot_layouts.core.quoting import shown

Exists = Callable[[str], bool]

PACKAGE_MARKS = ("package.xml", ".git/HEAD", ".git")
URDF_FOLDERS = ("urdf", "urdfs", "xacro")
MESH_FOLDERS = ("mesh", "meshes")


def resolve(reference: str, urdf: str, exists: Exists) -> str:
    """Return the path of a file that a URDF refers to, with forward slashes.

    A reference is relative to the URDF's folder, or absolute, or a ``file://``. ``package://name/
    rest`` is read as ``name/rest`` below that folder, or as ``rest`` there, or as ``name/rest``
    below a folder around it, whichever ``exists``.

    Args:
        reference: As it stands in the URDF.
        urdf: The URDF, absolute or relative to its package.
        exists: Whether a path exists.

    Raises:
        AssetError: If it is no path, or leads out of the folders that the URDF may refer to.
    """
    folder = posixpath.dirname(urdf)
    first = ""
    for path, package in _candidates(reference, urdf, exists):
        if is_allowed(path, folder, exists) or (package and _inside(path, package)):
            if exists(path):
                return path
            first = first or path
    if not first:
        raise AssetError(
            f"{urdf} refers to {shown(reference)}, which leads out of its folder and its package"
            " (the folder around it with a package.xml); files elsewhere are not opened: copy it"
            " beside the URDF"
        )
    return first


def is_allowed(path: str, folder: str, exists: Exists) -> bool:
    """Tell whether a URDF may refer to a path, whatever the reference looked like.

    Args:
        path: Normalised path.
        folder: Folder of the URDF, absolute or relative to its package.
        exists: Whether a path exists.
    """
    if not posixpath.isabs(folder):
        return not (posixpath.isabs(path) or path == ".." or path.startswith("../"))
    if _inside(path, folder) or any(_inside(path, root) for root in _roots(folder, exists)):
        return True
    around = posixpath.dirname(folder)
    inner = posixpath.relpath(path, around).split("/")[:-1]
    return _inside(path, around) and any(part.lower() in MESH_FOLDERS for part in inner)


def _candidates(reference: str, urdf: str, exists: Exists) -> Iterator[tuple[str, str]]:
    """Yield the paths that may be meant, each with the package that it is in, if it names one."""
    folder = posixpath.dirname(urdf)
    scheme, separator, rest = reference.partition("://")
    if not separator:
        yield posixpath.normpath(posixpath.join(folder, reference)), ""
    elif scheme == "file":
        yield posixpath.normpath(_local(rest, reference, urdf)), ""
    elif scheme == "package":
        name, _, inside = rest.partition("/")
        yield posixpath.normpath(posixpath.join(folder, rest.lstrip("/"))), ""
        yield posixpath.normpath(posixpath.join(folder, inside.lstrip("/"))), ""
        for parent in _parents(folder) if name not in ("", ".", "..") else ():
            package = posixpath.join(parent, name)
            known = _inside(f"{folder}/", package) or exists(f"{package}/package.xml")
            yield posixpath.normpath(posixpath.join(parent, rest)), package if known else ""
    else:
        raise AssetError(
            f"{urdf} refers to {shown(reference)}; only paths, package:// and file:// are read"
        )


def _local(path: str, reference: str, urdf: str) -> str:
    """Return the path of a ``file://``, without the name of this machine if it has one."""
    path = unquote(path.removeprefix("localhost") if path.startswith("localhost/") else path)
    if not path.startswith("/"):
        raise AssetError(f"{urdf} refers to {shown(reference)}; file:// takes an absolute path")
    return path


def _roots(folder: str, exists: Exists) -> Iterator[str]:
    """Yield the folders besides its own in which files may lie that a URDF refers to."""
    yield default_root().as_posix()
    if posixpath.basename(folder).lower() in URDF_FOLDERS:
        yield posixpath.dirname(folder)
    for parent in (folder, *_parents(folder)):
        if any([exists(posixpath.join(parent, mark)) for mark in PACKAGE_MARKS]):
            yield parent
            return


def _inside(path: str, root: str) -> bool:
    """Tell whether a path is below a folder; nothing counts as below the root of a disk."""
    return bool(root.strip("/")) and path.startswith(root.rstrip("/") + "/")


def _parents(folder: str) -> list[str]:
    """Return the folders around an absolute folder, nearest first; none of a relative one."""
    found: list[str] = []
    while posixpath.isabs(folder) and posixpath.dirname(folder) != folder:
        folder = posixpath.dirname(folder)
        found.append(folder)
    return found
