"""The search itself: the best of a grid, refined by steps and checked as a user would."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from layouts.layout import Layout
from layouts.placement import Placement
from layouts.placing.cost import Candidate, Cost, Requirement
from layouts.placing.grid import GridSearch
from layouts.placing.scene import SearchScene
from layouts.validation.findings import length_text, reach_text
from layouts.validation.report import Report
from robot_layouts.core.progress import Progress
from robot_layouts.kinematics.rotations import Floats
from robots import LayoutError, RobotDescriptor

STARTS = 12  # random ones of the search over the grid, for each place to begin at
MORE = 3  # times as many places are tried where none of the best will do
STEPS = (0.15, 0.06, 0.02)  # of a base, as shares of the largest reach
TURN = 4.0  # rad per m of the largest reach, of the same steps
SWEEPS = 2  # over all robots at most, for one length of step
REPEATS = 4  # of the same step, while the cost falls


def find_layout(
    scene: SearchScene,
    requirements: tuple[Requirement, ...],
    clearance: float,
    progress: Progress,
    *,
    partial: bool,
    seed: int,
    tries: int,
) -> Layout:
    """Return the best layout that a search finds; see `layouts.search`.

    Raises:
        LayoutError: If nothing meets the requirements; says why.
    """
    progress.tell("sampling where robots get to")
    cost = Cost(scene, requirements, clearance)
    grid = GridSearch(scene, cost)
    unreachable = grid.unreachable(progress)
    if unreachable and not partial:
        raise LayoutError(
            "no robot that may reach these gets there, wherever it stands:"
            f" {'; '.join(unreachable.values())}. Move them, change around, within or heights, or"
            " leave them out with partial=True"
        )
    if unreachable:
        met = [r for number, r in enumerate(requirements) if number not in unreachable]
        cost = Cost(scene, met, clearance)
        grid = GridSearch(scene, cost)
    random = np.random.default_rng(seed)
    progress.tell("trying places on a grid")
    begun = grid.best(STARTS * tries, MORE * tries, random)
    outcomes: list[_Outcome] = []
    for first in range(0, len(begun), tries):  # more only where none of the best will do
        refined = [
            refine(scene, cost, cost.candidate(bases), random, progress, f"beginning {number}")
            for number, bases in enumerate(begun[first : first + tries], start=first + 1)
        ]
        for candidate in sorted(refined, key=lambda candidate: candidate.cost):
            progress.tell("checking what was found")
            outcomes.append(_checked(scene, cost, candidate))
            if not outcomes[-1].wrong and not outcomes[-1].unmet:
                return outcomes[-1].layout
    best = min(outcomes, key=lambda outcome: (bool(outcome.wrong), len(outcome.unmet)))
    if best.wrong:
        raise LayoutError(
            f"found no places that are clear of each other; in the best ones {best.wrong}; give"
            " the robots more room, lower clearance, or choose another keyframe"
        )
    if not partial:
        raise LayoutError(
            "found no places from which all targets are reached; from the best ones"
            f" {'; '.join(best.unmet)}; raise tries, ask for less, or take the best with"
            " partial=True"
        )
    return best.layout


def refine(
    scene: SearchScene,
    cost: Cost,
    candidate: Candidate,
    random: np.random.Generator,
    progress: Progress,
    what: str,
) -> Candidate:
    """Move one robot after the other by ever smaller steps, as long as that lowers the cost."""
    for length in STEPS:
        step, turn = length * scene.reach, length * TURN
        moves = np.vstack([np.eye(3), -np.eye(3)]) * (step, step, turn)
        for _ in range(SWEEPS):
            before = candidate
            for name in random.permutation(list(scene.robots)).tolist():
                progress.tell(f"{what}, {cost.count} places tried")
                for move in moves:
                    candidate = _moved(scene, cost, candidate, name, move)
            if candidate is before:
                break
    return candidate


def _moved(
    scene: SearchScene, cost: Cost, candidate: Candidate, name: str, move: Floats
) -> Candidate:
    """Repeat one step of one robot while that lowers the cost."""
    for _ in range(REPEATS):
        base = scene.ground.near(candidate.bases[name], *move)
        if base is None or base == candidate.bases[name]:
            break
        better = cost.moved(candidate, name, base)
        if better is None:
            break
        candidate = better
    return candidate


@dataclass(frozen=True, eq=False)
class _Outcome:
    """A layout, and what it lacks.

    Attributes:
        layout: The layout.
        wrong: What is in the way, in words; empty if nothing is.
        unmet: Requirements that are not met, in words.
    """

    layout: Layout
    wrong: str
    unmet: list[str]


def _checked(scene: SearchScene, cost: Cost, candidate: Candidate) -> _Outcome:
    """Check a layout by `Layout.validate`."""
    layout = scene.layout(candidate.bases)
    targets = {requirement.target: requirement.numbers for requirement in cost.requirements}
    report = layout.validate(targets=targets, workspaces=False)
    return _Outcome(layout, _wrong(report, cost), _unmet(report, cost, candidate))


def _wrong(report: Report, cost: Cost) -> str:
    """Say what is wrong with places, targets aside; nothing if that is nothing."""
    for finding in report.findings:
        if finding.serious and finding.kind != "target":
            return finding.what
    near = [clear for clear in report.clearances if not clear.table]
    least = min(near, key=lambda clear: clear.noisy_distance, default=None)
    if least is None or least.noisy_distance >= cost.clearance:
        return ""
    return (
        f"{' and '.join(least.between)} come within {length_text(least.noisy_distance)},"
        f" less than the clearance of {length_text(cost.clearance)}"
    )


def _unmet(report: Report, cost: Cost, candidate: Candidate) -> list[str]:
    """Say which requirements are not met, each with what keeps the arm that comes nearest."""
    unmet: list[str] = []
    for required, assignment in zip(cost.requirements, candidate.assignments, strict=True):
        own = [
            reach
            for reach in report.reaches
            if reach.target == required.target and reach.robot in required.arms
        ]
        if not any(reach.reached for reach in own):
            nearest = min(own, key=lambda reach: (not reach.blocked, reach.missing))
            unmet.append(f"{required.target}: {reach_text(nearest)}")
        elif assignment.missing > 0:
            clear = length_text(cost.clearance)
            unmet.append(f"{required.target}: {assignment.arm} is less than {clear} clear there")
    return unmet


def centred(layout: Layout) -> Layout:
    """Return the layout with the middle of its bases above the origin, to a mm."""
    x, y, _ = np.mean([placement.base_position for placement in layout.values()], axis=0).tolist()
    moved: dict[str, Placement] = {}
    for name, placement in layout.items():
        own_x, own_y, z = placement.base_position
        position = (round(own_x - x, 3) + 0.0, round(own_y - y, 3) + 0.0, z)
        moved[name] = replace(placement, position=position)
    return Layout(moved)


def expect_sound(robots: Mapping[str, RobotDescriptor], keyframe: str | None) -> None:
    """Refuse robots that are not sound at their keyframe, wherever they stand.

    Raises:
        LayoutError: If one is not.
    """
    for name, robot in robots.items():
        report = Layout({name: Placement(robot, keyframe=keyframe)}).validate(workspaces=False)
        if not report.ok:
            finding = report.findings[0]
            raise LayoutError(f"{finding.what}, wherever it stands; {finding.advice}")
