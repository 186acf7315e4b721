"""Placements, presets and frames that make no sense."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import tasks
from layouts import Frame, Layout, Placement, ceiling, face_to_face, table, wall
from layouts.presets import PRESETS as KNOWN
from tests.faults.fault import GOES_ON, Fault, refused

AREA = "arguments"
NAN, INF = math.nan, math.inf

NO_POINTS: tuple[Any, ...] = (
    *(5, "abc", True, (), (0, 0), (0, 0, 0, 0), (0, 0, None), (0, 0, "0"), (0, 0, True)),
    *((NAN, 0, 0), (0, INF, 0), (1e308, 0, 0), (0, 0, 1e7), {0, 1, 2}, {0: 1}, (1j, 0, 0)),
    *(np.zeros((3, 1)), np.array(["a", "b", "c"]), (10**400, 0, 0)),
)
NO_POINT = ((0, 0), (0, 0, "0"), (0, INF, 0), (0, 0, 1e7))
NO_TURNS: tuple[Any, ...] = (*NO_POINT, (1e-9, 0, 0, 0), (2, 0, 0, 0), (NAN, 0, 0, 0))
NO_MODES: tuple[Any, ...] = (
    *(5, "nowhere", "", "left=", "a=b,a=c", ["pd_joint_pos"], {"left": 5}, {"panda": None}, True),
)
NO_ROBOTS: tuple[Any, ...] = (None, 5, True, ["panda"], {"panda"}, b"panda", "pandda", "", object)
NO_DISTANCES: tuple[Any, ...] = (
    *(None, True, "1", "Auto", (1,), {}, 1j, NAN, INF, 0, -1, 1e308, 10**400, np.array([1.0, 2.0])),
)
NO_EDGES: tuple[Any, ...] = (
    *(5, "ns", ["north"], {"a": "north"}, ["north", "up"], ["north", 5], object),
)
NO_TABLES: tuple[Any, ...] = (5, "large", (1,), (1, NAN), (1, None), (1e9, 1), (0, 1), {1, 2})
NO_LAYOUTS: tuple[Any, ...] = (None, [], 5, {"a": "panda"}, {"a": None}, {5: None}, [("a", 1)])
NO_FRAMES: tuple[Any, ...] = (5, [1], {"t": 5}, {5: None}, "table")
NO_OTHERS: tuple[Any, ...] = ({"left": None}, {"left": 5}, {"lefty": "panda"}, {"left": "x"})
WRONG_ROBOTS: dict[str, Any] = {
    "nothing": {},
    "a list": ["panda", "panda"],
    "a name": "panda",
    "a number": 2,
    "names that do not exist": {"a": "panda", "b": "pandda"},
    "a robot that is None": {"a": "panda", "b": None},
    "a place that is a number": {1: "panda", 2: "panda"},
    "a place with a space": {"the left": "panda", "b": "panda"},
    "a place without a name": {"": "panda", "b": "panda"},
    "pairs": [("a", "panda"), ("b", "panda")],
}


def _layout() -> Layout:
    return face_to_face({"left": "panda", "right": "panda"}, spacing=1.5)


def _preset(name: str, **options: Any) -> None:
    robots = {"a": "panda"} if name == "single" else {"a": "panda", "b": "panda"}
    needed = {"spacing": 1.5} if name in ("side_by_side", "face_to_face") else {}
    KNOWN[name](robots, **{**needed, **options})


CALLS: dict[str, tuple[Callable[[Any], object], tuple[Any, ...]]] = {
    "Placement({})": (Placement, NO_ROBOTS),
    "Placement(position={})": (lambda x: Placement("panda", position=x), NO_POINTS),
    "Placement(rpy={})": (lambda x: Placement("panda", rpy=x), NO_POINT),
    "Placement(quaternion={})": (lambda x: Placement("panda", quaternion=x), NO_TURNS),
    "Placement(control_mode={})": (lambda x: Placement("panda", control_mode=x), NO_MODES),
    "Placement(keyframe={})": (lambda x: Placement("panda", keyframe=x), (5, "nowhere", ["rest"])),
    "Placement(qpos_noise={})": (lambda x: Placement("panda", qpos_noise=x), ("0.02", -0.01, 2.0)),
    "Placement(on={})": (lambda x: Placement("panda", on=x), (5, True, b"table", ("table",))),
    "Frame(position={})": (lambda x: Frame(position=x), NO_POINT),
    "layout.moved(position={})": (lambda x: _layout().moved(position=x), NO_POINT),
    "layout.moved(yaw={})": (lambda x: _layout().moved(yaw=x), ("1", 1e308)),
    "ceiling({})": (ceiling, ("1", 1e308)),
    "table({}, 1)": (lambda x: table(x, 1.0), ("1", 1e308)),
    "table(1, {})": (lambda x: table(1.0, x), ("1", 1e308)),
    "wall(yaw={})": (lambda x: wall((0, 0, 0), yaw=x), ("1", 1e308)),
    "ring(radius={})": (lambda x: _preset("ring", radius=x), NO_DISTANCES),
    "ring(facing={})": (lambda x: _preset("ring", facing=x), (None, 5, "center", ["out"], "")),
    "grid(columns={})": (lambda x: _preset("grid", columns=x), ("2", 0)),
    "grid(spacing={})": (lambda x: _preset("grid", spacing=x), ("far", -1, 1e7)),
    "face_to_face(spacing={})": (lambda x: _preset("face_to_face", spacing=x), ("far", -1, 1e7)),
    "around_table(inset={})": (lambda x: _preset("around_table", inset=x), ("far", -1, 1e7)),
    "around_table(edges={})": (lambda x: _preset("around_table", edges=x), NO_EDGES),
    "around_table(table={})": (lambda x: _preset("around_table", table=x), NO_TABLES),
    "single(keyframe={})": (lambda x: _preset("single", keyframe=x), (5, ["rest"], "nowhere")),
    "Layout({})": (Layout, NO_LAYOUTS),
    "Layout(frames={})": (lambda x: Layout({"a": Placement("panda")}, x), NO_FRAMES),
    "replace_robots({})": (lambda x: _layout().replace_robots(**x), NO_OTHERS),
    "in_control_mode({})": (lambda x: _layout().in_control_mode(x), (5, "pd_joint", True)),
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    yield from refused(AREA, CALLS)
    for preset in ("single", "ring"):
        for name, robots in WRONG_ROBOTS.items():
            run = partial(_of_robots, preset, robots)
            yield Fault(AREA, f"{preset} of {name}", run)
    for fields in ({"position": (1e308, 0, 0)}, {"qpos_noise": 1e300}, {"position": (0, NAN, 0)}):
        yield Fault(AREA, f"a task with a robot at {fields!r}", partial(_task, fields))
    # Where positions round to 6 cm, physics throws the robot about, and that is said.
    down: dict[str, Any] = {"position": (0, 0, -1e6)}
    yield Fault(AREA, f"a task with a robot at the bounds: {down!r}", partial(_task, down))
    for fields in ({"position": (1e6, 0, 0)}, {"qpos_noise": 1.0}):
        what = f"a task with a robot at the bounds: {fields!r}"
        yield Fault(AREA, what, partial(_task, fields), GOES_ON)


def _of_robots(preset: str, robots: Any, folder: Path) -> None:
    KNOWN[preset](robots)


def _task(fields: dict[str, Any], folder: Path) -> str:
    layout = Layout({"arm": Placement("panda", **fields)})
    env = tasks.make("PickCube-v1", layout=layout, check_layout=False)
    env.reset(seed=0)
    for _ in range(5):
        obs, *_ = env.step(np.ones((1, 8), np.float32))
    assert obs.isfinite().all()
    env.close()
    return "made, and its observations are finite"
