"""`replay` and `convert` write the same whoever plays, and whatever happens on the way."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from robot_layouts.__main__ import main
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording.record import record
from robot_layouts.data.recording.replaying import replay_recording
from tests.data.plays import Here
from tests.data.recordings import record as record_at_random
from tests.data.test_record import PATIENCE, ROOT, wait_for_parts, wait_until_nobody_is_left
from tests.data.test_recorder import same_files
from tests.process_trees import workers_of

FILE = "trajectory.h5"


@pytest.fixture(scope="module")
def pushed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pushed") / FILE
    record_at_random(path, "PushCube-v1", [4, 3, 5, 2, 3])
    return path.parent


def replay(source: Path, out: Path, *words: str) -> int:
    return main(["replay", str(source), "--obs-mode=state_dict", f"--out={out}", *words])


def test_observations_are_the_same_whoever_plays(pushed: Path, tmp_path: Path, capsys):
    size = "--file-size=0.02"
    assert replay(pushed, tmp_path / "here", size) == 0
    here = capsys.readouterr().out
    assert replay(pushed, tmp_path / "workers", size, "--workers=2") == 0
    assert capsys.readouterr().out == here
    with Recording(pushed) as file:
        how = {"obs_mode": "state_dict", "folder": tmp_path / "reversed", "file_size": 0.02}
        assert replay_recording(file, Here(), **how).agrees
    with Recording(tmp_path / "here") as file:
        assert file.manifest is not None
        assert len(file.manifest.files) > 1
        names = [entry["file"] for entry in file.manifest.files]
    for name in names:
        assert same_files(tmp_path / "here" / name, tmp_path / "workers" / name)
        assert same_files(tmp_path / "here" / name, tmp_path / "reversed" / name)


def test_what_was_recorded_before_is_not_played(pushed: Path, tmp_path: Path, capsys):
    assert replay(pushed, tmp_path, "--episodes=2") == 0
    capsys.readouterr()
    assert replay(pushed, tmp_path) == 0
    captured = capsys.readouterr()
    assert "2 of 5 episodes were recorded before" in captured.err
    assert "3 of 3 episodes end as recorded" in captured.out
    assert replay(pushed, tmp_path) == 0  # nothing is left to play


def test_episodes_without_seeds_of_their_own_are_played_here(pushed: Path, tmp_path: Path, capsys):
    path = record_at_random(tmp_path / FILE, "PushCube-v1", [4, 3])
    text = path.with_suffix(".json").read_text().replace('"seed": 11', '"seed": 10')
    path.with_suffix(".json").write_text(text)
    assert main(["replay", str(path), "--from=state"]) == 0
    assert main(["replay", str(path), "--from=state", "--workers=1"]) == 1
    assert "does not name another seed for each episode" in capsys.readouterr().err


@pytest.mark.long
def test_a_conversion_is_the_same_whoever_converts(tmp_path: Path, capsys):
    record("PushCube-v1", range(4), tmp_path / "deltas", workers=0)
    words = ["convert", str(tmp_path / "deltas"), "--to=pd_ee_delta_pose"]
    printed: list[str] = []
    for workers in "02":
        out = tmp_path / workers
        assert main([*words, f"--out={out}", f"--workers={workers}"]) == 0
        printed.append(capsys.readouterr().out.replace(str(out), ""))
    assert printed[0] == printed[1]
    assert "4 of 4 successful episodes succeed" in printed[0]
    assert same_files(tmp_path / "0" / FILE, tmp_path / "2" / FILE)


def start(*words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "robot_layouts", *words],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("many") / FILE
    return record_at_random(path, "PushCube-v1", [50] * 40).parent


@pytest.mark.long
def test_a_worker_that_is_killed(many: Path, tmp_path: Path):
    words = ["replay", str(many), "--obs-mode=state", f"--out={tmp_path / 'killed'}"]
    process = start(*words, "--workers=2")
    wait_for_parts(tmp_path / "killed", 2)
    worker = workers_of(process.pid)[0]
    os.kill(worker, signal.SIGKILL)
    printed, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, said
    assert f"worker process {worker} died by SIGKILL " in said
    assert "40 of 40 episodes end as recorded; in 40 all states" in printed
    assert main(["replay", str(many), "--obs-mode=state", f"--out={tmp_path / 'here'}"]) == 0
    assert same_files(tmp_path / "killed" / FILE, tmp_path / "here" / FILE)


@pytest.mark.long
def test_a_replay_that_is_interrupted_goes_on(many: Path, tmp_path: Path):
    words = ["replay", str(many), "--obs-mode=state", f"--out={tmp_path}", "--workers=2"]
    process = start(*words)
    wait_for_parts(tmp_path, 3)
    os.killpg(process.pid, signal.SIGINT)
    printed, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert printed == ""
    assert "Traceback" not in said
    assert said.splitlines()[-1] == "stopped; the same command goes on from there"
    wait_until_nobody_is_left(process)
    with Recording(tmp_path) as file:
        assert 3 <= len(file) < 40
    assert main(words) == 0
    with Recording(tmp_path) as file:
        assert len(file) == 40
