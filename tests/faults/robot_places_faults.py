"""Robot files that are no files, or that lie where a URDF may not or may refer to."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

from layouts.visuals import read_visuals
from robots import LocalUrdf
from tests.faults.fault import GOES_ON, Fault
from tests.faults.toy_robots import (
    BOX,
    LIMIT,
    build,
    check,
    guess,
    mesh,
    read_by_all,
    toy,
    write_mesh,
)

AREA = "robot files"


def faults() -> Iterator[Fault]:
    """Go through this area's faults of files and places."""
    for what, place in _NO_FILES.items():
        for file in ("toy.urdf", "toy.srdf", "arm.stl"):
            yield Fault(AREA, f"{file} is {what}", lambda f, p=place, n=file: _no_file(f, p, n))
    for reference in _OUTSIDE:
        yield Fault(AREA, f"mesh {reference}", lambda f, r=reference: _refer(f, r))
        yield Fault(AREA, f"visual mesh {reference}", lambda f, r=reference: _draw(f, r))
        yield Fault(AREA, f"texture {reference}", lambda f, r=reference: _paint(f, r))
    for what, run in _RIGHT.items():
        yield Fault(AREA, what, run, GOES_ON)


def _sparse(path: Path) -> None:
    path.touch()
    os.truncate(path, 5 << 30)


def _link_to(target: str) -> Callable[[Path], None]:
    return lambda path: path.symlink_to(target)


_NO_FILES: dict[str, Callable[[Path], None]] = {
    "a link to /dev/zero": _link_to("/dev/zero"),
    "a link to a FIFO": lambda path: (os.mkfifo(f"{path}.fifo"), path.symlink_to(f"{path}.fifo"))[
        1
    ],
    "a FIFO": os.mkfifo,
    "a folder": Path.mkdir,
    "5 GB of nothing": _sparse,
    "a link to itself": lambda path: path.symlink_to(path),
    "a link to nowhere": _link_to("/no/such/file"),
}

_OUTSIDE = (
    "../../../../../../../../etc/passwd",
    "/etc/passwd",
    "/etc/hostname.stl",
    "file:///etc/passwd",
    "file://localhost/etc/passwd",
    "file:///%65tc/passwd",
    "file://etc/passwd",
    "file://../outside.stl",
    "package://../../etc/passwd",
    "package://etc/passwd",
    "package:///etc/passwd",
    "package://../outside.stl",
    "package://./../outside.stl",
    "../outside.stl",
    "meshes/../../outside.stl",
    "../robot_of_another/arm.stl",
    "../../meshes/arm.stl",
    "/dev/zero",
    "/proc/self/environ",
    "http://127.0.0.1:9/arm.stl",
    "https://127.0.0.1:9/arm.stl",
    "ftp://127.0.0.1:9/arm.stl",
    "model://toy/arm.stl",
    "data:,arm.stl",
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


def _built(reference: str, mesh_file: str, urdf: str = "toy/toy.urdf") -> Callable[[Path], str]:
    def run(folder: Path) -> str:
        write_mesh(folder / mesh_file)
        path = folder / urdf
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(toy(mesh(reference.replace("FOLDER", folder.as_posix()))))
        for reader in (guess, check, build):
            reader(path)
        return "every link has its shape"

    return run


def _in_a_package(folder: Path) -> str:
    (folder / "arm_description").mkdir()
    (folder / "arm_description" / "package.xml").write_text("<package/>")
    (folder / "arm_meshes").mkdir()
    (folder / "arm_meshes" / "package.xml").write_text("<package/>")
    _built("package://arm_meshes/a.stl", "arm_meshes/a.stl", "arm_description/a/b/toy.urdf")(folder)
    return _built("../../c/a.stl", "arm_description/c/a.stl", "arm_description/a/b/toy.urdf")(
        folder
    )


def _as_hugging_face(folder: Path) -> str:
    write_mesh(folder / "blobs" / "box.stl")
    (folder / "snapshots" / "1" / "meshes").mkdir(parents=True)
    (folder / "snapshots" / "1" / "meshes" / "a.stl").symlink_to("../../../blobs/box.stl")
    path = folder / "snapshots" / "1" / "toy.urdf"
    path.write_text(toy(mesh("meshes/a.stl")))
    for reader in (guess, check, build):
        reader(path)
    return "links are followed"


def _unused(folder: Path) -> str:
    """What SAPIEN's parser stumbles over, and nobody needs."""
    text = toy().replace(
        "</robot>",
        "<transmission><type>t</type></transmission><gazebo><sensor/></gazebo>"
        '<gazebo reference="arm"><sensor type="camera"><camera/></sensor></gazebo></robot>',
    )
    text = text.replace(LIMIT, f"{LIMIT}<safety_controller/><calibration rising='x'/>", 1)
    (folder / "toy.urdf").write_text(text)
    read_by_all(folder / "toy.urdf")
    return "left out"


def _encoded(encoding: str) -> Callable[[Path], str]:
    def run(folder: Path) -> str:
        text = f'<?xml version="1.0" encoding="{encoding}"?>{toy()}'
        (folder / "toy.urdf").write_bytes(text.encode(encoding))
        read_by_all(folder / "toy.urdf")
        return "read as any other"

    return run


_RIGHT: dict[str, Callable[[Path], str]] = {
    "mesh beside the URDF": _built("a.stl", "toy/a.stl"),
    "mesh below it": _built("meshes/visual/../a.stl", "toy/meshes/a.stl"),
    "mesh in ../meshes": _built("../meshes/a.stl", "meshes/a.stl"),
    "mesh in ../other/meshes": _built("../other/meshes/a.stl", "other/meshes/a.stl"),
    "mesh around a folder called urdf": _built("../parts/a.stl", "parts/a.stl", "urdf/toy.urdf"),
    "mesh at an absolute path beside it": _built("FOLDER/toy/a.stl", "toy/a.stl"),
    "mesh at file:// beside it": _built("file://FOLDER/toy/a.stl", "toy/a.stl"),
    "mesh at file:// with a space": _built("file://FOLDER/toy/a%20b.stl", "toy/a b.stl"),
    "mesh of package:// around it": _built("package://toy/m/a.stl", "toy/m/a.stl", "toy/u/t.urdf"),
    "mesh of package:// without its folder": _built("package://gone/a.stl", "toy/a.stl"),
    "meshes of packages with package.xml": _in_a_package,
    "mesh that is a link into a cache": _as_hugging_face,
    "mesh with a name in capitals": _built("A.STL", "toy/A.STL"),
    "transmissions, sensors and calibrations": _unused,
    "URDF in UTF-16": _encoded("utf-16"),
    "URDF in UTF-8 with a byte order mark": _encoded("utf-8-sig"),
    "URDF in Latin-1": _encoded("iso-8859-1"),
}
