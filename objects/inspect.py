"""``robot-layouts objects list``, and what there is to know about a thing, as text."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from objects.descriptor import ObjectDescriptor
from objects.packaged import PACKAGED
from objects.registry import ObjectRegistry
from objects.shapes import Mesh
from robot_layouts.core.cli import Word
from robot_layouts.core.commands import print_error, printable
from robot_layouts.core.quoting import columns

OBJECT = Word("OBJECT", about="a name that `robot-layouts objects list` prints, a mesh, or an MJCF")


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
            [
                (joint.name, f"{joint.kind}s", f"{joint.lower:g} to {joint.upper:g} {joint.unit}")
                for joint in thing.joints
            ]
        ),
    }
    lines = [
        line for title, body in sections.items() for line in (title, *(f"  {row}" for row in body))
    ]
    return printable("\n".join(lines))


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
