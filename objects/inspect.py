"""``robot-layouts objects list`` and ``fetch``, and what there is to know about a thing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import PurePath
from typing import Annotated

from objects.descriptor import ObjectDescriptor
from objects.joints import Joint
from objects.packaged import PACKAGED
from objects.registry import ObjectRegistry
from objects.shapes import Mesh
from robot_layouts.core.cli import Word
from robot_layouts.core.commands import print_error, printable
from robot_layouts.core.errors import UnknownNameError
from robot_layouts.core.paths import default_root
from robot_layouts.core.quoting import columns
from robots.assets.fetching import default_sources, ensure
from robots.assets.manifest import AssetFile, load_manifest
from robots.assets.store import AssetStore
from robots.fetch_assets import print_files, union
from robots.urdf.mesh_files import ENDINGS

OBJECT = Word("OBJECT", about="a name that `robot-layouts objects list` prints, a mesh, or an MJCF")
NAME = Word("OBJECT", about="a name of the second list that `robot-layouts objects list` prints")


def named_object(word: str, seed: int | None = None) -> ObjectDescriptor:
    """Return the thing that a word names.

    Args:
        word: A name of the registry, or the path of a mesh or an MJCF.
        seed: Draws a member of the family of that name.

    Raises:
        RobotLayoutsError: If there is no such thing, or its file can be none.
    """
    ending = PurePath(word).suffix.lower()
    if ending in ENDINGS:
        return ObjectDescriptor.from_mesh(word)
    if ending in (".xml", ".mjcf"):
        return ObjectDescriptor.from_mjcf(word)
    return ObjectRegistry.load(word, seed)


def list_objects() -> int:
    """List the objects: size, mass, grasps, what they are; and those of packages, with licences.

    Exit code: 0, or 1 if an object of another package cannot be loaded.
    """
    things, failures = ObjectRegistry.load_all()
    rows = [("object", "size (cm)", "mass (kg)", "grasps", "rests", "what it is")]
    for thing in things:
        long = " × ".join(f"{100 * length:.3g}" for length in thing.extent)
        rests, count = ", ".join(thing.rests), str(len(thing.grasps))
        rows.append((thing.name, long, f"{thing.mass:.2g}", count, rests, thing.about))
    print(printable("\n".join(columns(rows))))
    packages = [("made of files, which are fetched", "licence", "what it is")]
    packages += [(name, one.licence, one.about) for name, one in sorted(PACKAGED.items())]
    print(printable("\n".join(["", *columns(packages)])))
    for failure in failures:
        print_error(failure)
    return 1 if failures else 0


def report(thing: ObjectDescriptor) -> str:
    """Return everything there is to know about a thing, as text."""
    member = "" if thing.seed is None else f", the member of seed {thing.seed}"
    sections: Mapping[str, Iterable[str]] = {
        f"{thing.name}: {thing.about}{member}": [
            f"numbers from   {thing.source}",
            f"licence        {thing.licence}",
            f"mass           {thing.mass:.3g} kg, its centre at {_row(thing.centre_of_mass)} m",
            f"size           {_row(thing.extent)} m",
            *(f"{name:<15}{size:g} m" for name, size in thing.sizes.items()),
        ],
        "rests": [
            f"{name}: its origin {thing.height(name):.4g} m above the table,"
            f" quaternion wxyz {_row(turn)}"
            for name, turn in thing.rests.items()
        ],
        "points": columns(
            [
                (name, f"{_row(point.position)} m", f"wxyz {_row(point.quaternion)}")
                for name, point in thing.points.items()
            ]
        ),
        "grasps": _grasps(thing),
        "parts": _parts(thing),
        "joints": columns(
            [(joint.name, f"{joint.kind}s", _range(joint)) for joint in thing.joints]
        ),
    }
    lines = [
        line for title, body in sections.items() for line in (title, *(f"  {row}" for row in body))
    ]
    return printable("\n".join(lines))


def _range(joint: Joint) -> str:
    low, high = joint.limits
    return "without end" if joint.is_endless else f"{low:g} to {high:g} {joint.unit}"


def _grasps(thing: ObjectDescriptor) -> Iterator[str]:
    for part in dict.fromkeys(grasp.part for grasp in thing.grasps):
        openings = [grasp.opening for grasp in thing.grasps if grasp.part == part]
        wide = " to ".join(f"{1e3 * end:.3g}" for end in sorted({min(openings), max(openings)}))
        yield f"{part}: {len(openings)}, {wide} mm wide"


def _parts(thing: ObjectDescriptor) -> Iterator[str]:
    kinds = [type(part).__name__ for part in thing.all_parts if part.collides]
    yield ", ".join(f"{kinds.count(kind)} {kind}" for kind in sorted(set(kinds)))
    for part in thing.all_parts:
        if isinstance(part, Mesh):
            yield f"mesh {part.file}"
    materials = dict.fromkeys((part.density, part.friction) for part in thing.all_parts)
    for density, friction in materials:
        rubs = "the world's friction" if friction is None else f"friction {friction.static:g}"
        yield f"{density:g} kg/m³, {rubs}"


def _row(values: Iterable[float]) -> str:
    return "(" + ", ".join(f"{round(value, 6) + 0.0:.4g}" for value in values) + ")"


def fetch(
    objects: Sequence[Annotated[str, NAME]] = (), *, check: bool = False, offline: bool = False
) -> int:
    """Bring the files of objects to this machine, or check them, and print their licences.

    Exit code: 0 if every file is there and right, 1 if not, 2 for bad usage.

    Args:
        objects: Objects to fetch (default: all).
        check: Fetch nothing, only list what is missing or wrong.
        offline: Never use the network.

    Raises:
        RobotLayoutsError: If there is no such object, or no source has a file.
    """
    needs = {name: object_files(name) for name in objects or PACKAGED}
    store = AssetStore(default_root())
    if not check:
        ensure(union(needs), store, default_sources(offline=offline))
    return print_files(needs, store)


def object_files(name: str) -> tuple[AssetFile, ...]:
    """Return the files that an object of a package needs, all its members included.

    Raises:
        UnknownNameError: If no package brings it.
    """
    if name not in PACKAGED:
        raise UnknownNameError("object of a package", name, PACKAGED)
    one = PACKAGED[name]
    package = load_manifest().package(one.package)
    mains = {one.file.format(number) for number in range(one.members)}
    return tuple(file for file in package.files if mains & {*file.physics})
