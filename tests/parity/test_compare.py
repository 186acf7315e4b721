"""``python -m parity compare``: what it plays, what it finds, prints and records."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch

import tasks
from parity.__main__ import main
from parity.compare import Wanted, summary_table
from parity.results import number_text, read_results, reward_text, success_text, summarise
from parity.tables import markdown
from tests.native import NATIVE, TASKS
from tests.parity.test_episodes import demonstration

ROOT = Path(__file__).parents[2]
TASK = "TwoRobotPickCube-v1"
COMPARE = (
    "import sys; from parity.__main__ import main;"
    "sys.exit(main(['compare', '--task', 'PickCube-v1', '--seeds', '1', '--steps', '1']))"
)


def run(*words: object) -> int:
    try:
        return main(["compare", *map(str, words)])
    except SystemExit as stop:  # tyro's
        return stop.code


def run_alone(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", code]
    variables = {**os.environ, **environment}
    return subprocess.run(
        command, cwd=ROOT, env=variables, capture_output=True, text=True, check=False
    )


class TestPlan:
    @pytest.mark.parametrize("task_id", TASKS)
    def test_every_way_of_playing_every_task(self, task_id):
        default, *others = tasks.get_task_class(task_id).reward_modes
        ways = [("fresh", default), ("reused", default), *(("reused", mode) for mode in others)]
        own = [run for run in Wanted(all=True, seeds=2, steps=5).runs() if run.task == task_id]
        assert [(run.source, run.history, run.reward_mode) for run in own] == [
            (source, *way) for source in ("random", "over-range") for way in ways
        ]
        assert {run.steps for run in own} == {10}

    def test_demonstrations_are_played_beside_random_actions(self, tmp_path):
        demonstration(tmp_path / "PickCube-v1" / "planned", "trajectory.none.pd_joint_delta_pos")
        demonstration(tmp_path / "Unknown-v1", env_id="Unknown-v1")
        runs = Wanted(all=True, demos=tmp_path, seeds=1).runs()
        sources = {task: {run.source for run in runs if run.task == task} for task in TASKS}
        assert sources.pop("PickCube-v1") == {"random", "over-range", "planned/trajectory"}
        assert all(own == {"random", "over-range"} for own in sources.values())


def found_run(**changes):
    quantities = ("object pose", "object velocity", "qpos", "qvel", "root", "observation")
    largest = dict.fromkeys((*quantities, "reward", "info"), 0.0)
    return {
        "task": TASK,
        "source": "random",
        "history": "fresh",
        "reward_mode": "dense",
        "episodes": 2,
        "steps": 10,
        "contact_steps": 3,
        "equal": True,
        "max_difference": largest | changes.pop("max_difference", {}),
        "success": {"native": 2, "ours": 1, "both": 1},
        **changes,
    }


def test_a_task_s_runs_together():
    found = summarise(
        [
            found_run(),
            found_run(history="reused", reward_mode="sparse", max_difference={"reward": 1.0}),
            found_run(source="over-range", equal=False, max_difference={"qpos": 1e-6}),
            found_run(task="PushT-v1", reward_mode="none", max_difference={"root": "inf"}),
        ]
    )
    assert found[TASK]["equal"] is False
    assert found[TASK]["success"] == {"native": 6, "ours": 3, "both": 3}
    assert found[TASK]["histories"] == ["fresh", "reused"]
    assert found[TASK]["actions"] == {
        "random": {"episodes": 4, "steps": 20, "contact_steps": 6},
        "over-range": {"episodes": 2, "steps": 10, "contact_steps": 3},
    }
    assert found[TASK]["max_difference"]["qpos"] == 1e-6
    assert found[TASK]["reward"] == {"dense": 0.0, "sparse": 1.0}
    cells = [list(column.cells) for column in summary_table(found).columns]
    assert cells[0] == [TASK, "PushT-v1"]
    row = ["6", "30", "9", "0", "0", "1.0e-06", "0", "0", "0", "0", "–", "0", "1.0e+00", "–"]
    assert [column[0] for column in cells[1:]] == [*row, "6 / 3"]


def test_only_an_exact_zero_is_zero():
    assert (number_text(0.0), number_text(1e-30), number_text("inf")) == ("0", "1.0e-30", "inf")
    assert reward_text({"reward": {"dense": 0.0}}, "dense") == "0"
    assert reward_text({"reward": {"dense": 0.0}}, "none") == "–"
    assert success_text({"success": {"native": 1, "ours": 2, "both": 1}}) == "1 / 2"


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--task", "PikCube-v1"], "unknown task 'PikCube-v1'. Did you mean 'PickCube-v1'?"),
        (["--task", "PickCube-v1", "--seeds", "0"], "--seeds is 0; it must be 1 or more"),
        (
            ["--task", "PickCube-v1", "--reward-mode", "sparce"],
            "PickCube-v1 has no reward mode 'sparce'. Did you mean 'sparse'?",
        ),
        (["--task", "PickCube-v1", "--demos", "nowhere"], "there is no folder nowhere"),
        (["--all", "--actions", "a.h5"], "give one --task"),
        ([], "give --task, --all, or both"),
        (["--task", "PushT-v1", "--record"], "--record keeps all of --all"),
    ],
)
def test_bad_usage(words, complaint, capsys):
    assert run(*words) == 2
    assert complaint in " ".join(capsys.readouterr().err.split())


@pytest.mark.long
@pytest.mark.parametrize("package", ["mani_skill", "dacite"])
def test_without_a_package_that_native_needs(package):
    done = run_alone(f"import sys; sys.modules['{package}'] = None\n" + COMPARE)
    assert done.returncode == 2
    assert "error: comparing with native ManiSkill needs" in done.stderr
    assert "pip install -e '.[parity]'" in done.stderr


@pytest.mark.long
def test_importing_the_room_loads_no_native():
    code = "import sys, parity.__main__; sys.exit('mani_skill' in sys.modules)"
    done = run_alone(code)
    assert done.returncode == 0, done.stderr


@pytest.mark.long
class TestComparing:
    pytestmark = NATIVE

    def test_equal(self, capsys, tmp_path):
        json_file = tmp_path / "result.json"
        code = run(
            *("--task", "maniskill.pick_cube_native", "--seeds", 3, "--steps", 3),
            *("--num-envs", 2, "--history", "fresh", "reused", "--json", json_file),
        )
        printed = capsys.readouterr().out
        assert code == 0
        assert "Bitwise equal: 6 episodes, 18 steps; success in native 0, here 0" in printed
        document = json.loads(json_file.read_text())
        assert document["versions"]["mani_skill"].startswith("3.0")
        for history, found in zip(("fresh", "reused"), document["runs"], strict=True):
            assert (found["task"], found["history"]) == ("PickCube-v1", history)
            assert set(found["max_difference"].values()) == {0.0}
            assert found["differing"] == []

    def test_different(self, capsys, tmp_path, monkeypatch):
        task = tasks.get_task_class("PickCube-v1")
        evaluate, true = task.evaluate, torch.ones(1, dtype=torch.bool)
        monkeypatch.setattr(
            task, "evaluate", lambda env, state: evaluate(env, state) | {"success": true}
        )
        json_file = tmp_path / "result.json"
        words = ("--seeds", 5, "--steps", 2, "--reward-mode", "dense", "--json", json_file)
        assert run("--task", "PickCube-v1", *words) == 1
        printed = capsys.readouterr().out
        assert "PickCube-v1, random actions, fresh, dense: seed 0 differs at the reset" in printed
        assert "2 more episode(s) differ" in printed
        assert "NOT equal: 5 of 5 episodes differ" in printed
        first = json.loads(json_file.read_text())["runs"][0]["differing"][0]
        assert (first["seed"], first["step"]) == (0, 0)
        assert (first["quantity"], first["entry"]) == ("info", "success")

    @pytest.mark.parametrize("wrong", [False, True])
    def test_what_is_found_of_all_is_recorded(self, wrong, monkeypatch, tmp_path):
        monkeypatch.setattr("tasks.list_clones", lambda: ("PushT-v1",))
        monkeypatch.setattr("parity.compare.RESULTS", record := tmp_path / "parity.json")
        task = tasks.get_task_class("PushT-v1")
        dense = task.dense_reward
        if wrong:
            monkeypatch.setattr(task, "dense_reward", lambda *words: dense(*words) + 1)
        assert run("--all", "--seeds", 1, "--steps", 2, "--record") == wrong
        found = read_results(record)
        entry = found["tasks"]["PushT-v1"]
        assert (entry["robots"], entry["observation_size"]) == ("panda_stick", 31)
        assert entry["equal"] != wrong
        assert entry["reward"]["dense"] == pytest.approx(float(wrong))
        assert entry["reward"]["sparse"] == 0
        assert sum("PushT-v1" in line for line in markdown(found)) == 1
        one_more = "--task", "PullCube-v1", "--all", "--seeds", 1, "--steps", 2, "--record"
        assert run(*one_more) == 0
        both = read_results(record)
        assert [*both["tasks"]] == ["PullCube-v1", "PushT-v1"]
        assert both["tasks"]["PushT-v1"] == entry
        assert both["equal"] != wrong

    def test_without_a_vulkan_driver(self):
        nowhere = {"VK_DRIVER_FILES": "/nowhere.json", "VK_ICD_FILENAMES": "/nowhere.json"}
        done = run_alone(COMPARE, **nowhere)
        assert done.returncode == 2
        assert "native ManiSkill builds no scene without a Vulkan driver" in done.stderr
        assert "Traceback" not in done.stderr
