"""Plans, motions, obstacles and searches for places that make no sense."""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from layouts import face_to_face, search
from robot_layouts.motion import Motion, RegionGoal, TcpGoal, plan
from robot_layouts.motion.collision.cell import Cell
from robot_layouts.motion.model.obstacles import Obstacle, Track, box, cylinder, mesh, sphere
from tests.faults.arguments_layouts_faults import NO_POINTS, WRONG_ROBOTS
from tests.faults.fault import GOES_ON, Fault, refused, shown

AREA = "motion"
NAN, INF = math.nan, math.inf
GOAL = (0.3, 0.1, 0.3)

WRONG_PLANS: dict[str, tuple[Any, ...]] = {
    "layout": (None, "two", {"left": "panda"}, True),
    "start": (5, "home", np.zeros((2, 9)), np.full(18, NAN), {"left": [0]}, {"lefty": [0]})
    + ({5: [0]}, {"left": None}, {"left": "home"}, {"left": [INF] * 9}),
    "goals": (None, {}, "left", [GOAL], {"lefty": GOAL}, {5: GOAL}, {"left": None}, {"left": GOAL})
    + ({"left": [NAN] * 7}, {"left": [9] * 7}, {"left": []}, {"left": [1e308] * 7}),
    "obstacles": (5, "wall", [None], ["wall"], {"wall": GOAL}, [GOAL]),
    "held": (5, [None], ["cube"], {"left": "cube"}),
    "table": (5, "large", (1,), (0, 0, 1), (1, 1, 0, 0), (0, 0, NAN, 1), (0, 0, 1e9, 1), {1, 2}),
    "others": (5, ["right"], {"right": None}, {"right": 5}, {"rihgt": None}, {5: 5}),
    "clearance": ("1cm", -0.01, NAN, 2.0, (0.01,)),
    "seed": (None, -1, 1.5, "0", 2**40),
    "patience": ("long", 0, NAN, [30]),
    "control_mode": (5, "pd_joint", ["pd_joint_pos"], {"lefty": "pd_joint_pos"}, {"left": None}),
    "velocity": ("fast", 0, NAN, 1.5, [1]),
    "acceleration": ("fast", 0, NAN, [1, 2], {"lefty": 1}, {"left": 0}, {"left": [1] * 3}, {5: 1}),
}
WRONG_TURNS: tuple[Any, ...] = (5, "up", (), (0, 0, 0), (0, 0, 0, 0), (2, 0, 0, 0), (NAN, 0, 0, 0))
WRONG_LENGTHS: tuple[Any, ...] = (None, "1", 0, -1, NAN, 1e308, (1,), True)
WRONG_SHAPES: tuple[Any, ...] = (
    *(
        None,
        5,
        "box",
        (),
        [[]],
        ([0, 0, 0],),
        (np.zeros((4, 2)),),
        (np.full((4, 3), NAN),),
        (None,),
    ),
)
WRONG_POSES: tuple[Any, ...] = (
    *(None, "here", np.eye(3), np.full((4, 4), NAN), 2 * np.eye(4), np.diag([-1.0, 1, 1, 1])),
)
WRONG_TRACKS: tuple[tuple[Any, Any], ...] = (
    *(((), ()), ((1, 0), [np.eye(4)] * 2), ((0,), [np.eye(4)] * 2), ((NAN,), [np.eye(4)])),
    *(("now", [np.eye(4)]), ((0,), [np.zeros((4, 4))]), (None, None)),
)
WRONG_MOMENTS: tuple[Any, ...] = ("now", NAN, [0, NAN], 1j, [[0], [0, 1]], object)
WRONG_SEARCHES: dict[str, tuple[Any, ...]] = {
    "targets": (5, "abc", {"t": None}, {"t": (0, 0)}, {"t": (NAN, 0, 0)}, {"t": (0, 0, 3.0)}),
    "around": (5, "table", (1, 1), (1, 1, 0, 0), (0, 0, NAN, 1), {"t": 5}, {}),
    "within": ("room", (1, 1), (0, 0, NAN, 1), (0, 0, 1e-9, 1e-9)),
    "heights": ("low", (), (1.0, 0.0), (NAN,), {"a": "low"}, {"c": (0, 1)}),
    "reached_by": (5, "c", {"t": "c"}, {"u": "a"}, {"t": 5}),
    "keyframe": (5, "nowhere", ["rest"]),
    "clearance": ("1", -1, NAN, 1e308),
    "tries": (0, 1.5, "2"),
    "patience": ("long", 0, NAN),
    "seed": (None, -1, 1.5, "0"),
}
# What each of these may not be given.
WRONG_CALLS: dict[str, tuple[Callable[[Any], object], tuple[Any, ...]]] = {
    "TcpGoal({})": (lambda x: _planned(lambda: TcpGoal(x)), NO_POINTS),
    "TcpGoal(…, {})": (lambda x: _planned(lambda: TcpGoal(GOAL, x)), WRONG_TURNS),
    "RegionGoal({}, …)": (lambda x: _planned(lambda: RegionGoal(x, GOAL)), NO_POINTS[:6]),
    "box(position={})": (lambda x: box("wall", (1, 1, 1), x), NO_POINTS[:6]),
    "box(size={})": (lambda x: box("wall", x), NO_POINTS[:6]),
    "sphere({})": (lambda x: sphere("wall", x), WRONG_LENGTHS),
    "cylinder({}, 1)": (lambda x: cylinder("wall", x, 1.0), WRONG_LENGTHS),
    "cylinder(1, {})": (lambda x: cylinder("wall", 1.0, x), WRONG_LENGTHS),
    "mesh({})": (lambda x: mesh("wall", x), (None, 5, "", "nowhere.stl", "/dev/null", "/tmp")),
    "an obstacle called {}": (
        lambda x: Cell(_cell(), [box(x, (0.1, 0.1, 0.1))]),
        (None, 5, "", "a\nb", b"wall", "a/b", "left"),
    ),
    "an obstacle of {}": (lambda x: _obstacle(shapes=x), WRONG_SHAPES),
    "an obstacle at {}": (lambda x: _obstacle(pose=x), WRONG_POSES),
    "Track{}": (lambda x: Track(*x), WRONG_TRACKS),
    "motion.sample({})": (lambda x: _motion().sample(x), WRONG_MOMENTS),
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for name, values in WRONG_PLANS.items():
        for value in values:
            yield Fault(AREA, f"plan({name}={shown(value)})", partial(_plan, {name: value}))
    yield from refused(AREA, WRONG_CALLS)
    for value in ("", "m.txt", "m", "/dev/null/m.png"):
        for name in ("picture", "save"):
            yield Fault(AREA, f"motion.{name}({value!r})", partial(_method, name, value))
    for name, robots in WRONG_ROBOTS.items():
        yield Fault(AREA, f"search of {name}", partial(_search, {"robots": robots}))
    for name, values in WRONG_SEARCHES.items():
        for value in values:
            yield Fault(AREA, f"search({name}={shown(value)})", partial(_search, {name: value}))
    for name, change in WRONG_NUMBERS.items():
        yield Fault("saved motions", name, partial(_load, change))
    for what, change in {
        "a joint thrown about by 1e5 rad/s": _thrown,
        "a motion that swings 10 rad between any two knots": _swinging,
    }.items():
        yield Fault("certificates", what, partial(_certified, change), GOES_ON)


@functools.cache
def _cell() -> Any:
    return face_to_face({"left": "panda", "right": "panda"}, spacing=1.4)


@functools.cache
def _motion() -> Any:
    return plan(_cell(), goals={"left": TcpGoal(GOAL)})


def _plan(given: dict[str, Any], folder: Path) -> None:
    plan(**{"layout": _cell(), "goals": {"left": TcpGoal(GOAL)}, **given})


def _planned(goal: Callable[[], Any]) -> None:
    plan(_cell(), goals={"left": goal()})


def _obstacle(**given: Any) -> None:
    shapes = box("wall", (0.1, 0.1, 0.1)).shapes
    Cell(_cell(), [Obstacle(**{"name": "wall", "shapes": shapes, **given})])


def _method(name: str, path: Any, folder: Path) -> None:
    inside = folder / path if isinstance(path, str) and path else path
    getattr(_motion(), name)(inside)


def _changed(change: Callable[[dict[str, Any]], None], folder: Path) -> Motion:
    """Save a motion, change the file, and load it."""
    file = _motion().save(folder / "motion.json")
    document = json.loads(file.read_text())
    change(document)
    file.write_text(json.dumps(document))
    return Motion.load(file)


def _load(change: Callable[[dict[str, Any]], None], folder: Path) -> None:
    _changed(change, folder)


def _with_cube(**changed: Any) -> Callable[[dict[str, Any]], None]:
    shape = [[x, y, z] for x in (0.0, 0.1) for y in (0.0, 0.1) for z in (0.0, 0.1)]
    cube = {"name": "cube", "shapes": [shape], "pose": np.eye(4).tolist(), **changed}
    return lambda document: document["obstacles"].append(cube)


def _far(number: float) -> list[list[float]]:
    pose = np.eye(4)
    pose[0, 3] = number
    return pose.tolist()


WRONG_NUMBERS: dict[str, Callable[[dict[str, Any]], None]] = {
    "times beyond a million seconds": lambda m: m.update(times=[0.0, *m["times"][1:-1], 2e6]),
    "one position of 1e7": lambda m: m["positions"]["left"][3].__setitem__(0, 1e7),
    "one velocity of 1e308": lambda m: m["velocities"]["left"][3].__setitem__(0, 1e308),
    "a largest velocity below 0": lambda m: m["largest_velocities"].update(left=[-1.0] * 9),
    "an obstacle of 1e300 m": _with_cube(shapes=[[[0, 0, 0], [1e300, 0, 0], [0, 1, 0], [0, 0, 1]]]),
    "an obstacle 1e300 m away": _with_cube(pose=_far(1e300)),
    "an obstacle that travels 1e300 m": _with_cube(
        track={"times": [0.0, 1.0], "poses": [_far(0.0), _far(1e300)]}
    ),
}


def _thrown(document: dict[str, Any]) -> None:
    document["velocities"]["left"][3][0] = 1e5


def _swinging(document: dict[str, Any]) -> None:
    for i, row in enumerate(document["positions"]["left"]):
        row[0] = (-1) ** i * 10.0


def _certified(change: Callable[[dict[str, Any]], None], folder: Path) -> str:
    certificate = _changed(change, folder).certify()
    assert not certificate.ok
    assert certificate.joint_limits or certificate.too_fast
    return str(certificate).splitlines()[0]


def _search(given: dict[str, Any], folder: Path) -> None:
    robots = {"a": "panda", "b": "panda"}
    search(**{"robots": robots, "targets": {"t": (0.0, 0.0, 0.1)}, "tries": 1, **given})
