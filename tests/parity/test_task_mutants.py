"""For every task, a clone that is wrong in one number is noticed."""

from dataclasses import replace
from typing import Any

import pytest

import tasks
from parity.episodes import random_episodes
from robot_layouts.simulation import PhysicsSettings, World
from tests.native import NATIVE, TASKS, against_native
from tests.quick import quick_cases

pytestmark = NATIVE


def make_bodies_heavier(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give every body that physics moves a tenth more density."""
    add = World.add

    def add_heavier(world: World, name: str, *shapes: Any, **options: Any) -> Any:
        if options.get("kind", "dynamic") == "dynamic":
            shapes = tuple(replace(shape, density=1.1 * shape.density) for shape in shapes)
        return add(world, name, *shapes, **options)

    monkeypatch.setattr(World, "add", add_heavier)


def widen_the_hole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "tasks.maniskill.peg_insertion_side.CLEARANCE", 0.004
    )  # m, instead of 0.003


def move_where_tips_should_be(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tasks.maniskill.rotate_valve.TIP_OFFSET", 0.011)  # m, instead of 0.01


def nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave everything as it is."""


# Where a wrong density cannot be told, or something else is special to the task.
OTHER_MUTANTS = {
    **dict.fromkeys(
        ("DrawTriangle-v1", "TableTopFreeDraw-v1"),
        (nothing, {"physics": PhysicsSettings()}),  # their own solver is 4/0
    ),
    "PegInsertionSide-v1": (widen_the_hole, {}),
    **{f"RotateValveLevel{n}-v1": (move_where_tips_should_be, {}) for n in range(5)},
}


@pytest.mark.parametrize("task_id", quick_cases(TASKS))
def test_one_wrong_number(task_id: str, monkeypatch: pytest.MonkeyPatch):
    mutate, fields = OTHER_MUTANTS.get(task_id, (make_bodies_heavier, {}))
    mutate(monkeypatch)
    mutant = tasks.make(task_id, **fields)
    episode = random_episodes([0], 40, mutant.layout.action_dim)[0]
    (result,) = against_native(task_id, mutant).play([episode])
    assert not result.equal
    assert result.first_difference.step <= 1
