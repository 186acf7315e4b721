"""Placements, presets and frames that make no sense."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import layouts
import tasks
from layouts import Frame, Layout, Placement, face_to_face, frames, wall
from layouts.presets import PRESETS as KNOWN
from tests.faults.fault import GOES_ON, Fault

AREA = "arguments"
NAN, INF = math.nan, math.inf

NO_POINTS: tuple[Any, ...] = (
    *(5, "abc", True, (), (0, 0), (0, 0, 0, 0), (0, 0, None), (0, 0, "0"), (0, 0, True)),
    *((NAN, 0, 0), (0, INF, 0), (1e308, 0, 0), (0, 0, 1e7), {0, 1, 2}, {0: 1}, (1j, 0, 0)),
    *(np.zeros((3, 1)), np.array(["a", "b", "c"]), (10**400, 0, 0)),
)
NO_POINT = ((0, 0), (0, 0, "0"), (0, INF, 0), (0, 0, 1e7))
WRONG_PLACEMENTS: dict[str, tuple[Any, ...]] = {
    "position": NO_POINTS,
    "rpy": NO_POINT,
    "quaternion": (*NO_POINT, (1e-9, 0, 0, 0), (2, 0, 0, 0), (1, 1, 0, 0))
    + ((NAN, 0, 0, 0), (1, 0, 0, None)),
    "control_mode": (5, "nowhere", "", "left=", "a=b,a=c", ["pd_joint_pos"], {"left": 5})
    + ({"panda": None}, {5: "pd_joint_pos"}, b"pd_joint_pos", True, 2.5),
    "keyframe": (5, "nowhere", "", ["rest"], {"rest": 1}, b"rest", True),
    "qpos_noise": ("0.02", -0.01, 2.0),
    "on": (5, True, b"table", ("table",), 0.5),
    "robot": (None, 5, True, ["panda"], {"panda"}, b"panda", "pandda", "", object),
}
WRONG_DISTANCES: tuple[Any, ...] = (
    *(None, True, "1", "Auto", (1,), {}, 1j, NAN, INF, 0, -1, 1e308, 10**400, np.array([1.0, 2.0])),
)
DISTANCES = {
    "side_by_side": "spacing",
    "face_to_face": "spacing",
    "ring": "radius",
    "grid": "spacing",
    "around_table": "inset",
}
WRONG_OPTIONS: dict[str, dict[str, tuple[Any, ...]]] = {
    "ring": {"facing": (None, 5, "center", ["out"], True, "")},
    "grid": {"columns": ("2", 0)},
    "around_table": {
        "edges": (5, "ns", ["north"], {"a": "north"}, ["north", "up"], ["north", 5], object),
        "table": (5, "large", (1,), (1, NAN), (1, None), (1e9, 1), (0, 1), True, {1, 2}),
    },
}
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
PRESETS = ("single", "side_by_side", "face_to_face", "ring", "grid", "around_table")


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for name, values in WRONG_PLACEMENTS.items():
        for value in values:
            yield Fault(AREA, f"Placement({name}={_text(value)})", partial(_place, {name: value}))
    for value in NO_POINT:
        yield Fault(AREA, f"Frame(position={_text(value)})", partial(_frame, {"position": value}))
        yield Fault(
            AREA, f"layout.moved(position={_text(value)})", partial(_moved, {"position": value})
        )
    for value in ("1", 1e308):
        yield Fault(AREA, f"layout.moved(yaw={value!r})", partial(_moved, {"yaw": value}))
        yield Fault(AREA, f"ceiling({value!r})", partial(_call, "ceiling", (value,)))
        yield Fault(AREA, f"table({value!r}, 1)", partial(_call, "table", (value, 1.0)))
        yield Fault(AREA, f"table(1, {value!r})", partial(_call, "table", (1.0, value)))
        yield Fault(AREA, f"wall(yaw={value!r})", partial(_wall, value))
    for preset in PRESETS:
        for name, robots in WRONG_ROBOTS.items():
            if preset not in ("ring", "single") and name != "a name":
                continue  # they all read them alike
            yield Fault(AREA, f"{preset} of {name}", partial(_preset, preset, robots, {}))
        wrong = WRONG_DISTANCES if preset == "ring" else ("far", -1, 1e7)
        for value in wrong if preset in DISTANCES else ():
            own = {DISTANCES[preset]: value}
            what = f"{preset}({DISTANCES[preset]}={_text(value)})"
            yield Fault(AREA, what, partial(_preset, preset, None, own))
        for name, values in WRONG_OPTIONS.get(preset, {}).items():
            for value in values:
                what = f"{preset}({name}={value!r})"
                yield Fault(AREA, what, partial(_preset, preset, None, {name: value}))
        for value in (5, ["rest"], "nowhere", True):
            what = f"{preset}(keyframe={value!r})"
            yield Fault(AREA, what, partial(_preset, preset, None, {"keyframe": value}))
    for value in (None, [], 5, "panda", {"a": "panda"}, {"a": None}, {5: None}, [("a", 1)]):
        yield Fault(AREA, f"Layout({value!r})", partial(_call, "Layout", (value,)))
    for value in (5, [1], {"t": 5}, {5: None}, "table"):
        yield Fault(AREA, f"Layout(frames={value!r})", partial(_frames, value))
    for value in ({"left": None}, {"left": 5}, {"lefty": "panda"}, {"left": "x"}):
        yield Fault(AREA, f"replace_robots({value!r})", partial(_replaced, value))
    for mode in (5, "pd_joint", ["pd_joint_pos"], True):
        yield Fault(AREA, f"in_control_mode({mode!r})", partial(_mode, mode))
    for fields in ({"position": (1e308, 0, 0)}, {"qpos_noise": 1e300}, {"position": (0, NAN, 0)}):
        yield Fault(AREA, f"a task with a robot at {fields!r}", partial(_task, fields))
    # Where positions round to 6 cm, physics throws the robot about, and that is said.
    down: dict[str, Any] = {"position": (0, 0, -1e6)}
    yield Fault(AREA, f"a task with a robot at the bounds: {down!r}", partial(_task, down))
    for fields in ({"position": (1e6, 0, 0)}, {"qpos_noise": 1.0}):
        what = f"a task with a robot at the bounds: {fields!r}"
        yield Fault(AREA, what, partial(_task, fields), GOES_ON)


def _text(value: Any) -> str:
    return repr(value).replace(repr(10**400), "10**400")


def _place(fields: dict[str, Any], folder: Path) -> None:
    Placement(**{"robot": "panda", **fields})


def _frame(fields: dict[str, Any], folder: Path) -> None:
    Frame(**fields)


def _layout() -> Any:
    return face_to_face({"left": "panda", "right": "panda"}, spacing=1.5)


def _moved(fields: dict[str, Any], folder: Path) -> None:
    _layout().moved(**fields)


def _call(function: str, values: tuple[Any, ...], folder: Path) -> None:
    (getattr(layouts, function, None) or getattr(frames, function))(*values)


def _wall(yaw: Any, folder: Path) -> None:
    wall((0, 0, 0), yaw=yaw)


def _preset(name: str, robots: Any, options: dict[str, Any], folder: Path) -> None:
    some = {"a": "panda"} if name == "single" else {"a": "panda", "b": "panda"}
    given = some if options else robots
    needed = {"spacing": 1.5} if name in ("side_by_side", "face_to_face") else {}
    KNOWN[name](given, **{**needed, **options})


def _frames(value: Any, folder: Path) -> None:
    Layout({"a": Placement("panda")}, value)


def _replaced(robots: dict[str, Any], folder: Path) -> None:
    _layout().replace_robots(**robots)


def _mode(mode: Any, folder: Path) -> None:
    _layout().in_control_mode(mode)


def _task(fields: dict[str, Any], folder: Path) -> str:
    layout = Layout({"arm": Placement("panda", **fields)})
    env = tasks.make("PickCube-v1", layout=layout, check_layout=False)
    env.reset(seed=0)
    for _ in range(5):
        obs, *_ = env.step(np.ones((1, 8), np.float32))
    assert obs.isfinite().all()
    env.close()
    return "made, and its observations are finite"
