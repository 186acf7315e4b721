"""The example that learns from an expert's episodes."""

import json
import os
import pickle
import signal
import subprocess
import sys
import time
from contextlib import closing

import pytest
import torch

pytest.importorskip("matplotlib")

import tasks
from robot_layouts.data import evaluate
from robot_layouts.data.reading.recording import Recording
from tests.examples.learning import EXAMPLES, ROOT, loaded

EXAMPLE = EXAMPLES / "imitate.py"
TASK, MODE = "PushCube-v1", "pd_joint_pos"
WORDS = [TASK, "--episodes", "2", "--steps", "60", "--examined", "1", "--tests", "2"]

pytestmark = pytest.mark.long  # they record and learn


@pytest.fixture(scope="module")
def example():
    with loaded("imitate") as module:
        yield module


@pytest.fixture(scope="module")
def recording(example, tmp_path_factory):
    folder = tmp_path_factory.mktemp("recording")
    example.demonstrate(example.Recipe(TASK, episodes=2), folder, workers=0)
    return folder


@pytest.fixture(scope="module")
def learned(example, recording, tmp_path_factory):
    """The folder of a run that nothing interrupted."""
    out = tmp_path_factory.mktemp("learned")
    assert example.main([*WORDS, "--recording", str(recording), "--out", str(out)]) in (0, 1)
    return out


def weights(folder):
    return torch.load(folder / "policy.pt", weights_only=True)["network"]


def expect_equal(found, expected):
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        assert torch.equal(found[name], values), name


def test_it_records_learns_and_leaves_its_files(example, learned, tmp_path, capsys):
    assert example.main([*WORDS, "--workers", "0", "--out", str(tmp_path)]) in (0, 1)
    names = {"learning_curve.json", "learning_curve.png", "policy.pt"}
    assert {path.name for path in tmp_path.iterdir()} == names | {"recording"}
    numbers = json.loads((tmp_path / "learning_curve.json").read_text())
    assert [found["steps"] for found in numbers["curve"]] == [*range(3, 61, 3)]
    errors = [found["error"] for found in numbers["curve"]]
    assert errors[-1] < 0.8 * errors[0]
    assert numbers["test_seeds"] == [1_000_000, 1_000_001]
    assert "of 2 episodes with success" in capsys.readouterr().out
    expect_equal(weights(tmp_path), weights(learned))  # two runs, the same weights
    assert (tmp_path / "policy.pt").read_bytes() == (learned / "policy.pt").read_bytes()


def test_a_killed_run_goes_on_to_the_same_weights(example, learned, recording, tmp_path):
    words = [*WORDS, "--recording", str(recording), "--out", str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    run = subprocess.Popen([sys.executable, str(EXAMPLE), *words], env=environment)
    kept, since = tmp_path / "policy.pt", time.monotonic()
    while not kept.exists() and time.monotonic() < since + 300 and run.poll() is None:
        time.sleep(0.01)
    run.send_signal(signal.SIGKILL)
    assert run.wait() == -signal.SIGKILL
    assert 0 < torch.load(kept, weights_only=True)["steps"] < 60
    example.main(words)
    expect_equal(weights(tmp_path), weights(learned))
    assert kept.read_bytes() == (learned / "policy.pt").read_bytes()


def test_the_policy_plays_alike_alone_and_beside_others(example, learned):
    policy = example.ClonedPolicy.load(learned / "policy.pt")
    how = {"control_mode": MODE, "obs_mode": "state_dict", "workers": 0}
    alone = evaluate(policy, TASK, range(50, 53), **how)
    beside = evaluate(pickle.loads(pickle.dumps(policy)), TASK, range(50, 53), num_envs=3, **how)
    assert alone.scores == beside.scores
    assert policy.file == str(learned / "policy.pt")


def test_it_learns_and_plays_with_other_robots(example, tmp_path):
    words = ["--robots", "panda_wristcam", "--workers", "0", "--out", str(tmp_path)]
    assert example.main([*WORDS, *words]) in (0, 1)
    policy = example.ClonedPolicy.load(tmp_path / "policy.pt")
    with closing(tasks.make(TASK, **policy.making)) as env:
        assert [placement.robot.name for placement in env.layout.values()] == ["panda_wristcam"]
    with (
        Recording(tmp_path / "recording") as episodes,
        closing(
            tasks.make(TASK, randomization=example.shaking(policy.recipe), **policy.recipe.making)
        ) as env,
    ):
        episodes.expect_world(env)


def test_a_folder_of_another_recipe_is_refused(example, learned, recording, capsys):
    words = [*WORDS, "--steps", "61", "--recording", str(recording), "--out", str(learned)]
    assert example.main(words) == 1
    assert "policy.pt follows another recipe; choose another folder" in capsys.readouterr().err


def test_a_recording_that_does_not_serve_is_refused(example, recording, tmp_path, capsys):
    words = [*WORDS, "--episodes", "3", "--recording", str(recording), "--out", str(tmp_path)]
    assert example.main(words) == 1
    assert "has 2 episodes, not 3" in capsys.readouterr().err
    assert not (tmp_path / "policy.pt").exists()
