"""Cells of odd meshes, drives and names, and places where none can be written, in every format."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

from layouts import Layout, Placement
from robots import RobotLayoutsError
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf
from tests.faults.fault import GOES_ON, Fault
from tests.faults.toy_robots import descriptor, mesh, toy
from tests.layouts.hostile_names import HOSTILE_NAMES

AREA = "exports"
STEPS, DRIFT = 100, 1e-6  # rad

Corners = list[tuple[float, float, float]]
Faces = list[tuple[int, int, int]]


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for what, (corners, faces) in _MESHES.items():
        run = functools.partial(_of_mesh, corners, faces)
        yield Fault(AREA, f"a visual mesh of {what}", run, GOES_ON)
    for what, corner in _FAR.items():
        run = functools.partial(_refused, [*_TRIANGLE, corner], [(0, 1, 2), (0, 1, 3)])
        yield Fault(AREA, f"a visual mesh has a corner at {what}", run)
    for what, numbers in _DRIVES.items():
        run = functools.partial(_of_drive, numbers)
        yield Fault(AREA, f"drives with {what}", run, GOES_ON)
    for name in (*filter(str.isprintable, HOSTILE_NAMES), "../../out", "/", "ARM", "world"):
        run = functools.partial(_of_name, name)
        yield Fault(AREA, f"a link called {name[:40]}", run, GOES_ON)
    for kind, write in _WRITERS.items():
        for what, make in _PLACES.items():
            run = functools.partial(_to_place, write, make)
            yield Fault(AREA, f"{kind} to {what}", run)


# -- what is exported -----------------------------------------------------------------------------


_TRIANGLE: Corners = [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0)]
_MESHES: Mapping[str, tuple[Corners, Faces]] = {
    "a triangle": (_TRIANGLE, [(0, 1, 2)]),
    "a line": ([(0, 0, 0), (0.1, 0, 0), (0.2, 0, 0)], [(0, 1, 2)]),
    "less than single precision": (
        [(500, 500, 500), (500.00001, 500, 500), (500, 500.00001, 500)],
        [(0, 1, 2)],
    ),
    "corners that no face has": ([*_TRIANGLE, (5, 5, 5), (6, 6, 6)], [(0, 1, 2)]),
    "corners that are not finite": ([*_TRIANGLE, (0, 0, float("nan"))], [(0, 1, 2), (0, 1, 3)]),
}
_FAR = {"1e30 m": (0.0, 0.0, 1e30), "1e200 m": (0.0, 1e200, 0.0), "20 km": (2e4, 0.0, 0.0)}
_DRIVES: Mapping[str, Mapping[str, float]] = {
    "no stiffness": {"stiffness": 0.0},
    "no force": {"force_limit": 0.0},
    "a stiffness of 1e30": {"stiffness": 1e30},
}


def _of_mesh(corners: Corners, faces: Faces, folder: Path) -> str:
    return _exported(_layout(folder, _drawn(folder, corners, faces)), folder)


def _refused(corners: Corners, faces: Faces, folder: Path) -> None:
    """Have every format that reads meshes refuse one, in the same words, and leave nothing."""
    layout = _layout(folder, _drawn(folder, corners, faces))
    errors: dict[str, RobotLayoutsError] = {}
    (folder / "out").mkdir()
    for kind, write in _WRITERS.items():
        try:
            write(layout, folder / "out")
        except RobotLayoutsError as error:
            errors[str(error)] = error
        else:
            assert kind == "urdf", f"{kind} is written"  # it only names them
            (folder / "out" / "cell.urdf").unlink()
    assert not list((folder / "out").iterdir()), "something is left"
    (error,) = errors.values()
    raise error


def _of_drive(numbers: Mapping[str, float], folder: Path) -> str:
    robot = _layout(folder, toy())["arm"].robot
    group = replace(robot.action_split.groups["arm"], **numbers)
    robot = replace(robot, action_split=robot.action_split.replace(arm=group))
    return _exported(Layout({"arm": Placement(robot)}), folder)


def _of_name(name: str, folder: Path) -> str:
    text = toy().replace('"hand"', quoteattr(name))
    before = set(folder.parent.iterdir())
    happened = _exported(_layout(folder, text, tool=name), folder)
    assert set(folder.parent.iterdir()) == before, "something lies elsewhere"
    return happened


def _drawn(folder: Path, corners: Corners, faces: Faces) -> str:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in corners]
    lines += ["f " + " ".join(str(corner + 1) for corner in face) for face in faces]
    (folder / "odd.obj").write_text("\n".join(lines))
    return toy(more=f"<visual><geometry>{mesh('odd.obj')}</geometry></visual>")


def _layout(folder: Path, text: str, tool: str = "hand") -> Layout:
    urdf = folder / "toy.urdf"
    urdf.write_text(text, "utf-8")
    return Layout({"arm": Placement(replace(descriptor(urdf), tcp_link=tool))})


# -- formats ---------------------------------------------------------------------------------------


def _exported(layout: Layout, folder: Path) -> str:
    """Export in every format and read what came out; MuJoCo holds it where it starts."""
    out = folder / "out"
    out.mkdir()
    for write in _WRITERS.values():
        write(layout, out)
    _hold(out / "cell.xml")
    robots = [out / "cell.urdf", *out.glob("cell_robots/*/*.urdf"), *out.glob("cell/urdf/*.urdf")]
    assert len(robots) == 3
    for urdf in robots:
        assert len(read_model(read_urdf(urdf), str(urdf)).moving) == 2
    return f"{len(_WRITERS)} formats are written; MuJoCo holds the cell for {STEPS} steps"


def _hold(path: Path) -> None:
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    home = data.qpos.copy()
    for _ in range(STEPS):
        mujoco.mj_step(model, data)
    assert not any(warning.number for warning in data.warning)
    assert np.abs(data.qpos - home).max() < DRIFT


_WRITERS: dict[str, Callable[[Layout, Path], object]] = {
    "mjcf": lambda layout, out: layout.to_mjcf(out / "cell.xml"),
    "urdf": lambda layout, out: layout.to_urdf(out / "cell.urdf"),
    "drake": lambda layout, out: layout.to_drake(out / "cell.dmd.yaml"),
    "ros2": lambda layout, out: layout.to_ros2(out / "cell"),
}
if find_spec("pxr"):
    _WRITERS["usd"] = lambda layout, out: layout.to_usd(out / "cell.usda")


# -- places ----------------------------------------------------------------------------------------


_PLACES: Mapping[str, Callable[[Path], object]] = {
    "a folder that is a file": lambda out: out.touch(),
    "a folder that is a link to itself": lambda out: out.symlink_to(out),
    "where folders and files have each other's names": lambda out: _swap(out),
}


def _swap(out: Path) -> None:
    for name in ("cell.xml", "cell.urdf", "cell.dmd.yaml", "cell.usda"):
        (out / name / "thesis").mkdir(parents=True)
    (out / "cell").touch()


def _to_place(
    write: Callable[[Layout, Path], object], make: Callable[[Path], object], folder: Path
) -> None:
    out = folder / "out"
    make(out)
    before = sorted(folder.rglob("*"))
    layout = _layout(folder, toy())
    try:
        write(layout, out)
    finally:
        assert sorted({*folder.rglob("*")} - {folder / "toy.urdf"}) == before, "something is left"
