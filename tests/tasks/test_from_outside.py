"""Tasks, experts and presets of other packages: by entry points, and by module and id."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import tasks
from robots import TaskError, UnknownNameError

CHECKOUT = Path(__file__).parents[2]
TRAY = '''
import numpy as np
from robot_layouts.experts import register_expert
from layouts import face_to_face
from tasks import MultiRobotTask, register_task


def opposite(robots, *, keyframe=None):
    return face_to_face(robots, spacing=1.4, keyframe=keyframe)


@register_task("TwoArmTray-v1", "tray")
class TwoArmTray(MultiRobotTask):
    """Two arms that hold still. Success: never."""

    layout = opposite({"left": "panda", "right": "panda"})
    max_episode_steps = 3

    def build(self, world): ...

    def sample(self, world, rng): ...

    def evaluate(self, state):
        return {"success": np.zeros(state.num_envs, bool)}


def lift(task, seed):
    return np.zeros((2, 16), np.float32)


class NoTask: ...
'''
ENTRY_POINTS = """
[robot_layouts.tasks]
TwoArmTray-v1 = mylab.tray:TwoArmTray
Other-v1 = mylab.tray:TwoArmTray
NoTask-v1 = mylab.tray:NoTask
Missing-v1 = mylab.missing:Missing
[robot_layouts.experts]
TwoArmTray-v1 = mylab.tray:lift
PickCube-v7 = mylab.tray:lift
[robot_layouts.presets]
opposite = mylab.tray:opposite
nonsense = mylab.tray:lift
"""


@pytest.fixture
def mylab(tmp_path) -> Path:
    """A package with a task, its expert and a preset; not yet one that pip knows."""
    (tmp_path / "mylab").mkdir()
    (tmp_path / "mylab" / "__init__.py").write_text("")
    (tmp_path / "mylab" / "tray.py").write_text(TRAY)
    (tmp_path / "mylab" / "broken.py").write_text("raise RuntimeError('no licence')")
    return tmp_path


@pytest.fixture
def installed(mylab) -> Path:
    """The same package with its entry points."""
    info = mylab / "mylab-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mylab\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRY_POINTS)
    return mylab


def run(folder: Path, *words: str) -> str:
    """Return what a program prints that finds the package."""
    done = subprocess.run(
        [sys.executable, *words],
        env={**os.environ, "PYTHONPATH": f"{folder}{os.pathsep}{CHECKOUT}"},
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.long
def test_a_module_and_an_id_go_wherever_an_id_goes(mylab):
    code = (
        "import tasks, sys\n"
        "from robot_layouts import experts\n"
        "assert 'mylab.tray' not in sys.modules\n"
        "env = tasks.make('mylab.tray:twoarmtray-v1', num_envs=2)\n"
        "print(env.task_id, env.num_envs, 'TwoArmTray-v1' in tasks.list_tasks())\n"
        "assert tasks.get_task_class('mylab.tray:TRAY') is env.task_class\n"
        "assert tasks.get_task_class('TwoArmTray-v1') is env.task_class\n"
        "try: tasks.make('mylab.tray:TwoArmTry-v1')\n"
        "except KeyError as error: print(error)\n"
    )
    first, second = run(mylab, "-c", code).splitlines()
    assert first == "TwoArmTray-v1 2 True"
    assert second.startswith("unknown task 'TwoArmTry-v1'. Did you mean 'TwoArmTray-v1'? ")
    assert second.endswith(" Importing 'mylab.tray' registered no such task.")


@pytest.mark.long
def test_gymnasium_takes_them_by_module_and_id(mylab):
    (named,) = re.findall(r"`gymnasium\.make\(([^)]*)\)`", (CHECKOUT / "README.md").read_text())
    code = (
        "import gymnasium, sys\n"
        "assert 'tasks' not in sys.modules\n"
        f"print(gymnasium.make({named}).action_space.shape)\n"
        "envs = gymnasium.make_vec('RobotLayouts/PickCube-v1', num_envs=1, num_workers=1,"
        " task_id='mylab.tray:TwoArmTray-v1')\n"
        "print(envs.single_action_space.shape)\n"
        "envs.close()\n"
        "print(gymnasium.make('mylab.tray:RobotLayouts/TwoArmTray-v1').action_space.shape)\n"
    )
    assert run(mylab, "-c", code).splitlines() == ["(8,)", "(16,)", "(16,)"]


def test_a_module_that_cannot_be_imported_is_named(mylab, monkeypatch):
    monkeypatch.syspath_prepend(mylab)
    with pytest.raises(TaskError) as error:
        tasks.make("mylab.broken:X-v1")
    assert str(error.value) == (
        "the module 'mylab.broken' of the task 'mylab.broken:X-v1' cannot be imported:"
        " RuntimeError: no licence"
    )
    with pytest.raises(TaskError, match=r"of the task ':X-v1' cannot be imported: ValueError"):
        tasks.make(":X-v1")


def test_an_unknown_task_says_how_to_name_one_from_outside():
    with pytest.raises(UnknownNameError, match=r"A task of your own goes by 'module:Id'"):
        tasks.get_task_class("Trey-v1")


@pytest.mark.long
def test_an_installed_package_brings_tasks_experts_and_presets(installed):
    code = (
        "import sys, gymnasium, tasks\n"
        "from robot_layouts import experts\n"
        "from layouts.presets import PRESETS\n"
        "assert 'mylab.tray' not in sys.modules\n"
        "assert 'TwoArmTray-v1' in tasks.list_tasks()\n"
        "print(gymnasium.make('RobotLayouts/TwoArmTray-v1').action_space.shape)\n"
        "print(experts.find_expert('twoarmtray-v1')(None, 0).shape)\n"
        "print(*PRESETS['opposite']({'a': 'panda', 'b': 'koch'}))\n"
        "assert 'opposite' in list(PRESETS)\n"
    )
    assert run(installed, "-c", code).splitlines() == ["(16,)", "(2, 16)", "a b"]


@pytest.mark.long
def test_a_broken_entry_point_is_named(installed):
    broken = {
        "Other-v1": "is listed as 'Other-v1', but its task is 'TwoArmTray-v1'",
        "NoTask-v1": "a subclass of tasks.MultiRobotTask is needed, with @register_task('NoTask",
        "Missing-v1": "cannot be loaded: ModuleNotFoundError: No module named 'mylab.missing'",
    }
    code = (
        "import tasks\n"
        "from robots import TaskError\n"
        f"for name in {list(broken)}:\n"
        "    try: tasks.make(name)\n"
        "    except TaskError as error: print(error)\n"
    )
    for printed, message in zip(
        run(installed, "-c", code).splitlines(), broken.values(), strict=True
    ):
        assert printed.startswith("entry point 'mylab.")
        assert " of mylab 1.0 " in printed
        assert message in printed


@pytest.mark.long
def test_a_preset_of_another_package_on_the_command_line(installed):
    assert "panda" in run(installed, "-m", "layouts", "show", "opposite", "a=panda", "b=panda")
    code = (
        "from layouts.__main__ import main\n"
        "import contextlib, sys\n"
        "sys.stderr = sys.stdout\n"
        "print(main(['show', 'nonsense', 'a=panda']))\n"
    )
    assert "a function whose first argument is robots" in run(installed, "-c", code)
