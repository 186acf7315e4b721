"""Goals that take a longer search: postures that are not met with at first."""

import numpy as np

from layouts import single
from robot_layouts.motion import TcpGoal, plan
from robot_layouts.motion.collision.cell import Cell, Clearances
from robot_layouts.motion.model.obstacles import box
from robot_layouts.motion.planning.goals import PlaceGoal, read_targets
from robot_layouts.motion.planning.query import find_goal_configurations
from tests.motion.two_pandas import aside, cell, in_the_middle

HARD = TcpGoal((-0.465, -0.112, 0.763), (0.46803, 0.79404, 0.09321, 0.37802))


def test_a_goal_that_no_first_start_leads_to_is_reached():
    motion = plan(single({"arm": "ur5_gripper"}), goals={"arm": HARD})
    assert motion.certify().ok
    assert motion.moving == ("arm",)


def meeting(whole, *, others):
    """Both arms in the middle, the right one somewhere else after a longer search."""
    start = np.concatenate(list(aside().values()))
    places = {"left": in_the_middle(), "right": in_the_middle()}
    left, right = read_targets(whole, places, start)
    return (
        left,
        PlaceGoal("right", "right", right.moving, right.candidates, "", lambda: others),
        start,
    )


def test_postures_of_a_longer_search_let_goals_agree():
    whole = Cell(cell())
    elsewhere = np.array([aside()["right"][:7]])
    left, right, start = meeting(whole, others=elsewhere)
    (end,) = find_goal_configurations(
        [left, right], Clearances(whole, whole.robots, 0.01), start, 0.0
    )
    assert np.array_equal(end[right.moving], elsewhere[0])
    assert any(np.array_equal(end[left.moving], posture) for posture in left.candidates)


def test_an_obstacle_is_avoided_by_a_posture_of_a_longer_search():
    block = box("block", (0.3, 0.3, 0.3), (0.0, 0.0, 0.3))
    whole = Cell(cell(), [block])
    elsewhere = np.array([aside()["right"][:7]])
    _, right, start = meeting(whole, others=elsewhere)
    (end,) = find_goal_configurations([right], Clearances(whole, ["right"], 0.01), start, 0.0)
    assert np.array_equal(end[right.moving], elsewhere[0])
