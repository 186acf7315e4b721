"""The tutorial's notebook does what it says, in a plain process and in a notebook."""

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


@pytest.mark.long
def test_a_notebook_runs_it_from_the_first_to_the_last_cell(tmp_path):
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(
        notebook, timeout=600, resources={"metadata": {"path": tmp_path}}
    ).execute()
    shown = {}
    for cell in notebook.cells:
        for output in cell.get("outputs", ()):
            assert output["output_type"] != "error"
            shown.update(
                {kind: shown.get(kind, "") + text for kind, text in output.get("data", {}).items()}
            )
    assert "<svg" in shown["text/html"]  # the task's layout
    assert "arm.panda_joint1" in shown["text/html"]  # the robot's numbers
    assert "4 of 4 episodes with success" in shown["text/plain"]
    assert "is defined in this notebook or interactive session" in shown["text/plain"]
