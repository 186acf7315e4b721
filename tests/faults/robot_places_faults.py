"""Robot files that are no files, or that lie where a URDF may not or may refer to."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from layouts.visuals import read_visuals
from robots import LocalUrdf
from tests.faults.fault import NO_FILES, Fault
from tests.faults.toy_robots import BOX, mesh, read_by_all, toy, write_mesh

AREA = "robot files"


def faults() -> Iterator[Fault]:
    """Go through this area's faults of files and places."""
    for what, place in list(NO_FILES.items())[1:]:
        for file in ("toy.urdf", "toy.srdf", "arm.stl"):
            yield Fault(AREA, f"{file} is {what}", lambda f, p=place, n=file: _no_file(f, p, n))
    for reference in _OUTSIDE:
        yield Fault(AREA, f"mesh {reference}", lambda f, r=reference: _refer(f, r))
    for reference in _OUTSIDE[:6]:
        yield Fault(AREA, f"visual mesh {reference}", lambda f, r=reference: _draw(f, r))
        yield Fault(AREA, f"texture {reference}", lambda f, r=reference: _paint(f, r))


_OUTSIDE = (
    "../../../../../../../../etc/passwd",
    "/etc/passwd",
    "file:///etc/passwd",
    "file:///%65tc/passwd",
    "file://../outside.stl",
    "package://../../etc/passwd",
    "package:///etc/passwd",
    "package://../outside.stl",
    "../outside.stl",
    "../robot_of_another/arm.stl",
    "/dev/zero",
    "http://127.0.0.1:9/arm.stl",
    "model://toy/arm.stl",
)


def _no_file(folder: Path, place: Callable[[Path], None], kind: str) -> None:
    if kind != "toy.urdf":
        (folder / "toy.urdf").write_text(toy(mesh("arm.stl") if kind == "arm.stl" else BOX))
    place(folder / kind)
    read_by_all(folder / "toy.urdf", ("check", "build"))


def _refer(folder: Path, reference: str) -> None:
    read_by_all(_robot_beside(folder, toy(mesh(reference))))


def _draw(folder: Path, reference: str) -> None:
    visual = f"<visual><geometry>{mesh(reference)}</geometry></visual>"
    _looked_at(_robot_beside(folder, toy(more=visual)))


def _paint(folder: Path, reference: str) -> None:
    material = f'<material name="m"><texture filename="{reference}"/></material>'
    visual = f"<visual><geometry>{BOX}</geometry>{material}</visual>"
    _looked_at(_robot_beside(folder, toy(more=visual)))


def _looked_at(urdf: Path) -> None:
    read_visuals(LocalUrdf(urdf).locate(pictures=True))


def _robot_beside(folder: Path, text: str) -> Path:
    """Write a URDF into a folder, with good meshes outside of it."""
    for mesh_file in ("outside.stl", "robot_of_another/arm.stl", "meshes/arm.stl"):
        write_mesh(folder / "around" / mesh_file)
    urdf = folder / "around" / "toy" / "inner" / "toy.urdf"
    urdf.parent.mkdir(parents=True)
    urdf.write_text(text)
    write_mesh(urdf.parent.parent / "outside.stl")
    write_mesh(urdf.parent.parent / "robot_of_another" / "arm.stl")
    return urdf
