"""The experts of cells: they pass every stage, with the cells' own robots and with others."""

from itertools import cycle

import pytest

import layouts
import tasks
from robot_layouts.data.gate import check_task
from robot_layouts.experts import find_expert
from tasks.episode import play

UR5_AND_Z1 = {"south": "ur5", "east": "z1", "north": "ur5", "west": "z1"}
STICK_AND_FLANGE = {"west": "panda_stick", "east": "xarm7", "pusher": "panda_stick"}
CELLS = [name for name in tasks.list_tasks() if name.startswith("Cell")]


@pytest.mark.long
@pytest.mark.parametrize("task_id", CELLS)
def test_the_scores_of_an_episode_are_proofs(task_id):
    found = {outcome.check: outcome for outcome in check_task(task_id, 2, first=3)}
    assert [name for name, outcome in found.items() if not outcome.passed] == []


@pytest.mark.long
@pytest.mark.parametrize("task_id", ["CellPassAround-v1", "CellShiftRing-v1"])
def test_rings_may_have_another_number_of_arms(task_id):
    ring = layouts.ring({f"arm{i}": "panda" for i in range(5)}, radius=1.05)
    env = tasks.make(task_id, layout=ring)
    assert play(env, 0, find_expert(task_id)(env, 0)).solved


@pytest.mark.long
def test_a_hand_comes_down_on_a_bracket_as_it_has_set_off():
    env = tasks.make("CellHangBrackets-v1")  # of seed 49 the third hand turned about on its way
    assert play(env, 49, find_expert("CellHangBrackets-v1")(env, 49)).solved


@pytest.mark.parametrize(
    ("task_id", "robots", "seed"),
    [
        ("CellTwoHandPress-v1", {"loader": "panda"}, 1),  # a flat tip, to which the block sticks
        pytest.param("CellGatherBlocks-v1", UR5_AND_Z1, 0, marks=pytest.mark.long),  # z1s lean far
        pytest.param("CellSqueezeBox-v1", "xarm7", 0, marks=pytest.mark.long),  # is wide
        pytest.param("CellStackInOrder-v1", "so101", 0, marks=pytest.mark.long),  # small cubes rest
        pytest.param("CellSqueezeBox-v1", STICK_AND_FLANGE, 0, marks=pytest.mark.long),
    ],
)
def test_tips_of_other_makes_push_and_press(task_id, robots, seed):
    env = tasks.make(task_id, robots=robots)
    assert play(env, seed, find_expert(task_id)(env, seed)).solved


@pytest.mark.parametrize(
    ("task_id", "robots"),
    [
        ("CellTwoHandPress-v1", ("koch",)),  # it begins with its joints at their limits
        ("CellPressInOrder-v1", ("ur3", "fetch")),  # fingers reach below the Fetches' TCPs
        ("CellSetFaders-v1", ("so101", "fetch")),
        ("CellTakeSides-v1", ("panda_stick", "so100")),  # a block slips off, and is pushed again
        ("CellSqueezeBox-v1", ("xarm7", "so100")),  # tips feel where the box begins
        pytest.param("CellTurnTaps-v1", ("ur3", "ur10"), marks=pytest.mark.long),  # wide flanges
    ],
)
def test_arms_of_other_makes_press_push_and_sweep(task_id, robots):
    cls = tasks.get_task_class(task_id)
    steps = 2 * cls.max_episode_steps  # small arms are slow
    named = dict(zip(cls.layout, cycle(robots), strict=False))
    env = tasks.make(task_id, robots=named, max_episode_steps=steps)
    assert play(env, 0, find_expert(task_id)(env, 0)).solved
