"""Named frames that robots hang on: edges of tables, walls, ceilings; resolved to world poses."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from robot_layouts.core.bounds import FAR, as_float, checked_numbers, expect_unit, shown
from robot_layouts.kinematics.quaternions import multiplied, normalised, rotated, rpy_quaternion
from robots import LayoutError, UnknownNameError
from robots.descriptor import IDENTITY, Quaternion, Vector3

Rectangle = tuple[float, float, float, float]  # x_min, y_min, x_max, y_max (m)

ORIGIN: Vector3 = (0.0, 0.0, 0.0)
TABLE_DEPTH = 0.9  # m; tables are solid, from their tops down

# The edges of a table, and the turn about z (rad) from a table's +x to what each one faces: the
# middle of the table.
EDGES: Mapping[str, float] = {
    "north": -math.pi / 2,
    "east": math.pi,
    "south": math.pi / 2,
    "west": 0.0,
}


class HangingError(LayoutError):
    """A robot or frame that hangs on nothing that exists, or on itself; ``name`` says which."""

    def __init__(self, message: str, name: str) -> None:
        """Keep the message and the name of the robot or frame at fault."""
        super().__init__(message, name)
        self.name = name


@dataclass(frozen=True)
class Pose:
    """Where a frame is, in another one.

    Attributes:
        position: Its origin (m).
        quaternion: Its orientation, wxyz, unit length.
    """

    position: Vector3 = ORIGIN
    quaternion: Quaternion = IDENTITY

    def then(self, local: Pose) -> Pose:
        """Return what is at ``local`` in this frame, in the frame that this pose is given in."""
        (a, b, c), (x, y, z) = self.position, rotated(self.quaternion, local.position)
        turned = normalised(multiplied(self.quaternion, local.quaternion))
        return Pose((a + x, b + y, c + z), turned)


@dataclass(frozen=True)
class Frame:
    """A named place that robots and other frames can hang on.

    Attributes:
        position: Its origin in the frame it hangs on (m).
        quaternion: Its orientation there, wxyz, unit length; None is no turn.
        rpy: Its orientation as roll, pitch and yaw (rad, about fixed x, y, z as in a URDF),
            instead of a quaternion.
        on: Name of the frame or robot it hangs on; None is the world.
    """

    position: Vector3 = ORIGIN
    quaternion: Quaternion | None = None
    rpy: Vector3 | None = None
    on: str | None = None

    def __post_init__(self) -> None:
        """Refuse poses that are no poses."""
        object.__setattr__(self, "position", numbers("position", self.position, 3))
        check_pose(self)

    @property
    def local_pose(self) -> Pose:
        """Its pose in the frame it hangs on."""
        return Pose(self.position, declared_quaternion(self, IDENTITY))


def table(
    width: float,
    depth: float,
    *,
    position: Vector3 = ORIGIN,
    yaw: float = 0.0,
    name: str = "table",
) -> dict[str, Frame]:
    """Return the frames of a table top: its middle, and the middle of each edge.

    The north edge is the one at +y, the east edge at +x. A robot without a turn of its own that
    hangs on ``table.north`` faces the middle of the table.

    Args:
        width: Size along x (m).
        depth: Size along y (m).
        position: Middle of the top (m, world).
        yaw: Turn of the table about z (rad).
        name: Name of the middle; the edges are ``NAME.north`` and so on.

    Raises:
        LayoutError: If a size is not positive.
    """
    half_width = check_positive("a table's width", width) / 2
    half_depth = check_positive("a table's depth", depth) / 2
    places = {
        "north": (0.0, half_depth, 0.0),
        "east": (half_width, 0.0, 0.0),
        "south": (0.0, -half_depth, 0.0),
        "west": (-half_width, 0.0, 0.0),
    }
    edges = {
        f"{name}.{edge}": Frame(place, rpy=(0.0, 0.0, EDGES[edge]), on=name)
        for edge, place in places.items()
    }
    return {name: Frame(position, rpy=(0.0, 0.0, yaw)), **edges}


def table_outlines(frames: Mapping[str, Pose]) -> dict[str, list[Vector3]]:
    """Return the four corners of each table, by the name of its middle (m).

    A table is a frame ``NAME`` with frames ``NAME.north``, ``NAME.east`` and so on.

    Args:
        frames: World pose by name, as `Layout.frame_poses`.
    """
    corners: dict[str, list[Vector3]] = {}
    for name, middle in frames.items():
        if all(f"{name}.{edge}" in frames for edge in EDGES):
            north, east, south, west = (frames[f"{name}.{edge}"].position for edge in EDGES)
            centre = middle.position
            corners[name] = [
                (a[0] + b[0] - centre[0], a[1] + b[1] - centre[1], a[2] + b[2] - centre[2])
                for a, b in ((north, east), (east, south), (south, west), (west, north))
            ]
    return corners


def table_tops(
    frames: Mapping[str, Pose], table: Rectangle | None
) -> dict[str, tuple[Vector3, ...]]:
    """Return the corners of each table's top (m): those of the frames, and the one given.

    The one given, at z = 0, takes the place of a frame called ``table``.

    Args:
        frames: See `table_outlines`.
        table: Outline of a table, or None.

    Raises:
        LayoutError: If it is no rectangle.
    """
    tops = {name: tuple(corners) for name, corners in table_outlines(frames).items()}
    if table is not None:
        x_min, y_min, x_max, y_max = rectangle("table", table)
        outline = ((x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max))
        tops["table"] = tuple((x, y, 0.0) for x, y in outline)
    return tops


def rectangle(what: str, value: object) -> Rectangle:
    """Return an outline: x_min, y_min, x_max, y_max (m).

    Raises:
        LayoutError: If it is not four numbers, or not in this order.
    """
    x_min, y_min, x_max, y_max = numbers(what, value, 4)
    if x_min >= x_max or y_min >= y_max:
        raise LayoutError(f"{what} is {shown(value)}; it must be x_min, y_min, x_max, y_max (m)")
    return x_min, y_min, x_max, y_max


def wall(position: Vector3, *, yaw: float = 0.0) -> Frame:
    """Return a frame on a wall: z points out of the wall, x down.

    Args:
        position: A point on the wall (m, world).
        yaw: Turn about z from the world's +x to the direction in which the wall faces (rad).
    """
    return Frame(position, rpy=(0.0, math.pi / 2, yaw))


def ceiling(height: float, *, position: tuple[float, float] = (0.0, 0.0)) -> Frame:
    """Return a frame under a ceiling: z points down, x along the world's x.

    Args:
        height: Height of the ceiling (m).
        position: x and y of the frame (m, world).
    """
    x, y = numbers("position", position, 2)
    return Frame((x, y, height), quaternion=(0.0, 1.0, 0.0, 0.0))


def resolve(poses: Mapping[str, tuple[str | None, Pose]]) -> dict[str, Pose]:
    """Return world poses.

    Args:
        poses: By name, what each one hangs on (None is the world) and its pose there.

    Raises:
        HangingError: If one hangs on a name that is not there, or in the end on itself.
    """
    world: dict[str, Pose] = {}
    for name in poses:
        chain: dict[str, None] = {}  # from ``name`` to the world, as far as it is not known yet
        at: str | None = name
        while at is not None and at not in world:
            if at in chain:
                links = list(chain)
                circle = " on ".join(map(repr, [*links[links.index(at) :], at]))
                raise HangingError(f"these hang on each other: {circle}; let one stand free", at)
            chain[at] = None
            at = _support(at, poses)
        for at in reversed(chain):
            on, local = poses[at]
            world[at] = local if on is None else world[on].then(local)
    return world


def check_frame_names(frames: Mapping[str, object]) -> None:
    """Refuse frame names that are not words, or words joined by dots.

    Raises:
        LayoutError: If one is not, or is not a `Frame`.
    """
    for name, frame in frames.items():
        if not (isinstance(name, str) and re.fullmatch(r"[^\W\d]\w*(\.\w+)*", name)):
            raise LayoutError(
                f"frame name {name!r} must be a letter followed by letters, digits and _,"
                " with dots in between if wanted: 'table.north'"
            )
        if not isinstance(frame, Frame):
            raise LayoutError(
                f"frame {name!r} is a {type(frame).__name__}; it must be a layouts.Frame"
            )


def check_pose(declared: Any) -> None:
    """Check position, quaternion, rpy and ``on`` of a frozen declaration, and make them tuples.

    Raises:
        LayoutError: If one is no such thing, or both quaternion and rpy are given.
    """
    for what, count in (("position", 3), ("quaternion", 4), ("rpy", 3)):
        value = getattr(declared, what)
        if value is not None:
            object.__setattr__(declared, what, numbers(what, value, count))
    if declared.quaternion is not None:
        if declared.rpy is not None:
            raise LayoutError(
                f"quaternion {declared.quaternion} and rpy {declared.rpy} are both given;"
                " give one of them"
            )
        expect_unit("quaternion", declared.quaternion, LayoutError)
    if declared.on is not None and not isinstance(declared.on, str):
        raise LayoutError(f"on is {declared.on!r}; it takes the name of a frame or robot")


def declared_quaternion(declared: Any, default: Quaternion) -> Quaternion:
    """Return the wxyz quaternion of a checked declaration, or the default if it gives no turn."""
    if declared.rpy is not None:
        return rpy_quaternion(declared.rpy)
    return default if declared.quaternion is None else declared.quaternion


def check_positive(what: str, value: Any) -> float:
    """Return a distance: a number greater than 0 and of at most `FAR` (m).

    Raises:
        LayoutError: If it is not such a number.
    """
    distance = as_float(value)
    if distance is None or not 0 < distance <= FAR:
        raise LayoutError(
            f"{what} is {shown(value)} m; it must be finite and greater than 0, {FAR:g} at most"
        )
    return distance


def numbers(what: str, values: Any, count: int) -> tuple[float, ...]:
    """Return ``count`` floats of at most `robot_layouts.core.bounds.FAR`.

    Raises:
        LayoutError: If ``values`` are not that.
    """
    return checked_numbers(what, values, count, FAR, LayoutError)


def _support(name: str, poses: Mapping[str, tuple[str | None, Pose]]) -> str | None:
    on = poses[name][0]
    if on is not None and on not in poses:
        problem = UnknownNameError(
            "frame or robot", on, [other for other in poses if other != name]
        )
        raise HangingError(f"{name!r} hangs on an {problem}", name)
    return on
