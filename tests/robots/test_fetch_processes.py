"""Fetches in real processes: killed, several at once, without room, through pip."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import zipfile
from pathlib import Path

import pytest

from robots import AssetError, UrdfLocator
from robots.assets import sources
from robots.assets.fetching import ensure
from robots.assets.manifest import MANI_SKILL
from robots.assets.sources import PackageWheel
from robots.assets.store import FileState
from tests.robots.conftest import contents
from tests.robots.hub_server import HubServer, stall
from tests.robots.wheel_index import WHEEL, build_wheel, members

pytestmark = pytest.mark.usefixtures("store")

HAND = "franka_description/meshes/collision/hand.stl"
CHECKOUT = Path(__file__).parents[2]
FETCH = [sys.executable, "-m", "robots.fetch_assets", "--physics-only"]


def start(*arguments: str, **settings) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*FETCH, *arguments],
        cwd=CHECKOUT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **settings,
    )


def finish(process: subprocess.Popen[str]) -> tuple[int, str]:
    out, err = process.communicate(timeout=120)
    return process.returncode, out + err


@pytest.mark.long
def test_a_killed_fetch_leaves_nothing_that_is_trusted(hub: HubServer, store, physics):
    reached = threading.Event()
    hub.fail("GET", HAND, stall(reached), times=1)
    process = start("panda", "--source", "hf", start_new_session=True)
    assert reached.wait(timeout=60)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL

    states = {store.state(file) for file in physics}
    assert FileState.MISSING in states
    assert states <= {FileState.VERIFIED, FileState.MISSING}

    code, text = finish(start("panda", "--source", "hf"))
    assert code == 0, text
    assert store.unusable(physics) == []
    assert not (store.root / ".partial").exists()


def test_a_process_killed_while_writing_leaves_no_half_file(store, physics, tmp_path):
    # The sixth file is killed after its bytes are in the scratch folder, before it is in place.
    script = tmp_path / "killed.py"
    script.write_text(
        "import os, signal\n"
        "from robots import UrdfLocator\n"
        "from robots.assets.manifest import MANI_SKILL\n"
        "from robots.assets.sources import InstalledPackage\n"
        "import robots.assets.fetching\n"
        "robots.assets.fetching.default_sources = lambda: [InstalledPackage(MANI_SKILL)]\n"
        "real, calls = os.fsync, []\n"
        "def fsync(descriptor):\n"
        "    calls.append(descriptor)\n"
        "    if len(calls) == 6:\n"
        "        os.truncate(f'/proc/self/fd/{descriptor}', 10)\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        "    real(descriptor)\n"
        "os.fsync = fsync\n"
        "UrdfLocator('maniskill_panda', 'panda_v2.urdf').locate()\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
    done = subprocess.run([sys.executable, script], env=environment, check=False)
    assert done.returncode == -signal.SIGKILL
    assert len(store.unusable(physics)) == len(physics) - 5
    assert all(not store.path(file).exists() for file in store.unusable(physics))
    assert (store.root / ".partial").exists()
    assert UrdfLocator("maniskill_panda", "panda_v2.urdf").locate().is_file()
    assert not (store.root / ".partial").exists()


@pytest.mark.long
def test_four_processes_at_once_download_each_file_once(hub: HubServer, store, physics):
    results = [finish(process) for process in [start("panda", "--source", "hf") for _ in range(4)]]
    assert [code for code, _ in results] == [0] * 4, results
    assert store.unusable(physics) == []
    assert len(hub.downloads()) == len(set(hub.downloads())) == len(physics)


@pytest.fixture
def wheel_index(tmp_path, monkeypatch, physics) -> Path:
    """Let pip find a small mani_skill wheel, and nothing else."""
    index = tmp_path / "index"
    index.mkdir()
    (index / WHEEL).write_bytes(build_wheel(members(physics, contents)))
    for name in [name for name in os.environ if name.startswith("PIP_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("PIP_CONFIG_FILE", os.devnull)
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(index))
    return index


def test_the_wheel_comes_through_pip_and_only_robot_files_are_kept(wheel_index, store, physics):
    ensure(physics, store, [PackageWheel(MANI_SKILL)])
    assert store.unusable(physics) == []
    kept = {path for path in store.root.rglob("*") if path.is_file()}
    extra = {path.name for path in kept - {store.path(file) for file in physics}}
    assert extra == {".lock"}


def test_a_wheel_without_a_file_is_named(wheel_index, store, physics):
    archive = next(wheel_index.iterdir())
    smaller = archive.with_suffix(".new")
    with zipfile.ZipFile(archive) as old, zipfile.ZipFile(smaller, "w") as new:
        for member in old.namelist():
            if not member.endswith("hand.stl"):
                new.writestr(member, old.read(member))
    smaller.replace(archive)
    with pytest.raises(AssetError, match=r"lacks 1 files: mani_skill/assets/.*/hand\.stl"):
        ensure(physics, store, [PackageWheel(MANI_SKILL)])


@pytest.mark.long
def test_uv_runs_pip_where_python_has_none(wheel_index, store, physics, monkeypatch, tmp_path):
    uv = tmp_path / "bin" / "uv"
    uv.parent.mkdir()
    shift = '[ "$1 $2 $3" = "tool run pip" ] && shift 3'
    uv.write_text(f'#!/bin/sh\n{shift}\n"{sys.executable}" -m pip "$@"\n')
    uv.chmod(0o755)
    monkeypatch.setenv("PATH", f"{uv.parent}:{os.environ['PATH']}")
    monkeypatch.setattr(sources, "find_spec", lambda name: None)
    ensure(physics, store, [PackageWheel(MANI_SKILL)])
    assert store.unusable(physics) == []
