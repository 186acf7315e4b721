"""The hand-over by any two grippers."""

import numpy as np
import pytest

import tasks
from benchmarks.experts import standing
from layouts import face_to_face
from robot_layouts.experts import find_expert
from robot_layouts.experts.hands import Hand
from robots import TaskError
from tasks.episode import play

TASK = "TwoRobotHandOver-v1"
expert = find_expert(TASK)


@pytest.mark.long
@pytest.mark.parametrize("pair", [("so100", "so100"), ("so101", "so101"), ("panda", "so100")])
def test_small_and_mixed_pairs_hand_over(pair: tuple[str, str]):
    env = tasks.make(TASK, layout=face_to_face(dict(zip(("left", "right"), pair, strict=True))))
    assert any(play(env, seed, expert(env, seed)).solved for seed in range(3))


@pytest.mark.long
def test_a_taker_comes_round_where_it_cannot_come_straight():
    env = standing(TASK, ("panda", "ur3_with_panda"))  # the UR3 waits across where the cube comes
    assert play(env, 2, expert(env, 2)).solved


def test_a_cube_out_of_reach_is_said_to_be():
    class Away(tasks.get_task_class(TASK)):
        cube = tasks.Cube(0.02, spawn=tasks.Area(x=0.0, y=1.5))

    with pytest.raises(TaskError, match="'left' cannot reach the cube"):
        expert(Away(Away.scenario), 0)


@pytest.mark.parametrize("robot", ["panda", "so100"])
def test_postures_bring_the_point_between_the_fingers_where_it_is_to_be(robot: str):
    env = tasks.make(TASK, layout=face_to_face({"left": robot, "right": robot}))
    hand, here = Hand(env, "left"), env.state.qpos("left")[0].astype(float)
    link = hand.link(here[None])[0]
    point = hand.motion.middle(0.3)
    place = link[:3, :3] @ point + link[:3, 3]
    away = here.copy()
    away[hand.columns] += 0.1
    found = hand.reach(place[None], hand.turns(here[None]), hand.pointing(point), away[None])
    assert len(found) == 1
    reached = hand.link(found.qpos)[0]
    assert np.linalg.norm(reached[:3, :3] @ point + reached[:3, 3] - place) < 2e-3


@pytest.mark.parametrize("robot", ["panda", "so101"])
def test_a_hand_shows_in_physics_how_it_holds_a_cube(robot: str):
    env = tasks.make(TASK, layout=face_to_face({"left": robot, "right": robot}))
    hand = Hand(env, "left")
    grip = hand.grip(0.02, 0.2)
    assert grip is not None
    assert 0 < grip.held < grip.share
    ahead = hand.motion.turn.T @ (grip.pose[:3, 3] - hand.motion.middle(grip.share))
    assert ahead[2] == pytest.approx(0.2 * 0.02)
    assert hand.grip(3 * hand.motion.widest, 0.2) is None


def test_a_cube_that_slips_is_held_more_firmly():
    hand = Hand(tasks.make(TASK, layout=face_to_face({"left": "z1", "right": "z1"})), "left")
    assert hand.grip(0.025, 0.4) is None
    firm = hand.grip(0.025, 0.4, firmness=2.5)
    assert firm is not None
    assert firm.firmness == 2.5


@pytest.mark.long
def test_fingers_that_draw_back_as_they_open_close_on_a_large_cube():
    hand = Hand(tasks.make(TASK, robots="tiago_pro"), "left")
    assert hand.motion.middle(1.0)[2] < hand.motion.middle(0.0)[2] - 0.01
    grip = hand.grip(0.048, 0.4)
    assert grip is not None
    assert grip.share < 0.9
