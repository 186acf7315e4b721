"""A check of a layout before anything moves: collisions, limits, workspaces, targets."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from layouts.arrangement import Arrangement
from layouts.frames import TABLE_DEPTH, Rectangle, table_tops
from layouts.validation.collisions import (
    Approach,
    Postures,
    fixed,
    moving_hulls,
    nearest,
    noisy_postures,
    slab_hull,
    stand,
    touching,
)
from layouts.validation.findings import (
    NARROW,
    Clearance,
    Finding,
    LinkPair,
    Point,
    SharedWorkspace,
    TargetReach,
    length_text,
    links_text,
    reach_text,
    to_be_reached,
    to_leave_the_table,
    to_stand_apart,
    to_start_elsewhere,
    to_touch_itself_no_more,
)
from layouts.validation.reach import Arm, Workspace
from layouts.validation.report import Report
from robot_layouts.core.bounds import shown
from robot_layouts.core.progress import Progress
from robot_layouts.kinematics.rotations import Floats
from robots import AssetError, DescriptorError, LayoutError, RobotLayoutsError, UnknownNameError
from robots.bodies.hulls import RobotModel, load_model

Targets = Mapping[str, Sequence[float]] | Sequence[Sequence[float]]

SHALLOW = 0.005  # m; a folded arm's hulls overlap by less where its links do not
LIMIT_TOLERANCE = 1e-4  # rad or m; limits and keyframes are written with four digits


class LayoutCheck:
    """One check of one layout, with everything loaded that it needs; see `Layout.validate`."""

    def __init__(
        self, layout: Arrangement, targets: Targets, draws: int, table: Rectangle | None, seed: int
    ) -> None:
        """Load the robots' files, and refuse arguments that are invalid."""
        if not (isinstance(draws, int) and draws >= 0):
            raise LayoutError(f"samples is {draws!r}; it must be an integer of 0 or more")
        self._layout, self._targets, self._draws = layout, named_targets(targets), draws
        self._tops = table_tops(layout.frame_poses, table)
        self._progress = Progress(work="checking the layout")
        self._unread: dict[str, RobotLayoutsError] = {}
        self._models = dict(self._load())
        if self._unread and not self._models:
            raise next(iter(self._unread.values()))
        self._checked = {name: layout[name] for name in self._models}
        self._arms = {
            name: Arm(layout, name, self._models[layout.owner(name)])
            for name in layout.arms
            if layout.owner(name) in self._models
        }
        random = np.random.default_rng(seed)
        self._robots = {
            name: stand(name, p.base_pose, self._models[name], noisy_postures(p, draws, random))
            for name, p in self._checked.items()
        }
        self._surfaces = {
            name: fixed(name, slab_hull(np.array(top), TABLE_DEPTH, name), draws + 1)
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
        """Return what is found; see `layouts.Layout.validate`."""
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
            what = f"{name} cannot be checked: {error}"
            advice = (
                f"fix the files or the descriptor of {self._layout[name].robot.name}; the others"
                f" are checked as if {name} were not there"
            )
            yield Finding("files", True, (name,), (), 0.0, "m", what, advice)

    def _limits(self) -> Iterator[Finding]:
        for name, placement in self._checked.items():
            groups = placement.robot.action_split.groups.values()
            units = {joint: group.unit for group in groups for joint in group.joints}
            limits = self._models[name].kinematics.limits
            for joint, value, (low, high) in zip(
                placement.robot.joints, placement.start_qpos, limits.tolist(), strict=True
            ):
                excess, unit = max(low - value, value - high), units[joint]
                if excess > LIMIT_TOLERANCE:
                    start = placement.start_keyframe
                    what = (
                        f"{f'keyframe {start!r}' if start else 'qpos'} of {name} puts {joint} at"
                        f" {value:g} {unit}, {excess:.3g} {unit} beyond its limits"
                        f" {low:g} … {high:g}"
                    )
                    advice = f"put {joint} within its limits, or {to_start_elsewhere(placement)}"
                    yield Finding("joint limit", True, (name,), (), excess, unit, what, advice)

    # -- collisions --------------------------------------------------------------------------

    def _self_collisions(self) -> Iterator[Finding]:
        for name, robot in self._robots.items():
            self._progress.tell(f"{name} with itself")
            overlaps = touching(robot, robot, self._models[name].self_pairs)
            if overlaps:
                pairs = _worst(overlaps)
                still = any(overlap.posture == 0 for overlap in overlaps)
                serious, depth = still or pairs[0].depth > SHALLOW, pairs[0].depth
                what = (
                    f"{name} touches itself {self._when(overlaps)}:"
                    f" {links_text(pairs, (name, name))}"
                )
                advice = to_touch_itself_no_more(self._layout[name], overlaps)
                yield Finding("self-collision", serious, (name,), pairs, depth, "m", what, advice)

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
        table = other.name in self._surfaces
        what = (
            f"{one.name} and {other.name} collide {self._when(overlaps)}:"
            f" {links_text(pairs, between, table=table)}"
        )
        depth = pairs[0].depth
        if table:
            top = float(other.high[..., 2].max())
            lift = top - min(one.lowest(overlap) for overlap in overlaps)
            advice = to_leave_the_table(one.name, self._layout[one.name], lift)
            return Finding("table", True, between[:1], pairs, depth, "m", what, advice)
        advice, farther = to_stand_apart(self._layout, one, other)
        return Finding("collision", True, between, pairs, depth, "m", what, advice, farther)

    def _narrow(self, one: Postures, other: Postures, near: Approach) -> Finding:
        between, (first, second) = (one.name, other.name), near.links
        what = (
            f"{one.name}.{first} comes within {length_text(near.distance)} of {other.name}.{second}"
        )
        advice, farther = to_stand_apart(self._layout, one, other)
        return Finding("clearance", False, between, (), near.distance, "m", what, advice, farther)

    def _when(self, overlaps: list[Approach]) -> str:
        """Say in which postures: at the keyframes, or only with joint noise."""
        if any(overlap.posture == 0 for overlap in overlaps):
            return "at the keyframes"
        noisy = len({overlap.posture for overlap in overlaps})
        return f"with joint noise ({noisy} of {self._draws} draws)"

    # -- reach -------------------------------------------------------------------------------

    def _workspaces(self) -> dict[str, Workspace]:
        spaces: dict[str, Workspace] = {}
        for name, arm in self._arms.items():
            self._progress.tell(f"workspace of {name}")
            space = Workspace(arm, arm.base)
            spaces.update({name: space} if space.sampled else {})
        return spaces

    def _reaches(self) -> Iterator[TargetReach]:
        for name, arm in self._arms.items():
            start = np.array(arm.placement.start_qpos)
            for target, numbers in self._targets.items():
                self._progress.tell(f"{name} to {target}")
                found = arm.solve([numbers])
                ranked = found.ranked(start)
                solved = [row for row in ranked if found.solved[row]]
                touching_nothing = (
                    row for row in solved if not any(self._obstacles(arm.owner, found.qpos[row]))
                )
                free = next(touching_nothing, None)
                best = ranked[0] if free is None else free
                blocked = bool(solved) and free is None
                obstacles = self._obstacles(arm.owner, found.qpos[best]) if blocked else ()
                yield TargetReach(
                    target,
                    name,
                    free is not None,
                    float(found.missing[best]),
                    float(found.turn_missing[best]),
                    tuple(obstacles),
                    tuple(found.qpos[best].tolist()),
                )

    def _obstacles(self, name: str, qpos: Floats) -> Iterator[str]:
        """Yield what a robot touches there, itself included, with the others at their keyframes."""
        model = self._models[name]
        robot = stand(name, self._layout[name].base_pose, model, qpos[None])
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
            turned = False
            if len(numbers) == 7 and not best.blocked:  # perhaps its place can be reached
                turned = bool(self._arms[best.robot].solve([numbers[:3]]).solved.any())
            what = f"no robot reaches {target}{' without a collision' * best.blocked}"
            what = f"{what}; {reach_text(best)}"
            advice = to_be_reached(target, best, otherwise_turned=turned)
            yield Finding("target", True, (best.robot,), (), best.missing, "m", what, advice)


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


def named_targets(targets: Targets) -> dict[str, tuple[float, ...]]:
    """Return targets by name; those in a list are called by their number.

    Raises:
        LayoutError: If one is no place, or they come neither by name nor in order.
    """
    if isinstance(targets, str) or not isinstance(targets, Iterable):
        raise LayoutError(
            f"targets is {shown(targets)}; it takes places by name or in order:"
            " {'cube': (0.4, 0.0, 0.1)}, in m"
        )
    named = (
        dict(targets)
        if isinstance(targets, Mapping)
        else {f"target {i}": target for i, target in enumerate(targets, start=1)}
    )
    return {name: _target(name, numbers) for name, numbers in named.items()}


def _target(name: str, numbers: Sequence[float]) -> tuple[float, ...]:
    try:
        target = tuple(float(x) for x in numbers)
    except (TypeError, ValueError):
        target = ()
    if len(target) not in (3, 7) or not all(math.isfinite(x) for x in target):
        raise LayoutError(
            f"target {name!r} is {numbers!r}; it takes x, y, z (m), or these and w, x, y, z of the"
            " TCP's orientation"
        )
    length = math.hypot(*target[3:])
    if target[3:] and abs(length - 1) > 1e-3:
        raise LayoutError(
            f"the quaternion {target[3:]} of target {name!r} has length {length:.4g}; a rotation"
            " has length 1 (order w, x, y, z)"
        )
    return (*target[:3], *(x / length for x in target[3:]))
