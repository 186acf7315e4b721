"""Episodes on a Ray cluster of several nodes, some of which are killed."""

import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import robot_layouts.data.playing.ray_executor
import robot_layouts.data.playing.scheduler
from robot_layouts.__main__ import main
from robot_layouts.core.own_packages import PACKAGES
from robot_layouts.core.processes.start import WorkerError
from robot_layouts.data import evaluate
from robot_layouts.data.playing.ray_cluster import gather_code
from robot_layouts.data.playing.ray_executor import RayExecutor
from robot_layouts.data.playing.scheduler import WorkersDied
from robot_layouts.data.reading.recording import FILE, Recording
from robot_layouts.data.receipts import verify
from robot_layouts.data.recording.record import record
from robot_layouts.experts import registry
from robots import MissingPackageError, TaskError, UnknownNameError
from tests.data.clusters import Nodes, running_cluster
from tests.data.plays import (
    TASK,
    CodeFolder,
    Play,
    at_random,
    cannot_prepare,
    dies_before_it_is_ready,
)
from tests.data.policies import LEANS, Wanders, meddles
from tests.data.test_executor import squares
from tests.data.test_record import PATIENCE, arguments, recorded_directly, start, wait_for_parts
from tests.data.test_recorder import same_files

ROOT = Path(__file__).parents[2]
MODULES = ["tests.data.plays"]


@pytest.fixture(scope="module")
def cluster():
    with running_cluster() as nodes:
        yield nodes


@pytest.fixture
def nodes(cluster):
    cluster.grow(2)
    yield cluster
    cluster.wait_for_no_player()


@pytest.fixture
def _cheap_expert(monkeypatch):
    monkeypatch.setitem(registry.EXPERTS.registered, TASK, at_random)


def run(nodes, prepare, seeds, workers=None):
    return list(RayExecutor(nodes.address, workers, modules=MODULES).run(prepare, seeds))


@pytest.mark.long
def test_a_cluster_without_room(cluster, monkeypatch):
    cluster.shrink()
    with pytest.raises(WorkerError, match="no node of the Ray cluster offers a CPU"):
        run(cluster, Play(), range(3))
    monkeypatch.setattr(robot_layouts.data.playing.scheduler, "QUIET_SECONDS", 3.0)
    events = RayExecutor(cluster.address, 1, modules=MODULES).run(Play(), range(3))
    said = next(events).note
    assert re.fullmatch(
        r"no message for \d s: actor has been getting ready for \d s;"
        r" 0 CPUs of the Ray cluster, of 1 nodes, are free",
        said,
    )
    cluster.grow(1)
    assert len(squares(list(events))) == 3


class Disturbance:
    """Kills a node when all three workers have played, and another one's actor a little later."""

    def __init__(self, nodes: Nodes) -> None:
        self.nodes, self.arrived, self.played = nodes, [], []

    def __call__(self, summary, event) -> None:
        if event is None or event.result is None:
            return
        self.arrived.append(event.seed)
        if len(summary.workers) == 3:
            self.played.append(event.worker)
        if len(self.played) == 1:
            self.first = next(worker for worker in summary.workers if worker != event.worker)
            self.nodes.kill_at(self.first.rpartition(" ")[2])
        if len(self.played) == 5:
            second = next(w for w in self.played if w not in (self.first, event.worker))
            os.kill(int(second.split()[1]), signal.SIGKILL)


@pytest.mark.long
@pytest.mark.usefixtures("_cheap_expert")
def test_a_cluster_records_what_this_machine_does(cluster, tmp_path):
    cluster.grow(1)
    summary = record(TASK, range(3), tmp_path, RayExecutor(cluster.address))
    assert not summary.deaths
    assert same_files(tmp_path / FILE, recorded_directly(tmp_path / "direct" / FILE, range(3)))
    cluster.wait_for_no_player()


@pytest.mark.long
@pytest.mark.usefixtures("_cheap_expert")
def test_nodes_and_actors_that_are_killed_change_nothing(nodes, tmp_path):
    nodes.grow(3)
    nodes.barrier.mkdir()
    disturb = Disturbance(nodes)
    summary = record(TASK, range(24), tmp_path, RayExecutor(nodes.address), on_event=disturb)
    shutil.rmtree(nodes.barrier)
    assert sorted(disturb.arrived) == list(range(24))
    lost = [death.partition(" was lost: ")[2] for death in summary.deaths]
    assert sorted(words.partition(" at seed ")[0] for words in lost if " at seed " in words) == [
        "its worker process has died",
        "out of reach",
    ]
    late = {  # sent to a node not yet known to be dead, or libraries that could not be loaded
        "out of reach before it could play anything",
        "its worker process has died before it could play anything",
        "its code could not be loaded before it could play anything",
    }
    assert {words for words in lost if " at seed " not in words} <= late
    assert same_files(tmp_path / FILE, recorded_directly(tmp_path / "direct" / FILE, range(24)))


@pytest.mark.long
def test_a_recording_on_a_cluster_is_stopped_and_goes_on(nodes, tmp_path):
    out, words = tmp_path / "out", [f"--ray={nodes.address}"]
    stopped = start(*arguments(out, 10**6), *words)
    wait_for_parts(out, 3)
    stopped.send_signal(signal.SIGTERM)
    printed, said = stopped.communicate(timeout=PATIENCE)
    assert (stopped.returncode, "Traceback" in said) == (130, False)
    assert "recorded" not in printed  # Ray itself may tell there of nodes that are gone
    nodes.wait_for_no_player()
    with Recording(out / FILE) as file:
        count = len(file)
    assert count >= 3
    assert said.splitlines()[-1] == (
        f"stopped; {count} episodes are recorded; the same command goes on from there"
    )
    interrupted = start(*arguments(out, 10**6), *words)
    wait_for_parts(out, 3)
    os.killpg(interrupted.pid, signal.SIGINT)
    printed, said = interrupted.communicate(timeout=PATIENCE)
    assert (interrupted.returncode, "Traceback" in said) == (130, False)
    nodes.wait_for_no_player()
    with Recording(out / FILE) as file:
        assert len(file) >= count + 3
        count = len(file)
    killed = start(*arguments(out, 10**6), *words)
    wait_for_parts(out, 3)
    killed.kill()
    killed.communicate()
    nodes.wait_for_no_player()
    count += len(list(out.glob("trajectory.parts/*.part")))
    whole = count + 20
    last = start(*arguments(out, whole, workers=2), *words)
    printed, said = last.communicate(timeout=PATIENCE)
    assert last.returncode == 0, said
    assert f"{count} of {whole} episodes were recorded before" in said
    assert "20 new episodes, 0 with success" in printed
    assert same_files(out / FILE, recorded_directly(tmp_path / FILE, range(whole)))


@pytest.mark.long
def test_a_receipt_says_there_what_it_says_here(nodes, tmp_path):
    there, here = tmp_path / "there.json", tmp_path / "here.json"
    evaluate(Wanders(), TASK, range(3), executor=RayExecutor(nodes.address), receipt=there)
    evaluate(Wanders(), TASK, range(3), workers=0, receipt=here)
    assert there.read_bytes() == here.read_bytes()
    assert verify(here, RayExecutor(nodes.address), policy=Wanders()).equal


@pytest.mark.long
def test_a_policy_and_who_helps_it_are_recorded_there_as_here(nodes, tmp_path):
    given = {"policy": Wanders(), "takeover": meddles, "corrector": LEANS, "num_envs": 2}
    record(TASK, range(5), tmp_path / "there", RayExecutor(nodes.address), **given)
    record(TASK, range(5), tmp_path / "here", workers=0, **given)
    assert same_files(tmp_path / "there" / FILE, tmp_path / "here" / FILE)


@pytest.mark.long
def test_who_plays_what(nodes, tmp_path):
    played = run(nodes, Play(lasts=0.2, fails_at=1, breaks_at=2), range(8))
    assert squares(played) == {seed: seed**2 for seed in (0, 3, 4, 5, 6, 7)}
    errors = {event.seed: event.error for event in played if event.error}
    assert isinstance(errors[1], TaskError)
    assert "ZeroDivisionError: division by zero (" in str(errors[2])
    nobody = run(nodes, Play(tmp_path, dies_at=1, always=True), range(4), workers=1)
    assert [event.seed for event in nobody if event.died] == [1, 1, 1]
    (given_up,) = [event for event in nobody if event.error]
    assert isinstance(given_up.error, WorkersDied)
    assert sorted(squares(nobody)) == [0, 2, 3]
    folders = {event.result for event in run(nodes, CodeFolder(), range(3))}  # one a node
    assert all("working_dir_files" in folder for folder in folders)
    assert run(nodes, Play(), []) == []


@pytest.mark.long
def test_what_cannot_begin(nodes, monkeypatch):
    with pytest.raises(TaskError, match=r"nothing can be made here \(on node 127\.0\.0\.\d+\)"):
        run(nodes, cannot_prepare, range(3))
    with pytest.raises(WorkerError, match="3 worker processes died before they could play any"):
        run(nodes, dies_before_it_is_ready, range(9), workers=1)
    with pytest.raises(WorkerError, match="cannot be sent to them: "):
        run(nodes, (lambda file: lambda: file)(sys.stderr), range(3))
    monkeypatch.setattr(
        robot_layouts.data.playing.ray_executor, "versions", lambda _: {"sapien": "0.1"}
    )
    with pytest.raises(WorkerError, match=r"node 127.* has sapien 3.*, this machine sapien 0\.1;"):
        run(nodes, Play(), range(3))


def test_ray_is_not_installed(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(MissingPackageError, match=r"pip install 'robot-layouts\[ray\]'"):
        RayExecutor()
    assert main(arguments(tmp_path / "never", 1, ray="auto")) == 1
    assert "pip install 'robot-layouts[ray]'" in capsys.readouterr().err
    assert not (tmp_path / "never").exists()


@pytest.mark.long
def test_nodes_get_all_the_code(tmp_path):
    gather_code(tmp_path, ["tests.data.plays"])
    assert {path.name for path in tmp_path.iterdir()} == {*PACKAGES, "tests"}
    program = "import robots; print(robots.__file__); from robots.assets.manifest import *; "
    program += "print(CHECKOUT_CACHE.exists(), len(load_manifest().packages))"
    words = [sys.executable, "-c", program]
    said = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert said.split()[:2] == [str(tmp_path / "robots" / "__init__.py"), "False"]
    assert int(said.split()[2]) > 1
    with pytest.raises(UnknownNameError, match="unknown module 'no_such_module'"):
        gather_code(tmp_path, ["no_such_module.part"])
