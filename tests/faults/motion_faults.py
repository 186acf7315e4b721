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

from tests.faults.arguments_checkers_faults import NO_POINTS
from tests.faults.arguments_layouts_faults import WRONG_ROBOTS
from tests.faults.fault import GOES_ON, Fault

AREA = "motion"
NAN, INF = math.nan, math.inf
GOAL = (0.3, 0.1, 0.3)

WRONG_PLANS: dict[str, tuple[Any, ...]] = {
    "layout": (None, 5, "two", {"left": "panda"}, ["panda"], True),
    "start": (5, "home", [0.0], np.zeros((2, 9)), np.full(18, NAN), {"left": [0]}, {"lefty": [0]})
    + ({5: [0]}, {"left": None}, {"left": "home"}, {"left": [INF] * 9}, True),
    "goals": (None, {}, 5, "left", [GOAL], {"lefty": GOAL}, {5: GOAL}, {"left": None})
    + ({"left": GOAL}, {"left": "home"}, {"left": [NAN] * 7}, {"left": [9] * 7}, {"left": []})
    + ({"left": np.zeros((7, 1))}, {"left": [1e308] * 7}, {"left": (GOAL, (1, 0, 0, 0))}),
    "obstacles": (5, "wall", [None], [5], ["wall"], {"wall": GOAL}, [GOAL]),
    "held": (5, "cube", [None], [5], ["cube"], {"left": "cube"}),
    "table": (5, "large", (1,), (0, 0, 1), (1, 1, 0, 0), (0, 0, NAN, 1), (0, 0, None, 1), True)
    + ((0, 0, 1e9, 1), np.zeros((4, 4)), {1, 2, 3, 4}),
    "others": (5, "right", ["right"], {"right": None}, {"right": 5}, {"rihgt": None}, {5: 5}),
    "clearance": ("1cm", None, -0.01, NAN, INF, 2.0, (0.01,), True, 1j),
    "seed": (None, -1, 1.5, "0", NAN, True, 2**40, [0]),
    "patience": ("long", None, 0, -1, NAN, INF, True, [30]),
    "control_mode": (5, "pd_joint", "", ["pd_joint_pos"], {"lefty": "pd_joint_pos"})
    + ({"left": None}, {"left": 5}, True, 2.5),
    "velocity": ("fast", None, 0, -1, NAN, INF, 1.5, True, [1], 1j),
    "acceleration": ("fast", 0, -1, NAN, INF, [1, 2], {"lefty": 1}, {"left": "fast"}, {"left": 0})
    + ({"left": [1] * 3}, np.zeros((2, 2)), {5: 1}, {"left": None}),
}
WRONG_TURNS: tuple[Any, ...] = (5, "up", (), (0, 0, 0), (0, 0, 0, 0), (2, 0, 0, 0), (NAN, 0, 0, 0))
WRONG_LENGTHS: tuple[Any, ...] = (None, "1", 0, -1, NAN, INF, 1e308, (1,), True, 1j)
WRONG_SHAPES: tuple[Any, ...] = (
    *(None, 5, "box", (), [[]], ([0, 0, 0],), (np.zeros((4, 2)),), (np.full((4, 3), NAN),)),
    *((None,), ("box",), (5,), ([["a", 0, 0]],)),
)
WRONG_POSES: tuple[Any, ...] = (
    *(None, 5, "here", np.eye(3), np.full((4, 4), NAN), 2 * np.eye(4), np.zeros((4, 4))),
    *(np.diag([-1.0, 1, 1, 1]), [[1, 0], [0]]),
)
WRONG_TRACKS: tuple[tuple[Any, Any], ...] = (
    *(((), ()), ((0, 0), [np.eye(4)] * 2), ((1, 0), [np.eye(4)] * 2), ((0,), [np.eye(4)] * 2)),
    *(((NAN,), [np.eye(4)]), ("now", [np.eye(4)]), ((0,), [np.zeros((4, 4))]), (None, None)),
)
WRONG_MOMENTS: tuple[Any, ...] = (None, "now", NAN, INF, [0, NAN], 1j, [[0], [0, 1]], object)
WRONG_SEARCHES: dict[str, tuple[Any, ...]] = {
    "targets": (5, "abc", {"t": None}, {"t": "here"}, {"t": (0, 0)}, {"t": (NAN, 0, 0)}, [5])
    + ({"t": (0, 0, 3.0)}, {"t": (0, 0, 0.1, 0, 0, 0, 0)}, True),
    "around": (5, "table", (1, 1), (1, 1, 0, 0), (0, 0, NAN, 1), {"t": 5}, {}, True),
    "within": (5, "room", (1, 1), (1, 1, 0, 0), (0, 0, NAN, 1), (0, 0, 1e-9, 1e-9), True),
    "heights": (5, "low", (), (1.0, 0.0), (NAN,), {"a": "low"}, {"c": (0, 1)}, True, 1j),
    "reached_by": (5, "c", "", {"t": "c"}, {"u": "a"}, {"t": 5}, [5], True),
    "keyframe": (5, "nowhere", "", ["rest"], True),
    "clearance": ("1", -1, NAN, INF, 1e308, (1,), True, 1j),
    "tries": (None, 0, -1, 1.5, "2", NAN, True),
    "patience": ("long", None, 0, -1, NAN, True, [30]),
    "seed": (None, -1, 1.5, "0", NAN, True, [0]),
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for name, values in WRONG_PLANS.items():
        for value in values:
            yield _fault(f"plan({name}={_text(value)})", partial(_plan, {name: value}))
    for value in NO_POINTS:
        yield _fault(f"TcpGoal({_text(value)})", partial(_goal, "TcpGoal", value))
        yield _fault(f"RegionGoal({_text(value)}, …)", partial(_goal, "RegionGoal", value, GOAL))
        yield _fault(f"box(position={_text(value)})", partial(_make, "box", (1, 1, 1), value))
        yield _fault(f"box(size={_text(value)})", partial(_make, "box", value))
    for value in WRONG_TURNS:
        yield _fault(f"TcpGoal(…, {_text(value)})", partial(_goal, "TcpGoal", GOAL, value))
    for value in WRONG_LENGTHS:
        yield _fault(f"sphere({_text(value)})", partial(_make, "sphere", value))
        yield _fault(f"cylinder({_text(value)}, 1)", partial(_make, "cylinder", value, 1.0))
        yield _fault(f"cylinder(1, {_text(value)})", partial(_make, "cylinder", 1.0, value))
    for value in (None, 5, "", "nowhere.stl", "/dev/null", "/tmp"):
        yield _fault(f"mesh({value!r})", partial(_make, "mesh", value))
    for value in (None, 5, "", "a\nb", b"wall", "a/b", "left"):
        yield _fault(f"an obstacle called {value!r}", partial(_called, value))
    for value in WRONG_SHAPES:
        yield _fault(f"an obstacle of {_text(value)}", partial(_obstacle, {"shapes": value}))
    for value in WRONG_POSES:
        yield _fault(f"an obstacle at {_text(value)}", partial(_obstacle, {"pose": value}))
    for times, poses in WRONG_TRACKS:
        yield _fault(f"Track({_text(times)}, {_text(poses)})", partial(_track, times, poses))
    for value in WRONG_MOMENTS:
        yield _fault(f"motion.sample({_text(value)})", partial(_sampled, value))
    for value in ("", "m.txt", "m", "/dev/null/m.png"):
        yield _fault(f"motion.picture({value!r})", partial(_method, "picture", value))
        yield _fault(f"motion.save({value!r})", partial(_method, "save", value))
    for name, spoil in SPOILT_FILES.items():
        yield _fault(f"Motion.load of a file {name}", partial(_load, spoil))
    for name, robots in WRONG_ROBOTS.items():
        yield _fault(f"search of {name}", partial(_search, {"robots": robots}))
    for name, values in WRONG_SEARCHES.items():
        for value in values:
            yield _fault(f"search({name}={_text(value)})", partial(_search, {name: value}))

    for name, change in WRONG_NUMBERS.items():
        yield Fault("saved motions", name, partial(_load, partial(_changed, change)))
    for what, change in {
        "a joint thrown about by 1e5 rad/s": _thrown,
        "a motion that swings 10 rad between any two knots": _swinging,
    }.items():
        yield Fault("certificates", what, partial(_certified, change), GOES_ON)
    yield Fault("certificates", "a step of a nanometre", partial(_stepped, 1e-9))
    yield Fault("certificates", "an obstacle that travels 1e6 m in a second", _long)
    yield Fault("certificates", "an obstacle of 2,001 parts", _crowded)


def _fault(what: str, run: Callable[[Path], Any]) -> Fault:
    return Fault(AREA, what, run)


def _text(value: Any) -> str:
    return " ".join(repr(value).split())[:80]


@functools.cache
def _cell() -> Any:
    from layouts import face_to_face

    return face_to_face({"left": "panda", "right": "panda"}, spacing=1.4)


@functools.cache
def _motion() -> Any:
    from robot_layouts.motion import TcpGoal, plan

    return plan(_cell(), goals={"left": TcpGoal(GOAL)})


def _plan(given: dict[str, Any], folder: Path) -> None:
    from robot_layouts.motion import TcpGoal, plan

    plan(**{"layout": _cell(), "goals": {"left": TcpGoal(GOAL)}, **given})


def _goal(name: str, *given: Any) -> None:
    from robot_layouts import motion

    goal = getattr(motion, name)(*given[:-1])
    motion.plan(_cell(), goals={"left": goal})


def _make(name: str, *given: Any) -> None:
    from robot_layouts.motion.model import obstacles

    getattr(obstacles, name)("wall", *given[:-1])


def _called(name: Any, folder: Path) -> None:
    from robot_layouts.motion.collision.cell import Cell
    from robot_layouts.motion.model.obstacles import box

    Cell(_cell(), [box(name, (0.1, 0.1, 0.1))])


def _obstacle(given: dict[str, Any], folder: Path) -> None:
    from robot_layouts.motion.collision.cell import Cell
    from robot_layouts.motion.model.obstacles import Obstacle, box

    shapes = box("wall", (0.1, 0.1, 0.1)).shapes
    Cell(_cell(), [Obstacle(**{"name": "wall", "shapes": shapes, **given})])


def _track(times: Any, poses: Any, folder: Path) -> None:
    from robot_layouts.motion.model.obstacles import Track

    Track(times, poses)


def _sampled(times: Any, folder: Path) -> None:
    _motion().sample(times)


def _method(name: str, path: Any, folder: Path) -> None:
    inside = folder / path if isinstance(path, str) and path else path
    getattr(_motion(), name)(inside)


SPOILT_FILES: dict[str, Callable[[str], str | bytes]] = {
    "that is empty": lambda text: "",
    "cut short": lambda text: text[: len(text) // 2],
    "of other bytes": lambda text: bytes(range(256)),
    "that holds a list": lambda text: "[]",
    "that holds a number": lambda text: "5",
    "without its layout": lambda text: json.dumps({**json.loads(text), "layout": None}),
    "without times": lambda text: json.dumps({**json.loads(text), "times": []}),
    "with NaN": lambda text: text.replace("0.02,", "NaN,", 1),
    "nested deep": lambda text: "[" * 100_000,
}


def _load(spoil: Callable[[str], str | bytes], folder: Path) -> None:
    from robot_layouts.motion import Motion

    file = folder / "motion.json"
    _motion().save(file)
    spoilt = spoil(file.read_text())
    file.write_bytes(spoilt if isinstance(spoilt, bytes) else spoilt.encode())
    Motion.load(file)


def _changed(change: Callable[[dict[str, Any]], None], text: str) -> str:
    document = json.loads(text)
    change(document)
    return json.dumps(document)


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
    from robot_layouts.motion import Motion

    file = folder / "motion.json"
    _motion().save(file)
    file.write_text(_changed(change, file.read_text()))
    certificate = Motion.load(file).certify()
    assert not certificate.ok
    assert certificate.joint_limits or certificate.too_fast
    return str(certificate).splitlines()[0]


def _stepped(step: float, folder: Path) -> None:
    _motion().certify(step=step)


def _long(folder: Path) -> None:
    from dataclasses import replace

    from robot_layouts.motion.model.obstacles import Track, box

    track = Track(np.array([0.0, 1.0]), np.array([_far(0.0), _far(1e6)]))
    replace(_motion(), obstacles=(box("comet", (0.1, 0.1, 0.1)).moved(track),)).certify()


def _crowded(folder: Path) -> None:
    from dataclasses import replace

    from robot_layouts.motion.model.obstacles import Obstacle, box

    crate = Obstacle("crate", box("crate", (0.1, 0.1, 0.1)).shapes * 2001)
    replace(_motion(), obstacles=(crate,)).certify()


def _search(given: dict[str, Any], folder: Path) -> None:
    from layouts import search

    robots = {"a": "panda", "b": "panda"}
    search(**{"robots": robots, "targets": {"t": (0.0, 0.0, 0.1)}, "tries": 1, **given})
