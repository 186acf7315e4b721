"""Randomizations that make no sense, as declared in files and in Python."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from tasks import Distractors, Randomization
from tests.faults.fault import Fault

AREA = "randomization"
NAN, INF = math.nan, math.inf

# No distribution of a factor; all axes and groups read theirs by the same function.
WRONG_DISTRIBUTIONS: tuple[Any, ...] = (
    *(True, "1", b"1", [], [0.5, 2.0], {}, 1j, NAN, INF, -1, 1e300, 10**400, {"unifrom": [0, 1]}),
    *({"uniform": 5}, {"uniform": [2.0, 0.5]}, {"uniform": [0.5, NAN]}, {"uniform": ["a", "b"]}),
    *({"normal": {"mean": 1}}, {"normal": {"std": 0.1}}, {"normal": {"std": -1}}, {"choice": []}),
    *({"choice": [1, None]}, {"uniform": [0.5, 2], "choice": [1]}, {5: [0.5, 2]}),
)
WRONG_AXES: dict[str, tuple[Any, ...]] = {
    **dict.fromkeys(("friction", "size", "stiffness", "damping"), (5, {"cube": "1"}, {"cube": -1})),
    **dict.fromkeys(("joint_friction", "action_noise", "sensor_noise"), (5, {"arm": "1"})),
    "mass": (5, ["cube"], {5: 1.0}, {"": 1.0}, {None: 1.0}),
    "gravity": ("1", -1, {"cube": 1}),
    "action_delay": ("1", -1, 1.5, {"uniform": [0, 2]}),
    "observation_delay": ("1", -1, 1.5, {"uniform": [0, 2]}),
    "bases": (5, {"arm": 5}, {"arm": {"w": 1}}, {"arm": {"x": "1"}}, {"arm": {"x": 1e9}}),
    "cameras": (5, {"base_camera": 5}, {"base_camera": {"w": 1}}, {"base_camera": {"x": "1"}}),
    "lights": (5, {"side": 5}, {"side": {"w": 1}}),
    "colors": (5, {"cube": 5}, {"cube": {"w": 1}}, {"cube": {"red": 2}}),
    "textures": (5, {"cube": 5}, {"cube": {"w": 1}}),
    "distractors": (5, [], {}, {"count": None}, {"kind": "static"}, {"count": -1}, {"count": 1.5})
    + ({"count": 1e9}, {"count": 2, "kind": "loud"}, {"count": 2, "shapes": []})
    + ({"count": 2, "shapes": ["cone"]}, {"count": 2, "shapes": 5}, {"count": 2, "bodies": 1})
    + ({"count": 2, "gap": -1}, {"count": 2, "size": 0}, {"count": 2, "number": 3}),
    "masses": ({"cube": 1.0},),
    "": (1,),
}
WRONG_WHOLES: tuple[Any, ...] = (None, 5, "mass", ["mass"], {5: {}})


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for value in WRONG_DISTRIBUTIONS:
        text = repr(value).replace(repr(10**400), "10**400")
        yield Fault(AREA, f"a distribution: {text}", partial(_read, {"mass": {"cube": value}}))
    for axis, values in WRONG_AXES.items():
        for value in values:
            yield Fault(AREA, f"{axis}: {value!r}", partial(_read, {axis: value}))
    for value in WRONG_WHOLES:
        yield Fault(AREA, f"all of it is {value!r}", partial(_read, value))
    yield Fault(AREA, "Distractors(count=None)", _uncounted)


def _read(data: Any, folder: Path) -> None:
    Randomization.from_json(data)


def _uncounted(folder: Path) -> None:
    Distractors(count=None)
