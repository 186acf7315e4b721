"""The tutorial's notebook does what it says, cell by cell in a plain process."""

import json
import sys
from pathlib import Path
from types import ModuleType

import gymnasium
import pytest

from robot_layouts.experts.registry import EXPERTS
from tasks.registry import TASKS

NOTEBOOK = Path(__file__).parents[2] / "examples" / "two_arm_tray.ipynb"
TASK = "NotebookTray-v1"


def cells() -> list[str]:
    found = json.loads(NOTEBOOK.read_text())["cells"]
    return ["".join(cell["source"]) for cell in found if cell["cell_type"] == "code"]


def test_it_holds_no_outputs():
    found = json.loads(NOTEBOOK.read_text())["cells"]
    code = [cell for cell in found if cell["cell_type"] == "code"]
    assert all(not cell["outputs"] and cell["execution_count"] is None for cell in code)


@pytest.mark.long
def test_its_cells_run_one_after_the_other(monkeypatch, tmp_path):
    """As in a notebook: what they define is in a ``__main__`` that comes from no file."""
    main = ModuleType("__main__")
    monkeypatch.setitem(sys.modules, "__main__", main)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    try:
        for source in cells():
            exec(compile(source, "<cell>", "exec"), vars(main))
    finally:
        TASKS.registered.pop(TASK, None)
        EXPERTS.registered.pop(TASK, None)
        gymnasium.registry.pop(f"RobotLayouts/{TASK}", None)
    expect_results(vars(main))


def expect_results(names: dict) -> None:
    assert names["plan"].shape[1] == 16
    assert names["plan"].reason == ""
    assert names["solved"].success_rate == 1
    assert "'right' is a panda_stick, which has none" in names["failed"].reasons[0]
    assert list(names["judged"].successes.values()) == [False] * 8
    assert "is defined in this notebook or interactive session, where worker" in names["refused"]
    assert names["lowered"].reason == "no success within 100 steps"
    assert names["summary"].recorded == 2
    tray = names["played"].states["actors"]["tray"]
    assert (tray == names["episodes"][0].states["actors"]["tray"]).all()
