"""``python -m parity compare --all``: what it plays, what it finds, and what it records."""

import json

import numpy as np
import pytest

import tasks
from measurements.tables import markdown
from parity.__main__ import main
from parity.compare.command import plan
from parity.compare.episodes import over_range_episodes
from parity.compare.results import read
from parity.compare.task_summary import (
    number_text,
    reward_text,
    success_text,
    summarise,
    summary_table,
)
from robot_layouts.__main__ import PROGRAM
from tests.native import NATIVE

TASK = "TwoRobotPickCube-v1"
COMPARE = ("parity", "compare")


def parse(words: list[str]):
    return PROGRAM.parse(words).arguments["options"]


def planned(*options: str) -> list:
    return plan(
        PROGRAM.parse([*COMPARE, "--all", "--seeds", "2", "--steps", "5", *options]).arguments[
            "options"
        ]
    )


class TestPlan:
    @pytest.mark.parametrize("task_id", tasks.list_clones())
    def test_every_way_of_playing_every_task(self, task_id):
        default, *others = tasks.get_task_class(task_id).reward_modes
        ways = [("fresh", default), ("reused", default), *(("reused", mode) for mode in others)]
        own = [run for run in planned() if run.task == task_id]
        assert [(run.source, run.history, run.reward_mode) for run in own] == [
            (source, *way) for source in ("random", "over-range") for way in ways
        ]
        assert {run.steps for run in own} == {10}

    def test_asking_for_less(self):
        runs = planned("--history", "fresh", "--reward-mode", "sparse")
        assert {(run.history, run.reward_mode) for run in runs} == {("fresh", "sparse")}
        assert {run.history for run in planned("--reward-mode", "sparse")} == {"fresh"}

    def test_one_task_is_played_as_before(self):
        runs = plan(
            PROGRAM.parse([*COMPARE, "--task", TASK, "--seeds", "1", "--steps", "2"]).arguments[
                "options"
            ]
        )
        assert [(run.source, run.history) for run in runs] == [("random", "fresh")]


def test_over_range_actions_go_beyond_in_both_directions():
    first, second = over_range_episodes([3, 4], 50, 8)
    assert first.actions.shape == (50, 8)
    assert first.actions.dtype == np.float32
    assert (first.seed, second.seed) == (3, 4)
    assert not np.array_equal(first.actions, second.actions)
    assert -3 <= first.actions.min() < -2.5
    assert 2.5 < first.actions.max() <= 3
    assert 0.5 < (np.abs(first.actions) > 1).mean() < 0.8
    (again,) = over_range_episodes([3], 50, 8)
    assert np.array_equal(first.actions, again.actions)


def found_run(**changes):
    largest = dict.fromkeys(("object pose", "object velocity", "qpos", "qvel", "root"), 0.0)
    largest |= dict.fromkeys(("observation", "reward", "info"), 0.0)
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


class TestSummary:
    RUNS = (
        found_run(),
        found_run(history="reused", reward_mode="sparse", max_difference={"reward": 1.0}),
        found_run(source="over-range", equal=False, max_difference={"qpos": 1e-6, "root": "inf"}),
        found_run(task="PushT-v1", reward_mode="none", max_difference={"root": 0.5}),
        found_run(task="PushT-v1", reward_mode="none", max_difference={"root": 1e-6}),
    )

    def test_of_runs(self):
        found = summarise(self.RUNS)
        assert list(found) == [TASK, "PushT-v1"]
        assert found[TASK] == {
            "equal": False,
            "episodes": 6,
            "steps": 30,
            "contact_steps": 9,
            "success": {"native": 6, "ours": 3, "both": 3},
            "histories": ["fresh", "reused"],
            "actions": {
                "random": {"episodes": 4, "steps": 20, "contact_steps": 6},
                "over-range": {"episodes": 2, "steps": 10, "contact_steps": 3},
            },
            "max_difference": {
                "object pose": 0.0,
                "object velocity": 0.0,
                "qpos": 1e-6,
                "qvel": 0.0,
                "root": "inf",
                "observation": 0.0,
                "info": 0.0,
            },
            "reward": {"dense": 0.0, "sparse": 1.0},
        }
        assert found["PushT-v1"]["equal"] is True
        assert found["PushT-v1"]["max_difference"]["root"] == 0.5

    def test_table(self):
        table = summary_table(summarise(self.RUNS))
        cells = [list(column.cells) for column in table.columns]
        assert cells[0] == [TASK, "PushT-v1"]
        assert [column[0] for column in cells[1:]] == (
            ["6", "30", "9", "0", "0", "1.0e-06", "0", "inf", "0", "0", "–", "0", "1.0e+00", "–"]
            + ["6 / 3"]
        )

    def test_only_an_exact_zero_is_zero(self):
        assert (number_text(0.0), number_text(1e-30), number_text("inf")) == ("0", "1.0e-30", "inf")
        assert reward_text({"reward": {"dense": 0.0}}, "dense") == "0"
        assert reward_text({"reward": {"dense": 0.0}}, "none") == "–"
        assert success_text({"success": {"native": 1, "ours": 2, "both": 1}}) == "1 / 2"


@pytest.mark.parametrize(
    "arguments",
    [
        ["--task", "PushT-v1"],
        ["--all", "--history", "fresh"],
        ["--all", "--reward-mode", "none"],
    ],
)
def test_only_the_whole_is_recorded(arguments, capsys):
    assert main(["compare", *arguments, "--record"]) == 2
    assert "--record keeps all of --all" in capsys.readouterr().err


class TestComparing:
    pytestmark = NATIVE

    @pytest.fixture(autouse=True)
    def only_push_t(self, monkeypatch):
        monkeypatch.setattr("tasks.list_clones", lambda: ("PushT-v1",))

    @pytest.mark.long
    def test_what_is_found_is_shown_written_and_recorded(self, capsys, monkeypatch, tmp_path):
        json_file, record_file = tmp_path / "found.json", tmp_path / "results.json"
        monkeypatch.setattr("parity.compare.command.RESULTS", record_file)
        options = ("--seeds", "1", "--steps", "2", "--json", str(json_file), "--record")
        assert main(["compare", "--all", *options]) == 0
        printed = capsys.readouterr().out
        (row,) = (line.split() for line in printed.splitlines() if "PushT-v1" in line)
        assert row == ["PushT-v1", "10", "20", "0", *["0"] * 11, "0", "/", "0"]
        assert "Bitwise equal: 10 episodes, 20 steps" in printed
        found, record = json.loads(json_file.read_text()), read(record_file)
        assert len(found["runs"]) == 10
        about = {"robots": "panda_stick", "observation_size": 31, "action_size": 7}
        assert record["tasks"] == {"PushT-v1": about | found["tasks"]["PushT-v1"]}
        assert {"mani_skill", "sapien", "torch", "python"} <= set(record["versions"])
        assert list(record["tasks"]["PushT-v1"]["actions"]) == ["random", "over-range"]
        assert sum("PushT-v1" in line for line in markdown(record)) == 1
        assert str(tmp_path) not in record_file.read_text()

    @pytest.mark.long
    def test_a_difference_is_recorded_too(self, capsys, monkeypatch, tmp_path):
        record_file = tmp_path / "results.json"
        monkeypatch.setattr("parity.compare.command.RESULTS", record_file)
        task = tasks.get_task_class("PushT-v1")
        dense = task.dense_reward
        monkeypatch.setattr(
            task,
            "dense_reward",
            lambda env, state, action, info: dense(env, state, action, info) + 1,
        )
        assert main(["compare", "--all", "--seeds", "1", "--steps", "2", "--record"]) == 1
        assert "NOT equal" in capsys.readouterr().out
        entry = read(record_file)["tasks"]["PushT-v1"]
        assert entry["equal"] is False
        assert entry["reward"]["dense"] == pytest.approx(1)
        assert entry["reward"]["sparse"] == entry["reward"]["none"] == 0
        assert set(entry["max_difference"].values()) == {0.0}
