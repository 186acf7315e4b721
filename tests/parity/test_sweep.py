"""Replay, rollout, sweep and report: what they write, what they print, and what they refuse."""

import numpy as np
import pytest

from parity.__main__ import main
from parity.lockstep import EpisodeResult, FirstDifference
from parity.native import make_native, native_action
from parity.replay import episode_table, verdict
from parity.rollout import NATIVE_FILE, OUR_FILE, VIDEO_FILE, differences_table, load
from parity.sweep import agreement, read_summary
from tests.native import NATIVE
from tests.parity.test_episodes import demonstration

TASK = "TwoRobotPickCube-v1"
DIFFERS = EpisodeResult(3, 9, 2, True, False, {"qpos": 0.5}, FirstDifference(4, "qpos", "panda"))
EQUAL = EpisodeResult(2, 7, 1, True, True)


@pytest.mark.long
class TestBesideNative:
    pytestmark = [*NATIVE, pytest.mark.usefixtures("renderer")]

    def test_a_rollout_keeps_what_both_sides_did(self, tmp_path, capsys):
        demo = demonstration(tmp_path / "demo", env_id=TASK, width=16)
        words = ("--demo", str(demo), "--seed", "41", "--out", str(tmp_path))
        assert main(["rollout", "--task", TASK, *words]) == 0
        assert "Bitwise equal: demo/trajectory, seed 41, 4 steps" in capsys.readouterr().out
        folder = tmp_path / TASK
        assert {path.name for path in folder.iterdir()} == {NATIVE_FILE, OUR_FILE, VIDEO_FILE}
        (found, about), (ours, _) = (load(folder / name) for name in (NATIVE_FILE, OUR_FILE))
        for name, values in found.items():
            np.testing.assert_array_equal(values, ours[name], err_msg=name)
        assert about["action_split"] == {"left": [0, 8], "right": [8, 16]}
        native = make_native(TASK)
        native.reset(seed=41, options={"reconfigure": True})
        for step, action in enumerate(found["actions"], 1):
            obs, reward, _, _, info = native.step(native_action(native, action))
            np.testing.assert_array_equal(found["observation"][step], obs[0])
            assert found["reward"][step - 1] == reward
            assert found["info.success"][step] == info["success"]
            for place, robot in zip(("left", "right"), native.agent.agents, strict=True):
                np.testing.assert_array_equal(found[f"{place}.qpos"][step], robot.robot.qpos[0])
                pose = robot.tcp.pose.raw_pose[0]
                np.testing.assert_array_equal(found[f"{place}.tcp_pose"][step], pose)
            cube = native.scene.actors["cube"].pose.raw_pose[0]
            np.testing.assert_array_equal(found["cube.pose"][step], cube)
        native.close()

    def test_a_replay_of_a_recording(self, tmp_path, capsys):
        demo = demonstration(tmp_path)
        assert main(["replay", "--task", "pick_cube", "--demo", str(demo), "--episodes", "1"]) == 0
        printed = capsys.readouterr().out
        assert "Agreement 1 of 1 episodes (100%); success in native 0, here 0, both 0." in printed
        assert "Equal to the last bit: 1 of 1 episodes, 3 steps." in printed

    def test_a_sweep_goes_on_and_is_reported(self, tmp_path, capsys):
        demonstration(tmp_path / "demos")
        runs, page = tmp_path / "runs", tmp_path / "report.html"
        words = ("--tasks", "PickCube-v1", "--demos", str(tmp_path / "demos"), "--out", str(runs))
        assert main(["sweep", *words, "--episodes", "1"]) == 0
        entry = read_summary(runs / "summary.json")["tasks"]["PickCube-v1"]
        assert (entry["source"], entry["equal"], entry["error"]) == ("demonstrations", True, None)
        assert entry["agreement"]["equal"] == entry["agreement"]["episodes"] == 1
        assert entry["clip"]["differing_frames"] == entry["rollout"]["max_difference"] == 0
        before = (runs / "summary.json").read_bytes()
        assert main(["sweep", *words, "--episodes", "1"]) == 0
        assert (runs / "summary.json").read_bytes() == before, "it was done before"
        assert main(["report", "--runs", str(runs), "--out", str(page)]) == 0
        assert "data:video/mp4;base64," in page.read_text(encoding="utf-8")

    def test_a_task_that_fails_does_not_end_the_sweep(self, tmp_path, capsys):
        demonstration(tmp_path / "demos", width=9)
        words = ("--demos", str(tmp_path / "demos"), "--out", str(tmp_path), "--no-video")
        assert main(["sweep", "--tasks", "PickCube-v1", *words]) == 1
        entry = read_summary(tmp_path / "summary.json")["tasks"]["PickCube-v1"]
        assert "shape (3, 9)" in entry["error"]
        assert "FAILED" in capsys.readouterr().out


def test_what_is_said_of_episodes():
    from parity.lockstep import Run, RunResult

    result = RunResult(Run("PickCube-v1", "a.h5", (), "fresh", "dense"), (EQUAL, DIFFERS))
    rows = [list(column.cells) for column in episode_table(result).columns]
    assert rows[-2:] == [["yes", "NO"], ["none", "from step 4 in qpos of panda"]]
    assert "Agreement 1 of 2 episodes (50%); success in native 2, here 1" in verdict(result)
    found = agreement([EQUAL, DIFFERS])
    assert (found["equal"], found["same_success"], found["max_difference"]) == (1, 1, 0.5)
    assert found["differing"] == [{"seed": 3, "where": "from step 4 in qpos of panda"}]
    alike = {"dot_1.pose": 0.0, "dot_2.pose": 1.0, "left.qpos": 0.0}
    names, largest = (list(column.cells) for column in differences_table(alike).columns)
    assert names == ["dot_*.pose (2 arrays)", "left.qpos"]
    assert [str(cell) for cell in largest] == ["1.0e+00", "0"]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["sweep", "--episodes", "0"], "--episodes is 0; it must be 1 or more"),
        (["sweep", "--tasks", "PikCube-v1"], "Did you mean 'PickCube-v1'"),
        (["sweep", "--demos", "nowhere"], "there is no folder nowhere"),
        (["report", "--runs", "nowhere"], "`python -m parity sweep` writes it"),
        (
            ["replay", "--task", "PickCube-v1", "--episodes", "0"],
            "--episodes is 0; it must be 1 or more",
        ),
        (["rollout", "--task", "PickCube-v1", "--demo", "no.h5"], "no.h5"),
    ],
)
def test_bad_usage(words, complaint, capsys):
    assert main(words) == 2
    assert complaint in capsys.readouterr().err
