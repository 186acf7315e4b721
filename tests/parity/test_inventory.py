"""``python -m parity inventory``: what it says about tasks here, files, and native's own tasks."""

import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

import tasks
from parity.__main__ import main
from parity.compare.native_env import native_tasks
from parity.records.inventory import NO_REASON, find_files, missing_tasks, reason
from rollouts.reading.recording import TrajectoryError
from tests.native import NATIVE

ROOT = Path(__file__).parents[2]
TASKS = ("PickCube-v1", "TwoRobotPickCube-v1")
SAID = {"env_info": {"env_id": "PickCube-v1"}, "episodes": []}


@pytest.fixture
def demos(tmp_path):
    """A folder with two files for PickCube, and one that is none."""
    for name, text in (("a/one", json.dumps(SAID)), ("b/two", json.dumps(SAID)), ("three", "{}")):
        path = tmp_path / "demos" / f"{name}.h5"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
        path.with_suffix(".json").write_text(text)
    return tmp_path / "demos"


@pytest.fixture
def record(tmp_path):
    path = tmp_path / "results.json"
    compared = {"PickCube-v1": {"episodes": 7, "equal": False}}
    path.write_text(json.dumps({"versions": {}, "machine": "", "tasks": compared}))
    return path


@pytest.fixture
def inventory(capsys, monkeypatch, demos, record):
    monkeypatch.setattr("parity.records.inventory.list_tasks", lambda: TASKS)

    def run(*options: str) -> str:
        assert main(["inventory", "--demos", str(demos), "--results", str(record), *options]) == 0
        return capsys.readouterr().out

    return run


def test_as_json(inventory, demos):
    found = json.loads(inventory("--json"))
    one, two = found["tasks"]
    assert one == {
        "task_id": "PickCube-v1",
        "robots": "panda",
        "action_size": 8,
        "observation_size": 42,
        "max_episode_steps": 50,
        "reward_modes": ["normalized_dense", "dense", "sparse", "none"],
        "origin": "robot-layouts",
        "other_names": ["maniskill.pick_cube_native", "pick_cube_native"],
        "native_id": "PickCube-v1",
        "expert": one["expert"],
        "parity": {"episodes": 7, "equal": False},
        "demonstrations": [str(demos / "a/one.h5"), str(demos / "b/two.h5")],
    }
    assert (two["robots"], two["action_size"]) == ("2 × panda_wristcam", 16)
    assert two["expert"] is True
    assert two["parity"] == {"episodes": None, "equal": None}
    assert two["demonstrations"] == []
    assert list(found["unreadable"]) == [str(demos / "three.h5")]


def test_as_tables(inventory):
    lines = inventory().splitlines()
    (one,) = (line.split() for line in lines if line.startswith("PickCube-v1 "))
    (two,) = (line for line in lines if line.startswith("TwoRobotPickCube-v1 "))
    assert one[:3] == ["PickCube-v1", "maniskill.pick_cube_native,", "pick_cube_native"]
    assert one[3:7] == ["panda", "42", "8", "50"]
    assert one[-4:] == ["DIFFERS,", "7", "episodes", "2"]
    assert "never compared" in two
    assert two.endswith("0")
    assert any("three.h5 is not counted" in line and "no env_info" in line for line in lines)


def test_no_such_folder_or_record(tmp_path, capsys):
    with pytest.raises(TrajectoryError, match="there is no folder"):
        find_files(tmp_path / "nowhere")
    assert main(["inventory", "--results", str(tmp_path / "nowhere.json")]) == 2
    assert capsys.readouterr().err.startswith("error: cannot read")


@pytest.mark.long
def test_without_mani_skill_the_rest_is_told():
    code = (
        "import sys; sys.modules['mani_skill'] = None\n"
        "import parity.records.inventory as inventory\n"
        "inventory.list_tasks = lambda: ('PickCube-v1',)\n"
        "sys.exit(inventory.main([]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "PickCube-v1" in done.stdout
    assert "native's other tasks are not known here" in done.stdout
    assert "pip install 'robot-layouts[parity]'" in done.stdout


@pytest.mark.parametrize(
    ("robots", "downloads", "expected"),
    [
        (["anymal_c"], [], "no descriptor here of its robot: anymal_c"),
        ([("panda", "anymal_c")], [], NO_REASON),
        ([("anymal_c", "hopper")], [], "no descriptor here of its robot: anymal_c, hopper"),
        (["panda"], ["ycb", "more"], "needs files that native downloads: ycb, more"),
        (None, [], NO_REASON),
    ],
)
def test_reasons(robots, downloads, expected):
    spec = SimpleNamespace(
        asset_download_ids=downloads, cls=SimpleNamespace(SUPPORTED_ROBOTS=robots)
    )
    assert reason("Some-v1", spec) == expected


class TestNative:
    pytestmark = NATIVE

    def test_every_task_of_natives_is_either_cloned_or_missing(self):
        missing = {task.task_id: task.reason for task in missing_tasks()}
        cloned = set(tasks.list_clones())
        assert cloned.isdisjoint(missing)
        assert cloned | set(missing) == set(native_tasks())
        assert (
            missing["TurnFaucet-v1"] == "needs files that native downloads: partnet_mobility_faucet"
        )
        assert missing["DrawSVG-v1"] == "needs the packages svgpathtools and svgwrite"
        assert all(missing.values())

    def test_special_reasons_are_about_tasks_that_are_there(self):
        from parity.records.inventory import _SPECIAL_PREFIXES, _SPECIAL_REASONS

        known = set(native_tasks())
        assert set(_SPECIAL_REASONS) <= known
        for prefix in _SPECIAL_PREFIXES:
            assert any(task_id.startswith(prefix) for task_id in known), prefix
