"""Reads mesh files that may come from anyone, before and for any program that draws or cooks them.

SAPIEN says only in its log that it cannot read a mesh, and leaves the shape out. So each mesh is
read here first, by trimesh: physics, checks and pictures refuse the same files for the same
reasons.
"""

from __future__ import annotations

import os
import posixpath
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from typing import Any
from urllib.parse import unquote

from robot_layouts.core.errors import AssetError, UnreadableFileError
from robot_layouts.core.files import read_regular
from robot_layouts.core.paths import cached
from robots.urdf.paths import is_allowed
from robots.urdf.text import parse_xml

_METHOD = b"body 1"  # to be raised when the same contents are judged otherwise
ENDINGS = (".stl", ".obj", ".dae", ".glb", ".gltf", ".ply")
MAX_MESH_BYTES = 256 << 20
LARGEST = 1e4  # m; of a coordinate
SMALLEST = 1e-6  # m; how thick a body is

# What names another file in each kind of file.
_URI = re.compile(rb"\"uri\"\s*:\s*\"((?!data:)[^\"]*)\"")
_REFERENCES: Mapping[str, re.Pattern[bytes]] = {
    ".obj": re.compile(rb"mtllib[ \t]+([^\r\n]+)"),
    ".mtl": re.compile(rb"(?im)^[ \t]*(?:map_\w+|bump|disp|decal|refl|norm)[ \t]+([^\r\n]+)"),
    ".ply": re.compile(rb"(?i)TextureFile[ \t]+([^\r\n]+)"),
    ".dae": re.compile(rb"<init_from>([^<]+)<"),
    ".glb": _URI,
    ".gltf": _URI,
}

_PLY_HEADER = re.compile(
    rb"""ply[ \t]*\r?\n
    (?:(?:comment|obj_info)[^\r\n]*\r?\n)*
    format[ \t]+(?:ascii|binary_little_endian|binary_big_endian)[ \t]+1\.0[ \t]*\r?\n
    (?:(?:(?:comment|obj_info)[^\r\n]*
        |element[ \t]+\w+[ \t]+\d+
        |property[ \t]+(?:list[ \t]+TYPE[ \t]+)?TYPE[ \t]+\w+)[ \t]*\r?\n)+
    end_header[ \t]*\r?\n""".replace(
        b"TYPE", rb"(?:u?char|u?short|u?int|float|double|u?int(?:8|16|32)|float(?:32|64))"
    ),
    re.VERBOSE,
)

Floats = Any
"""An array of float64."""


class _NoVolumeError(AssetError):
    """A mesh that is flat; one that is empty may as well be damaged."""


def load_scene(path: str, where: str, urdf: str | None = None, **options: Any) -> Any:
    """Return what a mesh file holds, as a trimesh scene.

    Args:
        path: The file.
        where: What refers to it, for messages.
        urdf: The URDF that it belongs to; None for a mesh that belongs to none, whose materials
            and textures lie below its own folder.
        **options: Passed on to trimesh.

    Raises:
        AssetError: If it is missing, no regular file, too large, of an unknown kind or broken, or
            if it refers to files that the URDF may not refer to.
    """
    import trimesh  # which takes half a second to load

    ending = posixpath.splitext(path)[1].lower()
    if ending not in ENDINGS:
        raise AssetError(
            f"{where}: the mesh {path} ends in {ending or 'nothing'}; meshes end in"
            f" {', '.join(ENDINGS)}"
        )
    contents = read_mesh(path, where)
    beside: Any = _SideFiles(path, urdf, where)
    beside.expect_allowed(ending, contents)
    try:
        if ending == ".dae":
            parse_xml(contents, "it", "Collada")
        if ending == ".ply":
            _expect_ply(contents)
        stream = trimesh.util.wrap_as_stream(contents)
        scene = trimesh.load_scene(stream, file_type=ending[1:], resolver=beside, **options)
        broken = [_problem(mesh) for mesh in scene.geometry.values()]
    except Exception as error:  # a reader of many formats, which raises whatever it meets
        raise AssetError(f"{where}: cannot read the mesh {path}: {_line(error)}") from error
    if any(broken):
        raise AssetError(f"{where}: the mesh {path} has {next(filter(None, broken))}")
    return scene


def _expect_ply(contents: bytes) -> None:
    """Refuse a header with which SAPIEN's reader crashes, though trimesh's reads on.

    Raises:
        ValueError: If it is none of PLY 1.0, or describes an element twice.
    """
    header = _PLY_HEADER.match(contents)
    elements = re.findall(rb"\nelement[ \t]+(\w+)", header[0]) if header else []
    if len(set(elements)) != len(elements) or not elements:
        raise ValueError("its header is not that of a PLY file of version 1.0")


def _problem(mesh: Any) -> str:
    """Return what is wrong with a trimesh that no reader noticed; SAPIEN crashes with some."""
    import numpy as np

    if not np.isfinite(mesh.vertices).all():
        return "corners that are not finite"
    faces = np.asarray(getattr(mesh, "faces", ()))
    if faces.size and not (0 <= faces.min() and faces.max() < len(mesh.vertices)):
        return f"faces between more than its {len(mesh.vertices)} corners"
    # trimesh takes all lists of a binary PLY file for as long as the first of them.
    for element in mesh.metadata.get("_ply_raw", {}).values():
        fields = element.get("data", ())
        for name in getattr(getattr(fields, "dtype", None), "names", None) or ():
            if fields[name].dtype.names and len(np.unique(fields[name]["f0"])) > 1:
                return "faces that contradict the length of their list"
    return ""


def read_corners(path: str, scale: Sequence[float], where: str, urdf: str) -> Floats:
    """Return the corners of a mesh that collides, (n, 3) (m).

    Args:
        path: The file.
        scale: Factors along x, y and z.
        where: What refers to it, for messages.
        urdf: The URDF that it belongs to.

    Raises:
        AssetError: If it cannot be read (see `load_scene`), is empty or flat, or has corners that
            are not finite or more than `LARGEST` away.
    """
    corners, _ = _read_surface(path, scale, where, urdf)
    if not has_volume(corners):
        raise _NoVolumeError(
            f"{where}: the mesh {path} is a collision shape without a volume: all its corners lie"
            " in one plane"
        )
    return corners


def _read_surface(
    path: str, scale: Sequence[float], where: str, urdf: str
) -> tuple[Floats, Floats]:
    """Return corners, (n, 3) (m), and triangles, (t, 3), of a mesh, as its file numbers them."""
    import numpy as np

    scene = load_scene(path, where, urdf, process=False)
    try:
        mesh = scene.to_mesh()
        corners = np.asarray(mesh.vertices, float).reshape(-1, 3) * scale
        triangles = np.asarray(mesh.faces, np.intp).reshape(-1, 3)
    except Exception as error:  # what the reader left behind may be anything
        raise AssetError(f"{where}: cannot read the mesh {path}: {_line(error)}") from error
    if len(corners) == 0 or len(triangles) == 0:
        raise AssetError(f"{where}: the mesh {path} is empty, or damaged")
    expect_near(corners, path, where)
    return corners, triangles


def read_parts(path: str, scale: Sequence[float], where: str) -> tuple[Floats, ...]:
    """Return the corners of each part of a mesh that hangs together, (n, 3) each (m).

    What hangs together shares corners as the file numbers them: parts that only touch are told
    apart. A file is read once by a process, and again if it changes.

    Args:
        path: The file.
        scale: Factors along x, y and z.
        where: What refers to it, for messages.

    Raises:
        AssetError: If it cannot be read (see `read_corners`), or one of its parts is flat.
    """
    return _read_parts(path, _identity(path), tuple(scale), where)


@lru_cache(maxsize=256)
def _read_parts(
    path: str, identity: tuple[int, ...], scale: tuple[float, ...], where: str
) -> tuple[Floats, ...]:
    import numpy as np

    corners, triangles = _read_surface(path, scale, where, path)
    lowest, before = np.arange(len(corners)), None  # corner that each one hangs together with
    while not np.array_equal(lowest, before):
        before = lowest.copy()
        np.minimum.at(lowest, triangles, lowest[triangles].min(axis=1, keepdims=True))
    used = np.unique(triangles)
    parts = [corners[used[lowest[used] == first]] for first in np.unique(lowest[used])]
    flat = sum(not has_volume(part) for part in parts)
    if flat:
        raise AssetError(
            f"{where}: {flat} of the {len(parts)} parts of the mesh {path} have no volume; the"
            " triangles of a part share corners in the file (in a GLB or STL they often do not;"
            " save it as PLY)"
        )
    for part in parts:
        part.setflags(write=False)
    return tuple(parts)


def expect_near(corners: Floats, path: str, where: str) -> None:
    """Refuse corners of a mesh that are no robot's, such as those of other units.

    Args:
        corners: (n, 3) (m).
        path: The mesh's file.
        where: What refers to it, for messages.

    Raises:
        AssetError: If any is more than `LARGEST` away, or not finite.
    """
    import numpy as np

    farthest = float(np.abs(corners).max(initial=0.0))
    if not farthest <= LARGEST:
        raise AssetError(
            f"{where}: the mesh {path} has corners {farthest:.3g} m away; robots end at"
            f" {LARGEST:g} m (are its lengths in other units? then give it a scale)"
        )


def refers_to_shapes(path: str) -> bool:
    """Return whether a mesh may have its shape in other files, which its own only names."""
    return posixpath.splitext(path)[1].lower() in (".glb", ".gltf")


def has_body(path: str, scale: Sequence[float], where: str, urdf: str) -> bool:
    """Tell whether a mesh that collides can be touched: whether it is not flat.

    A file is read once by a process, and again if it changes: reading takes trimesh milliseconds,
    and leaves garbage.

    Args:
        path: The file.
        scale: Factors along x, y and z.
        where: What refers to it, for messages.
        urdf: The URDF that it belongs to.

    Raises:
        AssetError: If it cannot be read; see `read_corners`.
    """
    return _has_body(path, _identity(path), tuple(scale), where, urdf)


def _identity(path: str) -> tuple[int, ...]:
    """Return what changes with a file; nothing if there is none."""
    try:
        status = os.stat(path)
    except OSError:
        return ()
    return (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=4096)
def _has_body(
    path: str, identity: tuple[int, ...], scale: tuple[float, ...], where: str, urdf: str
) -> bool:
    def read() -> bool:
        try:
            read_corners(path, scale, where, urdf)
        except _NoVolumeError:
            return False
        return True

    if posixpath.splitext(path)[1].lower() in _REFERENCES:
        return read()  # what it refers to counts, too
    return cached(path, (_METHOD, repr(scale).encode(), read_mesh(path, where)), read)


def has_volume(corners: Floats) -> bool:
    """Tell whether corners, (n, 3) (m), are `SMALLEST` or more thick where they are thinnest."""
    import numpy as np

    if len(corners) < 4:
        return False
    spread = corners - corners.mean(axis=0)
    _, directions = np.linalg.eigh(spread.T @ spread)
    return bool(np.ptp(spread @ directions[:, 0]) >= SMALLEST)


def binary_stl(triangles: Floats) -> bytes:
    """Return triangles, (n, 3, 3) (m), as a binary STL; the normal of one without area is 0."""
    import numpy as np

    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    records = np.zeros(len(triangles), kind)
    records["corners"] = triangles
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    records["normal"] = normals / np.where(lengths > 0, lengths, 1.0)
    return bytes(80) + struct.pack("<I", len(triangles)) + records.tobytes()


def read_mesh(path: str, where: str) -> bytes:
    """Return the contents of a mesh's file.

    Args:
        path: The file.
        where: What refers to it, for messages.

    Raises:
        AssetError: If it cannot be read, or is larger than `MAX_MESH_BYTES`.
    """
    try:
        return read_regular(path, MAX_MESH_BYTES)
    except UnreadableFileError as error:
        raise AssetError(f"{where}: {error}") from error


class _SideFiles:
    """What a mesh's reader may open besides the mesh, as a resolver for trimesh."""

    def __init__(self, path: str, urdf: str | None, where: str) -> None:
        self.file_name = posixpath.basename(path)  # trimesh calls meshes so that have no name
        self._path, self._where = path, where
        # A mesh of another package than the URDF's has its materials there.
        self._folders = {posixpath.dirname(file) for file in (urdf, path) if file}

    def expect_allowed(self, ending: str, contents: bytes) -> None:
        """Refuse a file that names others which no program may open.

        One that is missing is as good as none: paths on its author's disk are common.
        """
        pattern = _REFERENCES.get(ending)
        for name in pattern.findall(contents) if pattern else ():
            with suppress(FileNotFoundError):
                named = self.get(name.decode("utf-8", "replace").strip())
                if ending == ".obj":
                    self.expect_allowed(".mtl", named)

    def get(self, name: str) -> bytes:
        """Return the contents of a file.

        Raises:
            AssetError: If it may not be opened, or is no regular file.
            FileNotFoundError: If it is missing.
        """
        found = ""
        for variant in _variants(name):
            path = posixpath.normpath(posixpath.join(posixpath.dirname(self._path), variant))
            if "\0" in path or not os.path.lexists(path):
                continue
            if not any(is_allowed(path, folder, os.path.isfile) for folder in self._folders):
                raise AssetError(
                    f"{self._where}: the mesh {self._path} refers to {name!r}, which leads out of"
                    " the folders that a robot's files may refer to; such files are not opened,"
                    " unless in a folder that is named with folder=… (--folder DIR)"
                )
            found = found or path
        if not found:
            raise FileNotFoundError(name)
        return read_mesh(found, self._where)

    __getitem__ = get


def _variants(name: str) -> Iterator[str]:
    """Yield the paths that a reader may take a reference for."""
    for text in (name, name.strip("\"'"), unquote(name), *name.split()):
        yield from (text, text.removeprefix("file://").replace("\\", "/"))
    yield posixpath.basename(name.replace("\\", "/"))  # its author's disk is not here


def _line(error: Exception) -> str:
    """Return an error's message on one line of bounded length."""
    text = " ".join(str(error).split())
    if " " not in text:  # the name of a key alone, or nothing
        text = f"{type(error).__name__} {text}".rstrip()
    return text if len(text) <= 200 else f"{text[:200]}…"
