"""Which engine an episode was simulated by: what is written down, and what is compared."""

import json

import numpy as np
import pytest

import tasks
from robot_layouts import evaluate
from robot_layouts.__main__ import main
from robot_layouts.data.comparison import SEEN, compare
from robot_layouts.data.recording.recorder import Recorder
from tasks.episode import play

mujoco = pytest.importorskip("mujoco")

TASK = "PickCube-v1"


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("mujoco") / "trajectory.h5"
    env = tasks.make(TASK, simulator="mujoco")
    actions = np.random.default_rng(0).uniform(-1, 1, (8, 8)).astype(np.float32)
    with Recorder(path, env) as recorder:
        recorder.add(play(env, 3, actions))
    return path


def replayed(capsys, *words):
    code = main(["replay", *map(str, words)])
    captured = capsys.readouterr()
    return code, " ".join((captured.out + captured.err).split())


def test_a_recording_names_its_engine_and_plays_again_in_it(recording, capsys):
    header = json.loads(recording.with_suffix(".json").read_text())
    assert header["env_info"]["env_kwargs"]["sim_backend"] == "mujoco"
    code, printed = replayed(capsys, recording)
    assert code == 0
    assert "in 1 all states are equal to the last bit" in printed


def test_another_engine_is_asked_for_and_no_replay(recording, capsys, tmp_path):
    code, printed = replayed(capsys, recording, "--simulator", "sapien3")
    assert code == 0
    assert "recorded in mujoco, end alike in sapien3. This compares two simulators" in printed
    assert "differ" in printed
    out = ("--obs-mode", "state", "--out", tmp_path / "again")
    code, printed = replayed(capsys, recording, "--simulator", "sapien3", *out)
    assert code != 0
    assert "is no replay, and is not recorded as one" in printed


def test_a_recording_of_sapiens_says_nothing_new(tmp_path):
    path = tmp_path / "trajectory.h5"
    env = tasks.make(TASK)
    with Recorder(path, env) as recorder:
        recorder.add(play(env, 3, np.zeros((2, 8), np.float32)))
    assert "simulator" not in path.with_suffix(".json").read_text()


def test_a_receipt_names_engine_and_version(tmp_path):
    path = tmp_path / "receipt.json"
    evaluate("expert", TASK, [0], workers=0, receipt=path, simulator="mujoco")
    receipt = json.loads(path.read_text())
    assert receipt["making"]["simulator"] == "mujoco"
    assert mujoco.__version__ in json.dumps(receipt)
    assert main(["verify", str(path), "--workers", "0"]) == 0


def test_a_description_says_that_a_clone_has_other_physics(capsys):
    assert main(["tasks", "describe", TASK, "--simulator", "mujoco"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "simulator mujoco" in printed
    assert "the same task with other physics" in printed


def test_engines_are_compared_by_the_same_actions(capsys):
    words = ("--episodes", "1", "--planned-in", "mujoco")
    assert main(["compare-engines", TASK, *words]) == 0
    printed = capsys.readouterr().out
    assert "sapien3: 1 of 1 solved" in printed
    assert "mujoco: 1 of 1 solved" in printed


def test_what_stands_still_in_both_is_at_the_same_place():
    envs = {name: tasks.make(TASK, simulator=name) for name in ("sapien3", "mujoco")}
    still, moved = np.zeros((3, 8), np.float32), np.ones((3, 8), np.float32)
    still[:, 7] = moved[:, 7] = 1.0  # open
    assert compare(envs, 0, still).since is None
    compared = compare(envs, 0, moved)
    assert (compared.steps, compared.since, compared.what) == (3, 1, "arm")
    assert SEEN < compared.apart < 0.02
    assert compared.solved == {"sapien3": False, "mujoco": False}
