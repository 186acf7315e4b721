"""Which robot files there are, in which packages' wheels, what each holds, what needs it."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib import metadata, resources
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from robot_layouts.core.errors import AssetError, UnknownNameError, UnreadableFileError
from robot_layouts.core.files import read_text
from robot_layouts.core.paths import CHECKOUT_CACHE

_LARGEST_MANIFEST = 2**24  # bytes


class SourceError(AssetError):
    """Why one source could not give every file it was asked for."""


@dataclass(frozen=True)
class IndexPackage:
    """A package on the package index whose wheel holds files of robots or objects.

    Attributes:
        name: Name on the index, and of a source on the command line.
        robots: Folder of its robots, one folder each, inside the wheel; empty if it has objects.
        prefix: What the names of packages of the manifest begin with that are its robots' folders.
        megabytes: Size of the wheel, roughly.
        hub_dataset: Hugging Face dataset that holds a copy of its files, if one does.
        mount: Folder that its URDFs believe to be in, as ``package://`` has it, if they do.
        licence: Of its objects, where their files name another one than the package does.
    """

    name: str
    robots: str
    prefix: str
    megabytes: int
    hub_dataset: str | None = None
    mount: str | None = None
    licence: str = ""


MANI_SKILL = IndexPackage(
    "mani_skill",
    robots="mani_skill/assets/robots",
    prefix="maniskill_",
    megabytes=100,
    hub_dataset="RoboVerseOrg/roboverse_data",
)
EXAMPLE_ROBOT_DATA = IndexPackage(
    "example-robot-data",
    robots="cmeel.prefix/share/example-robot-data/robots",
    prefix="example_",
    megabytes=131,
    mount="example-robot-data/robots",
)
GYMNASIUM_ROBOTICS = IndexPackage(
    "gymnasium_robotics",
    robots="",
    prefix="gymnasium_robotics_",
    megabytes=26,
    licence="Apache-2.0",  # of the kitchen
)
METAWORLD = IndexPackage("metaworld", robots="", prefix="metaworld_", megabytes=37)
PYBULLET = IndexPackage("pybullet", robots="", prefix="pybullet_", megabytes=103)
ROBOSUITE = IndexPackage("robosuite", robots="", prefix="robosuite_", megabytes=157)
OBJECT_PACKAGES = (GYMNASIUM_ROBOTICS, METAWORLD, PYBULLET, ROBOSUITE)
INDEX_PACKAGES = (MANI_SKILL, EXAMPLE_ROBOT_DATA, *OBJECT_PACKAGES)


def find_package(name: str) -> Path:
    """Return the folder that a package is installed in, without importing it.

    Args:
        name: Its name on the index.

    Raises:
        SourceError: If it is not installed.
    """
    spec = find_spec(name) if name.isidentifier() else None
    locations = list(spec.submodule_search_locations or ()) if spec is not None else []
    if locations:
        return Path(locations[0]).parent
    try:
        return Path(str(metadata.distribution(name).locate_file("")))
    except metadata.PackageNotFoundError:
        raise SourceError(f"{name} is not installed") from None


@dataclass(frozen=True)
class PackageOrigin:
    """Where the files of one package come from, and under what licence.

    Attributes:
        name: Package name, also its folder in the cache.
        folder: Its folder inside the wheel; empty for all of it.
        wheel: Requirement whose wheel holds the files.
        licence: Short name of the licence.
        licence_note: What the licence asks for, in one sentence.
        hub_dataset: Hugging Face dataset that holds a copy, if one does.
        hub_folder: Its folder inside the dataset.
        mount: Folder of the files inside the local copy's folder of the package, for URDFs that
            name the folders around them in ``package://``; None is that folder itself.
    """

    name: str
    folder: str
    wheel: str
    licence: str
    licence_note: str
    hub_dataset: str | None = None
    hub_folder: str | None = None
    mount: str | None = None

    @property
    def distribution(self) -> str:
        """Name of the package on the index whose wheel holds the files."""
        return self.wheel.partition("==")[0]


@dataclass(frozen=True)
class AssetFile:
    """One robot file, as the manifest promises it.

    Attributes:
        origin: The package it belongs to.
        path: Path inside the package, with forward slashes.
        bytes: Size (bytes).
        sha256: SHA-256 of its contents, in hex.
        physics: URDFs that cannot be simulated without it.
        pictures: URDFs that cannot be drawn without it.
    """

    origin: PackageOrigin
    path: str
    bytes: int
    sha256: str
    physics: tuple[str, ...] = ()
    pictures: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return package and path."""
        return f"{self.origin.name}/{self.path}"


@dataclass(frozen=True)
class AssetPackage:
    """The files of one package, sorted by path.

    Attributes:
        origin: Where they come from.
        files: The files.
        undrawable: URDFs some of whose visual meshes are not published; physics does not need them.
    """

    origin: PackageOrigin
    files: tuple[AssetFile, ...]
    undrawable: tuple[str, ...] = ()

    @property
    def urdfs(self) -> tuple[str, ...]:
        """Every URDF of the package, sorted."""
        return tuple(sorted({urdf for file in self.files for urdf in file.physics}))

    def needed(self, urdf: str, *, pictures: bool) -> tuple[AssetFile, ...]:
        """Return the files that a URDF needs, itself included.

        Args:
            urdf: Path of the URDF inside the package.
            pictures: Whether it will also be drawn; of one that is undrawable, physics is all
                there is.

        Raises:
            UnknownNameError: If the package has no such URDF.
        """
        if urdf not in self.urdfs:
            raise UnknownNameError(f"URDF of {self.origin.name}", urdf, self.urdfs)
        return tuple(
            file
            for file in self.files
            if urdf in file.physics or (pictures and urdf in file.pictures)
        )

    def file(self, path: str) -> AssetFile:
        """Return one file.

        Raises:
            UnknownNameError: If the package has no such file.
        """
        for file in self.files:
            if file.path == path:
                return file
        raise UnknownNameError(
            f"file of {self.origin.name}", path, [file.path for file in self.files]
        )


@dataclass(frozen=True)
class AssetManifest:
    """Every package of robot files, by name."""

    packages: Mapping[str, AssetPackage]

    def package(self, name: str) -> AssetPackage:
        """Return one package.

        Raises:
            UnknownNameError: If the manifest has no such package.
        """
        if name not in self.packages:
            raise UnknownNameError("package of robot files", name, sorted(self.packages))
        return self.packages[name]

    @classmethod
    def from_json(cls, text: str) -> AssetManifest:
        """Read what ``benchmarks.manifest`` wrote; it is ours, and a test checks what it holds.

        Raises:
            ValueError: If it is not json.
        """
        packages = json.loads(text)["packages"]
        return cls({name: _package_from_json(name, about) for name, about in packages.items()})


def manifest_path() -> Path:
    """Return the file of the manifest of this checkout, or of this installation.

    Raises:
        AssetError: If there is none.
    """
    checkout = CHECKOUT_CACHE / "manifest.json"
    installed = Path(str(resources.files("robots").joinpath("manifest.json")))
    path = checkout if os.path.lexists(checkout) or not installed.exists() else installed
    if not os.path.lexists(path):
        raise AssetError(
            f"no manifest of robot files: neither {checkout} nor {installed} exists; install"
            " robot-layouts again"
        )
    return path


@lru_cache(maxsize=1)
def load_manifest() -> AssetManifest:
    """Return the manifest of robot files.

    Raises:
        AssetError: If there is none, or it is damaged.
    """
    path = manifest_path()
    try:
        return AssetManifest.from_json(read_text(path, _LARGEST_MANIFEST))
    except UnreadableFileError as error:
        raise AssetError(f"{error}; install robot-layouts again") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise AssetError(
            f"the manifest of robot files {path} is damaged: {error}; install robot-layouts again"
        ) from error


def _package_from_json(name: str, about: dict[str, Any]) -> AssetPackage:
    files, undrawable = about.pop("files"), tuple(about.pop("undrawable", ()))
    origin = PackageOrigin(name, **about)
    listed = [
        AssetFile(
            origin,
            path,
            file["bytes"],
            file["sha256"],
            tuple(file["physics"]),
            tuple(file["pictures"]),
        )
        for path, file in sorted(files.items())
    ]
    return AssetPackage(origin, tuple(listed), undrawable)
