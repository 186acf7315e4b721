"""The command `python -m robots.fetch_assets`."""

from __future__ import annotations

import subprocess
import sys
from itertools import filterfalse
from pathlib import Path

import pytest

from robots import RobotRegistry
from robots.assets.manifest import load_manifest
from robots.assets.store import AssetStore
from robots.fetch_assets import main
from tests.catalogue import is_optional

pytestmark = pytest.mark.usefixtures("store")

CHECKOUT = Path(__file__).parents[2]
MESH = "franka_description/meshes/collision/link4.stl"

# Ends the process at the first attempt to resolve a name or to connect.
NO_NETWORK = """
import runpy, sys
def refuse(event, arguments):
    if event in ("socket.connect", "socket.getaddrinfo", "subprocess.Popen"):
        raise SystemExit(f"used the network: {event} {arguments}")
sys.addaudithook(refuse)
sys.argv[0] = "robots.fetch_assets"
runpy.run_module("robots.fetch_assets", run_name="__main__")
"""


def run_without_network(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", NO_NETWORK, *arguments]
    return subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, check=False)


def test_check_offline_lists_exactly_what_is_missing_or_wrong(store, physics, fill):
    fill(store, physics)
    mesh = next(file for file in physics if file.path == MESH)
    store.path(mesh).write_bytes(b"damaged")
    store.path(physics[0]).unlink()
    done = run_without_network("panda", "--check", "--offline", "--physics-only")
    assert done.returncode == 1
    listed = [line.strip() for line in done.stdout.splitlines() if line.startswith("    ")]
    assert len(listed) == 2
    assert listed[0].startswith(f"missing: {physics[0]} (")
    assert listed[1].startswith(f"differs from the manifest: {mesh} (")
    assert done.stderr == ""


def test_check_of_a_complete_copy_ends_well(store, physics, fill):
    fill(store, physics)
    done = run_without_network("panda", "--check", "--offline", "--physics-only")
    assert (done.returncode, done.stderr) == (0, "")
    assert "panda: complete, 11 files" in done.stdout
    assert "CC BY-NC 4.0" in done.stdout


def test_offline_fetches_from_the_installed_package_alone(store, physics):
    done = run_without_network("panda", "--offline", "--physics-only")
    assert done.returncode == 0, done.stderr
    assert store.unusable(physics) == []


@pytest.mark.long
def test_all_robots_with_pictures_and_scenery_is_the_default(store, capsys):
    assert main(["--source", "mani_skill"]) == 0
    printed = capsys.readouterr().out
    assert "scenery: complete, 2 files" in printed
    assert "maniskill_fmb: complete, 9 files" in printed
    assert store.unusable(load_manifest().package("maniskill_tabletop").files) == []
    for name in filterfalse(is_optional, RobotRegistry.names()):  # those have another source
        urdf = RobotRegistry.load(name).urdf
        package = load_manifest().package(urdf.package)
        assert store.unusable(package.needed(urdf.file, pictures=True)) == []


def test_physics_only_leaves_the_pictures_out(store, capsys):
    assert main(["panda_wristcam", "--source", "mani_skill", "--physics-only"]) == 0
    assert not list(store.root.rglob("*.glb"))
    assert main(["--check", "--physics-only"]) == 1
    printed = capsys.readouterr().out
    assert "scenery" not in printed
    assert "maniskill_fmb: 6 of 6 files" in printed
    assert main(["panda_wristcam", "--check"]) == 1
    assert "d415.stl (21.3 MB, pictures)" in capsys.readouterr().out


def test_another_folder_is_filled_from_the_local_copy(store, physics, fill, tmp_path, capsys):
    fill(store, physics)
    other = tmp_path / "other"
    assert main(["panda", "--physics-only", "--dest", str(other)]) == 0
    assert AssetStore(other).unusable(physics) == []
    said = capsys.readouterr()
    assert f"local copy {store.root}: 11 of 11 files" in said.err
    assert "Hub" not in said.err


def test_a_source_that_differs_is_refused(hub, store, physics, capsys):
    hub.files[f"robots/maniskill_panda/{MESH}"] = b"another mesh"
    arguments = ["panda", "--physics-only", "--source", "hf"]
    assert main(arguments) == 1
    assert f"refused, as 1 files differ from the manifest, twice: maniskill_panda/{MESH}" in (
        capsys.readouterr().err
    )
    assert [file.path for file in store.unusable(physics)] == [MESH]


def test_the_revision_is_passed_on(hub, capsys):
    assert main(["panda", "--physics-only", "--source", "hf", "--revision", "v9"]) == 1
    assert "roboverse_data at v9: not found (404)" in capsys.readouterr().err


def test_without_any_source_each_one_is_named(store, monkeypatch, no_mani_skill, capsys):
    for name in ("PIP_NO_INDEX", "PIP_RETRIES"):
        monkeypatch.setenv(name, "1")
    monkeypatch.setenv("PIP_CONFIG_FILE", "/dev/null")
    monkeypatch.delenv("PIP_FIND_LINKS", raising=False)
    assert main(["panda", "--physics-only"]) == 1
    said = capsys.readouterr().err
    error = said[said.index("error:") :]
    for part in (
        "Hugging Face Hub at http://127.0.0.1:9: RoboVerseOrg/roboverse_data at main: ConnectError",
        "installed mani_skill: mani_skill is not installed",
        "mani_skill wheel through pip: pip failed: No matching distribution found",
        "what to do: connect to the network",
    ):
        assert part in error
    assert "Traceback" not in said
