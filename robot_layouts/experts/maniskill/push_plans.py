"""Plans a few pushes that bring a flat body to a pose, by evolution in a model of sliding."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.maniskill.sliding import SlidingBody
from robot_layouts.kinematics.rotations import Floats

PUSHES, STROKES = 2, 2  # of a plan; strokes of one push share their contact
STEEPEST = np.radians(48)  # force off the normal; friction of 1.65 would hold 59°
WIDEST = 0.9  # rad; of a stroke's direction off the normal
LONGEST_STROKE = 0.3  # m
SHORTEST_PUSH = 0.004  # m; less is left out
APPROACH = 0.006  # m; between tip and side before a push
REACH = (0.3, 0.8)  # m; nearest and farthest tip from the arm's base
TURN_RADIUS = 0.09  # m; a wrong angle counts like a wrong place at this radius
# Control steps, measured: to lift, lower and settle; way through the air and along the table.
LIFT_STEPS, FREE_WAY, PUSHING_WAY = 7.0, 0.025, 0.015
STEP_PRICE = 0.25e-3  # m of error that a control step is worth
LATE_PRICE = 5e-3  # m, for each step beyond the episode's end
UNFIT_PRICE = 0.05  # m, for a tip out of reach
SLIP_PRICE = 1.0  # m, for a force off the normal: times the cosine that is missing
FAMILIES, CHILDREN, GENERATIONS, COOLING = 150, 6, 40, 0.88


@dataclass(frozen=True)
class Plans:
    """N plans.

    Attributes:
        contacts: Which contact each push begins at, (N, P).
        directions: Of each stroke off the inward normal, in the body's frame, (N, P, S) (rad).
        lengths: Of each stroke, (N, P, S) (m).
    """

    contacts: NDArray[np.int64]
    directions: Floats
    lengths: Floats

    def take(self, rows: NDArray[np.int64]) -> Plans:
        """Return some of the plans."""
        return Plans(*(getattr(self, field.name)[rows] for field in fields(self)))


@dataclass(frozen=True)
class Push:
    """One push.

    Attributes:
        contact: Point (m) and outward normal in the body's frame, (4,).
        directions: Of each stroke off the inward normal, in the body's frame, (S,) (rad).
        lengths: Of each stroke, (S,) (m).
        goes_on: Whether the tip is there already.
    """

    contact: Floats
    directions: Floats
    lengths: Floats
    goes_on: bool


@dataclass(frozen=True)
class Situation:
    """Where everything is when a plan is made.

    Attributes:
        pose: x, y (m, world) and yaw (rad) of the body, (3,).
        tip: Of the stick, (2,) (m, world).
        touching: Contact at which the tip is, (4,), or None.
        steps_left: Control steps until the episode ends.
    """

    pose: Floats
    tip: Floats
    touching: Floats | None
    steps_left: int


class PushPlanner:
    """Plans pushes of one body to one goal."""

    def __init__(
        self,
        body: SlidingBody,
        contacts: Floats,
        goal: Floats,
        base: Floats,
        random: np.random.Generator,
    ) -> None:
        """Take what stays.

        Args:
            body: What is pushed.
            contacts: Points (m) and outward normals at which it may be pushed, neighbours side by
                side, (C, 4).
            goal: x, y (m, world) and yaw (rad) that it is to have, (3,).
            base: Of the arm, (2,) (m, world).
            random: Where chance comes from.
        """
        self._body, self._contacts, self._goal, self._base = body, contacts, goal, base
        self._random = random

    def next_push(self, now: Situation) -> Push | None:
        """Return the first push of the best plan found, or None if the body is to stay."""
        table = self._contacts
        if now.touching is not None:
            table = np.vstack([table, now.touching])  # the last row: pushing on
        best = self._evolve(lambda plans: self._cost(plans, table, now), now.touching is not None)
        for contact, directions, lengths in zip(
            best.contacts[0], best.directions[0], best.lengths[0], strict=True
        ):
            if lengths.sum() > SHORTEST_PUSH:
                goes_on = contact == len(self._contacts)
                return Push(table[contact], directions, lengths, bool(goes_on))
        return None

    def error(self, poses: Floats) -> Floats:
        """Return how far poses (N, 3) are from the goal, place and angle in one, (N,) (m)."""
        x, y, turned = (poses - self._goal).T
        turned = (turned + np.pi) % (2 * np.pi) - np.pi
        return np.sqrt(x * x + y * y + (TURN_RADIUS * turned) ** 2)

    def _cost(self, plans: Plans, table: Floats, now: Situation) -> Floats:
        """Return the cost of each plan, (N,) (m)."""
        count = len(plans.contacts)
        poses, tips = np.tile(now.pose, (count, 1)), np.tile(now.tip, (count, 1))
        steps, unfit = np.zeros(count), np.zeros(count)
        for push in range(PUSHES):
            rows, lengths = plans.contacts[:, push], plans.lengths[:, push]
            used = lengths.sum(1) > SHORTEST_PUSH
            starts = self._body.tips(poses, table[rows], APPROACH)
            ways = np.hypot(*(starts - tips).T)
            coming = np.where(rows == len(self._contacts), 0.0, LIFT_STEPS + ways / FREE_WAY)
            steps += used * (coming + lengths.sum(1) / PUSHING_WAY)
            away = np.hypot(*(starts - self._base).T)
            unfit += used * UNFIT_PRICE * ((away < REACH[0]) | (away > REACH[1]))
            pushed, tips_then, squareness = self._pushed(poses, table[rows], plans, push)
            unfit += used * SLIP_PRICE * np.maximum(0.0, np.cos(STEEPEST) - squareness)
            poses = np.where(used[:, None], pushed, poses)
            tips = np.where(used[:, None], tips_then, tips)
        late = np.maximum(0.0, steps - now.steps_left)
        return self.error(poses) + STEP_PRICE * steps + LATE_PRICE * late + unfit

    def _pushed(
        self, poses: Floats, contacts: Floats, plans: Plans, push: int
    ) -> tuple[Floats, Floats, Floats]:
        """Return where bodies and tips come to be, and the least squareness on the way."""
        least = np.ones(len(poses))
        for slide in self._body.push(
            poses, contacts, plans.directions[:, push], plans.lengths[:, push]
        ):
            poses, contacts = slide.poses, slide.contacts
            least = np.minimum(least, slide.squareness)
        return poses, self._body.tips(poses, contacts), least

    def _evolve(self, cost: Callable[[Plans], Floats], may_go_on: bool) -> Plans:
        """Return plans, the best first: each family keeps its best child, half of them go on."""
        plans = self._random_plans(10 * FAMILIES, may_go_on)
        costs = cost(plans)
        order = np.argsort(costs)[:FAMILIES]
        plans, costs = plans.take(order), costs[order]
        for generation in range(GENERATIONS):
            if generation % 10 == 9:
                order = np.argsort(costs)[: len(costs) // 2]
                plans, costs = plans.take(order), costs[order]
            rows = np.repeat(np.arange(len(costs)), CHILDREN)
            children = self._varied(plans.take(rows), COOLING**generation)
            born = cost(children).reshape(-1, CHILDREN)
            best = np.arange(len(costs)) * CHILDREN + born.argmin(1)
            better = born.min(1) < costs
            plans = _merged(better, children.take(best), plans)
            costs = np.where(better, born.min(1), costs)
        return plans.take(np.argsort(costs))

    def _random_plans(self, count: int, may_go_on: bool) -> Plans:
        contacts = self._random.integers(len(self._contacts), size=(count, PUSHES))
        if may_go_on:
            contacts[: count // 2, 0] = len(self._contacts)
        shape = (count, PUSHES, STROKES)
        return Plans(
            contacts,
            self._random.uniform(-0.8, 0.8, shape),
            self._random.uniform(0.0, LONGEST_STROKE / 2, shape),
        )

    def _varied(self, plans: Plans, heat: float) -> Plans:
        random, shape, every = self._random, plans.contacts.shape, len(self._contacts)
        varied = (random.random(shape) < 0.6)[..., None]
        shifts = np.round(random.normal(0.0, 4 * heat + 0.6, shape)).astype(int)
        leaps = random.integers(every, size=shape)
        shifts = np.where(random.random(shape) < 0.1 * heat, leaps, shifts)
        shifts *= (random.random(shape) < 0.4) & (plans.contacts < every)
        contacts = np.where(plans.contacts < every, (plans.contacts + shifts) % every, every)
        turns = random.normal(0.0, 0.4 * heat + 0.01, plans.directions.shape)
        longer = random.normal(0.0, 0.04 * heat + 0.001, plans.lengths.shape)
        return Plans(
            contacts,
            np.clip(plans.directions + varied * turns, -WIDEST, WIDEST),
            np.clip(plans.lengths + varied * longer, 0.0, LONGEST_STROKE),
        )


def _merged(choose: NDArray[np.bool_], chosen: Plans, otherwise: Plans) -> Plans:
    """Return row by row the one or the other."""
    return Plans(
        np.where(choose[:, None], chosen.contacts, otherwise.contacts),
        np.where(choose[:, None, None], chosen.directions, otherwise.directions),
        np.where(choose[:, None, None], chosen.lengths, otherwise.lengths),
    )
