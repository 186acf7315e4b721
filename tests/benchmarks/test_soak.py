"""``python -m benchmarks soak``: what is healthy passes, and what leaks is reported."""

from contextlib import redirect_stdout
from io import StringIO

import pytest

from benchmarks.__main__ import main
from benchmarks.soak import growth
from tasks import register_task
from tests.data import leaking_tasks
from tests.fresh_process import in_fresh_process

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
    assert printed[-1].endswith("nothing grows.")


@pytest.mark.long
@pytest.mark.parametrize(
    ("leaking", "quantity"),
    [(leaking_tasks.HoardsMemory, "memory"), (leaking_tasks.LeavesFilesOpen, "descriptors")],
)
def test_a_task_that_leaks_is_reported(leaking, quantity):
    code, printed = in_fresh_process(soaked, "Leaking-v1", leaking)
    assert code == 1
    assert [line for line in printed if line.startswith("GROWS")] == [
        f"GROWS: Leaking-v1: {quantity} in workers",
        f"GROWS: Leaking-v1: {quantity} in this process",
        f"GROWS: {quantity} of this process, from lap to lap",
    ]


@pytest.mark.parametrize(
    ("values", "least"),
    [
        ([0, 1, 2, 3, 4, 5, 6, 7, 8], 5),
        ([0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4], 1),  # piece by piece
        ([5, 8, 9, 9, 9, 9, 9, 9, 9], 0),  # warming up
        ([3, 3, 3, 3, 3, 3, 9, 9, 9], 0),  # one step up
        ([3, 3, 3, 3, 9, 3, 9, 3, 3], 0),
        ([9, 9, 9, 9, 8, 7, 6, 5, 4], 0),
        ([1], 0),
    ],
)
def test_only_what_keeps_rising_grows(values, least):
    assert growth([values]) >= least if least else growth([values]) <= 0
