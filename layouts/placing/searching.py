"""A search for places: a coarse one over grids, then steps from its best, checked exactly."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module

import numpy as np

from layouts.layout import Layout
from layouts.placement import Placement, RobotLike, check_robots, load_robot
from layouts.placing.coarse import Coarse
from layouts.placing.demands import Demand, ReachedBy, demands_of
from layouts.placing.feasible import Obstacle, obstacles
from layouts.placing.scene import Scene
from layouts.placing.sites import Around, Rectangle, ground_of
from layouts.placing.trials import Trial, Trials
from layouts.validation.arguments import Targets, named_targets
from layouts.validation.findings import length_text, reach_text
from layouts.validation.report import Report
from robot_layouts.core.bounds import checked_number, checked_whole
from robot_layouts.core.errors import MissingPackageError
from robot_layouts.core.progress import Progress
from robots import LayoutError, RobotDescriptor

BEGINNINGS = 12  # random ones of the coarse search, for each place to begin at
MORE = 3  # times as many begin where none of the best will do
STEPS = (0.15, 0.06, 0.02)  # of a base, as shares of the largest reach
TURN = 4.0  # rad per m of the largest reach, of the same steps
SWEEPS = 2  # over all robots at most, for one length of step
STRIDES = 4  # the same step again, while it makes things better


def search(
    robots: Mapping[str, RobotLike],
    targets: Targets,
    *,
    around: Around | None,
    within: Rectangle | None,
    heights: float | Mapping[str, float],
    reached_by: ReachedBy,
    keyframe: str | None,
    clearance: float,
    partial: bool,
    seed: int,
    tries: int,
    patience: float,
) -> Layout:
    """Look for places; see `layouts.search`."""
    _require_scipy()
    check_robots(robots)
    if not robots:
        raise LayoutError("a search needs at least one robot")
    loaded = {name: load_robot(robot) for name, robot in robots.items()}
    seed = checked_whole("seed", seed, 0, None, LayoutError)
    tries = checked_whole("tries", tries, 1, None, LayoutError)
    clearance = checked_number("clearance", clearance, 0.0, 10.0, LayoutError, "m")
    patience = checked_number("patience", patience, 0.0, 1e9, LayoutError, "s")
    named = named_targets(targets)
    alone = Layout({name: Placement(robot, keyframe=keyframe) for name, robot in loaded.items()})
    demands = demands_of(named, reached_by, alone)
    ground = ground_of(around, within, heights, loaded, list(named.values()))
    _check_starts(loaded, keyframe)
    scene = Scene(loaded, keyframe, ground, demands)
    progress = Progress(work="looking for places", seconds=patience, late=_late(patience))
    layout = _Search(scene, named, demands, clearance, progress).run(partial, seed, tries)
    return layout if named or around is not None or within is not None else _centred(layout)


def _late(patience: float) -> Callable[[str], LayoutError]:
    return lambda what: LayoutError(
        f"no layout after {patience:g} s, while looking for places: {what}; raise patience, lower"
        " tries, or ask for less"
    )


def _centred(layout: Layout) -> Layout:
    """Return the layout with the middle of its bases above the origin, to a mm."""
    x, y, _ = np.mean([placement.base_position for placement in layout.values()], axis=0).tolist()
    return Layout(
        {
            name: replace(
                p,
                position=(
                    round(p.base_position[0] - x, 3) + 0.0,
                    round(p.base_position[1] - y, 3) + 0.0,
                    p.base_position[2],
                ),
            )
            for name, p in layout.items()
        }
    )


class _Search:
    """One search, with everything loaded."""

    def __init__(
        self,
        scene: Scene,
        targets: Mapping[str, tuple[float, ...]],
        demands: Sequence[Demand],
        clearance: float,
        progress: Progress,
    ) -> None:
        self._scene, self._targets, self._progress = scene, targets, progress
        self._demands, self._clearance = tuple(demands), clearance

    def run(self, partial: bool, seed: int, tries: int) -> Layout:
        self._progress.tell("sampling where robots get to")
        coarse = Coarse(self._scene, self._demands, self._clearance)
        hopeless = obstacles(self._scene, coarse.robots, self._demands, self._progress)
        if hopeless:
            if not partial:
                raise LayoutError(_hopeless_text(list(hopeless.values())))
            self._demands = tuple(
                demand for number, demand in enumerate(self._demands) if number not in hopeless
            )
            coarse = Coarse(self._scene, self._demands, self._clearance)
        random = np.random.default_rng(seed)
        trials = Trials(self._scene, self._demands, self._clearance)
        self._progress.tell("trying places on a grid")
        begun = coarse.best(BEGINNINGS * tries, MORE * tries, random)
        outcomes: list[_Outcome] = []
        for first in range(0, len(begun), tries):  # more only where none of the best will do
            bettered = [
                self._bettered(trials, trials.afresh(seats), random, f"beginning {number}")
                for number, seats in enumerate(begun[first : first + tries], start=first + 1)
            ]
            for trial in sorted(bettered, key=lambda trial: trial.loss):
                outcomes.append(self._outcome(trial))
                if not outcomes[-1].wrong and not outcomes[-1].unmet:
                    return outcomes[-1].layout
        best = min(outcomes, key=lambda outcome: (bool(outcome.wrong), len(outcome.unmet)))
        if best.wrong or not partial:
            raise LayoutError(best.reason)
        return best.layout

    def _bettered(
        self, trials: Trials, trial: Trial, random: np.random.Generator, what: str
    ) -> Trial:
        """Step to better seats until no step of any length makes a robot's better."""
        reach = max(robot.reach for robot in self._scene.robots.values())
        self._scene.forget()
        for length in STEPS:
            for _ in range(SWEEPS):
                before = trial
                for name in random.permutation(list(self._scene.robots)).tolist():
                    self._progress.tell(f"{what}, {trials.count} places tried")
                    trial = self._stepped(trials, trial, name, length * reach, length * TURN)
                if trial is before:
                    break
        return trial

    def _stepped(self, trials: Trials, trial: Trial, name: str, step: float, turn: float) -> Trial:
        """Step with one robot in every direction in which that makes things better."""
        for dx, dy, dyaw in np.vstack([np.eye(3), -np.eye(3)]) * (step, step, turn):
            for _ in range(STRIDES):
                at = trial.seats[name]
                site = self._scene.ground.sites[at.site]
                seat = site.seat(at.site, at.x + dx, at.y + dy, at.yaw + dyaw)
                if seat is None or seat == at:
                    break
                better = trials.moved(trial, name, seat)
                if better is None:
                    break
                trial = better
        return trial

    def _outcome(self, trial: Trial) -> _Outcome:
        """Check a layout as a user would."""
        self._progress.tell("checking what was found")
        layout = self._scene.layout(trial.seats)
        report = layout.validate(targets=self._asked(), workspaces=False)
        return _Outcome(layout, self._in_the_way(report), self._unmet(report, trial))

    def _in_the_way(self, report: Report) -> str:
        """Say what is wrong with places, targets aside; nothing if that is nothing."""
        for finding in report.findings:
            if finding.serious and finding.kind != "target":
                return finding.what
        near = [clear for clear in report.clearances if not clear.table]
        least = min(near, key=lambda clear: clear.noisy_distance, default=None)
        if least is None or least.noisy_distance >= self._clearance:
            return ""
        return (
            f"{' and '.join(least.between)} come within {length_text(least.noisy_distance)},"
            f" less than the clearance of {length_text(self._clearance)}"
        )

    def _asked(self) -> dict[str, tuple[float, ...]]:
        names = {demand.target for demand in self._demands}
        return {name: numbers for name, numbers in self._targets.items() if name in names}

    def _unmet(self, report: Report, trial: Trial) -> list[str]:
        """Say which demands are not met, each with what keeps the arm that comes nearest."""
        unmet: list[str] = []
        for demand, service in zip(self._demands, trial.services, strict=True):
            own = [
                r for r in report.reaches if r.target == demand.target and r.robot in demand.arms
            ]
            if not any(reach.reached for reach in own):
                nearest = min(own, key=lambda reach: (not reach.blocked, reach.missing))
                unmet.append(f"{demand.target}: {reach_text(nearest)}")
            elif service.missing > 0:
                clear = length_text(self._clearance)
                unmet.append(f"{demand.target}: {service.arm} is less than {clear} clear there")
        return unmet


@dataclass(frozen=True, eq=False)
class _Outcome:
    """A layout, and what it lacks.

    Attributes:
        layout: The layout.
        wrong: What is in the way, in words; empty if nothing is.
        unmet: Demands that are not met, in words.
    """

    layout: Layout
    wrong: str
    unmet: Sequence[str]

    @property
    def reason(self) -> str:
        """Why it is not what was asked for."""
        if self.wrong:
            return (
                f"found no places that are clear of each other; in the best ones {self.wrong}; give"
                " the robots more room, lower clearance, or choose another keyframe"
            )
        return (
            "found no places from which all targets are reached; from the best ones"
            f" {'; '.join(self.unmet)}; raise tries, ask for less, or take the best with"
            " partial=True"
        )


def _require_scipy() -> None:
    try:
        import_module("scipy")
    except ImportError as error:
        raise MissingPackageError(
            "a search for places needs scipy and python-fcl: pip install 'robot-layouts[checks]'"
        ) from error


def _check_starts(robots: Mapping[str, RobotDescriptor], keyframe: str | None) -> None:
    """Refuse robots that are not sound at their keyframe, wherever they stand.

    Raises:
        LayoutError: If one is not.
    """
    for name, robot in robots.items():
        report = Layout({name: Placement(robot, keyframe=keyframe)}).validate(workspaces=False)
        if not report.ok:
            finding = report.findings[0]
            raise LayoutError(f"{finding.what}, wherever it stands; {finding.advice}")


def _hopeless_text(hopeless: Sequence[Obstacle]) -> str:
    return (
        "no robot that may reach these gets there, wherever it stands:"
        f" {'; '.join(map(str, hopeless))}. Move them, change around, within or heights, or leave"
        " them out with partial=True"
    )
