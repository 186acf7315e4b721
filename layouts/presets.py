"""Usual ways to place robots: pure functions of an ordered mapping from names to robots."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from layouts.layout import Layout, Placement, RobotLike, load_robot
from robots import LayoutError
from robots.descriptor import Quaternion


def single(robots: Mapping[str, RobotLike], *, keyframe: str | None = None) -> Layout:
    """One robot at its own home.

    Args:
        robots: Its name and robot.
        keyframe: Keyframe it starts from, if not its home's.
    """
    _expect_count("single", robots, 1)
    return Layout(
        {name: Placement(load_robot(robot), keyframe=keyframe) for name, robot in robots.items()}
    )


def side_by_side(
    robots: Mapping[str, RobotLike], *, spacing: float, keyframe: str = "rest"
) -> Layout:
    """Robots in a row along y through the origin, all facing +x; the first at the smallest y.

    Args:
        robots: Robot by name, in order.
        spacing: Distance between neighbouring bases (m).
        keyframe: Keyframe every robot starts from.
    """
    _expect_positive("spacing", spacing)
    first = -spacing * (len(robots) - 1) / 2
    return Layout(
        {
            name: Placement(
                load_robot(robot),
                position=(0.0, first + i * spacing, 0.0),
                quaternion=yaw_quaternion(0.0),
                keyframe=keyframe,
            )
            for i, (name, robot) in enumerate(robots.items())
        }
    )


def face_to_face(
    robots: Mapping[str, RobotLike], *, spacing: float, keyframe: str = "rest"
) -> Layout:
    """Two robots on the y axis, looking at each other across the origin; the first at -y.

    Args:
        robots: Robot by name; the first stands at y = -spacing / 2 and faces +y.
        spacing: Distance between the two bases (m).
        keyframe: Keyframe both robots start from.
    """
    _expect_count("face_to_face", robots, 2)
    _expect_positive("spacing", spacing)
    return Layout(
        {
            name: Placement(
                load_robot(robot),
                position=(0.0, side * spacing / 2, 0.0),
                quaternion=yaw_quaternion(-side * math.pi / 2),
                keyframe=keyframe,
            )
            for side, (name, robot) in zip((-1, 1), robots.items(), strict=True)
        }
    )


# Every preset, by the name it has on the command line.
PRESETS: Mapping[str, Callable[..., Layout]] = {
    "single": single,
    "side_by_side": side_by_side,
    "face_to_face": face_to_face,
}


def yaw_quaternion(yaw: float) -> Quaternion:
    """Return the wxyz quaternion of a rotation by ``yaw`` (rad) about z."""
    return (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))


def _expect_count(preset: str, robots: Mapping[str, RobotLike], count: int) -> None:
    if len(robots) != count:
        raise LayoutError(
            f"{preset} places {count} robot{'s' * (count > 1)}; {len(robots)} given: {list(robots)}"
        )


def _expect_positive(what: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0):
        raise LayoutError(f"{what} is {value} m; it must be finite and greater than 0")
