"""How good it is to stand somewhere: who reaches what, with what clearance and shared workspace."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from layouts.placing.arms import RADIAN, Arm
from layouts.placing.demands import Demand
from layouts.placing.scene import Scene
from layouts.placing.sites import Seat
from robot_layouts.kinematics.rotations import Floats

UNREACHED = 100.0  # loss per m that is missing to a target
FARTHEST = 0.3  # m; being farther from a target is no worse
BLOCKED = 0.05  # m; a target that only a collision keeps from being reached counts as this far
CRAMPED = 20.0  # loss where a clearance that is asked for is missing altogether
ROOM = 1.0  # what full clearance is worth, beside all workspace that can be shared
AWKWARD = 0.3  # loss where all robots look away from their work
HELP = 0.5  # what it is worth that all robots that may reach a target are near enough
HOPELESS = 0.15  # m; what is so far from every sampled posture is not tried
FEW_STARTS, FEW_STEPS = 8, 15  # of inverse kinematics, where a robot is only moved a little
ALL_STEPS = 80

Seats = Mapping[str, Seat]


@dataclass(frozen=True, eq=False)
class Service:
    """How one demand is met, or how nearly.

    Attributes:
        arm: Full name of the arm.
        qpos: Joint positions of its robot, (dof,) (rad, m).
        missing: How far the target is (m), turns included; 0 if it is reached.
        gaps: Distance to each other robot at its keyframe (m); empty if it is not reached.
    """

    arm: str
    qpos: Floats
    missing: float
    gaps: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Trial:
    """Robots in seats, and what comes of it.

    Attributes:
        seats: By robot.
        services: One for each demand.
        loss: What is wrong with it; the less, the better. Negative if nothing is.
    """

    seats: Seats
    services: tuple[Service, ...]
    loss: float


class Trials:
    """Tries seats for the demands of one search."""

    def __init__(self, scene: Scene, demands: Sequence[Demand], clearance: float) -> None:
        """Take what is asked for.

        Args:
            scene: The robots.
            demands: Who must reach what.
            clearance: Least distance between robots (m).
        """
        self._scene, self._demands, self._clearance = scene, demands, clearance
        self._nears: dict[tuple[str, Seat], int] = {}
        self.count = 0

    def afresh(self, seats: Seats) -> Trial:
        """Try seats of which nothing is known."""
        services = [self._served(demand, seats, demand.arms) for demand in self._demands]
        return Trial(seats, tuple(services), self._loss(seats, services))

    def moved(self, trial: Trial, name: str, seat: Seat) -> Trial | None:
        """Try another seat for one robot; None if that is no better.

        Args:
            trial: What it is to be better than.
            name: The robot.
            seat: Where to.
        """
        self.count += 1
        seats = {**trial.seats, name: seat}
        spare = (trial.loss - self._loss(seats, ())) / UNREACHED
        services = self._followed(trial, name, seats, spare) if spare > 0 else None
        if services is None:
            return None
        loss = self._loss(seats, services)
        return Trial(seats, tuple(services), loss) if loss < trial.loss else None

    def shared(self, seats: Seats) -> float:
        """Return how much space all pairs of robots share (m³)."""
        scene = self._scene
        return sum(scene.shared(a, seats[a], b, seats[b]) for a, b in scene.pairs)

    # -- loss --------------------------------------------------------------------------------

    def _loss(self, seats: Seats, services: Sequence[Service]) -> float:
        """Return what is wrong; without services, no more than that."""
        scene = self._scene
        sunk = sum(not scene.stood(name, seat).on_table for name, seat in seats.items())
        missing = sum(service.missing for service in services)
        room, cramped = self._room(seats, services)
        share = self.shared(seats) / scene.most_shared if scene.most_shared else 0.0
        wrong = UNREACHED * missing + CRAMPED * (sunk + cramped)
        worth = share + ROOM * room + HELP * self._help(seats)
        return wrong + AWKWARD * self._awkward(seats) - worth

    def _help(self, seats: Seats) -> float:
        """Return the share of all arms that may reach targets which are near enough to them."""
        near = [self._near(arm, seats[arm.owner]) for arm in self._scene.arms.values()]
        counts = [len(demand.arms) for demand in self._demands]
        return sum(near) / sum(counts) if counts else 0.0

    def _near(self, arm: Arm, seat: Seat) -> int:
        """Return how many targets that an arm may reach are well within its reach, by samples."""
        key = (arm.name, seat)
        if key not in self._nears:
            base = self._scene.stood(arm.owner, seat).base[None]
            own = [d.numbers for d in self._demands if arm.name in d.arms]
            self._nears[key] = sum(float(arm.beyond(base, n)[0]) == 0 for n in own)
        return self._nears[key]

    def _awkward(self, seats: Seats) -> float:
        """Return how badly robots stand for their work, on the average."""
        scene = self._scene
        bases = {name: scene.stood(name, seat).base for name, seat in seats.items()}
        return float(
            np.mean(
                [
                    scene.awkward(name, base[None], [b for n, b in bases.items() if n != name])[0]
                    for name, base in bases.items()
                ]
            )
        )

    def _room(self, seats: Seats, services: Sequence[Service]) -> tuple[float, float]:
        """Return the least clearance as a share of what is enough, and all that is missing."""
        scene = self._scene
        gaps = {(a, b): scene.gap(a, seats[a], b, seats[b]) for a, b in scene.pairs}
        shares = [gap / scene.enough(*pair) for pair, gap in gaps.items()]
        cramped = sum(self._lacking(gap) for gap in gaps.values())
        for service in services:
            owner = scene.arms[service.arm].owner
            shares += [gap / scene.enough(owner, o) for o, gap in service.gaps.items()]
            cramped += sum(self._lacking(gap) for gap in service.gaps.values())
        return max(min([1.0, *shares]), 0.0), cramped

    def _lacking(self, gap: float) -> float:
        """Return how much of the clearance asked for is missing, in shares of a dm or of it."""
        return max(self._clearance - gap, 0.0) / max(self._clearance, 0.1)

    # -- targets -----------------------------------------------------------------------------

    def _followed(
        self, trial: Trial, name: str, seats: Seats, spare: float
    ) -> list[Service] | None:
        """Return how the demands are met after one robot has moved.

        None as soon as more is missing to the targets than may be (``spare``, m).
        """
        kept = self._kept(trial, name, seats)
        services: list[Service] = []
        for number in range(len(self._demands)):
            service = kept.get(number) or self._served_otherwise(number, trial, name, seats)
            spare -= service.missing
            if spare <= 0:
                return None
            services.append(service)
        return services

    def _kept(self, trial: Trial, name: str, seats: Seats) -> dict[int, Service]:
        """Return the services that go on as they were, or that follow their robot."""
        kept: dict[int, Service] = {}
        followers: dict[tuple[str, int], list[int]] = {}
        for number, service in enumerate(trial.services):
            if service.missing > 0:
                continue
            if self._scene.arms[service.arm].owner == name:
                kind = len(self._demands[number].numbers)
                followers.setdefault((service.arm, kind), []).append(number)
            elif same := self._beside(service, trial.seats, name, seats):
                kept[number] = same
        for (arm, _), numbers in followers.items():
            starts = np.array([[trial.services[number].qpos] for number in numbers])
            targets = [self._demands[number].numbers for number in numbers]
            base = self._scene.stood(name, seats[name]).base
            found = self._scene.arms[arm].solve(base, targets, starts, FEW_STEPS)
            for row, number in enumerate(numbers):
                if found.solved[row]:
                    service = self._checked(arm, seats, found.qpos[row])
                    kept.update({number: service} if service else {})
        return kept

    def _beside(self, service: Service, before: Seats, name: str, seats: Seats) -> Service | None:
        """Return a service of another robot than the moved one; None if that is in the way."""
        owner = self._scene.arms[service.arm].owner
        (posture,) = self._scene.postures(owner, before[owner], service.qpos[None])
        if self._scene.near(posture, name, seats[name], self._clearance):
            return None
        gap = self._scene.gap_to_start(posture, name, seats[name])
        return Service(service.arm, service.qpos, 0.0, {**service.gaps, name: gap})

    def _served_otherwise(self, number: int, trial: Trial, name: str, seats: Seats) -> Service:
        """Return how a demand is met that is not met any more, or was not before."""
        demand, before = self._demands[number], trial.services[number]
        if before.missing > BLOCKED:  # nobody else has come nearer
            arms = [arm for arm in demand.arms if self._scene.arms[arm].owner == name]
            tried = self._served(demand, seats, tuple(arms), quick=True)
            if tried.missing < before.missing or before.arm in arms:
                return tried
            return before
        return self._served(demand, seats, demand.arms, quick=True)

    def _served(
        self, demand: Demand, seats: Seats, arms: tuple[str, ...], *, quick: bool = False
    ) -> Service:
        """Return how an arm reaches a target, or how near one comes; the likeliest goes first."""
        scene = self._scene
        best = Service(demand.arms[0], scene.start(scene.arms[demand.arms[0]].owner), np.inf, {})
        far = {arm: self._beyond(scene.arms[arm], demand, seats) for arm in arms}
        for brief in (True,) if quick else (True, False):
            for arm in sorted(arms, key=lambda arm: far[arm]):
                tried = self._by(scene.arms[arm], demand, seats, far[arm], quick=brief)
                if tried.missing == 0:
                    return tried
                best = tried if tried.missing < best.missing else best
        return best

    def _beyond(self, arm: Arm, demand: Demand, seats: Seats) -> float:
        base = self._scene.stood(arm.owner, seats[arm.owner]).base
        return float(arm.beyond(base[None], demand.numbers)[0])

    def _by(self, arm: Arm, demand: Demand, seats: Seats, far: float, *, quick: bool) -> Service:
        if far > HOPELESS:
            return Service(arm.name, self._scene.start(arm.owner), min(far, FARTHEST), {})
        base = self._scene.stood(arm.owner, seats[arm.owner]).base
        starts = arm.starts[:FEW_STARTS] if quick else arm.starts
        steps = FEW_STEPS if quick else ALL_STEPS
        found = arm.solve(base, [demand.numbers], starts[None], steps)
        ranked = found.ranked(self._scene.start(arm.owner))
        if not found.solved[ranked[0]]:
            missing = found.missing + RADIAN * found.turn_missing
            nearest = int(np.argmin(missing))
            return Service(
                arm.name, found.qpos[nearest], min(float(missing[nearest]), FARTHEST), {}
            )
        for row in ranked:
            if service := self._checked(arm.name, seats, found.qpos[row]):
                return service
        return Service(arm.name, found.qpos[ranked[0]], BLOCKED, {})

    def _checked(self, arm: str, seats: Seats, qpos: Floats) -> Service | None:
        """Return a service by a posture; None if something is in its way, or nearly."""
        scene = self._scene
        owner = scene.arms[arm].owner
        (posture,) = scene.postures(owner, seats[owner], qpos[None])
        others = {other: seat for other, seat in seats.items() if other != owner}
        if not scene.free(owner, posture) or any(
            scene.near(posture, other, seat, self._clearance) for other, seat in others.items()
        ):
            return None
        gaps = {other: scene.gap_to_start(posture, other, seat) for other, seat in others.items()}
        return Service(arm, qpos, 0.0, gaps)
