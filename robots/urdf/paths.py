"""Which files a URDF or an MJCF may refer to, and where they are.

It may refer to files in

- its own folder and below,
- the package it is part of: the nearest folder around it with a ``package.xml`` or ``.git``; the
  Python package around it (folders with an ``__init__.py``); the folder of an installed
  distribution around it, which is one beside ``*.dist-info``,
- a package with a ``package.xml`` that a ``package://NAME`` names: in a folder around it, or deeper
  down in its workspace, which is the folder around it called ``src`` or with a ``.git``,
- the folder around its own if that is called ``urdf`` or the like, else the folders called
  ``meshes`` there,
- the folders that the user opened to it (`open_folder`),
- the local copy of robot files, which are checked against the manifest.

Everything else is refused before it is opened. Paths are compared as they are written: a link
inside these folders may lead anywhere, as those of Hugging Face's cache and of a workspace built
with ``colcon build --symlink-install`` do.
"""

from __future__ import annotations

import os
import posixpath
from collections.abc import Callable, Iterator
from contextlib import suppress
from urllib.parse import unquote

from robot_layouts.core.errors import AssetError
from robot_layouts.core.paths import default_root
from robot_layouts.core.quoting import shown

Exists = Callable[[str], bool]

PACKAGE_MARKS = ("package.xml", ".git/HEAD", ".git")
URDF_FOLDERS = ("urdf", "urdfs", "xacro")
MESH_FOLDERS = ("mesh", "meshes")
WORKSPACE = "src"  # what a workspace calls the folder of its packages
DEEPEST_PACKAGE = 3  # folders between a workspace and a package in it, that one included

_opened: dict[str, tuple[str, ...]] = {}  # by the folder of a URDF


def open_folder(urdf: str, folder: str) -> None:
    """Let what lies in a folder be read for the URDFs and MJCFs in another, in this process.

    Args:
        urdf: Absolute path of a URDF or MJCF in that other folder.
        folder: Absolute path of the folder, as the user gave it; no file may.

    Raises:
        AssetError: If it is no folder.
    """
    if not os.path.isdir(folder):
        raise AssetError(f"folder={folder!r} is no folder; it takes one that holds robot files")
    own = posixpath.dirname(urdf)
    _opened[own] = (*dict.fromkeys((*_opened.get(own, ()), posixpath.normpath(folder))),)


def opened_folders(folder: str) -> tuple[str, ...]:
    """Return the folders that were opened to the URDFs and MJCFs in a folder."""
    return _opened.get(folder, ())


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
        there = exists(path)
        if first and not there:
            continue
        if is_allowed(path, folder, exists) or (package and _inside(path, package)):
            if there:
                return path
            first = first or path
    if not first:
        raise leads_out(urdf, reference)
    return first


def leads_out(file: str, reference: str) -> AssetError:
    """Return the error of a file that refers to one which is not opened for it."""
    return AssetError(
        f"{file} refers to {shown(reference)}, which leads out of its folder and its package (the"
        " folder around it with a package.xml, .git or __init__.py); files elsewhere are not"
        " opened: copy it beside the file, or name the folder that may be read, too: folder=…"
        " (--folder DIR)"
    )


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


def parents(folder: str) -> list[str]:
    """Return the folders around an absolute folder, nearest first; none of a relative one."""
    found: list[str] = []
    while posixpath.isabs(folder) and posixpath.dirname(folder) != folder:
        folder = posixpath.dirname(folder)
        found.append(folder)
    return found


def is_workspace(folder: str, exists: Exists) -> bool:
    """Tell whether a folder holds the packages of a workspace, or is a repository."""
    name = posixpath.basename(folder)
    return name == WORKSPACE or any(exists(f"{folder}/{mark}") for mark in PACKAGE_MARKS[1:])


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
        for parent in parents(folder) if name not in ("", ".", "..") else ():
            path = posixpath.normpath(posixpath.join(parent, rest))
            yield path, _package_of(path, parent, name, folder, exists)
    else:
        raise AssetError(
            f"{urdf} refers to {shown(reference)}; only paths, package:// and file:// are read"
        )


def _package_of(path: str, parent: str, name: str, folder: str, exists: Exists) -> str:
    """Return the package below a folder that a path lies in, or nothing.

    It is that of a name in the folder, or, in a workspace, one deeper down.
    """
    package = posixpath.join(parent, name)
    if _inside(f"{folder}/", package) or exists(f"{package}/package.xml"):
        return package
    if _inside(path, parent) and exists(path) and is_workspace(parent, exists):
        for part in posixpath.relpath(path, parent).split("/")[1:DEEPEST_PACKAGE]:
            package = f"{package}/{part}"
            if exists(f"{package}/package.xml"):
                return package
    return ""


def _local(path: str, reference: str, urdf: str) -> str:
    """Return the path of a ``file://``, without the name of this machine if it has one."""
    path = unquote(path.removeprefix("localhost") if path.startswith("localhost/") else path)
    if not path.startswith("/"):
        raise AssetError(f"{urdf} refers to {shown(reference)}; file:// takes an absolute path")
    return path


def _roots(folder: str, exists: Exists) -> Iterator[str]:
    """Yield the folders besides its own in which files may lie that a URDF refers to."""
    yield default_root().as_posix()
    yield from opened_folders(folder)
    if posixpath.basename(folder).lower() in URDF_FOLDERS:
        yield posixpath.dirname(folder)
    around = (folder, *parents(folder))
    for parent in around:
        if any([exists(posixpath.join(parent, mark)) for mark in PACKAGE_MARKS]):
            yield parent
            break
    yield from _python_package(around, exists)
    for parent, site in zip(around, around[1:], strict=False):
        if _holds_distributions(site):
            yield parent
            return


def _python_package(around: tuple[str, ...], exists: Exists) -> list[str]:
    """Return the outermost folder of the Python package that the first folder is in, if any."""
    found: list[str] = []
    for parent in around:
        if exists(posixpath.join(parent, "__init__.py")):
            found = [parent]
        elif found:
            break
    return found


def _holds_distributions(folder: str) -> bool:
    """Tell whether distributions are installed in a folder, as pip does it."""
    with suppress(OSError):
        return any(name.endswith(".dist-info") for name in os.listdir(folder))
    return False


def _inside(path: str, root: str) -> bool:
    """Tell whether a path is below a folder; nothing counts as below the root of a disk."""
    return bool(root.strip("/")) and path.startswith(root.rstrip("/") + "/")
