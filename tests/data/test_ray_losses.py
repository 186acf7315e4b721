"""What a Ray cluster may lose, and how that ends: with every episode, or with an error."""

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

import robot_layouts.data.playing.ray_cluster
import robot_layouts.data.playing.scheduler
from robot_layouts.core.processes.start import WorkerError
from robot_layouts.data.playing.ray_executor import RayExecutor
from robot_layouts.data.reading.recording import FILE
from tests.data.clusters import running_cluster
from tests.data.plays import Play
from tests.data.test_executor import squares
from tests.data.test_ray_executor import MODULES
from tests.data.test_record import PATIENCE, arguments, recorded_directly, start, wait_for_parts
from tests.data.test_recorder import same_files

ray = pytest.importorskip("ray")

FIRST = 2000  # seed


@pytest.fixture
def nodes():
    with running_cluster() as nodes:
        nodes.grow(2)
        yield nodes


@pytest.mark.long
def test_an_actor_that_is_stopped_before_it_is_ready(nodes, monkeypatch, tmp_path):
    monkeypatch.setattr(robot_layouts.data.playing.scheduler, "START_SECONDS", 30.0)
    executor = RayExecutor(nodes.address, 1, modules=MODULES)
    played = []
    for event in executor.run(StopsItselfOnce(tmp_path), range(6)):
        played.append(event)
        if event.died is not None:
            monkeypatch.undo()  # a busy machine may need longer for the next one
    (death,) = [event for event in played if event.died is not None]
    assert "was not ready within 30 s and was ended" in death.died
    assert squares(played) == {seed: seed**2 for seed in range(6)}
    nodes.wait_for_no_player()


class StopsItselfOnce:
    def __init__(self, folder):
        self.folder = folder

    def __call__(self):
        try:
            (self.folder / "stopped").touch(exist_ok=False)
        except FileExistsError:
            return Play(lasts=0.5).play
        os.kill(os.getpid(), signal.SIGSTOP)
        return Play().play


def record_with(nodes, out: Path, episodes: int, *more: str) -> subprocess.Popen[str]:
    return start(*arguments(out, episodes, seed=FIRST), f"--ray={nodes.address}", *more)


@pytest.mark.long
def test_the_node_of_this_machine_is_stopped_before(nodes, monkeypatch):
    monkeypatch.setattr(robot_layouts.data.playing.ray_cluster, "_JOIN_SECONDS", 10.0)
    pid = nodes.signal_head("raylet", signal.SIGSTOP)
    with pytest.raises(WorkerError, match="cannot be joined: "):
        next(RayExecutor(nodes.address).run(Play(), [0]))
    os.kill(pid, signal.SIGCONT)


@pytest.mark.long
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_the_node_of_this_machine_is_lost(nodes, tmp_path, how):
    recording = record_with(nodes, tmp_path, 10**5)
    wait_for_parts(tmp_path, 5)
    nodes.signal_head("raylet", how)
    printed, said = recording.communicate(timeout=PATIENCE)
    assert recording.returncode == 1, said
    assert "Traceback" not in said
    assert "error: the Ray node of this machine has died" in said
    if how is signal.SIGKILL:
        (kept,) = map(int, re.findall(r"stopped; (\d+) episodes are recorded", said))
        again = start(*arguments(tmp_path, kept + 5, seed=FIRST))
        _, said = again.communicate(timeout=PATIENCE)
        assert again.returncode == 0, said
        assert f"{kept} of {kept + 5} episodes were recorded before" in said
        whole = recorded_directly(tmp_path / "direct" / FILE, range(FIRST, FIRST + kept + 5))
        assert same_files(tmp_path / FILE, whole)


@pytest.mark.long
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_the_head_is_lost(nodes, tmp_path, how):
    recording = record_with(nodes, tmp_path, 10**5)
    wait_for_parts(tmp_path, 5)
    pid = nodes.signal_head("gcs_server", how)
    if how is signal.SIGSTOP:  # the workers go on without it
        time.sleep(5)
        for worker in nodes.players():
            os.kill(worker, signal.SIGKILL)
    printed, said = recording.communicate(timeout=PATIENCE)
    if how is signal.SIGSTOP:
        os.kill(pid, signal.SIGCONT)
    assert recording.returncode == 1, said
    assert "Traceback" not in said
    assert "error: the head of the Ray cluster, 127.0.0.2:" in said
    (kept,) = re.findall(r"stopped; (\d+) episodes are recorded", said)
    assert int(kept) >= 5


@pytest.mark.long
def test_a_short_recording_may_go_on_without_the_head(nodes, tmp_path):
    recording = record_with(nodes, tmp_path, 150)
    wait_for_parts(tmp_path, 5)
    nodes.signal_head("gcs_server", signal.SIGKILL)
    printed, said = recording.communicate(timeout=PATIENCE)
    assert "Traceback" not in said
    if recording.returncode == 0:
        assert f"{FILE}: 150 episodes" in printed
        assert same_files(
            tmp_path / FILE,
            recorded_directly(tmp_path / "direct" / FILE, range(FIRST, FIRST + 150)),
        )
    else:
        assert recording.returncode == 1
        assert "error: the head of the Ray cluster, 127.0.0.2:" in said


@contextmanager
def guarded_head(monkeypatch, tmp_path):
    """Start a head that asks for a token, as the tutorial does; yields its address."""
    folder = tempfile.mkdtemp(prefix="ray-")  # short: it holds sockets
    monkeypatch.setenv("RAY_TMPDIR", folder)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("RAY_AUTH_MODE", "token")
    program = [sys.executable, "-m", "ray.scripts.scripts"]
    subprocess.run([*program, "get-auth-token", "--generate"], check=True, capture_output=True)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    words = ["--head", f"--port={port}", "--num-cpus=1", "--disable-usage-stats", "--block"]
    head = subprocess.Popen(
        [*program, "start", *words, "--include-dashboard=false", f"--temp-dir={folder}"],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        for line in head.stdout:
            if "Ray runtime started" in line:
                break
        yield f"127.0.0.1:{port}"
    finally:
        head.terminate()
        head.communicate(timeout=60)
        shutil.rmtree(folder, ignore_errors=True)


@pytest.mark.long
def test_a_cluster_that_asks_for_a_token(monkeypatch, tmp_path):
    with guarded_head(monkeypatch, tmp_path) as address:
        words = [*arguments(tmp_path / "out", 3), f"--ray={address}"]
        recording = start(*words)
        printed, said = recording.communicate(timeout=PATIENCE)
        assert recording.returncode == 0, said
        assert "3 new episodes" in printed
        monkeypatch.setenv("RAY_AUTH_TOKEN", "another token")
        expect_refusal(words)
        monkeypatch.delenv("RAY_AUTH_TOKEN")
        monkeypatch.setenv("RAY_AUTH_MODE", "disabled")
        expect_refusal(words)
        monkeypatch.setenv("RAY_AUTH_MODE", "token")
        monkeypatch.setenv("HOME", str(tmp_path / "nobody"))
        expect_refusal(words)


def expect_refusal(words):
    recording = start(*words, "--seed=3")
    _, said = recording.communicate(timeout=PATIENCE)
    assert recording.returncode == 1
    assert said.splitlines()[-1].endswith(
        "the cluster asks for a token: on its head, `ray get-auth-token` prints it; here, put it"
        " into ~/.ray/auth_token or RAY_AUTH_TOKEN, and set RAY_AUTH_MODE=token"
    )
