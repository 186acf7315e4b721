"""Reads an MJCF: its text with what it includes, its meshes, and MuJoCo's model of them.

MuJoCo is given only what was read here: one XML text without includes, and the contents of meshes.
It opens no file. What a robot's motion does not need is left out: textures, skins, lights, sensors.
"""

from __future__ import annotations

import hashlib
import os
import posixpath
import re
import warnings
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, fromstring, tostring

import numpy as np

from robot_layouts.core.errors import AssetError, UnreadableFileError
from robot_layouts.core.files import read_regular
from robot_layouts.core.importing import optional
from robot_layouts.core.quoting import shown
from robots.urdf.mesh_files import MAX_MESH_BYTES
from robots.urdf.paths import is_allowed, leads_out
from robots.urdf.summary import MAX_URDF_BYTES
from robots.urdf.text import parse_xml

MESH_ENDINGS = (".stl", ".obj", ".msh")
MOST_FILES = 2000  # that one MJCF refers to
MOST_BYTES = 1 << 30  # of them together

# Parts of an MJCF that say nothing of links, joints and drives; some of them name files.
UNUSED = ("size", "visual", "statistic", "option", "custom", "sensor", "extension")
UNUSED_ASSETS = ("texture", "skin", "hfield")
REFUSED_ELEMENT = re.compile("Element name '(.*)', id")  # as MuJoCo's messages end
MESSAGE = 400  # characters of MuJoCo's own that an error keeps
NUMBERS = {  # MuJoCo takes "nan" for a number
    "a body": ("body_pos", "body_quat", "body_mass", "body_inertia", "body_ipos", "body_iquat"),
    "a joint": ("jnt_pos", "jnt_axis", "jnt_range", "qpos0", "dof_armature", "dof_damping"),
    "a shape": ("geom_pos", "geom_quat", "geom_size"),
    "a site": ("site_pos", "site_quat"),
}
# What makes many bodies of one, or bodies that bend.
REFUSED = {
    "replicate": "copies bodies",
    "composite": "makes a rope or cloth",
    "flexcomp": "makes a body that bends",
    "flex": "makes a body that bends",
    "attach": "attaches another model",
    "plugin": "runs a plugin of MuJoCo",
}


Model = Any
"""A ``mujoco.MjModel``, whose package need not be installed."""


@dataclass(frozen=True)
class MjcfText:
    """An MJCF as MuJoCo is given it; two are equal if they have the same contents.

    Attributes:
        name: What it calls its model, or its file's name.
        xml: Its text, without includes.
        meshes: Contents of mesh files, by the names that the text has for them.
        digest: SHA-256 over the text and the meshes, in hex.
    """

    name: str = field(compare=False)
    xml: str = field(compare=False)
    meshes: Mapping[str, bytes] = field(compare=False)
    digest: str


def read_mjcf(path: Path) -> MjcfText:
    """Read an MJCF with all that it includes and refers to.

    Args:
        path: Absolute path.

    Raises:
        AssetError: If a file of it cannot be read, is no MJCF, lies outside of its folder and its
            package, or there are too many; or if it has elements that make no robot.
    """
    return _MjcfReading(path).text()


def says_angles(text: MjcfText) -> bool:
    """Tell whether an MJCF says in which unit its angles are."""
    return any(each.get("angle") for each in fromstring(text.xml).iter("compiler"))


def in_radians(text: MjcfText) -> MjcfText:
    """Return an MJCF with its angles, which are in degrees if it does not say so, in radians."""
    root = fromstring(text.xml)
    root.insert(0, Element("compiler", angle="radian"))
    return replace(text, xml=tostring(root, encoding="unicode"))


def files_of(path: Path) -> tuple[Path, ...]:
    """Return an MJCF, and all that it includes and refers to, as `read_mjcf` reads it.

    Args:
        path: Absolute path.

    Raises:
        AssetError: As `read_mjcf` does.
    """
    reading = _MjcfReading(path)
    reading.text()
    return reading.files


class _MjcfReading:
    """One MJCF that is being read."""

    def __init__(self, path: Path) -> None:
        self._path, self._folder = path, path.parent.as_posix()
        self._files: dict[Path, int] = {}  # and their bytes
        self._meshes: dict[str, bytes] = {}
        self._named: dict[str, str] = {}  # of meshes: path -> name in the text
        self._folders: dict[int, str] = {}  # of included elements that name a mesh, by identity

    @property
    def files(self) -> tuple[Path, ...]:
        """What was read."""
        return tuple(self._files)

    def text(self) -> MjcfText:
        root = self.expanded()
        folder = _mesh_folder(root)
        for mesh in list(root.iterfind("asset/mesh")):
            self._take(mesh, folder)
        xml = tostring(root, encoding="unicode")
        digest = hashlib.sha256(xml.encode())
        for name, contents in sorted(self._meshes.items()):
            digest.update(f"{name} {hashlib.sha256(contents).hexdigest()}\n".encode())
        name = root.get("model", "").strip() or self._path.stem
        return MjcfText(name, xml, self._meshes, digest.hexdigest())

    def expanded(self) -> Element:
        """Return the root element with what it includes, and without what is not needed."""
        root = self._root(self._path, "mujoco")
        self._include(root, (self._path,))
        _drop(root, UNUSED)
        for element in root.iter():
            if element.tag in REFUSED:
                raise AssetError(
                    f"{self._path} has a <{element.tag}>, which {REFUSED[element.tag]}; only bodies"
                    " that are written out are read (MuJoCo writes them out with mj_saveLastXML)"
                )
        for asset in root.iterfind("asset"):
            _drop(asset, UNUSED_ASSETS)
        for material in root.iter("material"):
            material.attrib.pop("texture", None)
            _drop(material, ("layer",))
        return root

    def _root(self, path: Path, *kinds: str) -> Element:
        contents = self._read(path, MAX_URDF_BYTES, "the MJCF" if not self._files else "the file")
        root = parse_xml(contents, str(path), "an MJCF")
        if root.tag not in kinds:
            raise AssetError(f"{path} is not an MJCF: it holds <{root.tag}>, not <{kinds[0]}>")
        return root

    def _include(self, element: Element, chain: tuple[Path, ...]) -> None:
        """Put what is included in the place of each ``<include>``, again and again."""
        for i in reversed(range(len(element))):
            child = element[i]
            if child.tag != "include":
                self._include(child, chain)
                continue
            folders = self._folder, chain[-1].parent.as_posix()
            path = self._resolve(child.get("file", ""), *folders)
            if path in chain:
                raise AssetError(f"{self._path} includes {path} in itself")
            if len(self._files) >= MOST_FILES:
                raise AssetError(f"{self._path} refers to more than {MOST_FILES} files")
            included = self._root(path, "mujoco", "mujocoinclude")
            self._include(included, (*chain, path))
            for mesh in included.iter("mesh"):
                self._folders.setdefault(id(mesh), path.parent.as_posix())
            element[i : i + 1] = list(included)

    def _take(self, mesh: Element, folder: str) -> None:
        """Read the file of a mesh, and give it the name that MuJoCo finds it by."""
        reference = mesh.get("file")
        if reference is None:
            return
        around = self._folders.get(id(mesh), self._folder)
        path = self._resolve(
            reference, *(posixpath.join(f, folder) for f in (self._folder, around))
        )
        ending = path.suffix.lower()
        if ending not in MESH_ENDINGS:
            raise AssetError(
                f"{self._path} refers to the mesh {path.name!r}; MuJoCo reads"
                f" {', '.join(MESH_ENDINGS)}"
            )
        name = self._named.setdefault(path.as_posix(), f"{len(self._named)}{ending}")
        if name not in self._meshes:
            self._meshes[name] = self._read(path, MAX_MESH_BYTES, "the mesh")
        if "name" not in mesh.keys():  # noqa: SIM118  # which an Element's own `in` would not ask
            mesh.set("name", posixpath.splitext(posixpath.basename(reference))[0])
        mesh.set("file", name)
        mesh.attrib.pop("content_type", None)

    def _read(self, path: Path, limit: int, what: str) -> bytes:
        try:
            contents = read_regular(path, limit)
        except UnreadableFileError as error:
            raise AssetError(f"cannot read {what} {path}: {error.strerror}") from error
        self._files[path] = len(contents)
        if len(self._files) > MOST_FILES or sum(self._files.values()) > MOST_BYTES:
            raise AssetError(
                f"{self._path} refers to more than {MOST_FILES} files or {MOST_BYTES:,} bytes"
            )
        return contents

    def _resolve(self, reference: str, *folders: str) -> Path:
        """Return the file that a reference means, from the first folder in which it is there.

        These are those of the MJCF itself, and of the file that it includes.
        """
        if not reference.strip() or "\0" in reference:
            raise AssetError(f"{self._path} refers to {shown(reference)}, which is no file")
        reference = reference.replace("\\", "/")
        tried = dict.fromkeys(
            posixpath.normpath(posixpath.join(folder, reference)) for folder in folders
        )
        allowed = [path for path in tried if is_allowed(path, self._folder, os.path.exists)]
        if not allowed:
            raise leads_out(str(self._path), reference)
        return Path(next((path for path in allowed if os.path.isfile(path)), allowed[0]))


def _mesh_folder(root: Element) -> str:
    """Return the folder of meshes that an MJCF names, and have it name none to MuJoCo."""
    found = {"assetdir": "", "meshdir": ""}
    names_only = False
    for compiler in root.iterfind("compiler"):
        for key in found:
            found[key] = compiler.attrib.pop(key, found[key]).replace("\\", "/")
        compiler.attrib.pop("texturedir", None)
        names_only |= compiler.attrib.pop("strippath", "") == "true"
    if names_only:
        for mesh in root.iterfind("asset/mesh"):
            if file := mesh.get("file"):
                mesh.set("file", posixpath.basename(file.replace("\\", "/")))
    return found["meshdir"] or found["assetdir"]


def _drop(parent: Element, tags: tuple[str, ...]) -> None:
    for child in [child for child in parent if child.tag in tags]:
        parent.remove(child)


def mujoco() -> Any:
    """Return the package mujoco.

    Raises:
        MissingPackageError: If it is not installed.
    """
    return optional("mujoco", "reading an MJCF needs MuJoCo", "mjcf")


@contextmanager
def without_log() -> Generator[None]:
    """Have MuJoCo write its warnings nowhere; else it adds them to a file where it was started."""
    library = mujoco()
    library.set_mju_user_warning(lambda warning: None)  # what is wrong is an error
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        library.set_mju_user_warning(None)


def compiled(text: MjcfText, path: Path) -> tuple[Model, tuple[str, ...]]:
    """Return the model that MuJoCo makes of an MJCF, and what was repaired in it.

    Args:
        text: The MJCF.
        path: Where it lies, for messages.

    Raises:
        AssetError: If MuJoCo refuses it, or a number of it is not finite.
        MissingPackageError: If MuJoCo is not installed.
    """
    notes: dict[str, str] = {}  # by mesh
    library = mujoco()
    try:
        with without_log():
            spec = library.MjSpec.from_string(text.xml, assets=dict(text.meshes))
            model = _compile(spec, library, notes)
    except Exception as error:  # a compiler that raises whatever it meets
        reason = " ".join(str(error).split())[:MESSAGE]
        raise AssetError(f"MuJoCo cannot compile {path}: {reason}") from error
    for what, fields in NUMBERS.items():
        if not all(np.isfinite(getattr(model, field)).all() for field in fields):
            raise AssetError(f"{path} has {what} with a number that is not finite")
    return model, tuple(notes.values())


def _compile(spec: Any, library: Any, notes: dict[str, str]) -> Model:
    """Compile a spec; a mesh that is too thin for MuJoCo is made a shell, or is left out.

    Args:
        spec: What to compile; it is changed.
        library: The package mujoco.
        notes: Takes what was done, by mesh.
    """
    shell = library.mjtMeshInertia.mjMESH_INERTIA_SHELL
    while True:
        try:
            return spec.compile()
        except ValueError as error:
            named = REFUSED_ELEMENT.search(str(error))
            mesh = spec.mesh(named[1]) if named else None
            geoms = [geom for geom in spec.geoms if mesh and geom.meshname == mesh.name]
            if mesh and mesh.inertia != shell:
                mesh.inertia = shell
                notes[mesh.name] = f"the mesh {mesh.name!r} has no volume, so it is a shell"
            elif mesh and not any(geom.contype or geom.conaffinity for geom in geoms):
                notes[mesh.name] = f"left out: the mesh {mesh.name!r}, which is only drawn"
                for element in (*geoms, mesh):
                    spec.delete(element)
            else:
                raise


def name_of(model: Model, kind: str, index: int) -> str:
    """Return the name of an object of a model; empty if it has none.

    Args:
        model: The model.
        kind: Such as ``"body"`` or ``"joint"``.
        index: Its index.
    """
    library = mujoco()
    return library.mj_id2name(model, getattr(library.mjtObj, f"mjOBJ_{kind.upper()}"), index) or ""
