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
from collections.abc import Callable, Iterable, Iterator
from urllib.parse import unquote

from robots.common.errors import AssetError
from robots.urdf.numbers import shown

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
    roots = _roots(folder, exists)
    allowed = [
        path
        for path, package in _candidates(reference, urdf, exists)
        if _is_below(path, folder, roots) or (package and _inside(path, package))
    ]
    if not allowed:
        raise AssetError(
            f"{urdf} refers to {shown(reference)}, which leads out of its folder and its package"
            " (the folder around it with a package.xml); files elsewhere are not opened: copy it"
            " beside the URDF"
        )
    return next((path for path in allowed if exists(path)), allowed[0])


def is_allowed(path: str, folder: str, exists: Exists) -> bool:
    """Tell whether a URDF may refer to a path, whatever the reference looked like.

    Args:
        path: Normalised path.
        folder: Folder of the URDF, absolute or relative to its package.
        exists: Whether a path exists.
    """
    return _is_below(path, folder, _roots(folder, exists))


def _is_below(path: str, folder: str, roots: Iterable[str]) -> bool:
    if not posixpath.isabs(folder):
        return not (posixpath.isabs(path) or path == ".." or path.startswith("../"))
    if any(_inside(path, root) for root in roots):
        return True
    around = posixpath.dirname(folder)
    return _inside(path, around) and _is_mesh_folder(posixpath.relpath(path, around))


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


def _roots(folder: str, exists: Exists) -> list[str]:
    """Return the folders in which files may lie that a URDF refers to; none by a relative one."""
    if not posixpath.isabs(folder):
        return []
    roots = [folder, _local_copy()]
    if posixpath.basename(folder).lower() in URDF_FOLDERS:
        roots.append(posixpath.dirname(folder))
    for parent in (folder, *_parents(folder)):
        if any(exists(posixpath.join(parent, mark)) for mark in PACKAGE_MARKS):
            return [*roots, parent]
    return roots


def _local_copy() -> str:
    from robots.assets.store import default_root

    return default_root().as_posix()


def _is_mesh_folder(path: str) -> bool:
    return any(part.lower() in MESH_FOLDERS for part in path.split("/")[:-1])


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
