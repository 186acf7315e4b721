"""Robots that are declared wrongly, here or by another package."""

from __future__ import annotations

import contextlib
import importlib
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from robots import (
    ActionSplit,
    CameraMount,
    Fingers,
    GripperMaterial,
    Home,
    JointGroup,
    RobotDescriptor,
    RobotRegistry,
)
from robots.fetch_assets import main as fetch_assets
from robots.inspect import main as inspect
from robots.registry import ROBOTS
from tests.faults.fault import GOES_ON, Fault
from tests.faults.tiny_files import run_main, settings

AREA = "descriptors"
HUGE = 10**400


class _Hostile:
    """Raises whatever one does with it."""

    def __repr__(self) -> str:
        raise RuntimeError("no repr")

    def __eq__(self, other: object) -> bool:
        raise RuntimeError("no ==")

    __hash__ = None  # type: ignore[assignment]


PANDA = RobotRegistry.load("panda")
NO_NUMBERS: dict[str, Any] = {
    "nan": math.nan,
    "inf": math.inf,
    "1e300": 1e300,
    "an integer of 401 digits": HUGE,
    "a text": "5",
    "True": True,
    "a complex number": 1j,
    "numpy's nan": np.float64("nan"),
    "bytes": b"1",
    "a set": {1.0},
    "an object without repr": _Hostile(),
}
NO_TEXTS: dict[str, Any] = {
    "empty": "",
    "blank": " \t",
    "a number": 5,
    "None": None,
    "bytes": b"link",
    "a list": ["link"],
    "half a character": "\ud800",
    "with a null": "a\0b",
    "an object without repr": _Hostile(),
}
NO_TUPLES: dict[str, Any] = {
    "a text": "abc",
    "a number": 5,
    "None": None,
    "an empty name in it": ("", "b"),
    "a number in it": (5, "b"),
    "nested": (("a", "b"),),
    "a mapping": {"a": 1},
    "numbers of numpy": np.arange(2),
}

GROUP = {
    "joints": ("a", "b"),
    "lower": -1.0,
    "upper": 1.0,
    "stiffness": 1e3,
    "damping": 1e2,
    "force_limit": 100.0,
}
# For each declaration: how it is made, and the kinds of wrong values of each of its fields.
DECLARATIONS: dict[str, tuple[Callable[..., object], dict[str, tuple[Mapping[str, Any], ...]]]] = {
    "JointGroup": (
        lambda **changes: JointGroup(**{**GROUP, **changes}),
        {
            "joints": (NO_TUPLES, {"none": (), "twice the same": ("a", "a")}),
            "lower": (NO_NUMBERS, {"above upper": 2.0, "too many": (-1.0,) * 3, "none": ()}),
            "upper": (NO_NUMBERS, {"with a nan": (1.0, math.nan)}),
            "stiffness": (NO_NUMBERS, {"negative": -1.0, "too few": (1.0,)}),
            "damping": (NO_NUMBERS, {"negative": (1.0, -1.0)}),
            "force_limit": (NO_NUMBERS, {"negative": -1.0}),
            "friction": (NO_NUMBERS, {"negative": -0.1}),
            "armature": (NO_NUMBERS, {"negative": (1.0, -1.0)}),
            "delta": ({"1": 1, "a text": "yes", "None": None},),
            "mimic": ({"0": 0, "a text": "no"},),
            "unit": (NO_TEXTS, {"degrees": "deg"}),
            "limits": (
                {
                    "one pair": ((0, 1),),
                    "turned": ((1, 0), (0, 1)),
                    "nan": ((0, 1), (0, math.nan)),
                    "no pairs": (0, 1),
                    "triples": ((0, 1, 2), (0, 1, 2)),
                    "a text": "01",
                },
            ),
            "multipliers": ({"of no mimic": (1.0, 1.0), "nan": (math.nan, 1.0)},),
            "offsets": ({"of no mimic": (1.0, 1.0), "texts": ("a", "b")},),
        },
    ),
    "GripperMaterial": (
        lambda **changes: GripperMaterial(
            **{"links": ("a", "b"), "static_friction": 1.0, "dynamic_friction": 1.0, **changes}
        ),
        {
            "links": (NO_TUPLES, {"none": (), "twice the same": ("a", "a")}),
            "static_friction": (NO_NUMBERS, {"negative": -1.0}),
            "dynamic_friction": (NO_NUMBERS, {"negative": -1.0}),
            "restitution": (NO_NUMBERS, {"negative": -0.1, "above 1": 1.1}),
            "patch_radius": (NO_NUMBERS, {"negative": -0.1}),
        },
    ),
    "Fingers": (
        lambda **changes: Fingers(**{"links": ("a", "b"), **changes}),
        {
            "links": (NO_TUPLES, {"one": ("a",), "three": ("a", "b", "c"), "equal": ("a", "a")}),
            "opening_signs": ({"0": (0, 1), "2": (2, 1), "one": (1,), "halves": (0.5, 1)},),
            "min_force": (NO_NUMBERS, {"negative": -1.0}),
            "max_angle": (NO_NUMBERS, {"negative": -1.0, "200": 200.0}),
            "opening_axes": (NO_TUPLES, {"one": ((0, 1, 0),), "0": ((0, 0, 0), (0, 1, 0))}),
        },
    ),
    "CameraMount": (
        lambda **changes: CameraMount(**{"name": "eye", "link": "hand", **changes}),
        {
            "name": (NO_TEXTS,),
            "link": (NO_TEXTS,),
            "position": (NO_NUMBERS, {"two": (0, 0), "nan": (0, 0, math.nan)}),
            "quaternion": (
                NO_NUMBERS,
                {"zero": (0, 0, 0, 0), "three": (1, 0, 0), "twice as long": (2, 0, 0, 0)},
            ),
            "width": (NO_NUMBERS, {"0": 0, "2.5": 2.5, "a million": 10**6, "-1": -1}),
            "height": ({"0": 0, "a million": 10**6},),
            "fov": (NO_NUMBERS, {"0": 0.0, "4 rad": 4.0, "-1": -1.0}),
            "near": (NO_NUMBERS, {"0": 0.0, "beyond far": 200.0}),
            "far": (NO_NUMBERS, {"before near": 0.001}),
        },
    ),
    "Home": (
        Home,
        {
            "position": (NO_NUMBERS, {"four": (0, 0, 0, 0), "inf": (0, 0, math.inf)}),
            "quaternion": (NO_NUMBERS, {"zero": (0, 0, 0, 0), "nan": (math.nan, 0, 0, 0)}),
            "keyframe": (NO_TEXTS,),
        },
    ),
    "RobotDescriptor": (
        lambda **changes: replace(PANDA, **changes),
        {
            "name": (NO_TEXTS, {"7dof": "7dof", "../x": "../x", "a line break": "a\nb"}),
            "urdf": ({"a path": "panda.urdf", "None": None, "a Path": Path("x.urdf")},),
            "action_split": ({"a group": PANDA.action_split.groups["arm"], "None": None},),
            "tcp_link": (NO_TEXTS,),
            "source": (NO_TEXTS,),
            "keyframes": (
                {
                    "None": None,
                    "none": {},
                    "a list": [("rest", (0.0,) * 9)],
                    "one number": {"rest": 0.0},
                    "too short": {"rest": (0.0,)},
                    "with nan": {"rest": (math.nan,) * 9},
                    "with 1e300": {"rest": (1e300,) * 9},
                    "with texts": {"rest": ("0",) * 9},
                    "without a name": {"": (0.0,) * 9, "rest": (0.0,) * 9},
                    "named by a number": {5: (0.0,) * 9, "rest": (0.0,) * 9},
                    "without home's": {"other": (0.0,) * 9},
                },
            ),
            "reach": (NO_NUMBERS, {"0": 0.0, "negative": -1.0}),
            "tcp_position_links": (NO_TUPLES, {"twice the same": ("a", "a")}),
            "no_floor_contact": ({"a text": "wheel", "twice the same": ("a", "a")},),
            "tcp_offset": (NO_NUMBERS, {"two": (0, 0), "inf": (0, 0, math.inf)}),
            "gripper_material": ({"links": ("a", "b"), "a number": 5},),
            "fingers": ({"links": ("a", "b"), "True": True},),
            "cameras": (
                {
                    "a camera": CameraMount("eye", "hand"),
                    "names": ("eye",),
                    "two of a name": (CameraMount("eye", "a"), CameraMount("eye", "b")),
                },
            ),
            "home": ({"None": None, "a position": (0, 0, 0)},),
        },
    ),
}

MODULE = """
from dataclasses import replace
from robots import RobotRegistry
ARM = replace(RobotRegistry.load("panda"), name="acme_arm", source="acme")
"""
# What a package of someone else brings as the robot acme_arm: its module, and its entry points.
PACKAGES = {
    "a module that is not there": (None, "acme_arm = {}:ARM"),
    "a module without the robot": ("", "acme_arm = {}:ARM"),
    "a module that raises": ("raise RuntimeError('no GPU')", "acme_arm = {}:ARM"),
    "a module that raises without a word": ("raise ValueError", "acme_arm = {}:ARM"),
    "a module that exits": ("raise SystemExit(3)", "acme_arm = {}:ARM"),
    "a module that imports itself": ("from {} import ARM", "acme_arm = {}:ARM"),
    "a module of no Python": ("robot: acme", "acme_arm = {}:ARM"),
    "a module of null characters": ("\0\0", "acme_arm = {}:ARM"),
    "a wrong declaration": (MODULE.replace('source="acme"', "reach=-1"), "acme_arm = {}:ARM"),
    "None": ("ARM = None", "acme_arm = {}:ARM"),
    "a function": ("ARM = len", "acme_arm = {}:ARM"),
    "a class": (MODULE + "\nARM = type(ARM)", "acme_arm = {}:ARM"),
    "no attribute, only a module": (MODULE, "acme_arm = {}"),
    "a robot of another name": (MODULE.replace("acme_arm", "other_arm"), "acme_arm = {}:ARM"),
    "an entry point of nonsense": (MODULE, "acme_arm = {} ARM !"),
    "the robot twice": (MODULE + "\nTWO = ARM", "acme_arm = {0}:ARM\nacme_arm = {0}:TWO"),
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for declaration, (make, fields) in DECLARATIONS.items():
        for field, kinds in fields.items():
            for what, value in {k: v for kind in kinds for k, v in kind.items()}.items():
                yield Fault(
                    AREA,
                    f"{declaration}.{field} is {what}",
                    lambda folder, make=make, field=field, value=value: _make(make, field, value),
                )
    for what, groups in {
        "no group": {},
        "None as a group": {"arm": None},
        "a tuple as a group": {"arm": ("a", "b")},
        "a group without a name": {"": JointGroup(**GROUP)},
        "a joint in two groups": {"arm": JointGroup(**GROUP), "hand": JointGroup(**GROUP)},
        "only held groups": {
            "base": JointGroup.hold(("a",), stiffness=1.0, damping=1.0, force_limit=1.0)
        },
    }.items():
        yield Fault(AREA, f"ActionSplit of {what}", lambda folder, g=groups: _split(g))
    for what, name in {
        "a number": 5,
        "None": None,
        "a list": ["panda"],
        "a descriptor": PANDA,
        "nothing": "",
        "capitals": "PANDA",
        "5000 letters": "x" * 5000,
    }.items():
        yield Fault(AREA, f"load of {what}", lambda folder, n=name: _load(n))
    for what, value in {"a name": "panda", "None": None, "a class": RobotDescriptor}.items():
        yield Fault(AREA, f"register of {what}", lambda folder, v=value: _register(v))
    yield Fault(AREA, "register of another panda", lambda f: _register(replace(PANDA, reach=2.0)))
    for what in PACKAGES:
        yield Fault(AREA, f"another package brings {what}", _of_package(what, _expect_refused))
        yield Fault(AREA, f"beside a package with {what}", _of_package(what, _others), GOES_ON)
    for what, make in {
        "lists instead of tuples": lambda: replace(
            PANDA,
            tcp_position_links=list(PANDA.tcp_position_links),
            keyframes=dict(PANDA.keyframes),
        ),
        "numbers of numpy": lambda: replace(PANDA, reach=np.float64(PANDA.reach)),
        "an array as keyframe": lambda: replace(
            PANDA, keyframes={k: np.array(v) for k, v in PANDA.keyframes.items()}
        ),
    }.items():
        yield Fault(AREA, what, lambda folder, make=make: _same(make), GOES_ON)


def _make(make: Callable[..., object], field: str, value: Any) -> None:
    make(**{field: value})


def _split(groups: dict[str, Any]) -> None:
    ActionSplit(**groups)


def _load(name: Any) -> None:
    RobotRegistry.load(name)


def _register(value: Any) -> None:
    with mock.patch.object(ROBOTS, "registered", {}):
        RobotRegistry.register(value)


def _same(make: Callable[[], RobotDescriptor]) -> None:
    robot = make()
    assert robot == PANDA
    assert hash(robot) == hash(PANDA)


@contextlib.contextmanager
def _package(folder: Path, what: str) -> Iterator[None]:
    """Install a package of someone else."""
    text, entry_points = PACKAGES[what]
    module = f"acme_{list(PACKAGES).index(what)}"
    site = folder / "site"
    info = site / f"{module}-1.0.dist-info"
    info.mkdir(parents=True)
    if text is not None:
        (site / f"{module}.py").write_text(text.replace("{}", module))
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
    lines = entry_points.format(module)
    (info / "entry_points.txt").write_text(f"[robot_layouts.robots]\n{lines}\n")
    with mock.patch.object(sys, "path", [*sys.path, str(site)]), settings(folder):
        importlib.invalidate_caches()
        try:
            yield
        finally:
            sys.modules.pop(module, None)


def _of_package(what: str, try_it: Callable[[], None]) -> Callable[[Path], None]:
    def run(folder: Path) -> None:
        with _package(folder, what):
            try_it()

    return run


def _expect_refused() -> None:
    RobotRegistry.load("acme_arm")


def _others() -> None:
    assert RobotRegistry.load("panda") is PANDA
    assert "acme_arm" in RobotRegistry.names()
    assert "9 joints" in run_main(inspect, "panda").replace("Panda", "")
    with contextlib.suppress(Exception):  # everything but that robot, and then its one error
        run_main(fetch_assets, "--check")
    mine = replace(PANDA, name="mine")
    with mock.patch.object(ROBOTS, "registered", {}):
        assert RobotRegistry.register(mine) is mine
