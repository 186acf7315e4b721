"""``python -m parity compare``: exit codes, what it prints, and what it writes."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

import tasks
from parity.__main__ import main
from robot_layouts.__main__ import PROGRAM
from robots import TaskError
from tests.native import NATIVE, TASKS

ROOT = Path(__file__).parents[2]


def run(*arguments: str) -> int:
    try:
        return main(["compare", *map(str, arguments)])
    except SystemExit as stop:  # argparse
        return stop.code


def run_alone(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


COMPARE = (
    "import sys; from parity.__main__ import main;"
    "sys.exit(main(['compare', '--task', 'PickCube-v1', '--seeds', '1', '--steps', '1']))"
)


@pytest.mark.long
class TestComparing:
    pytestmark = NATIVE

    def test_equal(self, capsys, tmp_path):
        json_file = tmp_path / "result.json"
        code = run("--task", "PickCube-v1", "--seeds", 2, "--steps", 5, "--json", json_file)
        printed = capsys.readouterr().out
        assert code == 0
        assert "actions: random, history: fresh, reward mode: normalized_dense" in printed
        (row,) = (line.split() for line in printed.splitlines() if "PickCube-v1" in line)
        assert row == ["PickCube-v1", "2", "10", "0", *["0"] * 8]
        for word in ("episodes", "contact", "pose", "velocity", "qpos", "qvel", "root"):
            assert word in printed
        for word in ("observation", "reward", "info"):
            assert word in printed
        assert "Bitwise equal: 2 episodes, 10 steps; success in native 0, here 0" in printed
        expect_equal_document(json.loads(json_file.read_text()))

    @pytest.mark.long
    def test_every_way_of_playing_is_a_row(self, capsys, tmp_path):
        json_file = tmp_path / "result.json"
        code = run(
            *("--task", "maniskill.pick_cube_native", "--num-envs", 2),
            *("--seeds", 3, "--steps", 3, "--history", "fresh", "reused"),
            *("--reward-mode", "dense", "--json", json_file),
        )
        assert code == 0
        runs = json.loads(json_file.read_text())["runs"]
        assert [(r["task"], r["history"], r["reward_mode"]) for r in runs] == [
            ("PickCube-v1", history, "dense") for history in ("fresh", "reused")
        ]
        assert {(r["episodes"], r["steps"], r["num_envs"]) for r in runs} == {(3, 9, 2)}
        assert capsys.readouterr().out.count("reused") == 1

    def test_different(self, capsys, tmp_path, monkeypatch):
        task = tasks.get_task_class("PickCube-v1")
        evaluate = task.evaluate
        monkeypatch.setattr(
            task,
            "evaluate",
            lambda env, state: evaluate(env, state) | {"success": torch.ones(1, dtype=torch.bool)},
        )
        json_file = tmp_path / "result.json"
        code = run(
            *("--task", "PickCube-v1", "--seeds", 5, "--steps", 2),
            *("--reward-mode", "dense", "--json", json_file),
        )
        printed = capsys.readouterr().out
        assert code == 1
        assert "PickCube-v1" in printed
        assert "PickCube-v1, random actions, fresh, dense: seed 0 differs at the reset" in printed
        assert "in info of success" in printed
        assert "2 more episode(s) differ" in printed
        assert "NOT equal: 5 of 5 episodes differ" in printed
        document = json.loads(json_file.read_text())
        assert document["equal"] is document["runs"][0]["equal"] is False
        first = document["runs"][0]["differing"][0]
        assert (first["seed"], first["step"]) == (0, 0)
        assert (first["quantity"], first["entry"]) == ("info", "success")
        assert first["max_difference"]["info"] == 1.0

    def test_a_file_of_actions(self, capsys, tmp_path):
        path = tmp_path / "actions.npz"
        np.savez(path, seeds=[3, 9], a0=np.zeros((2, 7)), a1=np.zeros((4, 7)))
        assert run("--task", "PushT-v1", "--actions", path) == 0
        printed = capsys.readouterr().out
        assert "actions: actions.npz" in printed
        assert "2 episodes, 6 steps" in printed

    def test_another_control_mode(self, capsys, tmp_path):
        arguments = ("--task", "PushT-v1", "--seeds", 1, "--steps", 3)
        written = tmp_path / "found.json"
        assert run(*arguments, "--control-mode", "pd_joint_pos", "--json", written) == 0
        assert "control mode: pd_joint_pos" in capsys.readouterr().out
        assert json.loads(written.read_text())["runs"][0]["control_mode"] == "pd_joint_pos"

    def test_a_long_comparison_says_how_far_it_is(self, capsys, monkeypatch):
        monkeypatch.setattr("robots.common.progress.PATIENCE", 0.0)
        assert run("--task", "PickCube-v1", "--seeds", 1, "--steps", 3) == 0
        assert "PickCube-v1 random fresh: 1 of 3 steps (33%)" in capsys.readouterr().err

    @pytest.mark.long
    def test_without_a_vulkan_driver(self):
        nowhere = {"VK_DRIVER_FILES": "/nowhere.json", "VK_ICD_FILENAMES": "/nowhere.json"}
        done = run_alone(COMPARE, **nowhere)
        assert done.returncode == 2
        last = done.stderr.splitlines()[-1]  # SAPIEN's renderer has its say before
        assert last.startswith("error: native ManiSkill builds no scene without a Vulkan driver")
        assert "mesa-vulkan-drivers" in last
        assert "Traceback" not in done.stderr

    @pytest.mark.long
    def test_native_is_quiet(self):
        done = run_alone(COMPARE)
        assert done.returncode == 0, done.stderr
        assert all("steps" in line for line in done.stderr.splitlines()), done.stderr


def expect_equal_document(document: dict) -> None:
    assert document["equal"] is True
    assert document["versions"]["mani_skill"].startswith("3.0")
    (found,) = document["runs"]
    assert found["max_difference"] == dict.fromkeys(
        ("object pose", "object velocity", "qpos", "qvel", "root", "observation", "reward", "info"),
        0.0,
    )
    assert found["success"] == {"native": 0, "ours": 0, "both": 0}
    assert found["differing"] == []
    assert (found["source"], found["history"]) == ("random", "fresh")
    assert (found["episodes"], found["steps"], found["contact_steps"]) == (2, 10, 0)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--task", "PikCube-v1"], "unknown task 'PikCube-v1'. Did you mean 'PickCube-v1'?"),
        (["--task", "PickCube-v1", "--seeds", "0"], "--seeds is 0; it must be 1 or more"),
        (["--task", "PickCube-v1", "--steps", "-1"], "--steps is -1; it must be 1 or more"),
        (["--task", "PickCube-v1", "--num-envs", "0"], "--num-envs is 0; it must be 1 or more"),
        (
            ["--task", "PickCube-v1", "--reward-mode", "sparce"],
            "PickCube-v1 has no reward mode 'sparce'. Did you mean 'sparse'?",
        ),
        (["--task", "PickCube-v1", "--actions", "no.h5"], "there is no file or folder no.h5"),
        (["--task", "PickCube-v1", "--demos", "nowhere"], "there is no folder nowhere"),
        (["--task", "PickCube-v1", "--json", "nowhere/a.json"], "there is no folder"),
        (["--all", "--actions", "a.npz"], "give one --task"),
        (["--task", "PickCube-v1", "--history", "old"], "invalid choice: 'old'"),
        ([], "one of the arguments --task --all is required"),
    ],
)
def test_bad_usage(arguments, complaint, capsys):
    assert run(*arguments) == 2
    captured = capsys.readouterr()
    assert complaint in captured.err
    assert captured.out == ""


def test_errors_take_one_line(capsys):
    run("--task", "PikCube-v1")
    assert capsys.readouterr().err.count("\n") == 1


def test_unknown_command(capsys):
    assert main(["comare"]) == 2
    assert (
        "unknown command 'parity comare'. Did you mean 'parity compare'?" in capsys.readouterr().err
    )


def test_help(capsys):
    assert main([]) == 0
    assert "compare" in capsys.readouterr().out
    assert run("--help") == 0
    assert "Exit code: 0 if every difference is exactly zero" in capsys.readouterr().out


@pytest.mark.long
def test_without_mani_skill():
    """As on a machine without it: every attempt to import it fails."""
    done = run_alone("import sys; sys.modules['mani_skill'] = None\n" + COMPARE)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("error: comparing with native ManiSkill needs mani_skill")
    assert "pip install 'robot-layouts[parity]'" in done.stderr


@pytest.mark.long
def test_without_a_package_that_mani_skill_needs():
    done = run_alone("import sys; sys.modules['dacite'] = None\n" + COMPARE)
    assert done.returncode == 2
    assert "needs dacite" in done.stderr or "needs mani_skill" in done.stderr


@pytest.mark.long
def test_importing_the_room_loads_no_native():
    done = run_alone(
        "import sys, parity.compare.command, parity.compare.native_env;"
        " sys.exit('mani_skill' in sys.modules)"
    )
    assert done.returncode == 0, done.stderr


def asked(*words):
    return PROGRAM.parse(["parity", "compare", *words]).arguments["options"]


def test_all_means_every_task(monkeypatch):
    from parity.compare.command import plan

    runs = plan(asked("--all", "--seeds", "2", "--steps", "3"))
    assert list(dict.fromkeys(run.task for run in runs)) == list(TASKS)
    assert {run.steps for run in runs} == {6}


def test_a_file_says_in_which_control_mode_it_was_recorded(tmp_path):
    from parity.compare.command import plan
    from tests.parity.test_episodes import demonstration

    path = demonstration(tmp_path, control_mode="pd_joint_pos")
    arguments = ["--task", "PickCube-v1", "--actions", str(path)]
    (found,) = plan(asked(*arguments))
    assert found.control_mode == "pd_joint_pos"
    assert len(plan(asked(*arguments, "--control-mode", "pd_joint_pos"))) == 1
    with pytest.raises(TaskError, match=r"recorded in pd_joint_pos; leave --control-mode pd_joi"):
        plan(asked(*arguments, "--control-mode", "pd_joint_delta_pos"))


def test_random_positions_lie_within_the_limits_and_partly_beyond():
    from parity.compare.command import plan

    layout = tasks.get_task_class("PickCube-v1").layout.in_control_mode("pd_joint_pos")
    low, high = np.array(layout.action_bounds).T
    (found,) = plan(asked("--task", "PickCube-v1", "--control-mode", "pd_joint_pos"))
    for episode in found.episodes:
        beyond = np.any((episode.actions < low) | (episode.actions > high), axis=1)
        assert beyond[40:60].any()
        assert not np.delete(beyond, slice(40, 60)).any()


def test_demonstrations_are_played_beside_random_actions(tmp_path):
    from parity.compare.command import plan
    from tests.parity.test_episodes import demonstration

    demonstration(tmp_path / "PickCube-v1" / "planned", "trajectory.none.pd_joint_delta_pos")
    demonstration(tmp_path / "Unknown-v1", env_id="Unknown-v1")
    runs = plan(asked("--all", "--demos", str(tmp_path), "--seeds", "1"))
    sources = {task: {run.source for run in runs if run.task == task} for task in TASKS}
    assert sources.pop("PickCube-v1") == {"random", "over-range", "planned/trajectory"}
    assert all(own == {"random", "over-range"} for own in sources.values())
