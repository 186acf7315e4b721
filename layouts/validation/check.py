"""A check of a layout before anything moves: collisions, limits, workspaces, targets."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from layouts.arrangement import Arrangement
from layouts.placement import Placement
from layouts.validation.advice import (
    NARROW,
    to_be_reached,
    to_leave_the_table,
    to_stand_apart,
    to_start_elsewhere,
    to_touch_itself_no_more,
)
from layouts.validation.arguments import Rectangle, Targets, named_targets, table_tops
from layouts.validation.collisions import (
    Approach,
    Postures,
    fixed,
    nearest,
    stand,
    touching,
)
from layouts.validation.findings import (
    Clearance,
    Finding,
    LinkPair,
    Point,
    SharedWorkspace,
    TargetReach,
    length_text,
    links_text,
    reach_text,
)
from layouts.validation.reach import Reach, Solution, Workspace
from layouts.validation.report import Report
from layouts.validation.slabs import slab_hull
from robot_layouts.core.progress import Progress
from robot_layouts.kinematics.rotations import Floats
from robots import (
    AssetError,
    DescriptorError,
    LayoutError,
    RobotLayoutsError,
    UnknownNameError,
)
from robots.bodies.hulls import RobotModel, load_model

TABLE_DEPTH = 0.9  # m; tables are solid, from their tops down
SHALLOW = 0.005  # m; a folded arm's hulls overlap by less where its links do not
LIMIT_TOLERANCE = 1e-4  # rad or m; limits and keyframes are written with four digits


def validate(
    layout: Arrangement,
    *,
    targets: Targets = (),
    samples: int = 20,
    table: Rectangle | None = None,
    seed: int = 0,
    workspaces: bool = True,
) -> Report:
    """Check a layout; see `layouts.Layout.validate`."""
    if not (isinstance(samples, int) and samples >= 0):
        raise LayoutError(f"samples is {samples!r}; it must be an integer of 0 or more")
    if table is not None and not (
        all(math.isfinite(x) for x in table) and table[0] < table[2] and table[1] < table[3]
    ):
        raise LayoutError(f"table is {table}; it must be x_min, y_min, x_max, y_max (m)")
    return _Check(layout, named_targets(targets), samples, table, seed).run(workspaces)


class _Check:
    """One check of one layout, with everything loaded that it needs."""

    def __init__(
        self,
        layout: Arrangement,
        targets: Mapping[str, tuple[float, ...]],
        samples: int,
        table: Rectangle | None,
        seed: int,
    ) -> None:
        self._layout, self._targets, self._draws = layout, targets, samples
        self._tops = table_tops(layout, table)
        self._progress = Progress(work="checking the layout")
        self._unread: dict[str, RobotLayoutsError] = {}
        self._models = dict(self._load())
        if self._unread and not self._models:
            raise next(iter(self._unread.values()))
        self._checked = {name: layout[name] for name in self._models}
        random = np.random.default_rng(seed)
        self._robots = {
            name: stand(name, p.base_pose, self._models[name], noisy_postures(p, samples, random))
            for name, p in self._checked.items()
        }
        self._surfaces = {
            name: fixed(name, slab_hull(np.array(top), TABLE_DEPTH, name), samples + 1)
            for name, top in self._tops.items()
        }

    def _load(self) -> Iterator[tuple[str, RobotModel]]:
        for name, placement in self._layout.items():
            self._progress.tell(f"files of {name}")
            try:
                yield name, load_model(placement.robot)
            except (AssetError, DescriptorError, UnknownNameError) as error:
                self._unread[name] = error

    def run(self, workspaces: bool) -> Report:
        findings = [*self._unreadable(), *self._limits(), *self._self_collisions()]
        clearances: list[Clearance] = []
        for one, other, pairs in self._neighbours():
            found, clearance = self._compare(one, other, pairs)
            findings += found
            clearances += clearance
        spaces = self._workspaces() if workspaces else {}
        reaches = tuple(self._reaches())
        findings += self._missed(reaches)
        return Report(
            layout=self._layout,
            draws=self._draws,
            tables=self._tops,
            targets={name: target[:3] for name, target in self._targets.items()},
            findings=tuple(sorted(findings, key=lambda finding: not finding.serious)),
            clearances=tuple(clearances),
            shared=tuple(_shared(spaces)),
            workspaces={name: space.volume for name, space in spaces.items()},
            reaches=reaches,
            outlines={
                name: _outline(self._robots[name]) if name in self._robots else ()
                for name in self._layout
            },
        )

    def _unreadable(self) -> Iterator[Finding]:
        for name, error in self._unread.items():
            yield Finding(
                "files",
                True,
                (name,),
                (),
                0.0,
                "m",
                f"{name} cannot be checked: {error}",
                f"mend the files or the descriptor of {self._layout[name].robot.name}; the others"
                f" are checked as if {name} were not there",
            )

    # -- joint limits ------------------------------------------------------------------------

    def _limits(self) -> Iterator[Finding]:
        for name, placement in self._checked.items():
            limits = self._models[name].kinematics.limits
            for joint, value, (low, high) in zip(
                placement.robot.joints, placement.start_qpos, limits.tolist(), strict=True
            ):
                excess = max(low - value, value - high)
                if excess > LIMIT_TOLERANCE:
                    unit = self._unit(placement, joint)
                    yield Finding(
                        "joint limit",
                        True,
                        (name,),
                        (),
                        excess,
                        unit,
                        f"keyframe {placement.start_keyframe!r} of {name} puts {joint} at"
                        f" {value:g} {unit}, {excess:.3g} {unit} beyond its limits"
                        f" {low:g} … {high:g}",
                        f"put {joint} within its limits, or {to_start_elsewhere(placement)}",
                    )

    @staticmethod
    def _unit(placement: Placement, joint: str) -> str:
        groups = placement.robot.action_split.groups.values()
        return next(group.unit for group in groups if joint in group.joints)

    # -- collisions --------------------------------------------------------------------------

    def _self_collisions(self) -> Iterator[Finding]:
        for name, robot in self._robots.items():
            self._progress.tell(f"{name} with itself")
            overlaps = touching(robot, robot, self._models[name].self_pairs)
            if overlaps:
                pairs = _worst(overlaps)
                still = any(overlap.posture == 0 for overlap in overlaps)
                yield Finding(
                    "self-collision",
                    still or pairs[0].depth > SHALLOW,
                    (name,),
                    pairs,
                    pairs[0].depth,
                    "m",
                    f"{name} touches itself {self._when(overlaps)}:"
                    f" {links_text(pairs, (name, name))}",
                    to_touch_itself_no_more(self._layout[name], overlaps),
                )

    def _neighbours(
        self,
    ) -> Iterator[tuple[Postures, Postures, Sequence[tuple[int, int]] | None]]:
        for one, other in combinations(self._robots.values(), 2):
            yield one, other, None
        for name, robot in self._robots.items():
            for surface in self._surfaces.values():
                yield robot, surface, moving_hulls(self._models[name])

    def _compare(
        self, one: Postures, other: Postures, pairs: Sequence[tuple[int, int]] | None
    ) -> tuple[list[Finding], list[Clearance]]:
        self._progress.tell(f"{one.name} with {other.name}")
        still = nearest(one.first, other.first, pairs)
        if still is None:
            return [], []
        near = nearest(one, other, pairs, still) or still
        between, table = (one.name, other.name), other.name in self._surfaces
        clearance = Clearance(
            between, table, still.links, still.distance, near.links, near.distance, still.points
        )
        if near.distance < 0:
            return [self._collision(one, other, touching(one, other, pairs))], [clearance]
        if near.distance < NARROW and not table:
            return [self._narrow(one, other, near)], [clearance]
        return [], [clearance]

    def _collision(self, one: Postures, other: Postures, overlaps: list[Approach]) -> Finding:
        pairs, between = _worst(overlaps), (one.name, other.name)
        at_table = other.name in self._surfaces
        advice, farther = (
            (to_leave_the_table(one.name, self._layout[one.name], overlaps[0]), None)
            if at_table
            else to_stand_apart(self._layout, one, other)
        )
        return Finding(
            "table" if at_table else "collision",
            True,
            between[:1] if at_table else between,
            pairs,
            pairs[0].depth,
            "m",
            f"{one.name} and {other.name} collide {self._when(overlaps)}:"
            f" {links_text(pairs, between, table=at_table)}",
            advice,
            farther,
        )

    def _narrow(self, one: Postures, other: Postures, near: Approach) -> Finding:
        first, second = near.links
        return Finding(
            "clearance",
            False,
            (one.name, other.name),
            (),
            near.distance,
            "m",
            f"{one.name}.{first} comes within {length_text(near.distance)} of"
            f" {other.name}.{second}",
            *to_stand_apart(self._layout, one, other),
        )

    def _when(self, overlaps: list[Approach]) -> str:
        """Say in which postures: at the keyframes, or only with joint noise."""
        if any(overlap.posture == 0 for overlap in overlaps):
            return "at the keyframes"
        noisy = len({overlap.posture for overlap in overlaps})
        return f"with joint noise ({noisy} of {self._draws} draws)"

    # -- reach -------------------------------------------------------------------------------

    def _workspaces(self) -> dict[str, Workspace]:
        spaces: dict[str, Workspace] = {}
        for name, robot in self._arms():
            self._progress.tell(f"workspace of {name}")
            arm = self._layout.arm(name).robot
            placed = self._checked[robot]
            base, model = placed.base_pose, self._models[robot]
            spaces[name] = Workspace(base, placed.robot, model, arm)
        return {name: space for name, space in spaces.items() if space.sampled}

    def _reaches(self) -> Iterator[TargetReach]:
        for name, robot in self._arms() if self._targets else ():
            arm = self._arm(name)
            for target, numbers in self._targets.items():
                self._progress.tell(f"{name} to {target}")
                quaternion = np.array(numbers[3:]) if len(numbers) == 7 else None
                solutions = arm.solve(np.array(numbers[:3]), quaternion)
                solved = [s for s in solutions if s.solved]
                free = next((s for s in solved if not any(self._obstacles(robot, s))), None)
                best = free or solutions[0]
                yield TargetReach(
                    target,
                    name,
                    free is not None,
                    best.missing,
                    best.turn_missing,
                    tuple(self._obstacles(robot, best)) if solved and free is None else (),
                    best.qpos,
                )

    def _obstacles(self, name: str, solution: Solution) -> Iterator[str]:
        """Yield what a robot touches there, itself included, with the others at their keyframes."""
        model = self._models[name]
        robot = stand(name, self._layout[name].base_pose, model, np.array([solution.qpos]))
        around = {**self._robots, **self._surfaces}
        for obstacle, body in around.items():
            if obstacle == name:
                touches = touching(robot, robot, model.self_pairs)
            else:
                pairs = moving_hulls(model) if obstacle in self._surfaces else None
                touches = touching(robot, body.first, pairs)
            if touches:
                yield obstacle

    def _missed(self, reaches: Sequence[TargetReach]) -> Iterator[Finding]:
        for target, numbers in self._targets.items():
            own = [reach for reach in reaches if reach.target == target]
            if any(reach.reached for reach in own):
                continue
            best = min(own, key=lambda reach: (not reach.blocked, reach.missing))
            turned = len(numbers) == 7 and not best.blocked and self._gets_to(best.robot, numbers)
            what = f"no robot reaches {target}{' without a collision' * best.blocked}"
            yield Finding(
                "target",
                True,
                (best.robot,),
                (),
                best.missing,
                "m",
                f"{what}; {reach_text(best)}",
                to_be_reached(target, best, otherwise_turned=turned),
            )

    def _gets_to(self, name: str, target: tuple[float, ...]) -> bool:
        """Tell whether a robot reaches the place of a target, however turned."""
        return self._arm(name).solve(np.array(target[:3]), None)[0].solved

    def _arms(self) -> Iterator[tuple[str, str]]:
        """Yield the arms of the robots that can be checked, each with its robot."""
        for name in self._layout.arms:
            robot = self._layout.owner(name)
            if robot in self._checked:
                yield name, robot

    def _arm(self, name: str) -> Reach:
        robot = self._layout.owner(name)
        return Reach(self._layout[robot], self._models[robot], self._layout.arm(name).robot)


def noisy_postures(placement: Placement, draws: int, random: np.random.Generator) -> Floats:
    """Return the keyframe, then draws with joint noise as at a reset, (1 + draws, dof)."""
    groups = placement.robot.action_split.groups.values()
    noisy = [group.reset_noise for group in groups for _ in group.joints]
    noise = random.normal(0.0, placement.qpos_noise, (draws, len(noisy))) * noisy
    return np.array(placement.start_qpos) + np.concatenate([np.zeros((1, len(noisy))), noise])


def moving_hulls(model: RobotModel) -> list[tuple[int, int]]:
    """Pair with the table's one hull all hulls of links that move; the base stands on it."""
    bodies = model.kinematics.bodies
    return [(i, 0) for i, hull in enumerate(model.hulls) if bodies[hull.link] != 0]


def _worst(overlaps: Sequence[Approach]) -> tuple[LinkPair, ...]:
    """Return the deepest overlap of each pair of links, the deepest first."""
    pairs: dict[tuple[str, str], LinkPair] = {}
    for overlap in overlaps:
        middle = tuple((a + b) / 2 for a, b in zip(*overlap.points, strict=True))
        pairs.setdefault(overlap.links, LinkPair(overlap.links, -overlap.distance, middle))
    return tuple(pairs.values())


def _shared(spaces: Mapping[str, Workspace]) -> Iterator[SharedWorkspace]:
    for (one, space), (other, other_space) in combinations(spaces.items(), 2):
        volume = space.shared_with(other_space)
        if volume > 0:
            shares = volume / space.volume, volume / other_space.volume
            yield SharedWorkspace((one, other), volume, shares)


def _outline(robot: Postures) -> tuple[tuple[Point, ...], ...]:
    return tuple(
        tuple(map(tuple, (hull.corners @ pose[:3, :3].T + pose[:3, 3]).tolist()))
        for hull, pose in zip(robot.hulls, robot.poses[0], strict=True)
    )
