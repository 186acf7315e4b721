"""Usual ways to place robots: pure functions of an ordered mapping from names to robots.

Every preset turns robots by where they reach out at home (`Placement.facing`), so that a robot
whose own front is not its base's +x faces like the others.

A distance given as ``"auto"`` comes from the robots' reach. Neighbours stand `HAND_OVER` of the sum
of their reaches apart: the last eighth of that sum is where both can work, so one can hand an
object to the other. Where one distance has to serve several pairs of neighbours, it is that of the
pair that can be the least far apart, but never less than `CLEAR` of the sum of two neighbours'
reaches, which keeps the bases of arms clear of each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import accumulate, combinations, pairwise
from typing import Literal

from layouts.frames import EDGES, check_positive
from layouts.frames import table as table_frames
from layouts.layout import Layout, Placement, RobotLike, faced, load_robot
from layouts.orientation import yaw_quaternion
from robots import LayoutError, RobotDescriptor, UnknownNameError
from robots.descriptor import Vector3

Distance = float | Literal["auto"]  # m

# Share of the sum of two reaches. ManiSkill's two-robot tasks stand their Pandas 1.5 m apart,
# which is 0.877 of twice 0.855 m (mani_skill 3.0.1, scene_builder/table).
HAND_OVER = 7 / 8
CLEAR = 1 / 4  # share of the sum of two reaches; 0.43 m for two Pandas

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
    _expect_count("single", robots, 1)
    return Layout(
        {name: Placement(load_robot(robot), keyframe=keyframe) for name, robot in robots.items()}
    )


def side_by_side(
    robots: Mapping[str, RobotLike], *, spacing: Distance, keyframe: str | None = "rest"
) -> Layout:
    """Robots in a row along y through the origin, all facing +x; the first at the smallest y.

    Args:
        robots: Robot by name, in order.
        spacing: Distance between neighbouring bases (m); ``"auto"`` chooses it for each pair.
        keyframe: Keyframe every robot starts from; None is each one's home.
    """
    loaded = _loaded(robots)
    if spacing == "auto":
        gaps = [_distance("spacing", spacing, [pair]) for pair in pairwise(loaded.values())]
        along = list(accumulate(gaps, initial=-sum(gaps) / 2))
    else:
        distance = _distance("spacing", spacing, [])
        first = -distance * (len(loaded) - 1) / 2
        along = [first + i * distance for i in range(len(loaded))]
    return Layout(
        {
            name: _placed(robot, (0.0, y, 0.0), 0.0, keyframe)
            for y, (name, robot) in zip(along, loaded.items(), strict=True)
        }
    )


def face_to_face(
    robots: Mapping[str, RobotLike], *, spacing: Distance, keyframe: str | None = "rest"
) -> Layout:
    """Two robots on the y axis, looking at each other across the origin; the first at -y.

    Args:
        robots: Robot by name; the first stands at y = -spacing / 2 and faces +y.
        spacing: Distance between the two bases (m), or ``"auto"``.
        keyframe: Keyframe both robots start from; None is each one's home.
    """
    _expect_count("face_to_face", robots, 2)
    loaded = _loaded(robots)
    distance = _distance("spacing", spacing, [tuple(loaded.values())])
    return Layout(
        {
            name: _placed(robot, (0.0, side * distance / 2, 0.0), -side * math.pi / 2, keyframe)
            for side, (name, robot) in zip((-1, 1), loaded.items(), strict=True)
        }
    )


def ring(
    robots: Mapping[str, RobotLike],
    *,
    radius: Distance = "auto",
    facing: str = "centre",
    keyframe: str | None = None,
) -> Layout:
    """Robots at equal angles on a circle about the origin; the first at -y, counterclockwise.

    Two robots that face the centre stand as in `face_to_face`.

    Args:
        robots: Robot by name, in order.
        radius: Distance of the bases from the origin (m). ``"auto"`` puts neighbours at hand-over
            distance, and a single robot where it reaches the centre.
        facing: ``"centre"``, ``"out"``, or ``"tangent"``: towards the next robot, along the circle.
        keyframe: Keyframe every robot starts from; None is each one's home.

    Raises:
        UnknownNameError: If a robot, a keyframe or the way to face does not exist.
    """
    if facing not in FACING:
        raise UnknownNameError("way to face", facing, FACING)
    loaded = _loaded(robots)
    around = list(loaded.values())
    if radius == "auto" and len(around) == 1:
        radius = HAND_OVER * around[0].reach
    elif radius == "auto":
        chord = _distance("radius", radius, pairwise([*around, around[0]]))
        radius = chord / (2 * math.sin(math.pi / len(around)))
    check_positive("radius", radius)
    placements: dict[str, Placement] = {}
    for i, (name, robot) in enumerate(loaded.items()):
        angle = 2 * math.pi * i / len(around)
        position = (_rounded(radius * math.sin(angle)), _rounded(-radius * math.cos(angle)), 0.0)
        yaw = math.remainder(angle - math.pi / 2 + FACING[facing], 2 * math.pi)
        placements[name] = _placed(robot, position, yaw, keyframe)
    return Layout(placements)


def around_table(
    robots: Mapping[str, RobotLike],
    *,
    edges: Mapping[str, str] | Sequence[str] | None = None,
    table: tuple[float, float] | Literal["auto"] = "auto",
    inset: float = 0.1,
    keyframe: str | None = None,
) -> Layout:
    """Robots on a table about the origin, along its edges, facing across it.

    They hang on the frames ``table.north`` (+y), ``table.east`` (+x), ``table.south`` and
    ``table.west``; see `layouts.frames.table`. Robots on one edge share it evenly, in order from
    right to left as they look at the table.

    Args:
        robots: Robot by name, in order.
        edges: Edge of each robot, by name or in order. Left out: south, north, west, east, and
            again from the south.
        table: Width (along x) and depth (along y) of the table (m). ``"auto"`` makes it so large
            that robots on one edge, and robots on opposite edges of a table with one robot an
            edge, are at hand-over distance.
        inset: Distance of the bases from the edge, inwards (m).
        keyframe: Keyframe every robot starts from; None is each one's home.

    Raises:
        LayoutError: If a robot has no edge, or the table is too small for the inset.
        UnknownNameError: If an edge, a robot or a keyframe does not exist.
    """
    loaded = _loaded(robots)
    sides = _edges(tuple(loaded), edges)
    if isinstance(inset, bool) or not (math.isfinite(inset) and inset >= 0):
        raise LayoutError(f"inset is {inset} m; it must be finite and 0 or more")
    rows = {edge: [name for name in loaded if sides[name] == edge] for edge in EDGES}
    width, depth = _table_size(table, list(loaded.values()), rows, inset)
    placements: dict[str, Placement] = {}
    for name, robot in loaded.items():
        row = rows[sides[name]]
        length = width if sides[name] in ("north", "south") else depth
        along = ((row.index(name) + 0.5) / len(row) - 0.5) * length
        placements[name] = Placement(
            robot, (inset, along, 0.0), keyframe=keyframe, on=f"table.{sides[name]}"
        )
    return Layout(placements, table_frames(width, depth))


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
    loaded = _loaded(robots)
    count = len(loaded)
    if columns is None:
        columns = math.ceil(math.sqrt(count))
    if isinstance(columns, bool) or not isinstance(columns, int) or columns < 1:
        raise LayoutError(f"columns is {columns!r}; it must be 1 or a larger whole number")
    columns = min(columns, max(count, 1))
    rows = math.ceil(count / columns)
    cells = {divmod(i, columns): robot for i, robot in enumerate(loaded.values())}
    neighbours = [
        (robot, cells[other])
        for (row, column), robot in cells.items()
        for other in ((row + 1, column), (row, column + 1))
        if other in cells
    ]
    distance = _distance("spacing", spacing, neighbours) if count > 1 or spacing != "auto" else 0.0
    placements: dict[str, Placement] = {}
    for i, (name, robot) in enumerate(loaded.items()):
        row, column = divmod(i, columns)
        x, y = (row - (rows - 1) / 2) * distance, (column - (columns - 1) / 2) * distance
        placements[name] = _placed(robot, (x, y, 0.0), 0.0, keyframe)
    return Layout(placements)


# Every preset, by the name it has on the command line.
PRESETS: Mapping[str, Callable[..., Layout]] = {
    "single": single,
    "side_by_side": side_by_side,
    "face_to_face": face_to_face,
    "ring": ring,
    "around_table": around_table,
    "grid": grid,
}


def _loaded(robots: Mapping[str, RobotLike]) -> dict[str, RobotDescriptor]:
    if not robots:
        raise LayoutError("a layout needs at least one robot")
    return {name: load_robot(robot) for name, robot in robots.items()}


def _placed(
    robot: RobotDescriptor, position: Vector3, yaw: float, keyframe: str | None
) -> Placement:
    """Place a robot upright so that it reaches out along ``yaw`` (rad from +x)."""
    return Placement(robot, position, faced(robot, yaw_quaternion(yaw)), keyframe)


def _distance(
    what: str, distance: Distance, neighbours: Iterable[Sequence[RobotDescriptor]]
) -> float:
    """Return a distance that is given, or the one that ``"auto"`` means for pairs of neighbours."""
    if distance == "auto":
        sums = [sum(robot.reach for robot in pair) for pair in neighbours]
        return max(HAND_OVER * min(sums), CLEAR * max(sums))
    if isinstance(distance, str):
        raise LayoutError(f"{what} is {distance!r}; it takes a number (m) or 'auto'")
    check_positive(what, distance)
    return distance


def _edges(
    names: Sequence[str], edges: Mapping[str, str] | Sequence[str] | None
) -> Mapping[str, str]:
    """Return the edge of each robot."""
    if edges is None:
        order = ("south", "north", "west", "east")
        edges = [order[i % len(order)] for i in range(len(names))]
    if isinstance(edges, str) or (not isinstance(edges, Mapping) and len(edges) != len(names)):
        raise LayoutError(f"edges is {edges!r}; it takes one edge for each of {list(names)}")
    chosen = dict(edges) if isinstance(edges, Mapping) else dict(zip(names, edges, strict=True))
    for name, edge in chosen.items():
        if name not in names:
            raise UnknownNameError("robot at the table", name, names)
        if edge not in EDGES:
            raise UnknownNameError("table edge", edge, EDGES)
    for name in names:
        if name not in chosen:
            raise LayoutError(f"edges gives no edge for {name!r}; choices: {', '.join(EDGES)}")
    return chosen


def _table_size(
    table: tuple[float, float] | Literal["auto"],
    robots: Sequence[RobotDescriptor],
    rows: Mapping[str, Sequence[str]],
    inset: float,
) -> tuple[float, float]:
    """Return width and depth (m)."""
    if isinstance(table, str):
        if table != "auto":
            raise LayoutError(f"table is {table!r}; it takes width and depth (m) or 'auto'")
        pairs = list(combinations(robots, 2)) or [(robots[0], robots[0])]
        apart = _distance("table", "auto", pairs)
        across, along = (
            max(1, *(len(rows[edge]) for edge in edges))
            for edges in (("north", "south"), ("east", "west"))
        )
        return apart * across + 2 * inset, apart * along + 2 * inset
    if len(table) != 2:
        raise LayoutError(f"table is {table!r}; it takes width and depth (m) or 'auto'")
    for what, size in zip(("width", "depth"), table, strict=True):
        check_positive(f"the table's {what}", size)
        if size <= 2 * inset:
            raise LayoutError(
                f"the table's {what} is {size} m; with an inset of {inset} m it must be more than"
                f" {2 * inset} m"
            )
    return table


def _rounded(value: float) -> float:
    """Round to a picometre, so that a sine of pi is 0; there is no minus zero."""
    return round(value, 12) + 0.0


def _expect_count(preset: str, robots: Mapping[str, RobotLike], count: int) -> None:
    if len(robots) != count:
        raise LayoutError(
            f"{preset} places {count} robot{'s' * (count > 1)}; {len(robots)} given: {list(robots)}"
        )
