"""Which demands nobody can meet, wherever robots stand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from layouts.placing.arms import RADIAN, Arm
from layouts.placing.coarse import Candidates
from layouts.placing.demands import Demand
from layouts.placing.scene import Scene
from layouts.placing.sites import Seat
from layouts.placing.trials import ALL_STEPS
from layouts.validation.findings import length_text
from robot_layouts.core.progress import Progress

SEATS_TRIED = 12  # the likeliest of one arm
STEPS = (0.1, 0.05, 0.02, 0.01)  # m; by which a base comes nearer to a target


@dataclass(frozen=True)
class Obstacle:
    """Why a demand cannot be met.

    Attributes:
        demand: The demand.
        arm: Full name of the arm that comes nearest.
        missing: How far it stays away (m), turns included; 0 if something is in its way.
    """

    demand: Demand
    arm: str
    missing: float

    def __str__(self) -> str:
        """Say who stays how far away."""
        if self.missing > 0:
            stays = f"{self.arm} stays {length_text(self.missing)} away"
            return f"{self.demand.target}: {stays}{_turns(self.demand)}"
        return f"{self.demand.target}: {self.arm} would touch itself or a table there"


def obstacles(
    scene: Scene,
    candidates: Mapping[str, Candidates],
    demands: Sequence[Demand],
    progress: Progress,
) -> dict[int, Obstacle]:
    """Return for each demand that no arm can meet what comes nearest, by its number."""
    found: dict[int, Obstacle] = {}
    for number, demand in enumerate(demands):
        progress.tell(f"who can reach {demand.target}")
        obstacle = _obstacle(scene, candidates, number, demand)
        found.update({} if obstacle is None else {number: obstacle})
    return found


def _obstacle(
    scene: Scene, candidates: Mapping[str, Candidates], number: int, demand: Demand
) -> Obstacle | None:
    nearest: Obstacle | None = None
    arms = [scene.arms[name] for name in demand.arms]
    for arm in sorted(arms, key=lambda arm: candidates[arm.owner].beyond[:, number].min()):
        own = candidates[arm.owner]
        order = np.argsort(own.beyond[:, number], kind="stable")[:SEATS_TRIED]
        seats = tuple(own.seats[at] for at in order)
        missing = _least_missing(scene, arm, seats, demand)
        if missing is None:
            return None
        if nearest is None or missing < nearest.missing:
            nearest = Obstacle(demand, arm.name, missing)
    return nearest


def _least_missing(scene: Scene, arm: Arm, seats: Sequence[Seat], demand: Demand) -> float | None:
    """Return how far an arm stays from a target (m); None if it gets there from some seat.

    From the best of the seats it comes nearer by steps.
    """
    missing: dict[Seat, float] = {}
    for seat in seats:
        far = _missing(scene, arm, seat, demand)
        if far is None:
            return None
        missing[seat] = far
    seat = min(missing, key=lambda seat: missing[seat])
    site = scene.ground.sites[seat.site]
    for step in STEPS:
        for dx, dy in ((step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)):
            near = site.seat(seat.site, seat.x + dx, seat.y + dy, seat.yaw)
            if near is None or near in missing:
                continue
            far = _missing(scene, arm, near, demand)
            if far is None:
                return None
            missing[near] = far
            seat = near if far < missing[seat] else seat
    return missing[seat]


def _missing(scene: Scene, arm: Arm, seat: Seat, demand: Demand) -> float | None:
    """Return how far an arm stays away from one seat (m), 0 if it would touch; None if not."""
    base = scene.stood(arm.owner, seat).base
    found = arm.solve(base, [demand.numbers], arm.starts[None], ALL_STEPS)
    for qpos in found.qpos[found.solved]:
        (posture,) = scene.postures(arm.owner, seat, qpos[None])
        if scene.free(arm.owner, posture):
            return None
    return 0.0 if found.solved.any() else float((found.missing + RADIAN * found.turn_missing).min())


def _turns(demand: Demand) -> str:
    return f" (a turn of 1 rad counts as {RADIAN:g} m)" if len(demand.numbers) == 7 else ""
