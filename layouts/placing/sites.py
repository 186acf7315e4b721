"""Where bases may stand: on the ground, along a table's edges, on a wall, under a ceiling."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from layouts.frames import EDGES, Frame, Pose, resolve, table_outlines
from layouts.placement import Placement, faced
from robot_layouts.core.bounds import FAR, checked_number, checked_numbers, shown
from robot_layouts.kinematics.quaternions import yaw_quaternion
from robot_layouts.kinematics.rotations import pose_matrix
from robots import LayoutError, RobotDescriptor, UnknownNameError
from robots.descriptor import IDENTITY, Vector3

Rectangle = tuple[float, float, float, float]  # x_min, y_min, x_max, y_max (m)
Around = Mapping[str, Frame] | Frame | Sequence[float]

EDGE = 0.1  # m, from a table's edge, or a rectangle's, to a base's middle
SIDEWAYS = math.pi / 2  # rad; how far robots at a table's edge turn away from its middle


@dataclass(frozen=True)
class Seat:
    """Where one base stands.

    Attributes:
        site: Index of the site.
        x: In the site's frame (m).
        y: In the site's frame (m).
        yaw: Turn about the frame's z from the robot's home (rad).
    """

    site: int
    x: float
    y: float
    yaw: float


@dataclass(frozen=True)
class Site:
    """A plane that bases may stand on.

    Attributes:
        frame: Name of the frame that they hang on; None is the world.
        pose: Of that frame in the world.
        low: Least x and y of a base in the frame (m).
        high: Greatest x and y.
        turns: Least and greatest yaw (rad).
        free_of: A rectangle in the frame that bases keep out of, or None.
    """

    frame: str | None
    pose: Pose
    low: tuple[float, float]
    high: tuple[float, float]
    turns: tuple[float, float] = (-math.pi, math.pi)
    free_of: Rectangle | None = None

    def allows(self, x: float, y: float) -> bool:
        """Tell whether a base may stand at a point of the frame (m)."""
        if not (self.low[0] <= x <= self.high[0] and self.low[1] <= y <= self.high[1]):
            return False
        if self.free_of is None:
            return True
        x_min, y_min, x_max, y_max = self.free_of
        return not (x_min < x < x_max and y_min < y < y_max)

    def seat(self, number: int, x: float, y: float, yaw: float) -> Seat | None:
        """Return a seat near some place, in whole mm and mrad; None if none may be there."""
        if self.turns[1] - self.turns[0] >= 2 * math.pi:
            yaw = math.remainder(yaw, 2 * math.pi)
        yaw = min(max(yaw, self.turns[0]), self.turns[1])
        x = min(max(round(x, 3), self.low[0]), self.high[0]) + 0.0
        y = min(max(round(y, 3), self.low[1]), self.high[1]) + 0.0
        return Seat(number, x, y, round(yaw, 3) + 0.0) if self.allows(x, y) else None


@dataclass(frozen=True)
class Ground:
    """All sites, and the frames that they belong to.

    Attributes:
        sites: Where bases may stand.
        frames: For the layout to hold.
        heights: Of each robot's base above its site (m).
    """

    sites: tuple[Site, ...]
    frames: Mapping[str, Frame]
    heights: Mapping[str, float]

    def placement(
        self, name: str, robot: RobotDescriptor, keyframe: str | None, seat: Seat
    ) -> Placement:
        """Return the placement of a robot in a seat, as a layout declares it."""
        position, on = (seat.x, seat.y, self.heights[name]), self.sites[seat.site].frame
        if robot.home.quaternion == IDENTITY:  # written as a turn, which people read more easily
            return Placement(robot, position, keyframe=keyframe, rpy=(0.0, 0.0, seat.yaw), on=on)
        return Placement(robot, position, faced(robot, yaw_quaternion(seat.yaw)), keyframe, on=on)

    def in_world(self, name: str, robot: RobotDescriptor, seat: Seat) -> Pose:
        """Return where the base of a robot in a seat is in the world."""
        turn = faced(robot, yaw_quaternion(seat.yaw))
        local = Pose((seat.x, seat.y, self.heights[name]), turn)
        return self.sites[seat.site].pose.then(local)


def ground_of(
    around: Around | None,
    within: Rectangle | None,
    heights: float | Mapping[str, float],
    robots: Mapping[str, RobotDescriptor],
    targets: Sequence[Sequence[float]],
) -> Ground:
    """Return where bases may stand; see `layouts.search`.

    Raises:
        LayoutError: If an argument makes no sense, or leaves no place.
    """
    reach = max(robot.reach for robot in robots.values())
    bounds = None if within is None else rectangle("within", within)
    high = _heights(heights, robots)
    if around is None:
        return Ground((_on_the_ground(bounds, targets, reach, len(robots)),), {}, high)
    if isinstance(around, Frame):
        around = {"mount": around}
    if isinstance(around, Mapping):
        sites = tuple(_on_frames(around, bounds, targets, reach))
        return Ground(sites, dict(around), high)
    if not hasattr(around, "__len__") or isinstance(around, str) or len(around) != 4:
        raise _no_ground(around)
    x_min, y_min, x_max, y_max = rectangle("around", around)
    out = (x_min - EDGE, y_min - EDGE, x_max + EDGE, y_max + EDGE)
    low, top = (x_min - reach, y_min - reach), (x_max + reach, y_max + reach)
    site = _clipped(Site(None, Pose(), low, top, free_of=out), bounds)
    corners = [(x, y) for x in (site.low[0], site.high[0]) for y in (site.low[1], site.high[1])]
    if not any(site.allows(*corner) for corner in corners):
        raise LayoutError(f"within {within} there is no room around {tuple(around)}")
    return Ground((site,), {}, high)


def rectangle(what: str, value: object) -> Rectangle:
    """Return x_min, y_min, x_max, y_max (m).

    Raises:
        LayoutError: If it is no rectangle.
    """
    x_min, y_min, x_max, y_max = checked_numbers(what, value, 4, FAR, LayoutError)
    if x_min >= x_max or y_min >= y_max:
        raise LayoutError(f"{what} is {shown(value)}; it must be x_min, y_min, x_max, y_max (m)")
    return x_min, y_min, x_max, y_max


def _no_ground(around: object) -> LayoutError:
    return LayoutError(
        f"around is {shown(around)}; it takes frames by name, as layouts.table(1.2, 0.8) makes"
        " them, one Frame, or x_min, y_min, x_max, y_max (m)"
    )


def _on_the_ground(
    within: Rectangle | None, targets: Sequence[Sequence[float]], reach: float, robots: int
) -> Site:
    """Return the ground round the targets, or round the origin if there are none."""
    if targets:
        spread = np.array([target[:2] for target in targets])
        low, high = spread.min(axis=0) - reach, spread.max(axis=0) + reach
    else:
        high = np.full(2, reach * math.sqrt(robots))
        low = -high
    site = Site(None, Pose(), (float(low[0]), float(low[1])), (float(high[0]), float(high[1])))
    return _clipped(site, within)


def _clipped(site: Site, within: Rectangle | None) -> Site:
    if within is None:
        return site
    low, high = (within[0], within[1]), (within[2], within[3])
    return Site(site.frame, site.pose, low, high, site.turns, site.free_of)


def _on_frames(
    frames: Mapping[str, Frame],
    within: Rectangle | None,
    targets: Sequence[Sequence[float]],
    reach: float,
) -> list[Site]:
    """Return the edges of tables, and the planes of all other frames."""
    if not frames or not all(isinstance(frame, Frame) for frame in frames.values()):
        raise _no_ground(frames)
    poses = resolve({name: (frame.on, frame.local_pose) for name, frame in frames.items()})
    tables = table_outlines(poses)
    edges = {f"{table}.{edge}" for table in tables for edge in EDGES}
    sites = [_edge(name, poses, tables) for name in frames if name in edges]
    planes = [name for name in frames if name not in edges and name not in tables]
    if within is not None and not planes:
        raise LayoutError(
            f"within is {within}, but bases stand along the edges of {', '.join(tables)}; make the"
            " table smaller, or leave within out"
        )
    return sites + [_plane(name, poses[name], within, targets, reach) for name in planes]


def _edge(name: str, poses: Mapping[str, Pose], tables: Mapping[str, list[Vector3]]) -> Site:
    corners = np.array(tables[name.rpartition(".")[0]])
    middle = np.array(poses[name].position)
    half = float(np.sort(np.linalg.norm(corners - middle, axis=1))[0])
    room = max(half - EDGE, 0.0)
    return Site(name, poses[name], (EDGE, -room), (EDGE, room), (-SIDEWAYS, SIDEWAYS))


def _plane(
    name: str,
    pose: Pose,
    within: Rectangle | None,
    targets: Sequence[Sequence[float]],
    reach: float,
) -> Site:
    places = np.array([target[:3] for target in targets] or [pose.position])
    back = np.linalg.inv(pose_matrix(pose.position, pose.quaternion))
    local = places @ back[:2, :3].T + back[:2, 3]
    low, high = local.min(axis=0) - reach, local.max(axis=0) + reach
    low, high = np.minimum(low, -reach), np.maximum(high, reach)
    plane = Site(name, pose, (float(low[0]), float(low[1])), (float(high[0]), float(high[1])))
    return _clipped(plane, within)


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
