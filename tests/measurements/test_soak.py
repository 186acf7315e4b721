"""``robot-layouts soak``: what is healthy passes, and what leaks is told."""

import random
from contextlib import redirect_stdout
from io import StringIO

import pytest

from measurements.soak.soak import Soak, Soaked, between_laps, complaints, leaks, soak
from robot_layouts.__main__ import main
from robots import TaskError
from tasks import list_tasks, register_task
from tests.fresh_process import in_fresh_process
from tests.measurements.test_process_resources import level
from tests.rollouts import leaking_tasks

SMALL = ["--envs", "2", "--workers", "1", "--steps", "1"]


def soaked(task_id: str, leaking: type | None = None) -> tuple[int, list[str]]:
    """Return the exit code of the command and the lines that it prints."""
    if leaking is not None:
        register_task(task_id)(leaking)
    printed = StringIO()
    with redirect_stdout(printed):
        code = main(["soak", "--tasks", task_id, *SMALL])
    return code, printed.getvalue().splitlines()


@pytest.mark.long
def test_a_healthy_task_passes():
    code, printed = in_fresh_process(soaked, "maniskill.push_cube_native")
    assert code == 0
    assert any("PushCube-v1" in line for line in printed)
    assert any("MB, all else –." in line for line in printed)
    assert printed[-1].endswith("nothing grows.")


@pytest.mark.long
@pytest.mark.parametrize(
    ("leaking", "quantity"),
    [
        (leaking_tasks.HoardsMemory, "memory"),
        pytest.param(leaking_tasks.LeavesFilesOpen, "descriptors", marks=pytest.mark.long),
    ],
)
def test_a_task_that_leaks_is_told(leaking, quantity):
    code, printed = in_fresh_process(soaked, "Leaking-v1", leaking)
    assert code == 1
    assert [line for line in printed if line.startswith("GROWS")] == [
        f"GROWS: Leaking-v1: {quantity} in workers",
        f"GROWS: Leaking-v1: {quantity} in this process",
        f"GROWS: {quantity} of this process, from lap to lap",
    ]
    assert printed[-1].endswith("something grows.")


def test_laps_are_compared_task_by_task():
    """Tasks need more or less, and one may keep a piece of memory by chance."""
    first, second, third = (Soaked(name) for name in "abc")
    first.after = [level(100), level(200), level(202), level(204)]
    second.after = [level(500), level(510), level(510), level(514)]
    third.after = [level(100), level(100), level(190), level(190)]
    assert between_laps([first, second, third]).memory == 2
    assert leaks(between_laps([first, second, third]), 1.9) == ["memory"]
    assert leaks(between_laps([first, second, third]), 2.1) == []


def test_it_takes_about_as_many_steps_as_asked_for():
    wanted = Soak(2_000_000)
    assert wanted.task_ids == tuple(list_tasks())
    assert wanted.planned == pytest.approx(2_000_000, rel=0.01)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"steps": 0}, "steps is 0; it must be 1 or more"),
        ({"num_workers": 0}, "num_workers is 0; it must be 1 or more"),
        ({"laps": 2}, "laps is 2; it must be 3 or more"),
        ({"num_envs": 2, "num_workers": 3}, "3 workers cannot share 2 environments"),
    ],
)
def test_numbers_that_make_no_sense(fields, message):
    with pytest.raises(TaskError, match=message):
        Soak(**{"steps": 1, **fields})


@pytest.mark.long
def test_nothing_grows_over_all_tasks():
    found = in_fresh_process(soak, Soak(60_000, seed=random.randrange(1000)))
    assert [task.task_id for task in found] == list(list_tasks())
    assert complaints(found) == []
