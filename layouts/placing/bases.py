"""Where bases may stand: on the ground, along a table's edges, on a wall, under a ceiling."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from layouts.frames import EDGES, Frame, Pose, Rectangle, rectangle, resolve, table_outlines
from layouts.placement import Placement, faced
from layouts.placing import Around
from robot_layouts.core.bounds import FAR, checked_number, shown
from robot_layouts.kinematics.quaternions import yaw_quaternion
from robot_layouts.kinematics.rotations import Floats, pose_matrix
from robots import LayoutError, RobotDescriptor, UnknownNameError
from robots.descriptor import IDENTITY, Vector3

EDGE = 0.1  # m, from a table's edge, or a rectangle's, to a base's middle
SIDEWAYS = math.pi / 2  # rad; how far robots at a table's edge turn away from its middle
MOST_BASES = 1500  # on the grid, of one robot
TURNS = 8  # in which a base on the grid may face, of a whole turn


@dataclass(frozen=True)
class BasePose:
    """Where one base stands.

    Attributes:
        surface: Index of the surface that it stands on.
        x: In the surface's frame (m).
        y: In the surface's frame (m).
        yaw: Turn about the frame's z from the robot's home (rad).
    """

    surface: int
    x: float
    y: float
    yaw: float


@dataclass(frozen=True)
class BaseSurface:
    """A plane that bases may stand on.

    Attributes:
        frame: Name of the frame that they hang on; None is the world.
        pose: Of that frame in the world.
        low: Least x and y of a base in the frame (m).
        high: Greatest x and y.
        turns: Least and greatest yaw (rad).
        keep_out: A rectangle in the frame that bases keep out of, or None.
    """

    frame: str | None
    pose: Pose
    low: tuple[float, float]
    high: tuple[float, float]
    turns: tuple[float, float] = (-math.pi, math.pi)
    keep_out: Rectangle | None = None

    def allows(self, x: float, y: float) -> bool:
        """Tell whether a base may stand at a point of the frame (m)."""
        if not (self.low[0] <= x <= self.high[0] and self.low[1] <= y <= self.high[1]):
            return False
        if self.keep_out is None:
            return True
        x_min, y_min, x_max, y_max = self.keep_out
        return not (x_min < x < x_max and y_min < y < y_max)


@dataclass(frozen=True)
class Surfaces:
    """All surfaces, and the frames that they belong to.

    Attributes:
        surfaces: Where bases may stand.
        frames: For the layout to hold.
        heights: Of each robot's base above its surface (m).
    """

    surfaces: tuple[BaseSurface, ...]
    frames: Mapping[str, Frame]
    heights: Mapping[str, float]

    def base(self, number: int, x: float, y: float, yaw: float) -> BasePose | None:
        """Return a base pose on a surface, in whole mm and mrad; None if it may not be there."""
        surface = self.surfaces[number]
        least, greatest = surface.turns
        if greatest - least >= 2 * math.pi:
            yaw = math.remainder(yaw, 2 * math.pi)
        yaw = min(max(yaw, least), greatest)
        x = min(max(round(x, 3), surface.low[0]), surface.high[0]) + 0.0
        y = min(max(round(y, 3), surface.low[1]), surface.high[1]) + 0.0
        return BasePose(number, x, y, round(yaw, 3) + 0.0) if surface.allows(x, y) else None

    def near(self, base: BasePose, dx: float, dy: float, dyaw: float = 0.0) -> BasePose | None:
        """Return the base pose that is so far from another one (m, rad), if one may be there."""
        return self.base(base.surface, base.x + dx, base.y + dy, base.yaw + dyaw)

    def grid(self) -> list[BasePose]:
        """Return base poses all over the surfaces, `MOST_BASES` at most, or few more."""
        planes = [s for s in self.surfaces if s.low[0] < s.high[0]]
        area = sum((s.high[0] - s.low[0]) * (s.high[1] - s.low[1]) for s in planes)
        step = max(math.sqrt(area * TURNS / MOST_BASES), 0.05) if planes else 0.05
        return [
            base
            for number, surface in enumerate(self.surfaces)
            for x in _spaced(surface.low[0], surface.high[0], step)
            for y in _spaced(surface.low[1], surface.high[1], step)
            for yaw in _turns(surface)
            if (base := self.base(number, x, y, yaw)) is not None
        ]

    def placement(
        self, name: str, robot: RobotDescriptor, keyframe: str | None, base: BasePose
    ) -> Placement:
        """Return the placement of a robot at a base pose, as a layout declares it."""
        position, on = (base.x, base.y, self.heights[name]), self.surfaces[base.surface].frame
        if robot.home.quaternion == IDENTITY:  # written as a turn, which people read more easily
            return Placement(robot, position, keyframe=keyframe, rpy=(0.0, 0.0, base.yaw), on=on)
        return Placement(robot, position, faced(robot, yaw_quaternion(base.yaw)), keyframe, on=on)

    def in_world(self, name: str, robot: RobotDescriptor, base: BasePose) -> Pose:
        """Return where the base of a robot at a base pose is in the world."""
        turn = faced(robot, yaw_quaternion(base.yaw))
        local = Pose((base.x, base.y, self.heights[name]), turn)
        return self.surfaces[base.surface].pose.then(local)


def ground_of(
    around: Around | None,
    within: Rectangle | None,
    heights: float | Mapping[str, float],
    robots: Mapping[str, RobotDescriptor],
    targets: Sequence[Sequence[float]],
) -> Surfaces:
    """Return where bases may stand; see `layouts.search`.

    Raises:
        LayoutError: If an argument is invalid, or leaves no place.
    """
    reach = max(robot.reach for robot in robots.values())
    bounds = None if within is None else rectangle("within", within)
    high = _heights(heights, robots)
    if around is None:
        return Surfaces((_on_the_ground(bounds, targets, reach, len(robots)),), {}, high)
    if isinstance(around, Frame):
        around = {"mount": around}
    if isinstance(around, Mapping):
        surfaces = tuple(_on_frames(around, bounds, targets, reach))
        return Surfaces(surfaces, dict(around), high)
    if not hasattr(around, "__len__") or isinstance(around, str) or len(around) != 4:
        raise _no_ground(around)
    x_min, y_min, x_max, y_max = rectangle("around", around)
    out = (x_min - EDGE, y_min - EDGE, x_max + EDGE, y_max + EDGE)
    low, top = (x_min - reach, y_min - reach), (x_max + reach, y_max + reach)
    surface = _clipped(BaseSurface(None, Pose(), low, top, keep_out=out), bounds)
    corners = product(*zip(surface.low, surface.high, strict=True))
    if not any(surface.allows(x, y) for x, y in corners):
        raise LayoutError(f"within {within} there is no room around {tuple(around)}")
    return Surfaces((surface,), {}, high)


def _no_ground(around: object) -> LayoutError:
    return LayoutError(
        f"around is {shown(around)}; it takes frames by name, as layouts.table(1.2, 0.8) makes"
        " them, one Frame, or x_min, y_min, x_max, y_max (m)"
    )


def _on_the_ground(
    within: Rectangle | None, targets: Sequence[Sequence[float]], reach: float, robots: int
) -> BaseSurface:
    """Return the ground round the targets, or round the origin if there are none."""
    if targets:
        spread = np.array([target[:2] for target in targets])
        low, high = spread.min(axis=0) - reach, spread.max(axis=0) + reach
    else:
        high = np.full(2, reach * math.sqrt(robots))
        low = -high
    return _clipped(_surface(None, Pose(), low, high), within)


def _surface(frame: str | None, pose: Pose, low: Floats, high: Floats) -> BaseSurface:
    (x_min, y_min), (x_max, y_max) = low.tolist(), high.tolist()
    return BaseSurface(frame, pose, (x_min, y_min), (x_max, y_max))


def _clipped(surface: BaseSurface, within: Rectangle | None) -> BaseSurface:
    return surface if within is None else replace(surface, low=within[:2], high=within[2:])


def _on_frames(
    frames: Mapping[str, Frame],
    within: Rectangle | None,
    targets: Sequence[Sequence[float]],
    reach: float,
) -> list[BaseSurface]:
    """Return the edges of tables, and the planes of all other frames."""
    if not frames or not all(isinstance(frame, Frame) for frame in frames.values()):
        raise _no_ground(frames)
    poses = resolve({name: (frame.on, frame.local_pose) for name, frame in frames.items()})
    tables = table_outlines(poses)
    edges = {f"{table}.{edge}" for table in tables for edge in EDGES}
    surfaces = [_edge(name, poses, tables) for name in frames if name in edges]
    planes = [name for name in frames if name not in edges and name not in tables]
    if within is not None and not planes:
        raise LayoutError(
            f"within is {within}, but bases stand along the edges of {', '.join(tables)}; make the"
            " table smaller, or leave within out"
        )
    return surfaces + [_plane(name, poses[name], within, targets, reach) for name in planes]


def _edge(name: str, poses: Mapping[str, Pose], tables: Mapping[str, list[Vector3]]) -> BaseSurface:
    corners = np.array(tables[name.rpartition(".")[0]])
    middle = np.array(poses[name].position)
    half = float(np.sort(np.linalg.norm(corners - middle, axis=1))[0])
    room = max(half - EDGE, 0.0)
    return BaseSurface(name, poses[name], (EDGE, -room), (EDGE, room), (-SIDEWAYS, SIDEWAYS))


def _plane(
    name: str,
    pose: Pose,
    within: Rectangle | None,
    targets: Sequence[Sequence[float]],
    reach: float,
) -> BaseSurface:
    places = np.array([target[:3] for target in targets] or [pose.position])
    back = np.linalg.inv(pose_matrix(pose.position, pose.quaternion))
    local = places @ back[:2, :3].T + back[:2, 3]
    low, high = local.min(axis=0) - reach, local.max(axis=0) + reach
    low, high = np.minimum(low, -reach), np.maximum(high, reach)
    return _clipped(_surface(name, pose, low, high), within)


def _heights(
    heights: float | Mapping[str, float], robots: Mapping[str, RobotDescriptor]
) -> dict[str, float]:
    given = heights if isinstance(heights, Mapping) else dict.fromkeys(robots, heights)
    for name in given:
        if name not in robots:
            raise UnknownNameError("robot to stand at a height", name, robots)
    return {
        name: checked_number("heights", given.get(name, 0.0), -FAR, FAR, LayoutError, "m")
        for name in robots
    }


def _spaced(low: float, high: float, step: float) -> list[float]:
    count = math.ceil((high - low) / step - 1e-9) + 1 if high > low else 1
    return np.linspace(low, high, count).tolist()


def _turns(surface: BaseSurface) -> list[float]:
    low, high = surface.turns
    whole = high - low >= 2 * math.pi
    count = TURNS if whole else round(TURNS * (high - low) / (2 * math.pi)) + 1
    return np.linspace(low, high, count, endpoint=not whole).tolist()
