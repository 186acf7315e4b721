"""Reads mesh files that may come from anyone, before and for any program that draws or cooks them.

SAPIEN says only in its log that it cannot read a mesh, and leaves the shape out. So each mesh is
read here first, by trimesh, for whoever uses it: physics, checks and pictures refuse the same
files for the same reasons.
"""

from __future__ import annotations

import json
import os
import posixpath
import re
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any
from urllib.parse import unquote

from robots.common.errors import AssetError, MissingPackageError, UnreadableFileError
from robots.common.files import parse_json, read_regular
from robots.urdf.paths import is_allowed
from robots.urdf.ply_files import check_ply
from robots.urdf.xml_text import parse_xml

ENDINGS = (".stl", ".obj", ".dae", ".glb", ".gltf", ".ply")
MAX_MESH_BYTES = 256 << 20
LARGEST = 1e4  # m; of a coordinate
SMALLEST = 1e-6  # m; how thick a body is
MAX_ELEMENTS = 50_000_000  # that a header may announce: vertices, indices, …

# A line of an OBJ that begins like a face, and is no list of three or more corners.
_WRONG_FACE = re.compile(
    rb"(?m)^[ \t]*f(?![\w.])(?!(?:[ \t]+-?\d+(?:/-?\d*){0,2}){3,}[ \t\r]*(?:#.*)?$).*"
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
        MissingPackageError: If trimesh or pycollada is not installed.
    """
    ending = _ending(path, where)
    trimesh = _reader(ending)
    contents = _read(path, where)
    beside: Any = _SideFiles(path, posixpath.dirname(urdf or path), where)
    beside.collect(ending, contents)
    try:
        stream = trimesh.util.wrap_as_stream(contents)
        scene = trimesh.load_scene(stream, file_type=ending[1:], resolver=beside, **options)
        broken = [_problem(mesh) for mesh in scene.geometry.values()]
    except Exception as error:  # a reader of many formats, which raises whatever it meets
        raise AssetError(f"{where}: cannot read the mesh {path}: {_line(error)}") from error
    if any(broken):
        raise AssetError(f"{where}: the mesh {path} has {next(filter(None, broken))}")
    return scene


def _problem(mesh: Any) -> str:
    """Return what is wrong with a trimesh that no reader noticed; SAPIEN crashes with some."""
    import numpy as np

    if not np.isfinite(mesh.vertices).all():
        return "corners that are not finite"
    faces = np.asarray(getattr(mesh, "faces", ()))
    if faces.size and not (0 <= faces.min() and faces.max() < len(mesh.vertices)):
        return f"faces between more than its {len(mesh.vertices)} corners"
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
        MissingPackageError: If trimesh or pycollada is not installed.
    """
    import numpy as np

    scene = load_scene(path, where, urdf, process=False)
    try:
        mesh = scene.to_mesh()
        corners = np.asarray(mesh.vertices, float).reshape(-1, 3) * scale
    except Exception as error:  # what the reader left behind may be anything
        raise AssetError(f"{where}: cannot read the mesh {path}: {_line(error)}") from error
    if len(corners) == 0 or len(mesh.faces) == 0:
        raise AssetError(f"{where}: the mesh {path} is empty")
    expect_near(corners, path, where)
    if not has_volume(corners):
        raise _NoVolumeError(
            f"{where}: the mesh {path} is a collision shape without a volume: all its corners lie"
            " in one plane"
        )
    return corners


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
        MissingPackageError: If trimesh or pycollada is not installed.
    """
    try:
        status = os.stat(path)
    except OSError:
        return _has_body(path, (), tuple(scale), where, urdf)
    identity = (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns)
    return _has_body(path, identity, tuple(scale), where, urdf)


@lru_cache(maxsize=4096)
def _has_body(
    path: str, identity: tuple[int, ...], scale: tuple[float, ...], where: str, urdf: str
) -> bool:
    try:
        read_corners(path, scale, where, urdf)
    except _NoVolumeError:
        return False
    return True


def has_volume(corners: Floats) -> bool:
    """Tell whether corners, (n, 3) (m), are `SMALLEST` or more thick where they are thinnest."""
    import numpy as np

    if len(corners) < 4:
        return False
    spread = corners - corners.mean(axis=0)
    _, directions = np.linalg.eigh(spread.T @ spread)
    return bool(np.ptp(spread @ directions[:, 0]) >= SMALLEST)


def _reader(ending: str) -> Any:
    """Return the package that reads meshes, once it can read those of an ending."""
    try:
        import trimesh

        if ending == ".dae":
            import collada  # noqa: F401  # pyright: ignore[reportUnusedImport]
    except ImportError as error:
        raise MissingPackageError(
            "reading meshes needs trimesh and pycollada: pip install trimesh pycollada"
        ) from error
    return trimesh


def _ending(path: str, where: str) -> str:
    ending = posixpath.splitext(path)[1].lower()
    if ending not in ENDINGS:
        raise AssetError(
            f"{where}: the mesh {path} ends in {ending or 'nothing'}; meshes end in"
            f" {', '.join(ENDINGS)}"
        )
    return ending


def _read(path: str, where: str) -> bytes:
    try:
        return read_regular(path, MAX_MESH_BYTES)
    except UnreadableFileError as error:
        raise AssetError(f"{where}: {error}") from error


class _SideFiles:
    """What a mesh's reader may open besides the mesh: a resolver for trimesh, filled beforehand."""

    def __init__(self, path: str, folder: str, where: str) -> None:
        self.file_name = posixpath.basename(path)  # trimesh calls meshes so that have no name
        self._path, self._folder, self._where = path, folder, where
        self._contents: dict[str, bytes] = {}

    def collect(self, ending: str, contents: bytes) -> None:
        """Read every file that a file names, and that those name."""
        try:
            names = list(_SCANS[ending](contents))
        except (ValueError, KeyError, TypeError, AttributeError) as error:  # json of other types
            reason = _line(error)
            raise AssetError(
                f"{self._where}: cannot read the mesh {self._path}: {reason}"
            ) from error
        for name in names:
            for variant in dict.fromkeys(_variants(name)):
                self._add(name, variant)

    def get(self, name: str) -> bytes:
        """Return the contents of a file; trimesh takes the error for a file that is missing."""
        if name not in self._contents:
            raise FileNotFoundError(name)
        return self._contents[name]

    def __getitem__(self, name: str) -> bytes:
        return self.get(name)

    def _add(self, name: str, variant: str) -> None:
        path = posixpath.normpath(posixpath.join(posixpath.dirname(self._path), variant))
        if "\0" in path or not os.path.lexists(path):
            return  # as good as a file without it; paths on its author's disk are common
        if not is_allowed(path, self._folder, os.path.isfile):
            raise AssetError(
                f"{self._where}: the mesh {self._path} refers to {name!r}, which leads out of the"
                f" folders that a robot's files may refer to; such files are not opened"
            )
        if name in self._contents and variant in self._contents:
            return
        contents = _read(path, self._where)
        for key in (name, variant):
            self._contents.setdefault(key, contents)
        if path.lower().endswith(".mtl"):
            self.collect(".mtl", contents)


def _variants(name: str) -> Iterator[str]:
    """Yield the paths that a reader may take a reference for."""
    for text in (name, name.strip().strip("\"'"), unquote(name.strip())):
        plain = text.removeprefix("file://")
        yield from (plain, plain.replace("\\", "/"))
    yield posixpath.basename(name.strip().replace("\\", "/"))  # its author's disk is not here


def _in_obj(contents: bytes) -> Iterator[str]:
    if wrong := _WRONG_FACE.search(contents.replace(b"\\\n", b" ").replace(b"\\\r\n", b" ")):
        raise ValueError(f"it has the face {wrong[0][:60].decode('utf-8', 'replace')!r}")
    for match in re.finditer(rb"mtllib[ \t]+([^\r\n]+)", contents):
        line = match[1].decode("utf-8", "replace")
        yield from (line, line.strip(), *line.split())


def _in_mtl(contents: bytes) -> Iterator[str]:
    keys = rb"(?im)^[ \t]*(?:map_\w+|bump|disp|decal|refl|norm|map_bump)[ \t]+([^\r\n]+)"
    for match in re.finditer(keys, contents):
        line = match[1].decode("utf-8", "replace").strip()
        yield from (line, line.split()[-1]) if line else ()


def _in_ply(contents: bytes) -> Iterator[str]:
    header = contents[: contents.find(b"end_header") + 1 or 4096]
    for count in re.findall(rb"(?m)^element[ \t]+\w+[ \t]+(\d{1,20})", header):
        _expect_possible(int(count), len(contents))
    check_ply(contents)
    for match in re.finditer(rb"(?im)^comment[ \t]+TextureFile[ \t]+([^\r\n]+)", header):
        yield match[1].decode("utf-8", "replace").strip()


def _in_stl(contents: bytes) -> Iterator[str]:
    faces = int.from_bytes(contents[80:84], "little")
    expected = 84 + 50 * faces
    is_text = contents.lstrip()[:5].lower() == b"solid" and b"facet" in contents
    if len(contents) != expected and not is_text:
        raise ValueError(f"{faces} faces need {expected} bytes; it has {len(contents)}")
    return iter(())


def _in_dae(contents: bytes) -> Iterator[str]:
    try:
        root = parse_xml(contents, "it", "Collada")
    except AssetError as error:
        raise ValueError(str(error)) from error
    for element in root.iter():
        tag = element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""
        if tag in ("init_from", "ref") and element.text:
            yield element.text.strip()
        for key in ("url", "source", "href"):
            value = element.get(key, "")
            if value and not value.startswith("#"):
                yield value.partition("#")[0]


def _in_glb(contents: bytes) -> Iterator[str]:
    if len(contents) < 20:
        raise ValueError("it is too short")
    magic, _, length, size, kind = struct.unpack_from("<4sIII4s", contents)
    if magic != b"glTF" or kind != b"JSON" or length > len(contents) or 20 + size > length:
        raise ValueError("its header does not fit what follows")
    yield from _in_gltf(contents[20 : 20 + size])


def _in_gltf(contents: bytes) -> Iterator[str]:
    tree = parse_json(contents.decode("utf-8").rstrip("\0 "))
    if not isinstance(tree, dict):
        raise ValueError("its json is no object")
    for part in ("accessors", "bufferViews", "buffers", "images"):
        for entry in tree.get(part, []):
            for key in ("count", "byteLength", "byteOffset", "byteStride"):
                _expect_possible(entry.get(key, 0), MAX_ELEMENTS)
            uri = entry.get("uri", "")
            if uri and not uri.startswith("data:"):
                yield uri
    children = [child for node in tree.get("nodes", []) for child in node.get("children", [])]
    starts = [node for scene in tree.get("scenes", []) for node in scene.get("nodes", [])]
    if len({*children, *starts}) < len(children) + len(starts):
        raise ValueError("its nodes are no tree")


def _expect_possible(count: Any, limit: int) -> None:
    if not isinstance(count, int) or not 0 <= count <= limit:
        raise ValueError(f"it announces {json.dumps(count)} elements")


def _line(error: Exception) -> str:
    """Return an error's message on one line of bounded length."""
    text = " ".join(str(error).split())
    if " " not in text:  # the name of a key alone, or nothing
        text = f"{type(error).__name__} {text}".rstrip()
    return text if len(text) <= 200 else f"{text[:200]}…"


# What each kind of file names; a ValueError says why one is broken.
_SCANS: Mapping[str, Callable[[bytes], Iterator[str]]] = {
    ".stl": _in_stl,
    ".obj": _in_obj,
    ".mtl": _in_mtl,
    ".ply": _in_ply,
    ".dae": _in_dae,
    ".glb": _in_glb,
    ".gltf": _in_gltf,
}
