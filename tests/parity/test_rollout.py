"""``python -m parity rollout``: the arrays of both sides, what the files say, and differences."""

import json

import numpy as np
import pytest
import torch

import tasks
from parity.__main__ import main
from parity.compare.native_env import make_native, native_action
from parity.replay.rollout import (
    LEGEND,
    NATIVE_FILE,
    OUR_FILE,
    VIDEO_FILE,
    compare_arrays,
    differences_table,
    find_source,
    load,
)
from robots import TaskError
from rollouts.reading.recording import TrajectoryError
from rollouts.recording.recorder import Recorder
from tasks.episode import play
from tests.native import NATIVE

TASK = "TwoRobotPickCube-v1"
SEED, STEPS = 5, 4


@pytest.fixture(scope="module")
def actions():
    return np.random.default_rng(0).uniform(-1, 1, (STEPS, 16)).astype(np.float32)


@pytest.fixture
def file(tmp_path, actions):
    path = tmp_path / "actions.npz"
    np.savez(path, seeds=[2, SEED], a0=actions[:2], a1=actions)
    return path


def roll_out(file, out, *options: str) -> int:
    words = ("--task", TASK, "--demo", str(file), "--out", str(out))
    return main(["rollout", *words, "--seed", str(SEED), *options])


class TestRolling:
    pytestmark = NATIVE

    def test_both_sides_are_kept_and_equal(self, file, tmp_path, actions, capsys):
        assert roll_out(file, tmp_path, "--no-video") == 0
        printed = capsys.readouterr().out
        assert f"Bitwise equal: actions.npz, seed {SEED}, {STEPS} steps" in printed
        assert sorted(p.name for p in (tmp_path / TASK).iterdir()) == [NATIVE_FILE, OUR_FILE]
        (native, about), (ours, about_ours) = (
            load(tmp_path / TASK / name) for name in (NATIVE_FILE, OUR_FILE)
        )
        assert native.keys() == ours.keys()
        for name, values in native.items():
            np.testing.assert_array_equal(values, ours[name], err_msg=name)
        assert (about.pop("side"), about_ours.pop("side")) == ("native ManiSkill", "robot-layouts")
        assert about == about_ours
        assert about["seed"] == SEED
        assert about["task"] == TASK
        assert about["robots"] == dict.fromkeys(("left", "right"), "panda_wristcam")
        assert about["action_split"] == {"left": [0, 8], "right": [8, 16]}
        assert about["versions"]["mani_skill"]
        assert about["arrays"] == LEGEND

    @pytest.mark.long
    def test_the_arrays_are_what_their_names_say(self, file, tmp_path, actions):
        roll_out(file, tmp_path, "--no-video")
        found, _ = load(tmp_path / TASK / NATIVE_FILE)
        np.testing.assert_array_equal(found["actions"], actions)
        native = make_native(TASK)
        native.reset(seed=SEED, options={"reconfigure": True})
        for step in range(STEPS + 1):
            if step:
                obs, reward, terminated, _, info = native.step(
                    native_action(native, actions[step - 1])
                )
                np.testing.assert_array_equal(found["observation"][step], obs[0])
                assert found["reward"][step - 1] == reward
                assert found["terminated"][step - 1] == terminated
                assert found["info.success"][step] == info["success"]
            for number, place in enumerate(("left", "right")):
                robot = native.agent.agents[number]
                np.testing.assert_array_equal(found[f"{place}.qpos"][step], robot.robot.qpos[0])
                np.testing.assert_array_equal(found[f"{place}.qvel"][step], robot.robot.qvel[0])
                pose = robot.tcp.pose.raw_pose[0]
                np.testing.assert_array_equal(found[f"{place}.tcp_pose"][step], pose)
            for name in ("cube", "goal_site"):
                pose = native.scene.actors[name].pose.raw_pose[0]
                np.testing.assert_array_equal(found[f"{name}.pose"][step], pose)
        native.close()
        lengths = {name: len(values) for name, values in found.items()}
        assert {n for n, length in lengths.items() if length == STEPS} == {
            "actions",
            "reward",
            "terminated",
        }
        assert set(lengths.values()) == {STEPS, STEPS + 1}

    @pytest.mark.long
    def test_a_robot_without_a_tcp_link(self, tmp_path):
        path = tmp_path / "actions.npz"
        np.savez(path, seeds=[0], a0=np.full((2, 6), 0.5, np.float32))
        task = "PickCubeSO100-v1"
        words = ("--task", task, "--demo", str(path), "--out", str(tmp_path), "--no-video")
        assert main(["rollout", *words]) == 0
        found, _ = load(tmp_path / task / NATIVE_FILE)
        assert found["arm.tcp_pose"].shape == (3, 7)

    @pytest.mark.long
    def test_a_file_says_in_which_control_mode_it_is(self, tmp_path):
        env = tasks.make("PickCube-v1", control_mode="pd_joint_pos")
        rest = np.array([*env.layout["arm"].start_qpos[:7], 1], np.float32)
        path = tmp_path / "trajectory.h5"
        with Recorder(path, env) as recorder:
            recorder.add(play(env, 7, np.stack([rest, rest])))
        words = ("--task", "PickCube-v1", "--demo", str(path), "--out", str(tmp_path))
        assert main(["rollout", *words, "--no-video"]) == 0
        found, about = load(tmp_path / "PickCube-v1" / NATIVE_FILE)
        assert about["control_mode"] == "pd_joint_pos"
        np.testing.assert_allclose(found["arm.qpos"][-1][:7], rest[:7], atol=0.05)

    @pytest.mark.long
    def test_native_is_filmed(self, file, tmp_path, renderer):
        imageio = pytest.importorskip("imageio.v2")
        assert roll_out(file, tmp_path, "--seed", "2") == 0
        with imageio.get_reader(tmp_path / TASK / VIDEO_FILE) as film:
            pictures = list(film.iter_data())
        assert len(pictures) == 3
        assert pictures[0].shape == (320, 320, 3)
        assert pictures[0].std() > 10
        assert not list((tmp_path / TASK).glob("*.partial*"))

    def test_a_difference_is_found(self, file, tmp_path, monkeypatch, capsys):
        cls = tasks.get_task_class(TASK)
        evaluate = cls.evaluate
        monkeypatch.setattr(
            cls,
            "evaluate",
            lambda env, state: evaluate(env, state) | {"success": torch.ones(1, dtype=torch.bool)},
        )
        assert roll_out(file, tmp_path, "--no-video") == 1
        printed = capsys.readouterr().out
        assert "NOT equal" in printed
        assert "success in native no, here yes" in printed
        rows = dict(line.split() for line in printed.splitlines() if line.startswith(" info"))
        assert rows["info.success"] == "1.0e+00"
        assert rows["info.is_obj_placed"] == "0"

    def test_a_folder_that_cannot_be_written(self, file, tmp_path, capsys):
        (tmp_path / TASK).write_text("in the way")
        assert roll_out(file, tmp_path, "--no-video") == 2
        assert capsys.readouterr().err.startswith(f"error: cannot write into {tmp_path / TASK}")


class TestSource:
    def test_an_episode_of_a_file_by_seed_or_the_first(self, file, actions):
        cls = tasks.get_task_class(TASK)
        assert find_source(cls, file, None).episode.seed == 2
        source = find_source(cls, file, SEED)
        np.testing.assert_array_equal(source.episode.actions, actions)
        assert source.name == "actions.npz"
        with pytest.raises(TrajectoryError, match="no episode of seed 9; it has seeds 2, 5"):
            find_source(cls, file, 9)

    def test_the_expert(self):
        source = find_source(tasks.get_task_class(TASK), None, 3)
        assert (source.name, source.episode.seed) == ("expert", 3)
        assert source.episode.actions.shape[1] == 16

    def test_neither(self, monkeypatch):
        monkeypatch.setattr("experts.registry.EXPERTS.lines", {})
        with pytest.raises(TaskError, match="has no expert yet"):
            find_source(tasks.get_task_class("PushT-v1"), None, None)

    @pytest.mark.parametrize(
        ("words", "complaint"),
        [(["--task", "PickCub-v1"], "PickCube-v1"), (["--task", TASK, "--demo", "no.h5"], "no.h5")],
    )
    def test_bad_usage(self, words, complaint, capsys):
        assert main(["rollout", *words]) == 2
        assert complaint in capsys.readouterr().err


def test_only_an_exact_match_is_zero():
    first = {"actions": np.zeros(3), "a": np.zeros(2), "b": np.zeros(2), "only": np.zeros(1)}
    second = {"actions": np.ones(3), "a": np.zeros(2), "b": np.array([0, 1e-30]), "c": np.zeros(1)}
    assert compare_arrays(first, second) == {"a": 0, "b": 1e-30, "only": np.inf, "c": np.inf}


def test_numbered_arrays_are_one_row():
    table = differences_table({"dot_0.pose": 0.0, "dot_1.pose": 2.0, "cube.pose": 0.0})
    names, largest = ([str(cell) for cell in column.cells] for column in table.columns)
    assert names == ["dot_*.pose (2 arrays)", "cube.pose"]
    assert largest == ["2.0e+00", "0"]


def test_metadata_is_json_and_nothing_needs_pickle(tmp_path):
    from parity.replay.rollout import save

    save(tmp_path / "file.npz", {"left.qpos": np.zeros(2, np.float32)}, {"task": "é"})
    with np.load(tmp_path / "file.npz", allow_pickle=False) as data:
        assert json.loads(str(data["metadata"])) == {"task": "é"}
        assert data["left.qpos"].dtype == np.float32
