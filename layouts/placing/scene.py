"""The geometry of a search: robots at any base poses, their clearances and workspaces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np

from layouts.frames import TABLE_DEPTH, Pose, table_outlines
from layouts.layout import Layout
from layouts.placement import Placement
from layouts.placing.bases import BasePose, Surfaces
from layouts.validation.collisions import (
    FAR,
    Postures,
    fixed,
    moving_hulls,
    nearer_than,
    nearest,
    noisy_postures,
    slab_hull,
    stand,
    touching,
)
from layouts.validation.reach import Arm, Workspace
from robot_layouts.kinematics.quaternions import inverted, rotated
from robot_layouts.kinematics.rotations import Floats, pose_matrix
from robots import RobotDescriptor
from robots.bodies.hulls import RobotModel, load_model

BEST_DISTANCE = 0.65  # of its reach; how far from its targets a base stands best
DRAWS = 20  # of joint noise, as many as `Layout.validate` takes
KEPT = 512  # robots at base poses; each takes about 0.1 MB


@dataclass(frozen=True, eq=False)
class PlacedRobot:
    """A robot at one base pose.

    Attributes:
        pose: Of its base in the world.
        base: The same, (4, 4).
        start: The robot at its keyframe, then with joint noise.
        on_table: Whether it sinks into no table there.
        spaces: Workspaces of its arms; only those that can be measured.
    """

    pose: Pose
    base: Floats
    start: Postures
    on_table: bool
    spaces: tuple[Workspace, ...]


class SearchScene:
    """The robots of a search, and the ground that they may stand on."""

    def __init__(
        self, robots: Mapping[str, RobotDescriptor], keyframe: str | None, ground: Surfaces
    ) -> None:
        """Load what is needed.

        Args:
            robots: By name.
            keyframe: That they start from; None is each one's home.
            ground: Where they may stand.

        Raises:
            AssetError: If a robot's files cannot be found or are invalid.
        """
        self.robots, self.keyframe, self.ground = dict(robots), keyframe, ground
        self.pairs = list(combinations(robots, 2))
        self.models: dict[str, RobotModel] = {n: load_model(r) for n, r in robots.items()}
        homes = {name: Placement(robot, keyframe=keyframe) for name, robot in robots.items()}
        layout = Layout(homes, ground.frames)
        self.arms = {n: Arm(layout, n, self.models[layout.owner(n)]) for n in layout.arms}
        random = np.random.default_rng(0)
        self._starts = {n: noisy_postures(p, DRAWS, random) for n, p in homes.items()}
        tables = {
            name: slab_hull(np.array(top), TABLE_DEPTH, name)
            for name, top in table_outlines(layout.frame_poses).items()
        }
        self._tables = {
            count: [fixed(name, hull, count) for name, hull in tables.items()]
            for count in (1, 1 + DRAWS)  # postures
        }
        self._moving = {name: moving_hulls(model) for name, model in self.models.items()}
        self.placed = lru_cache(KEPT)(self._placed)
        self.gap = lru_cache(KEPT * KEPT)(self._gap)
        self.shared_volume = lru_cache(KEPT * KEPT)(self._shared_volume)

    @property
    def reach(self) -> float:
        """The largest reach of a robot (m)."""
        return max(robot.reach for robot in self.robots.values())

    def start(self, name: str) -> Floats:
        """Return the joint positions that a robot starts from, (dof,) (rad, m)."""
        return self._starts[name][0]

    def ample_gap(self, one: str, other: str) -> float:
        """Return the distance of two robots (m) above which more is no better."""
        return min(self.robots[one].reach, self.robots[other].reach) / 3

    def largest_shared_volume(self) -> float:
        """Return what pairs of arms could share at most (m³): of each, the smaller workspace."""
        low = self.ground.surfaces[0].low
        spaces = {n: self.placed(n, BasePose(0, *low, 0.0)).spaces for n in self.robots}
        return sum(
            min(a.volume, b.volume)
            for one, other in self.pairs
            for a in spaces[one]
            for b in spaces[other]
        )

    def misalignment(
        self, name: str, bases: Floats, targets: Floats, others: Sequence[Floats]
    ) -> Floats:
        """Return how badly a robot stands for its targets, or towards the others' bases.

        It stands well where it faces the middle of them, and is `BEST_DISTANCE` of its reach from
        each target.

        Args:
            name: The robot.
            bases: Poses that its base may have, (n, 4, 4).
            targets: What it may have to reach, (targets, 3) (m).
            others: Poses of the others' bases, (4, 4), which count where there are no targets.

        Returns:
            For each pose 0 where it stands well, and 1 where it looks away, (n,).
        """
        robot = self.robots[name]
        ahead = np.array(rotated(inverted(robot.home.quaternion), (1.0, 0.0, 0.0)))
        places = targets if len(targets) else np.array([base[:3, 3] for base in others])
        if not len(places):
            return np.zeros(len(bases))
        towards = places.mean(axis=0) - bases[:, :3, 3]
        lengths = np.maximum(np.linalg.norm(towards, axis=1), 0.1)
        away = 1 - np.einsum("nij,j,ni->n", bases[:, :3, :3], ahead, towards) / lengths
        if not len(targets):
            return away / 2
        far = np.linalg.norm(targets - bases[:, None, :3, 3], axis=-1) / robot.reach
        return away / 2 + np.abs(far - BEST_DISTANCE).mean(axis=1)

    def posture(self, name: str, base: BasePose, qpos: Floats) -> Postures:
        """Return a robot at joint positions, (dof,) (rad, m)."""
        return stand(name, self.placed(name, base).pose, self.models[name], qpos[None])

    def free(self, name: str, posture: Postures) -> bool:
        """Tell whether a robot touches neither itself nor a table."""
        pairs = self.models[name].self_pairs
        return not touching(posture, posture, pairs) and not self._sinks(name, posture)

    def near(self, posture: Postures, other: str, base: BasePose, distance: float) -> bool:
        """Tell whether a robot in a posture is nearer than that to another at its keyframe (m)."""
        return nearer_than(posture, self.placed(other, base).start.first, distance)

    def gap_to_start(self, posture: Postures, other: str, base: BasePose) -> float:
        """Return how far a robot in a posture is from another one at its keyframe (m)."""
        approach = nearest(posture, self.placed(other, base).start.first)
        return FAR if approach is None else approach.distance

    def layout(self, bases: Mapping[str, BasePose]) -> Layout:
        """Return the layout in which every robot stands at its base pose."""
        return Layout(
            {
                name: self.ground.placement(name, robot, self.keyframe, bases[name])
                for name, robot in self.robots.items()
            },
            self.ground.frames,
        )

    def _placed(self, name: str, base: BasePose) -> PlacedRobot:
        pose = self.ground.in_world(name, self.robots[name], base)
        matrix = pose_matrix(pose.position, pose.quaternion)
        start = stand(name, pose, self.models[name], self._starts[name])
        spaces = [Workspace(arm, matrix) for arm in self.arms.values() if arm.owner == name]
        measured = tuple(space for space in spaces if space.sampled)
        return PlacedRobot(pose, matrix, start, not self._sinks(name, start), measured)

    def _sinks(self, name: str, postures: Postures) -> bool:
        tables = self._tables[len(postures.poses)]
        return any(touching(postures, table, self._moving[name]) for table in tables)

    def _gap(self, one: str, base: BasePose, other: str, other_base: BasePose) -> float:
        """Return the least distance of two robots where they start, joint noise included (m)."""
        first, second = self.placed(one, base).start, self.placed(other, other_base).start
        still = nearest(first.first, second.first)
        approach = None if still is None else nearest(first, second, None, still)
        return FAR if approach is None else approach.distance

    def _shared_volume(self, one: str, base: BasePose, other: str, other_base: BasePose) -> float:
        """Return how much space the arms of two robots share (m³)."""
        spaces, others = self.placed(one, base).spaces, self.placed(other, other_base).spaces
        return sum(a.shared_with(b) for a in spaces for b in others)
