"""Rewrites `assets_cache/manifest.json` from an installed mani_skill, when a robot is added."""

from __future__ import annotations

import argparse
import hashlib
import posixpath
import re
from importlib import metadata
from pathlib import Path

from robots.assets import scenery
from robots.assets.locator import UrdfLocator
from robots.assets.manifest import (
    CHECKOUT_CACHE,
    LARGEST_FILE,
    AssetFile,
    AssetPackage,
    Manifest,
    PackageOrigin,
)
from robots.assets.sources import find_mani_skill
from robots.common.commands import exit_code, start
from robots.common.errors import AssetError
from robots.common.files import read_regular, read_text
from robots.registry import CATALOGUE, RobotRegistry
from robots.urdf.summary import read_references

HUB_DATASET = "RoboVerseOrg/roboverse_data"
PREFIX = "maniskill_"  # package maniskill_panda is mani_skill's folder assets/robots/panda
LICENCE_FILE = "LICENSE"


def main(arguments: list[str] | None = None) -> int:
    """Write the manifest, or with ``--check`` tell whether it is up to date."""
    parser = argparse.ArgumentParser(prog="python -m robots.write_manifest", description=__doc__)
    parser.add_argument("--check", action="store_true", help="only compare; exit code 1 if stale")
    check = parser.parse_args(arguments).check
    return exit_code(lambda: _write(check=check))


def _write(*, check: bool) -> int:
    path = CHECKOUT_CACHE / "manifest.json"
    text = build_manifest(find_mani_skill()).to_json()
    if check:
        fresh = path.is_file() and read_text(path, LARGEST_FILE) == text
        print(
            f"{path} is {'up to date' if fresh else 'stale; run python -m robots.write_manifest'}"
        )
        return 0 if fresh else 1
    partial = path.with_suffix(".partial")
    try:
        partial.write_text(text, encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        raise AssetError(f"cannot write {path}: {error.strerror}") from error
    print(f"wrote {path}")
    return 0


def build_manifest(mani_skill: Path) -> Manifest:
    """Return the manifest of everything that the catalogue's URDFs need, and of the scenery.

    Args:
        mani_skill: Folder of an installed mani_skill package.

    Raises:
        AssetError: If a URDF refers to a file that mani_skill lacks.
        UnreadableFileError: If a file cannot be read.
    """
    urdfs: dict[str, set[str]] = {}
    for name in CATALOGUE:
        locator = RobotRegistry.load(name).urdf
        if isinstance(locator, UrdfLocator):
            urdfs.setdefault(locator.package, set()).add(locator.file)
    packages = {name: build_package(name, mani_skill, urdfs[name]) for name in urdfs}
    return Manifest({**packages, scenery.PACKAGE: build_scenery(mani_skill)})


def build_scenery(mani_skill: Path) -> AssetPackage:
    """Return the package of what stands around robots in pictures.

    Args:
        mani_skill: Folder of an installed mani_skill package.

    Raises:
        AssetError: If mani_skill lacks one of its files.
    """
    folder = mani_skill / scenery.MANI_SKILL_FOLDER
    origin = _origin(scenery.PACKAGE, folder, scenery.MANI_SKILL_FOLDER, "scenes")
    paths = sorted(locator.file for locator in scenery.FILES)
    return AssetPackage(origin, tuple(_asset_file(origin, folder, p, set(), set()) for p in paths))


def build_package(name: str, mani_skill: Path, urdfs: set[str]) -> AssetPackage:
    """Return one package with everything that some of its URDFs need.

    Args:
        name: ``maniskill_`` and the name of a folder in mani_skill's ``assets/robots``.
        mani_skill: Folder of an installed mani_skill package.
        urdfs: URDFs to include, relative to that folder.

    Raises:
        AssetError: If a URDF refers to a file that the folder lacks.
    """
    relative = f"assets/robots/{name.removeprefix(PREFIX)}"
    folder = mani_skill / relative
    if not (name.startswith(PREFIX) and folder.is_dir()):
        raise AssetError(f"package {name!r} has no folder {folder}; call it {PREFIX}<folder>")
    origin = _origin(name, folder, relative, "robots")
    physics: dict[str, set[str]] = {}
    pictures: dict[str, set[str]] = {}
    drawable = [_add_needs(folder, urdf, physics, pictures) for urdf in sorted(urdfs)]
    undrawable = [urdf for urdf, can in zip(sorted(urdfs), drawable, strict=True) if not can]
    files = (
        _asset_file(origin, folder, path, physics.get(path, set()), pictures.get(path, set()))
        for path in sorted({*physics, *pictures})
    )
    return AssetPackage(origin, tuple(files), tuple(undrawable))


def _origin(name: str, folder: Path, relative: str, kind: str) -> PackageOrigin:
    """Return where the files of a package come from; ``kind`` is their folder on the Hub."""
    try:
        version = metadata.version("mani_skill")
    except metadata.PackageNotFoundError:
        raise AssetError(
            f"{folder} is of no installed mani_skill, so its version is unknown"
        ) from None
    licence, terms = _licence(folder)
    return PackageOrigin(
        name=name,
        mani_skill=relative,
        hub_dataset=HUB_DATASET,
        hub_folder=f"{kind}/{name}",
        wheel=f"mani_skill=={version}",
        licence=licence,
        licence_note=f"{kind.removesuffix('s')} files of mani_skill {version}, {terms}",
    )


def _licence(folder: Path) -> tuple[str, str]:
    """Return the short name and terms of a folder's own licence, or else of mani_skill's assets."""
    own = folder / LICENCE_FILE
    if not own.is_file():
        return (
            "CC BY-NC 4.0",
            "Creative Commons Attribution-NonCommercial 4.0: name the authors, no commercial use",
        )
    beginning = " ".join(read_text(own, LARGEST_FILE).split()[:20])  # after a copyright line
    if "Apache License Version 2.0," in beginning:
        return "Apache-2.0", "Apache License 2.0: keep the licence file with the files"
    raise AssetError(f"{own} is a licence this command does not know; tell it in write_manifest.py")


def _add_needs(
    folder: Path, urdf: str, physics: dict[str, set[str]], pictures: dict[str, set[str]]
) -> bool:
    """Note what a URDF needs, and return whether all that its pictures need is there."""
    references = read_references(
        read_regular(folder / urdf, LARGEST_FILE),
        urdf,
        exists=lambda path: (folder / path).is_file(),
    )
    beside = [urdf.removesuffix(".urdf") + ".srdf", LICENCE_FILE]
    optional = [path for path in beside if (folder / path).is_file()]
    for path in (urdf, *optional, *references.collision):
        physics.setdefault(path, set()).add(urdf)
    visual = [*references.visual]
    visual += [texture for mesh in references.visual for texture in _textures(folder, mesh)]
    if not all((folder / path).is_file() for path in visual):
        return False
    for path in visual:
        pictures.setdefault(path, set()).add(urdf)
    return True


def _textures(folder: Path, mesh: str) -> list[str]:
    """Return the images that a Collada mesh names."""
    if not mesh.lower().endswith(".dae") or not (folder / mesh).is_file():
        return []
    text = read_regular(folder / mesh, LARGEST_FILE).decode(errors="replace")
    images = re.findall(r"<init_from>([^<>]+\.(?:png|jpe?g|tga))</init_from>", text, re.IGNORECASE)
    beside = posixpath.dirname(mesh)
    return sorted({posixpath.normpath(posixpath.join(beside, image)) for image in images})


def _asset_file(
    origin: PackageOrigin, folder: Path, path: str, physics: set[str], pictures: set[str]
) -> AssetFile:
    if path.startswith("../") or not (folder / path).is_file():
        urdfs = ", ".join(sorted(physics | pictures)) or origin.name
        raise AssetError(f"{urdfs} refers to {path}, which is not a file inside {folder}")
    data = read_regular(folder / path, LARGEST_FILE)
    return AssetFile(
        origin,
        path,
        len(data),
        hashlib.sha256(data).hexdigest(),
        tuple(sorted(physics)),
        tuple(sorted(pictures)),
    )


if __name__ == "__main__":
    start(main)
