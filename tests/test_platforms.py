"""The library where something is missing: a simulator, or what other operating systems lack."""

from __future__ import annotations

import pytest

from robot_layouts.core import operating_system
from robot_layouts.simulation.backend import SIMULATORS
from tests import without
from tests.fresh_process import in_fresh_process

PACKAGES = {"sapien3": "sapien", "mujoco": "mujoco"}  # by simulator


def test_tasks_are_declared_without_any_simulator():
    assert in_fresh_process(without.import_seam) == ["torch"]


@pytest.mark.long
def test_a_simulator_that_is_not_installed_is_named():
    said = in_fresh_process(without.refusal, "sapien3", "sapien")
    assert said.startswith("simulator='sapien3' needs SAPIEN, which cannot be imported here")


@pytest.mark.long
@pytest.mark.parametrize("simulator", PACKAGES)
def test_what_needs_no_physics_needs_no_simulator(simulator, tmp_path):
    backend = f"robot_layouts.simulation.{simulator}"
    found = in_fresh_process(without.without, PACKAGES[simulator], backend, str(tmp_path))
    assert found["modules"] > 500
    assert found["tasks"] > 20
    assert found["right"]
    assert found["urdf"]
    assert found["duration"] > 0
    assert not found["loaded"]


@pytest.mark.long
@pytest.mark.parametrize("simulator", SIMULATORS)
def test_a_simulator_needs_no_other(simulator):
    others = tuple(package for name, package in PACKAGES.items() if name != simulator)
    assert in_fresh_process(without.play, others, simulator) == pytest.approx(
        in_fresh_process(without.play, (), simulator), abs=0
    )


@pytest.mark.long
def test_the_demo_plays_and_films_without_sapien(tmp_path):
    found = in_fresh_process(without.demo, str(tmp_path))
    assert found == ["layout.png", "trajectory.h5", "trajectory.json", "video.mp4"]


@pytest.mark.long
@pytest.mark.parametrize("system", without.LACKING)
def test_one_process_does_on_other_systems_what_it_does_here(system, tmp_path):
    found = in_fresh_process(without.on, system, str(tmp_path))
    assert found["score"] == 1.0
    assert found["recorded"] == ["trajectory.h5", "trajectory.json"]
    assert found["rewards"][0] == pytest.approx(found["reward"], abs=1e-6)
    assert "worker processes need Linux; on this system use one process" in found["refusal"]


def test_here_everything_is_there(tmp_path):
    file = tmp_path / "file"
    file.write_bytes(b"0123456789")
    with file.open("rb") as opened:
        assert operating_system.read_at(opened, 3, 4) == b"456"
        assert opened.tell() == 0
    assert operating_system.cores() >= 1
    assert operating_system.memory() > operating_system.resident_memory() > 1e6
    clock = operating_system.thread_clock()
    assert 0 < clock() <= clock()


def test_what_is_missing_has_a_stand_in(tmp_path, monkeypatch):
    file = tmp_path / "file"
    file.write_bytes(b"0123456789")
    for module, name in (
        *(("os", name) for name in ("pread", "sched_getaffinity", "sysconf", "O_DIRECTORY")),
        ("time", "pthread_getcpuclockid"),
    ):
        monkeypatch.delattr(f"{module}.{name}")
    with file.open("rb") as opened:
        assert operating_system.read_at(opened, 3, 4) == b"456"
    assert operating_system.cores() >= 1
    assert operating_system.memory() is None
    assert operating_system.resident_memory() == 0
    assert operating_system.thread_clock()() > 0
    assert operating_system.open_folder(tmp_path) is None
