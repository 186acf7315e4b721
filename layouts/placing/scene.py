"""What is known exactly of robots wherever they stand, kept for as long as a search runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from layouts.frames import Pose, table_outlines
from layouts.layout import Layout
from layouts.placement import Placement
from layouts.placing.arms import Arm
from layouts.placing.demands import Demand
from layouts.placing.sites import Ground, Seat
from layouts.validation.check import TABLE_DEPTH, moving_hulls, noisy_postures
from layouts.validation.collisions import (
    FAR,
    Postures,
    fixed,
    nearer_than,
    nearest,
    stand,
    touching,
)
from layouts.validation.reach import Workspace
from layouts.validation.slabs import slab_hull
from robot_layouts.kinematics.quaternions import inverted, rotated
from robot_layouts.kinematics.rotations import Floats, pose_matrix
from robots import RobotDescriptor
from robots.bodies.hulls import RobotModel, load_model

HANDY = 0.65  # of its reach; how far from its targets a base stands best
DRAWS = 20  # of joint noise, as many as `Layout.validate` takes


@dataclass(frozen=True, eq=False)
class Stood:
    """A robot in one seat.

    Attributes:
        pose: Of its base in the world.
        start: The robot at its keyframe, then with joint noise.
        on_table: Whether it sinks into no table there.
        spaces: Workspace of each of its arms, by full name; only those that can be measured.
    """

    pose: Pose
    start: Postures
    on_table: bool
    spaces: dict[str, Workspace]

    @cached_property
    def base(self) -> Floats:
        """Pose of the base in the world, (4, 4)."""
        return pose_matrix(self.pose.position, self.pose.quaternion)


class Scene:
    """The robots of a search, and the ground that they may stand on."""

    def __init__(
        self,
        robots: Mapping[str, RobotDescriptor],
        keyframe: str | None,
        ground: Ground,
        demands: Sequence[Demand],
    ) -> None:
        """Load what is needed.

        Args:
            robots: By name.
            keyframe: That they start from; None is each one's home.
            ground: Where they may stand.
            demands: What they are to reach.

        Raises:
            AssetError: If a robot's files cannot be found or make no sense.
        """
        self.robots, self.keyframe, self.ground = dict(robots), keyframe, ground
        self.models: dict[str, RobotModel] = {n: load_model(r) for n, r in robots.items()}
        homes = {name: Placement(robot, keyframe=keyframe) for name, robot in robots.items()}
        alone = Layout(homes)
        self.arms = {
            name: Arm(
                name,
                owner := alone.owner(name),
                robots[owner],
                part.robot,
                self.models[owner],
                homes[owner],
            )
            for name, part in alone.arms.items()
        }
        self._work = {name: self._work_of(name, demands) for name in robots}
        random = np.random.default_rng(0)
        self._starts = {n: noisy_postures(p, DRAWS, random) for n, p in homes.items()}
        outlines = table_outlines(Layout(homes, ground.frames).frame_poses)
        self._slabs = [
            fixed(name, slab_hull(np.array(top), TABLE_DEPTH, name), 1)
            for name, top in outlines.items()
        ]
        self._above = {name: moving_hulls(model) for name, model in self.models.items()}
        self._stood: dict[tuple[str, Seat], Stood] = {}
        self._gaps: dict[tuple[str, Seat, str, Seat], float] = {}
        self._shared: dict[tuple[str, Seat, str, Seat], float] = {}

    @property
    def pairs(self) -> list[tuple[str, str]]:
        """All pairs of robots."""
        return list(combinations(self.robots, 2))

    @cached_property
    def most_shared(self) -> float:
        """What pairs of robots could share at the very most (m³); of each, the smaller volume."""
        seat = {name: self.anywhere(name) for name in self.robots}
        volumes = {n: [s.volume for s in self.stood(n, seat[n]).spaces.values()] for n in seat}
        return sum(
            min(a, b) for one, other in self.pairs for a in volumes[one] for b in volumes[other]
        )

    def anywhere(self, name: str) -> Seat:
        """Return some seat."""
        site = self.ground.sites[0]
        return Seat(0, site.low[0], site.low[1], 0.0)

    def enough(self, one: str, other: str) -> float:
        """Return the distance of two robots (m) above which more is no better."""
        return min(self.robots[one].reach, self.robots[other].reach) / 3

    def _work_of(self, name: str, demands: Sequence[Demand]) -> Floats:
        """Return the places that a robot may have to reach, of all if those are none, (n, 3)."""
        own = [d for d in demands if any(self.arms[arm].owner == name for arm in d.arms)]
        places = [demand.numbers[:3] for demand in own or demands]
        return np.array(places, float).reshape(-1, 3)

    def awkward(self, name: str, bases: Floats, others: Sequence[Floats]) -> Floats:
        """Return how badly a robot stands for its work: its targets, or the others' bases.

        It stands well where it faces the middle of them, and is `HANDY` of its reach from each.

        Args:
            name: The robot.
            bases: Poses that its base may have, (n, 4, 4).
            others: Poses of the others' bases, (4, 4).

        Returns:
            For each pose 0 where it stands well, and 1 where it looks away, (n,).
        """
        work, robot = self._work[name], self.robots[name]
        towards = work if len(work) else np.array([base[:3, 3] for base in others]).reshape(-1, 3)
        if not len(towards):
            return np.zeros(len(bases))
        ahead = np.array(rotated(inverted(robot.home.quaternion), (1.0, 0.0, 0.0)))
        ways = towards.mean(axis=0) - bases[:, :3, 3]
        lengths = np.maximum(np.linalg.norm(ways, axis=1), 0.1)
        away = 1 - np.einsum("nij,j,ni->n", bases[:, :3, :3], ahead, ways) / lengths
        if not len(work):
            return away / 2
        far = np.linalg.norm(work - bases[:, None, :3, 3], axis=-1) / robot.reach
        return away / 2 + np.abs(far - HANDY).mean(axis=1)

    def start(self, name: str) -> Floats:
        """Return the joint positions that a robot starts from, (dof,) (rad, m)."""
        return self._starts[name][0]

    def stood(self, name: str, seat: Seat) -> Stood:
        """Return a robot in a seat."""
        known = self._stood.get((name, seat))
        if known is None:
            known = self._stood[name, seat] = self._stand(name, seat)
        return known

    def _stand(self, name: str, seat: Seat) -> Stood:
        robot, model = self.robots[name], self.models[name]
        pose = self.ground.in_world(name, robot, seat)
        start = stand(name, pose, model, self._starts[name])
        spaces = {
            arm.name: Workspace(pose, robot, model, arm.own)
            for arm in self.arms.values()
            if arm.owner == name
        }
        measured = {arm: space for arm, space in spaces.items() if space.sampled}
        return Stood(pose, start, not self._sinks(name, start), measured)

    def gap(self, one: str, seat: Seat, other: str, other_seat: Seat) -> float:
        """Return the least distance of two robots where they start, joint noise included (m)."""
        key = (one, seat, other, other_seat)
        if key not in self._gaps:
            first, second = self.stood(one, seat).start, self.stood(other, other_seat).start
            still = nearest(first.first, second.first)
            near = None if still is None else nearest(first, second, None, still)
            self._gaps[key] = FAR if near is None else near.distance
        return self._gaps[key]

    def shared(self, one: str, seat: Seat, other: str, other_seat: Seat) -> float:
        """Return how much space the arms of two robots share (m³)."""
        key = (one, seat, other, other_seat)
        if key not in self._shared:
            spaces = self.stood(one, seat).spaces.values()
            others = self.stood(other, other_seat).spaces.values()
            self._shared[key] = sum(a.shared_with(b) for a in spaces for b in others)
        return self._shared[key]

    def postures(self, name: str, seat: Seat, qpos: Floats) -> list[Postures]:
        """Return a robot in some postures, (n, dof) (rad, m), each alone."""
        stood = self.stood(name, seat)
        return [stand(name, stood.pose, self.models[name], one[None]) for one in qpos]

    def free(self, name: str, posture: Postures) -> bool:
        """Tell whether a robot touches neither itself nor a table."""
        pairs = self.models[name].self_pairs
        return not touching(posture, posture, pairs) and not self._sinks(name, posture)

    def near(self, posture: Postures, other: str, seat: Seat, distance: float) -> bool:
        """Tell whether a robot in a posture is nearer than that to another at its keyframe (m)."""
        return nearer_than(posture, self.stood(other, seat).start.first, distance)

    def gap_to_start(self, posture: Postures, other: str, seat: Seat) -> float:
        """Return how far a robot in a posture is from another one at its keyframe (m)."""
        near = nearest(posture, self.stood(other, seat).start.first)
        return FAR if near is None else near.distance

    def _sinks(self, name: str, postures: Postures) -> bool:
        return any(
            touching(postures, _repeated(slab, len(postures.poses)), self._above[name])
            for slab in self._slabs
        )

    def layout(self, seats: Mapping[str, Seat]) -> Layout:
        """Return the layout in which every robot stands in its seat."""
        return Layout(
            {
                name: self.ground.placement(name, robot, self.keyframe, seats[name])
                for name, robot in self.robots.items()
            },
            self.ground.frames,
        )

    def forget(self) -> None:
        """Drop what is known of seats; it takes memory, and few of them are tried again."""
        self._stood.clear()
        self._gaps.clear()
        self._shared.clear()


def _repeated(body: Postures, count: int) -> Postures:
    """Return a body that never moves in as many postures as another one has."""
    poses, low, high = (
        np.broadcast_to(part, (count, *part.shape[1:]))
        for part in (body.poses, body.low, body.high)
    )
    return replace(body, poses=poses, low=low, high=high)
