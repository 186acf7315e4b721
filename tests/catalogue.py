"""Robots of the catalogue as parameters of tests: some always, all of them in `make test-all`."""

from __future__ import annotations

import functools
from collections.abc import Iterable

import pytest

from robots import AssetError, RobotRegistry
from robots.assets.locator import UrdfLocator
from robots.assets.manifest import EXAMPLE_ROBOT_DATA
from robots.registry import CATALOGUE

# One of each kind: the others differ from these in data alone.
QUICK = (
    "allegro_hand_right",
    "fetch",
    "floating_panda_gripper",
    "koch",
    "mobile_panda",
    "mobile_panda_dual",
    "panda",
    "panda_pinch",
    "panda_stick",
    "panda_wristcam",
    "so100",
    "xarm7",
    "xarm7_ability",
)


def is_optional(robot: str) -> bool:
    """Tell whether a robot's files are of a package that not everyone has."""
    urdf = RobotRegistry.load(robot).urdf
    return isinstance(urdf, UrdfLocator) and urdf.package.startswith(EXAMPLE_ROBOT_DATA.prefix)


def every_robot(names: Iterable[str] = CATALOGUE, *, quick: Iterable[str] = QUICK) -> list[object]:
    """Return a parameter for each robot; those that are not quick belong to the long tests."""
    return [pytest.param(name, marks=_marks(name, name in quick)) for name in names]


def _marks(robot: str, quick: bool) -> list[pytest.MarkDecorator]:
    optional = [pytest.mark.example_robots] if is_optional(robot) else []
    return optional if quick else [pytest.mark.long, *optional]


@functools.cache
def optional_problem() -> str | None:
    """Say why the files of optional robots cannot be found here, or None if they can."""
    for robot in filter(is_optional, CATALOGUE):
        try:
            RobotRegistry.load(robot).urdf.locate()
        except AssetError as error:
            return f"{str(error).splitlines()[0]}; pip install 'robot-layouts[robots]' brings them"
    return None
