"""The convex bodies of a cell: robots, tables, obstacles and what is held; which pairs count.

Where all their parts are is known for many states at once.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from layouts import Layout
from layouts.frames import TABLE_DEPTH, Rectangle, table_tops
from layouts.placement import Placement
from layouts.validation.collisions import slab_hull
from robot_layouts.core.bounds import FAR, checked_numbers, shown
from robot_layouts.kinematics.chain import motion_terms
from robot_layouts.kinematics.rotations import Floats, pose_matrix
from robot_layouts.motion.model.obstacles import Held, Obstacle, Track
from robots import LayoutError
from robots.action_split import is_gripper
from robots.bodies.hulls import Hull, RobotModel, load_model
from robots.urdf.tree import link_index

_Body = TypeVar("_Body", Obstacle, Held)

WORLD = 0  # the part that never moves
MOST_SHAPES = 2000  # convex parts of obstacles; a check of more takes minutes and gigabytes


@dataclass(frozen=True, eq=False)
class RigidBody:
    """What moves as one: a rigid body of a robot, with what it holds, or an obstacle.

    Attributes:
        robot: The robot's name; empty for the world and for obstacles.
        link: Index in the robot's tree of the link whose pose is the part's.
        parent: Index of the part that carries it; -1 for the world's own and for obstacles.
        joint: Pose of its joint in the frame of that part, (4, 4) (m).
        track: How it moves, if it is an obstacle.
    """

    robot: str = ""
    link: int = 0
    parent: int = -1
    joint: Floats = field(default_factory=lambda: np.eye(4))
    track: Track | None = None


@dataclass(frozen=True, eq=False)
class CellSolid:
    """A convex body of the cell.

    Attributes:
        name: For messages: ``left/panda_hand``, or the name of a table or an obstacle.
        owner: The robot, table or obstacle that it belongs to.
        mover: The robot that moves it; empty if none does.
        part: Index of the part that carries it.
        hull: Its corners in its own frame.
        offset: Its own frame in that of the part, (4, 4) (m).
    """

    name: str
    owner: str
    mover: str
    part: int
    hull: Hull
    offset: Floats


class Bodies:
    """All robots of a layout with all bodies that they may touch: what a `Cell` is made of.

    The coordinates of a cell are the joints of all robots: in the layout's order, each robot's in
    its descriptor's order.

    Attributes:
        layout: The layout.
        obstacles: What stands or moves in it.
        held: What arms hold.
        robots: The robots' names.
        slices: For each robot its part of the coordinates.
        size: How many coordinates there are (D).
        limits: Lower and upper limit of each, (D, 2) (rad, m); infinite where there is none.
        start: Where the layout starts its robots, (D,) (rad, m).
        links: Robot and link of each pose that `poses` returns.
        parts: What moves as one; the first is the world.
        solids: The convex bodies.
    """

    def __init__(
        self,
        layout: Layout,
        obstacles: Iterable[Obstacle] = (),
        held: Iterable[Held] = (),
        table: Rectangle | None = None,
    ) -> None:
        """Read the robots' files and gather all bodies.

        Args:
            layout: Which robots stand where. Its tables are in the cell, too.
            obstacles: What else stands in the way, or moves in it.
            held: What arms hold.
            table: A table's top as x_min, y_min, x_max, y_max (m), at height 0.

        Raises:
            AssetError: If a robot's files cannot be found or are invalid.
            LayoutError: If two bodies have one name, obstacles have too many parts, or an argument
                is of another type.
            MissingPackageError: If trimesh or python-fcl is not installed.
            UnknownNameError: If there is no place that is said to hold something.
        """
        if not isinstance(layout, Layout):
            raise LayoutError(f"layout is {shown(layout)}; it takes a layouts.Layout")
        self.layout = layout
        self.obstacles = _all_of("obstacles", obstacles, Obstacle)
        self.held = _all_of("held", held, Held)
        shapes = sum(len(o.shapes) for o in (*self.obstacles, *(h.obstacle for h in self.held)))
        if shapes > MOST_SHAPES:
            raise LayoutError(
                f"the obstacles have {shapes} convex parts together; it takes {MOST_SHAPES} at"
                " most, so let larger ones stand for several"
            )
        self.robots = tuple(layout)
        self.models: Mapping[str, RobotModel] = {
            name: load_model(placement.robot) for name, placement in layout.items()
        }
        ends = np.cumsum([0, *(len(m.kinematics.coordinates) for m in self.models.values())])
        self.slices = {
            name: slice(int(a), int(b))
            for name, a, b in zip(self.robots, ends[:-1], ends[1:], strict=True)
        }
        self.size = int(ends[-1])
        self.limits = np.concatenate([m.kinematics.limits for m in self.models.values()])
        self.start = np.concatenate([np.array(p.start_qpos, float) for p in layout.values()])
        self.links = tuple(
            (name, link) for name, m in self.models.items() for link in m.kinematics.links
        )
        self.tables = {
            name: slab_hull(np.array(top), TABLE_DEPTH, name)
            for name, top in table_tops(layout.frame_poses, checked_table(table)).items()
        }
        self._check_names()
        self._part_of: dict[tuple[str, int], int] = {}
        self.parts = self._gather_parts()
        self.solids: tuple[CellSolid, ...] = tuple(self._gather_solids())

    @property
    def names(self) -> tuple[str, ...]:
        """What `checker` can make an exception of: robots, links, tables, obstacles."""
        every = (name for solid in self.solids for name in (solid.owner, solid.name))
        return tuple(dict.fromkeys(every))

    def poses(self, qpos: ArrayLike) -> Floats:
        """Return the world poses of all links of all robots, (n, links, 4, 4) (m).

        Args:
            qpos: Coordinates, (n, D) (rad, m).
        """
        qpos = np.asarray(qpos, float)
        return np.concatenate(
            [
                self._bases[name] @ model.kinematics.forward(qpos[:, self.slices[name]])
                for name, model in self.models.items()
            ],
            axis=1,
        )

    # -- gathering ---------------------------------------------------------------------------

    def _check_names(self) -> None:
        taken = dict.fromkeys(self.robots, "a robot") | dict.fromkeys(self.tables, "a table")
        for body in (*self.obstacles, *(held.obstacle for held in self.held)):
            if "/" in body.name:
                raise LayoutError(
                    f"obstacle {body.name!r} has a /, as links' names have; rename it"
                )
            if body.name in taken:
                raise LayoutError(
                    f"an obstacle is called {body.name!r}, as {taken[body.name]} is; rename it"
                )
            taken[body.name] = "another obstacle"

    @cached_property
    def _bases(self) -> dict[str, Floats]:
        return {n: _base(placement) for n, placement in self.layout.items()}

    def _gather_parts(self) -> tuple[RigidBody, ...]:
        parts = [RigidBody()]
        for name, model in self.models.items():
            tree = model.kinematics
            self._part_of[name, 0] = WORLD
            for body in dict.fromkeys(tree.bodies[1:]):
                if body:
                    parent, pose = self._carried(name, int(tree.parents[body]))
                    self._part_of[name, body] = len(parts)
                    parts.append(RigidBody(name, body, parent, pose @ tree.origins[body]))
        tracks = [o.pose for o in self.obstacles if isinstance(o.pose, Track)]
        return (*parts, *(RigidBody(track=track) for track in tracks))

    def _gather_solids(self) -> Iterator[CellSolid]:
        for name, model in self.models.items():
            for i, hull in enumerate(model.hulls):
                part, offset = self._carried(name, hull.link)
                yield CellSolid(f"{name}/{model.link_name(i)}", name, name, part, hull, offset)
        for name, hull in self.tables.items():
            yield CellSolid(name, name, "", WORLD, hull, np.eye(4))
        tracked = len(self.parts) - sum(obstacle.moves for obstacle in self.obstacles)
        for obstacle in self.obstacles:
            part = tracked if obstacle.moves else WORLD
            tracked += obstacle.moves
            offset = np.eye(4) if obstacle.moves else obstacle.poses(None, 1)[0]
            for hull in obstacle.hulls:
                yield CellSolid(obstacle.name, obstacle.name, "", part, hull, offset)
        for held in self.held:
            robot, link = self.tcp(held.place)
            part, offset = self._carried(robot, link)
            pose = offset @ held.obstacle.poses(None, 1)[0]
            for hull in held.obstacle.hulls:
                yield CellSolid(held.obstacle.name, held.obstacle.name, robot, part, hull, pose)

    def _carried(self, robot: str, link: int) -> tuple[int, Floats]:
        """Return the part that carries a link, and the link's pose in its frame."""
        tree = self.models[robot].kinematics
        body, pose = tree.bodies[link], np.eye(4)
        at = link
        while at != body:
            pose, at = tree.origins[at] @ pose, int(tree.parents[at])
        part = self._part_of[robot, body]
        return part, self._bases[robot] @ pose if part == WORLD else pose

    def tcp(self, place: str) -> tuple[str, int]:
        """Return the robot of a place, and the index of its TCP link in the robot's tree.

        Raises:
            UnknownNameError: If there is no such place, or no such link.
        """
        robot = self.layout.owner(place)
        return robot, link_index(
            self.models[robot].kinematics, self.layout.arm(place).robot.tcp_link
        )

    # -- pairs -------------------------------------------------------------------------------

    @cached_property
    def counted_pairs(self) -> NDArray[np.intp]:
        """The pairs of solids that may not touch, whichever of them move, (m, 2)."""
        firsts = np.cumsum([0, *(len(model.hulls) for model in self.models.values())])
        links, others = range(firsts[-1]), range(firsts[-1], len(self.solids))
        owners = np.repeat(np.arange(len(self.models)), np.diff(firsts))
        moved = np.array([bool(solid.mover) for solid in self.solids])
        within = [
            np.array([*model.self_pairs], np.intp).reshape(-1, 2) + first
            for model, first in zip(self.models.values(), firsts, strict=False)
        ]
        across = _pairs_of(links)
        across = across[owners[across[:, 0]] != owners[across[:, 1]]]
        besides = np.array([*product(links, others)], np.intp).reshape(-1, 2)
        if self._touchable:
            held = [b not in self._touchable.get(a, ()) for a, b in besides.tolist()]
            besides = besides[held]
        among = _pairs_of(others)
        among = among[moved[among].any(axis=1)]
        pairs = np.concatenate([*within, across, besides, among])
        parts = np.array([solid.part for solid in self.solids], np.intp)
        return pairs[parts[pairs[:, 0]] != parts[pairs[:, 1]]]  # what moves against each other

    @cached_property
    def _touchable(self) -> dict[int, set[int]]:
        """For the solids of hands, what they hold."""
        touchable: dict[int, set[int]] = {}
        for held in self.held:
            robot = self.layout.owner(held.place)
            hand = self.hand(held.place)
            own = {i for i, s in enumerate(self.solids) if s.owner == held.obstacle.name}
            for i, solid in enumerate(self.solids):
                if solid.owner == robot and solid.part in hand:
                    touchable.setdefault(i, set()).update(own)
        return touchable

    def hand(self, place: str) -> set[int]:
        """Return the parts of a place's hand: what its TCP link and its gripper's joints carry.

        Raises:
            UnknownNameError: If there is no such place, or no such link.
        """
        robot, link = self.tcp(place)
        tree, arm = self.models[robot].kinematics, self.layout.arm(place).robot
        fingers = arm.fingers.links if arm.fingers else ()
        groups = arm.action_split.groups.items()
        gripping = {joint for name, group in groups if is_gripper(name) for joint in group.joints}
        drivers = {tree.coordinates.index(joint) for joint in gripping}
        hand = {tree.bodies[link], *(tree.bodies[link_index(tree, name)] for name in fingers)}
        for body in dict.fromkeys(tree.bodies):
            if tree.carrier(body) in hand or int(tree.drivers[body]) in drivers:
                hand.add(body)
        return {self._part_of[robot, body] for body in hand}


def _pairs_of(solids: range) -> NDArray[np.intp]:
    """Return all pairs of some solids, each once, (m, 2)."""
    return solids.start + np.stack(np.triu_indices(len(solids), 1), axis=-1)


def checked_table(table: Sequence[float] | None) -> Rectangle | None:
    """Return a table's outline as four numbers.

    Raises:
        LayoutError: If it is no rectangle.
    """
    if table is None:
        return None
    x_min, y_min, x_max, y_max = checked_numbers("table", table, 4, FAR, LayoutError, "m")
    if not (x_min < x_max and y_min < y_max):
        raise LayoutError(f"table is {shown(table)}; it takes x_min, y_min, x_max, y_max (m)")
    return x_min, y_min, x_max, y_max


def _all_of(what: str, given: Iterable[_Body], kind: type[_Body]) -> tuple[_Body, ...]:
    bodies = tuple(given) if isinstance(given, Iterable) else ()
    if not isinstance(given, Iterable) or not all(isinstance(body, kind) for body in bodies):
        raise LayoutError(f"{what} is {shown(given)}; it takes any number of {kind.__name__}s")
    return bodies


def _base(placement: Placement) -> Floats:
    return pose_matrix(placement.base_position, placement.base_quaternion)


class LinkPoses:
    """The parts of a cell and the joints between them, ordered for few and large products.

    What a joint does is A + B sin q + C cos q, or A + B q if it slides; the rows of one depth, of
    all robots, are computed at once.

    Attributes:
        rows: The row of each part in what `places` returns.
    """

    def __init__(self, bodies: Bodies, parts: Iterable[int]) -> None:
        """Prepare some parts, and all that carry them.

        Args:
            bodies: The cell.
            parts: Indices of its parts.
        """
        self._bodies = bodies
        depths = _depths(bodies.parts, {WORLD, *parts})
        tracks = [i for i in depths if bodies.parts[i].track is not None]
        moved = sorted((depth, i) for i, depth in depths.items() if i not in tracks)
        order = [i for _, i in moved]
        self.rows = {part: row for row, part in enumerate([*order, *tracks])}
        self._tracks = [bodies.parts[i].track for i in tracks]
        jointed = [bodies.parts[i] for i in order[1:]]
        self._count, self._jointed = len(self.rows), len(order)
        self._parents = np.array([self.rows[part.parent] for part in jointed], np.intp)
        ends = np.flatnonzero(np.diff([depth for depth, _ in moved])) + 1
        bounds = [*ends.tolist(), len(order)]
        self._levels = list(zip(bounds, bounds[1:], strict=False))
        trees = [bodies.models[part.robot].kinematics for part in jointed]
        links = [part.link for part in jointed]
        pick = list(zip(trees, links, strict=True))
        firsts = [bodies.slices[part.robot].start for part in jointed]
        drivers = [tree.drivers[i] + at for (tree, i), at in zip(pick, firsts, strict=True)]
        self._drivers = np.array(drivers, np.intp)
        self._factors = np.array([tree.multipliers[i] for tree, i in pick])[:, None]
        self._offsets = np.array([tree.offsets[i] for tree, i in pick])[:, None]
        self._slides = np.flatnonzero([tree.slides[i] for tree, i in pick])
        self._terms = np.array(
            [
                motion_terms(part.joint, tree.axes[i], slides=bool(tree.slides[i]))
                for part, (tree, i) in zip(jointed, pick, strict=True)
            ]
        ).reshape(-1, 3, 16)

    def places(self, qpos: Floats, times: Floats | None = None) -> Floats:
        """Return the world poses of the parts, (rows, n, 4, 4) (m).

        Args:
            qpos: Coordinates, (n, D) (rad, m).
            times: Where obstacles that move are, (n,) (s); None is 0.
        """
        count = len(qpos)
        poses = np.empty((self._count, count, 4, 4))
        poses[WORLD] = np.eye(4)
        if self._jointed > 1:
            self._place(poses[1 : self._jointed], self._motions(qpos))
        if self._tracks:
            moments = np.zeros(count) if times is None else times
            for row, track in enumerate(self._tracks, start=self._jointed):
                assert track is not None
                poses[row] = track.at(moments)
        return poses

    def _motions(self, qpos: Floats) -> Floats:
        """Return what each joint does, seen from the part that carries it, (joints, n, 4, 4)."""
        positions = qpos.T[self._drivers] * self._factors + self._offsets
        basis = np.empty((*positions.shape, 3))
        basis[..., 0] = 1.0
        np.sin(positions, out=basis[..., 1])
        np.cos(positions, out=basis[..., 2])
        if len(self._slides):
            basis[self._slides, :, 1] = positions[self._slides]
        return (basis @ self._terms).reshape(*positions.shape, 4, 4)

    def _place(self, poses: Floats, motions: Floats) -> None:
        """Fill in the poses of what hangs on joints, depth by depth."""
        first = self._levels[0][1] - 1 if self._levels else 0
        poses[:first] = motions[:first]  # those hang on the world
        for low, high in self._levels[1:]:
            own = slice(low - 1, high - 1)
            np.matmul(poses[self._parents[own] - 1], motions[own], out=poses[own])


def _depths(parts: tuple[RigidBody, ...], wanted: Iterable[int]) -> dict[int, int]:
    """Return how many joints away from the world some parts are, and those that carry them."""
    depths: dict[int, int] = {}

    def depth(part: int) -> int:
        if part not in depths:
            parent = parts[part].parent
            depths[part] = 0 if parent < 0 else depth(parent) + 1
        return depths[part]

    for part in wanted:
        depth(part)
    return depths
