"""Where URDFs of robots lie: folders, and packages that are installed."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from robots import AssetError, MissingPackageError, UnknownNameError

# Package on the index -> folder of its wheel, behind which its robots lie.
PACKAGES: Mapping[str, str] = {
    "example-robot-data": "share/example-robot-data/robots",
    "mani_skill": "mani_skill/assets/robots",
    "pybullet": "pybullet_data",
}

_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_COLLISION = re.compile(rb"<collision.*?</collision>", re.DOTALL)
_MESH = re.compile(rb"""<mesh\s[^>]*filename\s*=\s*["']([^"']+)["']""")
_MOVING = re.compile(rb"""<joint\s[^>]*type\s*=\s*["'](?!fixed["'])""")


@dataclass(frozen=True)
class Robot:
    """A URDF of a source.

    Attributes:
        source: Name of the source.
        path: Of the URDF, relative to the source's folder, with forward slashes.
        folder: The source's folder on this machine.
    """

    source: str
    path: str
    folder: Path

    @property
    def key(self) -> str:
        """What it is called in the record."""
        return f"{self.source}/{self.path}"

    def missing_meshes(self) -> list[str]:
        """Return the meshes that physics needs and that the source has nowhere.

        Whatever a reference starts with, a file is looked for by its name and that of its folder.
        """
        there = _tails(self.folder)
        meshes = [
            mesh.decode(errors="replace")
            for collision in _COLLISION.findall(_COMMENT.sub(b"", self.urdf.read_bytes()))
            for mesh in _MESH.findall(collision)
        ]
        return [mesh for mesh in dict.fromkeys(meshes) if _tail(mesh) not in there]

    @property
    def urdf(self) -> Path:
        """The URDF on this machine."""
        return self.folder / self.path


def package_folder(name: str) -> Path:
    """Return the folder of an installed package in which its robots lie.

    Raises:
        UnknownNameError: If it is none of `PACKAGES`.
        MissingPackageError: If it is not installed.
    """
    if name not in PACKAGES:
        raise UnknownNameError("package of robots", name, PACKAGES)
    try:
        files = distribution(name).files or ()
    except PackageNotFoundError as error:
        raise MissingPackageError(f"{name} is not installed: pip install {name}") from error
    part = f"{PACKAGES[name]}/"
    for file in files:
        if part in file.as_posix():
            return Path(str(file.locate()).split(part)[0]) / PACKAGES[name]
    raise MissingPackageError(f"{name} holds no robots in {PACKAGES[name]}: pip install {name}")


def named_folder(text: str) -> tuple[str, Path]:
    """Return name and path of a folder given as ``NAME=PATH``, or as ``PATH`` alone.

    Raises:
        AssetError: If there is no such folder.
    """
    name, equals, path = text.partition("=")
    folder = Path(path if equals else text).absolute()
    if not folder.is_dir():
        raise AssetError(f"there is no folder {folder}")
    return (name if equals else folder.name), folder


def find_robots(folders: Iterable[tuple[str, Path]]) -> Iterator[Robot]:
    """Yield every URDF in folders that has a joint that moves, sorted by path."""
    for source, folder in folders:
        for urdf in sorted(folder.rglob("*.urdf")):
            if _MOVING.search(_COMMENT.sub(b"", urdf.read_bytes())):
                yield Robot(source, urdf.relative_to(folder).as_posix(), folder)


@lru_cache(maxsize=16)
def _tails(folder: Path) -> frozenset[str]:
    """Return name and folder's name of every file, and the name alone."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return frozenset(
        tail for file in files for tail in (f"{file.parent.name}/{file.name}", file.name)
    )


def _tail(mesh: str) -> str:
    path = mesh.split("://")[-1]
    names = [name for name in path.split("/") if name not in ("", ".", "..")]
    return "/".join(names[-2:])
