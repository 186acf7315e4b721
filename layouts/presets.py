"""Usual ways to place robots: pure functions of an ordered mapping from names to robots.

Every preset turns robots by where they reach out at home (`Placement.facing`), so that a robot
whose own front is not its base's +x faces like the others.

A distance given as ``"auto"`` comes from the robots' reach; see `layouts.distances`. Where it has
to serve several pairs of neighbours, it is that of the pair that asks for the most. If a robot is
not an arm of the catalogue, or has wheels, the robots' files are read, and more is seen to:

- A robot whose wheels or feet are lower than its base is raised by as much, and a driven torso
  starts where its arm works on the ground. One whose arm still begins too high for that stands
  lower, as before a table, with its hand over it.
- Neighbours in a row or face to face are moved together until they share places near the
  ground, with their grippers down, as two Pandas do.
- As by `Layout.validate`, robots are moved apart until none collide. If one collides with itself,
  that is an error.

At a table of a given size no robot is moved: a task or `Layout.validate` checks it. Without
python-fcl there is no such check, and the distance comes from reach alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from inspect import signature
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal, TypeGuard, cast

from layouts.distances import (
    apart,
    centred,
    gaps,
    in_catalogue,
    is_known_arm,
    ring_of,
    share_at_table,
    table_for,
)
from layouts.frames import EDGES, check_positive
from layouts.frames import table as table_frames
from layouts.layout import Layout
from layouts.placement import Placement, RobotLike, faced, load_robots
from robot_layouts.core.bounds import checked_whole, shown
from robot_layouts.core.catalogue import Catalogue
from robot_layouts.kinematics.quaternions import yaw_quaternion
from robots import (
    AssetError,
    LayoutError,
    MissingPackageError,
    RobotDescriptor,
    UnknownNameError,
)
from robots.descriptor import Vector3

if TYPE_CHECKING:
    from layouts.validation.report import Report

Distance = float | Literal["auto"]  # m

FARTHEST = 3.0  # m; as much farther apart than by their reach robots stand at most
START = 0.05  # m; what is left between robots as they start, so that hands can set out
LEAST = 0.01  # m; by which they are moved apart at least

# Of the shorter reach: how deep within reach of neighbours the places lie that they share, how near
# the ground they are, both as those of two Pandas; in which steps robots are moved together for
# that, and by how much at most.
ROOM, LOW, NEARER, CLOSEST = 0.14, 0.2, 0.05, 0.8

EDGE = 0.1  # from a table's edge to a base's middle (m); native's single Pandas have 0.11 m

FACING: Mapping[str, float] = {  # turn from an outward look along the radius (rad)
    "centre": math.pi,
    "out": 0.0,
    "tangent": math.pi / 2,
}


def single(robots: Mapping[str, RobotLike], *, keyframe: str | None = None) -> Layout:
    """One robot at its own home.

    Args:
        robots: Its name and robot.
        keyframe: Keyframe it starts from, if not its home's.
    """
    loaded = load_robots(robots, "single", 1)
    return Layout({name: Placement(robot, keyframe=keyframe) for name, robot in loaded.items()})


def side_by_side(
    robots: Mapping[str, RobotLike], *, spacing: Distance = "auto", keyframe: str | None = "rest"
) -> Layout:
    """Robots in a row along y through the origin, all facing +x; the first at the smallest y.

    Args:
        robots: Robot by name, in order.
        spacing: Distance between neighbouring bases (m); ``"auto"`` chooses it for each pair.
        keyframe: Keyframe every robot starts from; None is each one's home.
    """
    loaded = load_robots(robots)

    def placed(along: Sequence[float]) -> Layout:
        return Layout(
            {
                name: _placed(robot, (0.0, y, 0.0), 0.0, keyframe)
                for y, (name, robot) in zip(along, loaded.items(), strict=True)
            }
        )

    if _is_auto(spacing):
        return _clear(
            loaded,
            lambda more: placed(centred(gaps(loaded.values(), more))),
            tuple(pairwise(loaded)),
        )
    distance = _given("spacing", spacing)
    first = -distance * (len(loaded) - 1) / 2
    return placed([first + i * distance for i in range(len(loaded))])


def face_to_face(
    robots: Mapping[str, RobotLike], *, spacing: Distance = "auto", keyframe: str | None = "rest"
) -> Layout:
    """Two robots on the y axis, looking at each other across the origin; the first at -y.

    Args:
        robots: Robot by name; the first stands at y = -spacing / 2 and faces +y.
        spacing: Distance between the two bases (m), or ``"auto"``.
        keyframe: Keyframe both robots start from; None is each one's home.
    """
    loaded = load_robots(robots, "face_to_face", 2)

    def placed(distance: float) -> Layout:
        return Layout(
            {
                name: _placed(robot, (0.0, side * distance / 2, 0.0), -side * math.pi / 2, keyframe)
                for side, (name, robot) in zip((-1, 1), loaded.items(), strict=True)
            }
        )

    if _is_auto(spacing):
        return _clear(
            loaded, lambda more: placed(apart(*loaded.values()) + more), tuple(pairwise(loaded))
        )
    return placed(_given("spacing", spacing))


def ring(
    robots: Mapping[str, RobotLike],
    *,
    radius: Distance = "auto",
    facing: str = "centre",
    keyframe: str | None = None,
) -> Layout:
    """Robots on a circle about the origin, the first at -y, the others counterclockwise.

    Two robots that face the centre stand as in `face_to_face`.

    Args:
        robots: Robot by name, in order.
        radius: Distance of the bases from the origin (m), at equal angles. ``"auto"`` puts every
            two neighbours at their own hand-over distance, which makes the angles equal if the
            reaches are; a single robot stands where it reaches the centre.
        facing: ``"centre"``, ``"out"``, or ``"tangent"``: towards the next robot, along the circle.
        keyframe: Keyframe every robot starts from; None is each one's home.

    Raises:
        UnknownNameError: If a robot, a keyframe or the way to face does not exist.
    """
    if not isinstance(facing, str) or facing not in FACING:
        raise UnknownNameError("way to face", facing, FACING)
    loaded = load_robots(robots)

    def placed(radius: float, angles: Sequence[float]) -> Layout:
        placements: dict[str, Placement] = {}
        for angle, (name, robot) in zip(angles, loaded.items(), strict=True):
            x, y = radius * math.sin(angle), -radius * math.cos(angle)
            yaw = math.remainder(angle - math.pi / 2 + FACING[facing], 2 * math.pi)
            placements[name] = _placed(robot, (_rounded(x), _rounded(y), 0.0), yaw, keyframe)
        return Layout(placements)

    if _is_auto(radius):
        return _clear(loaded, lambda more: placed(*ring_of(list(loaded.values()), more)))
    count = len(loaded)
    return placed(_given("radius", radius), [2 * math.pi * i / count for i in range(count)])


def around_table(
    robots: Mapping[str, RobotLike],
    *,
    edges: Mapping[str, str] | Sequence[str] | None = None,
    table: tuple[float, float] | Literal["auto"] = "auto",
    inset: Distance = "auto",
    keyframe: str | None = None,
) -> Layout:
    """Robots on a table about the origin, along its edges, facing across it.

    They hang on the frames ``table.north`` (+y), ``table.east`` (+x), ``table.south`` and
    ``table.west``; see `layouts.frames.table`. Robots on one edge stand in order from right to left
    as they look at the table: evenly, or at hand-over distance if the table is ``"auto"``.

    Args:
        robots: Robot by name, in order.
        edges: Edge of each robot, by name or in order. Left out: south, north, west, east, and
            again from the south.
        table: Width (along x) and depth (along y) of the table (m). ``"auto"`` makes it so large
            that robots on opposite edges are at hand-over distance; a little larger if robots
            stand round its corners, and larger if several stand on one edge.
        inset: Distance of the bases from the edge, inwards (m). ``"auto"`` is 0.1 m for the robot
            that reaches farthest, and more for others, so that they work in the same places.
        keyframe: Keyframe every robot starts from; None is each one's home.

    Raises:
        LayoutError: If a robot has no edge, or a size or the inset is no distance or does not fit.
        UnknownNameError: If an edge, a robot or a keyframe does not exist.
    """
    loaded = load_robots(robots)
    sides = _edges(tuple(loaded), edges)
    rows = {edge: [n for n in loaded if sides[n] == edge] for edge in EDGES}
    standing = {edge: [loaded[name] for name in row] for edge, row in rows.items()}
    least = EDGE if _is_auto(inset) else _given("inset", inset)
    given = None if _is_auto(table) else _given_table(table, least)
    share = share_at_table(standing)
    farthest = max(robot.reach for robot in loaded.values())

    def placed(more: float) -> Layout:
        size = given or table_for(standing, least, more)
        lengths = {edge: size[0] if edge in ("north", "south") else size[1] for edge in EDGES}
        along: dict[str, float] = {}
        for edge, row in rows.items():
            even = [lengths[edge] / len(row) for _ in pairwise(row)]
            along.update(
                zip(row, centred(even if given else gaps(standing[edge], more)), strict=False)
            )
        placements: dict[str, Placement] = {}
        for name, robot in loaded.items():
            across = size[1] if sides[name] in ("north", "south") else size[0]
            shorter = share * (farthest - robot.reach)
            to_middle = (across - more) / 2 - share * robot.reach
            inwards = max(EDGE, min(EDGE + shorter, to_middle)) if _is_auto(inset) else least
            placements[name] = Placement(
                robot, (inwards, along[name], 0.0), keyframe=keyframe, on=f"table.{sides[name]}"
            )
        return Layout(placements, table_frames(*size))

    return placed(0.0) if given else _clear(loaded, placed)


def grid(
    robots: Mapping[str, RobotLike],
    *,
    spacing: Distance = "auto",
    columns: int | None = None,
    keyframe: str | None = None,
) -> Layout:
    """Robots in rows about the origin, all facing +x; rows along y, the next row at larger x.

    One row stands as in `side_by_side`. A last row that is not full starts like the others.

    Args:
        robots: Robot by name; the first row is filled first.
        spacing: Distance between neighbouring bases, along x and along y (m), or ``"auto"``.
        columns: Robots in a row; left out, as many as make the grid square.
        keyframe: Keyframe every robot starts from; None is each one's home.

    Raises:
        LayoutError: If ``columns`` is no count.
    """
    loaded = load_robots(robots)
    count = len(loaded)
    if columns is None:
        columns = math.ceil(math.sqrt(count))
    columns = checked_whole("columns", columns, 1, None, LayoutError)
    columns = min(columns, max(count, 1))
    rows = math.ceil(count / columns)
    cells = {divmod(i, columns): robot for i, robot in enumerate(loaded.values())}
    neighbours = [
        (robot, cells[other])
        for (row, column), robot in cells.items()
        for other in ((row + 1, column), (row, column + 1))
        if other in cells
    ]

    def placed(distance: float) -> Layout:
        placements: dict[str, Placement] = {}
        for i, (name, robot) in enumerate(loaded.items()):
            row, column = divmod(i, columns)
            x, y = (row - (rows - 1) / 2) * distance, (column - (columns - 1) / 2) * distance
            placements[name] = _placed(robot, (x, y, 0.0), 0.0, keyframe)
        return Layout(placements)

    if _is_auto(spacing):
        distance = max((apart(*pair) for pair in neighbours), default=0.0)
        return _clear(loaded, lambda more: placed(distance + more))
    return placed(_given("spacing", spacing))


# One line per preset, sorted by name: name -> module:function.
CATALOGUE = {
    "around_table": "layouts.presets:around_table",
    "face_to_face": "layouts.presets:face_to_face",
    "grid": "layouts.presets:grid",
    "ring": "layouts.presets:ring",
    "side_by_side": "layouts.presets:side_by_side",
    "single": "layouts.presets:single",
}


def _check(given: object, origin: str, name: str) -> Callable[..., Layout]:
    """Return what an entry point gave, if it can be a preset."""
    if _first_argument(given) != "robots":
        raise LayoutError(
            f"{origin} gave {shown(given)}; the preset {name} is needed, a function whose first"
            " argument is robots"
        )
    return cast("Callable[..., Layout]", given)


def _first_argument(function: Any) -> str | None:
    try:
        return next(iter(signature(function).parameters), None)
    except (TypeError, ValueError):  # no function, or one of which Python does not know
        return None


PRESETS = Catalogue(
    "layout preset",
    CATALOGUE,
    group="robot_layouts.presets",
    check=_check,
    error=LayoutError,
)


def _placed(
    robot: RobotDescriptor, position: Vector3, yaw: float, keyframe: str | None
) -> Placement:
    """Place a robot upright so that it reaches out along ``yaw`` (rad from +x)."""
    return Placement(robot, position, faced(robot, yaw_quaternion(yaw)), keyframe)


def _clear(
    robots: Mapping[str, RobotDescriptor],
    placed: Callable[[float], Layout],
    neighbours: Sequence[tuple[str, str]] = (),
) -> Layout:
    """Return a layout in which robots stand on the ground, share places, and do not collide.

    Their distances are those of reach if that suffices. Arms of the catalogue are not looked at:
    for them it does, as tests show.

    Args:
        robots: Robot by name.
        placed: Makes the layout, with distances that are so much larger than those of reach (m).
        neighbours: Robots that are to reach the same places, by name.

    Raises:
        LayoutError: If there is none; says why.
    """
    if not all(map(is_known_arm, robots.values())):
        with suppress(AssetError, MissingPackageError):  # else their bodies are not known here
            return _sound(placed, neighbours)
    return placed(0.0)


def _sound(placed: Callable[[float], Layout], neighbours: Sequence[tuple[str, str]]) -> Layout:
    """See `_clear`."""
    from layouts.ready import grounded

    starts = {name: grounded(placement) for name, placement in placed(0.0).items()}

    def raised(more: float) -> Layout:
        layout, places = placed(more), dict[str, Placement]()
        for name, start in starts.items():
            (x, y, _), (_, _, z) = layout[name].local_pose.position, start.local_pose.position
            place = replace(layout[name], keyframe=start.keyframe, qpos=start.qpos)
            places[name] = replace(place, position=(x, y, z))
        return Layout(places, layout.frames)

    more = _more_to_share(raised, neighbours)
    layout = raised(more)
    while farther := _farther(report := layout.validate(workspaces=False, samples=20)):
        more += farther
        if more >= FARTHEST:
            first = [str(finding) for finding in report.findings[:1]]
            raise LayoutError("\n".join(["no distance keeps these robots apart", *first]))
        layout = raised(more)
    for finding in layout.validate(workspaces=False, samples=0).findings:
        if finding.serious and finding.kind in ("self-collision", "joint limit", "table"):
            if not all(in_catalogue(layout[name].robot) for name in finding.robots):
                raise LayoutError(f"no distance makes this layout sound\n{finding}")
    return layout


def _farther(report: Report) -> float:
    """Return by how much farther apart robots have to stand (m); 0 if all are far enough apart."""
    collisions = [found for found in report.findings if found.kind == "collision"]
    near = [START - pair.noisy_distance for pair in report.clearances if not pair.table]
    farther = max((*(found.farther or FARTHEST for found in collisions), *near), default=0.0)
    return max(farther, LEAST) if farther > 0 else 0.0


def _more_to_share(
    placed: Callable[[float], Layout], neighbours: Sequence[tuple[str, str]]
) -> float:
    """Return by how much to change distances so that neighbours reach the same places (m).

    That is 0, or negative; also 0 if they are never near enough for that.
    """
    from layouts.shared_place import shared_place

    def share(layout: Layout, pair: tuple[str, str]) -> bool:
        arms = [layout[name].robot for name in pair]
        if any(arm.fingers is None or arm.limbs for arm in arms):
            return True
        shared = shared_place(layout, pair, height=LOW)
        return shared is not None and shared[1] >= ROOM * min(arm.reach for arm in arms)

    least = min(placement.robot.reach for placement in placed(0.0).values())
    for nearer in range(round(CLOSEST / NEARER)):
        more = -nearer * NEARER * least
        layout = placed(more)
        if all(share(layout, pair) for pair in neighbours):
            return more
    return 0.0


def _is_auto(distance: object) -> TypeGuard[Literal["auto"]]:
    return isinstance(distance, str) and distance == "auto"


def _given(what: str, distance: object) -> float:
    """Return a distance (m) that is not automatic."""
    if isinstance(distance, str):
        raise LayoutError(f"{what} is {distance!r}; it takes a number (m) or 'auto'")
    return check_positive(what, distance)


def _edges(
    names: Sequence[str], edges: Mapping[str, str] | Sequence[str] | None
) -> Mapping[str, str]:
    """Return the edge of each robot."""
    if edges is None:
        order = ("south", "north", "west", "east")
        edges = [order[i % len(order)] for i in range(len(names))]
    if isinstance(edges, Mapping):
        chosen = dict(edges)
    elif isinstance(edges, Sequence) and not isinstance(edges, str) and len(edges) == len(names):
        chosen = dict(zip(names, edges, strict=True))
    else:
        raise LayoutError(f"edges is {shown(edges)}; it takes one edge for each of {list(names)}")
    for name, edge in chosen.items():
        if name not in names:
            raise UnknownNameError("robot at the table", name, names)
        if not isinstance(edge, str) or edge not in EDGES:
            raise UnknownNameError("table edge", edge, EDGES)
    for name in names:
        if name not in chosen:
            raise LayoutError(f"edges gives no edge for {name!r}; choices: {', '.join(EDGES)}")
    return chosen


def _given_table(table: object, inset: float) -> tuple[float, float]:
    """Return width and depth (m) that are not automatic."""
    if not (isinstance(table, Sequence) and not isinstance(table, str) and len(table) == 2):
        raise LayoutError(f"table is {shown(table)}; it takes width and depth (m) or 'auto'")
    sizes: list[float] = []
    for what, given in zip(("width", "depth"), table, strict=True):
        size = check_positive(f"the table's {what}", given)
        if size <= 2 * inset:
            raise LayoutError(
                f"the table's {what} is {size} m; with an inset of {inset} m it must be more than"
                f" {2 * inset} m"
            )
        sizes.append(size)
    return sizes[0], sizes[1]


def _rounded(value: float) -> float:
    """Round to a picometre, so that a sine of pi is 0; there is no minus zero."""
    return round(value, 12) + 0.0
