"""Robots whose arms begin high above their wheels stand before a task's table, below its top."""

from contextlib import closing
from dataclasses import replace

import pytest

import tasks
from layouts import Layout, at_task, face_to_face
from layouts.distances import SHOULDER
from robot_layouts.experts import find_expert
from robot_layouts.simulation.world import TABLE_OUTLINE
from tasks.episode import play
from tests.layouts.tall_robots import panda_on_a_pillar

TASK = "TwoRobotHandOver-v1"
PILLAR, SHOULDERS = 0.7, 0.333  # m, how high a Panda's first joint is above its own base
FRONT = 0.15 + 0.02  # m, from a base to the table before it


@pytest.fixture(scope="module")
def tall(tmp_path_factory):
    return panda_on_a_pillar(tmp_path_factory.mktemp("pillar"), PILLAR)


def test_two_of_them_begin_with_their_hands_over_the_table_between_them(tall):
    layout = face_to_face({"left": tall, "right": tall})
    table = tasks.get_task_class(TASK).table.outline(layout)
    assert table[::2] == TABLE_OUTLINE[::2]
    for name, side in (("left", -1), ("right", 1)):
        _, y, z = layout[name].base_position
        assert z + PILLAR + SHOULDERS == pytest.approx(SHOULDER * tall.reach, abs=1e-3)
        assert table[1 if side < 0 else 3] == pytest.approx(y - side * FRONT)
    assert layout.validate(workspaces=False, samples=20, table=table).ok


def test_the_table_stays_under_all_others(tall):
    task = tasks.get_task_class("CellCloseDrawers-v1")
    layout = at_task({"first": tall}, task)
    own, cut = (task.table.outline(at) for at in (task.layout, layout))
    assert cut[1] == pytest.approx(layout["first"].base_position[1] + FRONT)
    for name in ("second", "third"):
        x, y, z = layout[name].base_position
        assert cut[0] < x < cut[2]
        assert cut[1] < y < cut[3]
        assert z == 0.0
    assert own[1] < task.layout["first"].base_position[1]


def test_one_that_already_stands_clear_of_a_table_leaves_it_whole(tall):
    (placement, _) = face_to_face({"left": tall, "right": tall}).values()
    layout = Layout({"left": replace(placement, position=(0.0, -2.0, -0.6))})
    assert tasks.get_task_class(TASK).table.outline(layout) == TABLE_OUTLINE


@pytest.mark.parametrize(
    "robots", [("left",), pytest.param(("left", "right"), marks=pytest.mark.long)]
)
def test_they_hand_over(tall, robots):
    with closing(tasks.make(TASK, robots=dict.fromkeys(robots, tall))) as env:
        assert play(env, 0, find_expert(TASK)(env, 0)).solved
