"""URDFs that are put together from others."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, indent, tostring

from robot_layouts.core.bounds import expect_unit
from robot_layouts.core.errors import DescriptorError, UnknownNameError, UnwritableFileError
from robot_layouts.core.paths import default_root
from robot_layouts.core.schema import check
from robot_layouts.core.writing import written_whole
from robots.descriptor import IDENTITY, Quaternion, UrdfSource, Vector3
from robots.urdf.model import UrdfModel
from robots.urdf.paths import resolve
from robots.urdf.reading import model_of
from robots.urdf.summary import root_of
from robots.urdf.text import joint_element, origin_at

URDF = "assembled.urdf"


@dataclass(frozen=True)
class UrdfPart:
    """A URDF, and where its root link is fixed.

    Attributes:
        urdf: Where it comes from.
        link: Link of what is there already that carries it.
        position: Of its root in that link's frame (m).
        quaternion: How its root is turned there, wxyz.
        prefix: Put before the names of its links, joints and materials.
        root: Link that is fixed, of which only what it carries is taken over; the whole if empty.
    """

    urdf: UrdfSource
    link: str
    position: Vector3 = (0.0, 0.0, 0.0)
    quaternion: Quaternion = IDENTITY
    prefix: str = ""
    root: str = ""

    def __post_init__(self) -> None:
        """Refuse an invalid pose."""
        what = f"what is fixed to {self.link!r}"
        position = check(self.position, Vector3, f"{what}: position", DescriptorError)
        quaternion = check(self.quaternion, Quaternion, f"{what}: quaternion", DescriptorError)
        expect_unit(f"{what}: quaternion", quaternion, DescriptorError)
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "quaternion", quaternion)


@dataclass(frozen=True)
class AssembledUrdf:
    """A URDF made of others when it is located; making one touches nothing.

    Attributes:
        body: What carries the rest; keeps its names.
        parts: What is fixed to it, in this order; a part may be fixed to an earlier one.
        without: Links that are cut off the body, with all that they carry.
    """

    body: UrdfSource
    parts: tuple[UrdfPart, ...] = ()
    without: tuple[str, ...] = ()

    def locate(self, *, pictures: bool = False) -> Path:
        """Return the path of the URDF, put together from the parts as they are now.

        It lies in a folder of the local copy of robot files that is named by its contents, beside
        links to the folders of its meshes.

        Args:
            pictures: Whether the visual meshes are needed too.

        Raises:
            AssetError: If the files of a part cannot be found or are invalid.
            UnknownNameError: If a link that carries a part, or is cut off, does not exist.
            DescriptorError: If two parts have a link or joint of the same name, or nothing is left.
            UnwritableFileError: If the folder cannot be written.
        """
        assembly = _Assembly(pictures=pictures)
        assembly.take(self.body, without=self.without)
        for part in self.parts:
            assembly.fix(part)
        return assembly.written()


class _Assembly:
    """A robot that grows part by part."""

    def __init__(self, *, pictures: bool) -> None:
        self._pictures = pictures
        self._robot = Element("robot", name="assembled")
        self._names: dict[str, set[str]] = {"link": set(), "joint": set()}
        self._folders: dict[str, str] = {}  # of meshes: path → name of the link to it

    def take(
        self, source: UrdfSource, prefix: str = "", root: str = "", without: Sequence[str] = ()
    ) -> str:
        """Take a URDF over, or what one link of it carries, and return the new name of its root."""
        path = source.locate(pictures=self._pictures)
        model = model_of(path)
        root = root or model.root
        wanted = carried_by(model, [root]) - carried_by(model, without)
        if root not in wanted:
            raise DescriptorError(f"nothing is left without {root!r}, which carries the rest")
        for element in root_of(path):
            if not _belongs(element, wanted, root):
                continue
            for visual in [] if self._pictures else element.findall("visual"):
                element.remove(visual)
            rename(element, lambda name: prefix + name, lambda name: self._file(name, path))
            self._expect_new(element, path)
            self._robot.append(element)
        return prefix + root

    def fix(self, part: UrdfPart) -> None:
        """Take a part over and fix its root to a link."""
        if part.link not in self._names["link"]:
            raise UnknownNameError("link to fix something to", part.link, self._names["link"])
        root = self.take(part.urdf, part.prefix, part.root)
        origin = origin_at(part.position, part.quaternion)
        mount = joint_element(f"{root}_mount", "fixed", part.link, root, origin)
        self._expect_new(mount, Path(root))
        self._robot.append(mount)

    def written(self) -> Path:
        """Write the URDF, unless it is there, and return its path."""
        indent(self._robot)
        xml = tostring(self._robot, encoding="utf-8", xml_declaration=True)
        links = sorted((name, folder) for folder, name in self._folders.items())
        digest = hashlib.sha256(repr((xml, links)).encode()).hexdigest()[:16]
        folder = default_root() / "assembled" / digest
        if not (folder / URDF).is_file():
            write_folder(folder, {URDF: xml}, dict(links))
        return folder / URDF

    def _file(self, reference: str, urdf: Path) -> str:
        path = os.path.abspath(resolve(reference, urdf.as_posix(), os.path.isfile))
        folder, file = os.path.split(path)
        name = self._folders.setdefault(folder, f"meshes/{len(self._folders)}")
        return f"{name}/{file}"

    def _expect_new(self, element: Element, path: Path) -> None:
        names, name = self._names.get(element.tag), element.get("name", "")
        if names is None:
            return
        if name in names:
            raise DescriptorError(
                f"{path} has a {element.tag} {name!r}, and so has what it is joined with; a prefix"
                " tells them apart"
            )
        names.add(name)


def carried_by(model: UrdfModel, links: Sequence[str]) -> frozenset[str]:
    """Return links and all that they carry.

    Raises:
        UnknownNameError: If there is no such link.
    """
    for link in links:
        if link not in model.links:
            raise UnknownNameError("link of the URDF", link, model.links)
    found = set(links)
    for joint in model.ordered:  # each after the one that carries its parent
        if joint.parent in found:
            found.add(joint.child)
    return frozenset(found)


def _belongs(element: Element, links: frozenset[str], root: str) -> bool:
    """Tell whether an element is a material, one of some links, or a joint that carries one."""
    child = element.find("child")
    if element.tag == "joint" and child is not None:
        return child.get("link") in links - {root}
    return element.tag == "material" or (element.tag == "link" and element.get("name") in links)


def rename(element: Element, name: Callable[[str], str], file: Callable[[str], str]) -> None:
    """Give a link, joint or material, and what it refers to, other names."""
    names = [(element, "name"), *((part, "name") for part in element.iter("material"))]
    names += [(part, "link") for part in element if part.tag in ("parent", "child")]
    names += [(part, "joint") for part in element.iterfind("mimic")]
    for part, key in {id(part): (part, key) for part, key in names}.values():
        if old := part.get(key):
            part.set(key, name(old))
    for part in (*element.iter("mesh"), *element.iter("texture")):
        part.set("filename", file(part.get("filename", "")))


def write_folder(
    folder: Path, files: Mapping[str, bytes], links: Mapping[str, str] | None = None
) -> None:
    """Make a folder of files in the local copy, unless another process is faster.

    Args:
        folder: The folder.
        files: Contents by name.
        links: Folders that links in it lead to, by the path of the link.

    Raises:
        UnwritableFileError: If it cannot be written.
    """
    try:
        with written_whole(folder) as unfinished:
            unfinished.mkdir(parents=True)
            for name, target in (links or {}).items():
                (unfinished / name).parent.mkdir(exist_ok=True)
                (unfinished / name).symlink_to(target, target_is_directory=True)
            for name, contents in files.items():
                (unfinished / name).write_bytes(contents)
    except UnwritableFileError:
        if not all((folder / name).is_file() for name in files):
            raise
