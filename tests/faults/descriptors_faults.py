"""Robots that are declared wrongly."""

from __future__ import annotations

import math
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
from robots.registry import ROBOTS
from tests.faults.fault import GOES_ON, Fault

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
    "an object without repr": _Hostile(),
}
NO_TEXTS: dict[str, Any] = {
    "empty": "",
    "a number": 5,
    "None": None,
    "a list": ["link"],
    "with a null": "a\0b",
    "an object without repr": _Hostile(),
}
NO_TUPLES: dict[str, Any] = {
    "a text": "abc",
    "a number": 5,
    "None": None,
    "a number in it": (5, "b"),
    "a mapping": {"a": 1},
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
            "limits": ({"one pair": ((0, 1),), "turned": ((1, 0), (0, 1)), "no pairs": (0, 1)},),
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
                    "one number": {"rest": 0.0},
                    "too short": {"rest": (0.0,)},
                    "with nan": {"rest": (math.nan,) * 9},
                    "without a name": {"": (0.0,) * 9, "rest": (0.0,) * 9},
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
        "a descriptor": PANDA,
        "nothing": "",
        "5000 letters": "x" * 5000,
    }.items():
        yield Fault(AREA, f"load of {what}", lambda folder, n=name: _load(n))
    for what, value in {"a name": "panda", "None": None, "a class": RobotDescriptor}.items():
        yield Fault(AREA, f"register of {what}", lambda folder, v=value: _register(v))
    yield Fault(AREA, "register of another panda", lambda f: _register(replace(PANDA, reach=2.0)))
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
