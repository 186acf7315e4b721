"""Values that a joint cannot pass: what is proven to be cut off, and what is not."""

from functools import lru_cache

import numpy as np
import pytest

from layouts import Layout, Placement
from robot_layouts.motion import NoPlanError, plan
from robot_layouts.motion.collision.cell import Cell, Clearances
from robot_layouts.motion.model.obstacles import Track, box
from robot_layouts.motion.planning.infeasibility import InfeasibilityProofs

PAN, LIFT = range(2)
TABLE = (-2.0, -2.0, 2.0, 2.0)


@lru_cache(maxsize=2)
def raised(yaw=-0.3) -> Layout:
    """A UR10 30 cm above a table that it can reach."""
    return Layout({"arm": Placement("ur10", (0.0, 0.0, 0.3), rpy=(0.0, 0.0, yaw))})


def behind(cell):
    """Its upper arm leant over backwards, as far as it gets; the goal of what is asked."""
    goal = cell.start.copy()
    goal[LIFT] = 2.9
    return goal


def proof(cell, start=None, goal=None, moving=6):
    clearances = Clearances(cell, ["arm"], 0.01)
    start = cell.start if start is None else start
    proofs = InfeasibilityProofs(cell, clearances.standing, start, np.arange(moving))
    return proofs.before(behind(cell) if goal is None else goal)


def floor_with_a_slot(width):
    """A floor 30 cm below the arm's foot, with a slot along x in which the upper arm may hang."""
    middle, size = 0.15, (4.0, 2.0, 0.9)
    sides = {"left": middle + width / 2 + 1.0, "right": middle - width / 2 - 1.0}
    return [box(name, size, (0.0, y, -0.45)) for name, y in sides.items()]


@pytest.mark.long
def test_a_goal_beyond_the_floor_is_cut_off():
    cell = Cell(raised(), table=TABLE)
    assert cell.checker().free(behind(cell)[None])[0]
    message = (
        "arm cannot get to its goal: its shoulder_lift_joint would have to pass 1.6. rad,"
        " where upper_arm_link is in table whatever its other joints do"
    )
    with pytest.raises(NoPlanError, match=message) as error:
        plan(raised(), goals={"arm": behind(cell)[:6]}, table=TABLE, patience=60)
    assert error.value.reason == "cut off"


def test_everything_collides_at_a_barrier():
    cell = Cell(raised(), floor_with_a_slot(0.1))
    found = proof(cell)
    low, high = np.clip(cell.limits, -np.pi, np.pi).T
    states = np.random.default_rng(0).uniform(low, high, (300, cell.size))
    states[:, LIFT] = found.value
    assert not cell.checker().free(states).any()


@pytest.mark.parametrize("pan", [0.0, 1.0, 2.0])
def test_a_slot_that_few_postures_fit_through_is_a_way(pan):
    cell = Cell(raised(yaw=-0.3), floor_with_a_slot(0.2))
    start = cell.start.copy()
    start[PAN] = pan
    assert proof(cell, start) is None


def test_what_another_joint_can_avoid_is_no_barrier():
    cell = Cell(raised(), [box("post", (0.1, 0.1, 1.4), (0.6, 0.0, 0.0))], table=TABLE)
    start, goal = cell.start.copy(), cell.start.copy()
    start[:3], goal[:3] = (-1.0, -0.5, 0.5), (1.0, -0.5, 0.5)
    across = np.linspace(start, goal, 50)
    assert cell.checker().free(across[[0, -1]]).all()
    assert not cell.checker().free(across).all()
    assert proof(cell, start, goal) is None


def test_what_moves_away_is_no_barrier():
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[:, 2, 3] = -0.45, -3.0
    lift = box("lift", (4.0, 4.0, 0.9)).moved(Track(np.array([0.0, 2.0]), poses))
    assert proof(Cell(raised(), [lift])) is None
    assert proof(Cell(raised(), [box("floor", (4.0, 4.0, 0.9), (0.0, 0.0, -0.45))])) is not None
