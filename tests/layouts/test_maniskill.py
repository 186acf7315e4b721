"""The layouts of ManiSkill's tasks are those that the clones have."""

import pytest

import tasks
from layouts import from_maniskill
from layouts.maniskill import TASKS
from robots import UnknownNameError

CLONES = [
    task_id
    for task_id in tasks.list_tasks()
    if "native" in "".join(tasks.registry.other_names(tasks.get_task_class(task_id)))
]


@pytest.mark.parametrize("task_id", CLONES)
def test_every_clone_has_its_layout_here(task_id):
    assert from_maniskill(task_id) == tasks.get_task_class(task_id).layout


def test_no_layout_is_left_over():
    assert list(TASKS) == sorted(CLONES)


@pytest.mark.parametrize("task_id", TASKS)
def test_every_layout_names_its_source(task_id):
    assert TASKS[task_id][1].partition(":")[0].endswith(".py")


def test_native_distances():
    assert from_maniskill("PickCube-v1")["arm"].base_position == (-0.615, 0.0, 0.0)
    two = from_maniskill("TwoRobotPickCube-v1")
    assert [p.base_position for p in two.values()] == [(0.0, -0.75, 0.0), (0.0, 0.75, 0.0)]


def test_an_unknown_task_names_the_closest():
    with pytest.raises(UnknownNameError, match="'PickCub-v1'. Did you mean 'PickCube-v1'"):
        from_maniskill("PickCub-v1")
