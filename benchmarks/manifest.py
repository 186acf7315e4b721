"""``python -m benchmarks manifest``: rewrites ``assets_cache/manifest.json`` from packages."""

from __future__ import annotations

import hashlib
import json
import os
import posixpath
import re
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from typing import Any

from objects.packaged import PACKAGED
from robot_layouts.core.errors import AssetError
from robot_layouts.core.files import read_regular, read_text
from robot_layouts.core.paths import CHECKOUT_CACHE
from robot_layouts.core.writing import write_whole
from robots.assets.locator import (
    APPLE,
    APPLE_BODY,
    ASSEMBLY,
    ASSEMBLY_BODIES,
    ASSEMBLY_LOOKS,
    BOWL,
    BOWL_BODY,
    CARDBOARD_BOX,
    CARDBOARD_BOX_LOOKS,
    GROUND_TEXTURE,
    HUMANOID_THINGS,
    KITCHEN,
    KITCHEN_COUNTER,
    SCENERY,
    TABLE,
    FileLocator,
    UrdfLocator,
)
from robots.assets.manifest import (
    INDEX_PACKAGES,
    MANI_SKILL,
    OBJECT_PACKAGES,
    AssetFile,
    AssetManifest,
    AssetPackage,
    IndexPackage,
    PackageOrigin,
    SourceError,
    find_package,
    load_manifest,
)
from robots.mjcf.reading import files_of
from robots.registry import CATALOGUE, RobotRegistry
from robots.urdf.summary import UrdfReferences, read_references

LARGEST_FILE = 2**28  # bytes
ALL_ROBOTS = "robots"  # maniskill_robots: for a URDF that uses files of several robots' folders
LICENCE_FILES = ("LICENSE", "LICENSE.txt")
README = "README.md"
TERMS = {
    "Apache-2.0": "Apache License 2.0: keep the licence file with the files",
    "BSD": "BSD licence: keep the copyright notice with the files",
    "BSD-3-Clause": "BSD 3-clause licence: keep the copyright notice with the files",
    "CC BY-NC 4.0": "Creative Commons Attribution-NonCommercial 4.0: name the authors, no"
    " commercial use",
    "CC BY-NC-SA 4.0": "Creative Commons Attribution-NonCommercial-ShareAlike 4.0: name the"
    " authors, no commercial use, and share what you change under the same terms",
    "MIT": "MIT licence: keep the copyright notice with the files",
    "Zlib": "zlib licence: do not claim to be the author, and say so where you change the files",
    "MPL-2.0": "Mozilla Public License 2.0: what you change in the files stays under it",
}
# Packages of files that belong to no robot: their folder in mani_skill's wheel, what physics needs,
# and what pictures need besides.
_Files = tuple[FileLocator, ...]
SCENES: dict[str, tuple[str, _Files, _Files]] = {
    SCENERY: ("mani_skill/utils", (), (TABLE, GROUND_TEXTURE)),
    HUMANOID_THINGS: (
        "mani_skill/envs/tasks/humanoid/assets",
        (APPLE_BODY, BOWL_BODY, CARDBOARD_BOX),
        (APPLE, BOWL, *CARDBOARD_BOX_LOOKS),
    ),
    ASSEMBLY: ("mani_skill/envs/tasks/fmb/assets", ASSEMBLY_BODIES, ASSEMBLY_LOOKS),
    KITCHEN: ("mani_skill/utils/scene_builder/kitchen_counter/assets", (KITCHEN_COUNTER,), ()),
}
ON_HUB = (SCENERY,)  # of these


def manifest(*, check: bool = False) -> int:
    """Write the manifest of robot files from installed packages, when a robot is added.

    Args:
        check: Write nothing, and exit with 1 if it is stale.

    Raises:
        RobotLayoutsError: If a package cannot be read, or the manifest not be written.
    """
    path = CHECKOUT_CACHE / "manifest.json"
    text = to_json(build_manifest())
    if check:
        fresh = path.is_file() and read_text(path, LARGEST_FILE) == text
        print(f"{path} is {'up to date' if fresh else 'stale; run python -m benchmarks manifest'}")
        return 0 if fresh else 1
    write_whole(path, text, AssetError)
    print(f"wrote {path}")
    return 0


def build_manifest() -> AssetManifest:
    """Return the manifest of what the catalogue's URDFs need, of the scenery, and of objects.

    What is of an index package that is not installed is taken from the manifest that there is.

    Raises:
        AssetError: If a URDF refers to a file that its package lacks, or a package is neither
            installed nor in the manifest.
        UnreadableFileError: If a file cannot be read.
    """
    urdfs: dict[str, set[str]] = {}
    for name in CATALOGUE:
        locator = RobotRegistry.load(name).urdf
        if isinstance(locator, UrdfLocator):
            urdfs.setdefault(locator.package, set()).add(locator.file)
    packages = {name: _build_or_keep(name, urdfs[name]) for name in urdfs}
    installed = find_package(MANI_SKILL.name)
    scenes = {name: build_scenery(installed, name) for name in SCENES}
    things = {f"{package.prefix}objects": build_objects(package) for package in OBJECT_PACKAGES}
    return AssetManifest({**packages, **scenes, **things})


def to_json(manifest: AssetManifest) -> str:
    """Return a manifest as it is kept in the repository."""
    packages = {name: _package(manifest.packages[name]) for name in sorted(manifest.packages)}
    return json.dumps({"packages": packages}, indent=1) + "\n"


def _package(package: AssetPackage) -> dict[str, Any]:
    about = vars(package.origin).items()
    origin = {key: value for key, value in about if key != "name" and value is not None}
    files = {
        file.path: {
            "bytes": file.bytes,
            "sha256": file.sha256,
            "physics": list(file.physics),
            "pictures": list(file.pictures),
        }
        for file in sorted(package.files, key=lambda file: file.path)
    }
    undrawable = {"undrawable": list(package.undrawable)} if package.undrawable else {}
    return {**origin, **undrawable, "files": files}


def _build_or_keep(name: str, urdfs: set[str]) -> AssetPackage:
    package = _index_package(name)
    try:
        installed = find_package(package.name)
    except SourceError as error:
        if package is MANI_SKILL or name not in load_manifest().packages:
            raise
        kept = load_manifest().package(name)
        if set(kept.urdfs) != urdfs:
            raise AssetError(f"{name} has other URDFs than the manifest, and {error}") from error
        return kept
    return build_package(name, installed, urdfs)


def build_scenery(installed: Path, name: str) -> AssetPackage:
    """Return a package of what stands around robots, or is handled by them.

    Args:
        installed: Folder that mani_skill is installed in.
        name: One of `SCENES`.

    Raises:
        AssetError: If mani_skill lacks one of its files.
    """
    inside, bodies, looks = SCENES[name]
    folder = installed / inside
    origin = _origin(MANI_SKILL, name, inside, "scene", _licence(folder))
    if name not in ON_HUB:
        origin = replace(origin, hub_dataset=None, hub_folder=None)
    physics, pictures = ({locator.file for locator in own} for own in (bodies, looks))
    files = (
        _asset_file(origin, folder, path, {path} & physics, {path} & pictures)
        for path in sorted(physics | pictures)
    )
    return AssetPackage(origin, tuple(files))


def build_objects(package: IndexPackage) -> AssetPackage:
    """Return the files of a package's objects; those of the manifest, if it is not installed.

    Args:
        package: The package.

    Raises:
        AssetError: If it is installed, and lacks one of the files.
    """
    name = f"{package.prefix}objects"
    try:
        installed = find_package(package.name)
    except SourceError:
        return load_manifest().package(name)
    notice = next(
        path.as_posix()
        for path in metadata.files(package.name) or ()
        if path.name in LICENCE_FILES and ".dist-info" in path.parts[0]
    )
    named = _named_licence(read_text(installed / notice, LARGEST_FILE), readme=False)
    licence = package.licence or named
    origin = _origin(package, name, "", "object", (licence, TERMS[licence], notice))
    needs: dict[str, set[str]] = {}
    for thing in PACKAGED.values():
        for number in range(thing.members) if thing.package == name else ():
            file = thing.file.format(number)
            for path in (file, notice, *_referred(installed, file)):
                needs.setdefault(path, set()).add(file)
    files = (
        _asset_file(origin, installed, path, needed, set())
        for path, needed in sorted(needs.items())
    )
    return AssetPackage(origin, tuple(files))


def _referred(folder: Path, file: str) -> list[str]:
    """Return what an MJCF refers to; a mesh is taken alone, and drawn in one colour."""
    if not file.endswith(".xml"):
        return []
    return [used.relative_to(folder).as_posix() for used in files_of(folder / file)]


def build_package(name: str, installed: Path, urdfs: set[str]) -> AssetPackage:
    """Return one package with everything that some of its URDFs need.

    Args:
        name: Prefix of an index package, as ``maniskill_``, and the name of a folder of its robots.
        installed: Folder that the index package is installed in.
        urdfs: URDFs to include, relative to that folder.

    Raises:
        AssetError: If a URDF refers to a file that the folder lacks.
    """
    package = _index_package(name)
    robot = name.removeprefix(package.prefix)
    relative = package.robots if robot == ALL_ROBOTS else f"{package.robots}/{robot}"
    folder = installed / relative
    if not folder.is_dir():
        raise AssetError(
            f"package {name!r} has no folder {folder}; call it {package.prefix}<folder>"
        )
    licence = _licence(folder)
    origin = _origin(package, name, relative, "robot", licence)
    if robot == ALL_ROBOTS:
        origin = replace(origin, hub_dataset=None, hub_folder=None)
    if package.mount:
        origin = replace(origin, mount=f"{package.mount}/{robot}")
    physics: dict[str, set[str]] = {}
    pictures: dict[str, set[str]] = {}
    drawable = [_add_needs(folder, urdf, licence[2], physics, pictures) for urdf in sorted(urdfs)]
    undrawable = [urdf for urdf, can in zip(sorted(urdfs), drawable, strict=True) if not can]
    files = (
        _asset_file(origin, folder, path, physics.get(path, set()), pictures.get(path, set()))
        for path in sorted({*physics, *pictures})
    )
    return AssetPackage(origin, tuple(files), tuple(undrawable))


def _index_package(name: str) -> IndexPackage:
    packages = [package for package in INDEX_PACKAGES if package.robots]
    for package in packages:
        if name.startswith(package.prefix):
            return package
    choices = " or ".join(f"{package.prefix}<folder>" for package in packages)
    raise AssetError(f"package {name!r} is of no package on the index; call it {choices}")


def _origin(
    package: IndexPackage, name: str, folder: str, kind: str, licence: tuple[str, str, str]
) -> PackageOrigin:
    """Return where the files of a package come from; ``kind`` tells their folder on the Hub."""
    try:
        version = metadata.version(package.name)
    except metadata.PackageNotFoundError:
        raise AssetError(
            f"{folder} is of no installed {package.name}, so its version is unknown"
        ) from None
    return PackageOrigin(
        name=name,
        folder=folder,
        wheel=f"{package.name}=={version}",
        licence=licence[0],
        licence_note=f"{kind} files of {package.name} {version}, {licence[1]}",
        hub_dataset=package.hub_dataset,
        hub_folder=f"{kind}s/{name}" if package.hub_dataset else None,
    )


def _licence(folder: Path) -> tuple[str, str, str]:
    """Return short name and terms of a folder's licence, and the file that says so, if one does.

    A folder of mani_skill's that says nothing has the licence of mani_skill's assets.
    """
    for file in (*LICENCE_FILES, README):
        if (folder / file).is_file():
            name = _named_licence(read_text(folder / file, LARGEST_FILE), readme=file == README)
            if name in TERMS:
                return name, TERMS[name], file
            if file != README or name:
                raise AssetError(
                    f"{folder / file} is a licence this command does not know; tell it in"
                    " benchmarks/manifest.py"
                )
    if "mani_skill" in folder.parts:
        return "CC BY-NC 4.0", TERMS["CC BY-NC 4.0"], ""
    raise AssetError(f"{folder} names no licence; its files may not be fetched")


def _named_licence(text: str, *, readme: bool) -> str:
    if readme:
        found = re.search(r"^license: *(\S+)|\b(CC BY[A-Z-]* [\d.]+) license", text, re.MULTILINE)
        return (found[1] or found[2]) if found else ""
    if "Apache License Version 2.0," in " ".join(text.split()[:20]):  # after a copyright line
        return "Apache-2.0"
    if "Permission is hereby granted, free of charge" in text:
        return "MIT"
    if "origin of this software must not be misrepresented" in text:
        return "Zlib"
    return "BSD" if "Redistribution and use in source and binary forms" in text else ""


def _add_needs(
    folder: Path,
    urdf: str,
    licence_file: str,
    physics: dict[str, set[str]],
    pictures: dict[str, set[str]],
) -> bool:
    """Note what a URDF needs, and return whether all that its pictures need is there."""
    references = _references(folder, urdf)
    srdf = urdf.removesuffix(".urdf") + ".srdf"
    optional = [path for path in (srdf, licence_file) if (folder / path).is_file()]
    for path in (urdf, *optional, *references.collision):
        physics.setdefault(path, set()).add(urdf)
    visual = [*references.visual]
    visual += [texture for mesh in references.visual for texture in _textures(folder, mesh)]
    if not all((folder / path).is_file() for path in visual):
        return False
    for path in visual:
        pictures.setdefault(path, set()).add(urdf)
    return True


def _references(folder: Path, urdf: str) -> UrdfReferences:
    """Return the files a URDF refers to, relative to a folder."""
    xml = read_regular(folder / urdf, LARGEST_FILE)
    if b"package://" not in xml:
        return read_references(xml, urdf, exists=lambda path: (folder / path).is_file())
    found = read_references(xml, (folder / urdf).as_posix(), exists=os.path.isfile)
    collision, visual = (
        tuple(posixpath.relpath(path, folder.as_posix()) for path in paths)
        for paths in (found.collision, found.visual)
    )
    return UrdfReferences(collision, visual)


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
