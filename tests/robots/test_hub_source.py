"""The real Hub client against a local server that misbehaves in every way we know of."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from robots import AssetError
from robots.assets import hub_source
from robots.assets.fetching import ensure
from robots.assets.hub_source import HubSource
from robots.assets.packages import MANI_SKILL
from robots.assets.sources import InstalledPackage
from robots.assets.store import FileState
from tests.process_trees import children_of
from tests.robots.conftest import PANDA, contents
from tests.robots.hub_server import (
    COMMIT,
    HubServer,
    compressed,
    corrupt,
    die,
    drip,
    endless,
    headers,
    inflated,
    stall,
    status,
    truncate,
    without_length,
)
from tests.robots.processes import is_alive, wait_until

pytestmark = pytest.mark.usefixtures("store")

CHECKOUT = Path(__file__).parents[2]
HAND = "franka_description/meshes/collision/hand.stl"


@pytest.fixture(autouse=True)
def _impatient(request, monkeypatch) -> None:
    """Let the client try again at once, but where that is what is tested."""
    if "retried" not in request.node.name:
        at_once = hub_source._BOOT.replace("c.main()", "c._FIRST_WAIT = 0.01; c.main()")
        monkeypatch.setattr(hub_source, "_BOOT", at_once)


def fetch_from_hub(store, files, **settings):
    ensure(files, store, [HubSource(**settings)])


def assert_all_verified(store, files):
    assert [store.state(file) for file in files] == [FileState.VERIFIED] * len(files)


def test_every_file_arrives_and_no_token_leaves(hub: HubServer, store, physics):
    fetch_from_hub(store, physics)
    assert_all_verified(store, physics)
    assert len(hub.downloads()) == len(physics)
    assert hub.authorizations == []


def test_a_pinned_revision_in_the_hubs_cache_asks_for_nothing(hub: HubServer, store, physics):
    fetch_from_hub(store, physics, revision=COMMIT)
    hub.requests.clear()
    for file in physics:
        store.path(file).unlink()
    fetch_from_hub(store, physics, revision=COMMIT)
    assert_all_verified(store, physics)
    assert hub.requests == []


def test_the_revision_can_come_from_the_environment(hub: HubServer, store, physics, monkeypatch):
    monkeypatch.setenv("ROBOT_LAYOUTS_HF_REVISION", COMMIT)
    fetch_from_hub(store, physics)
    assert not any("/revision/" in path for _, path in hub.requests)


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        (status(404, "RepoNotFound"), r"not found \(404\)"),
        (status(404, "RevisionNotFound"), r"not found \(404\)"),
        (status(401, "RepoNotFound"), r"access refused \(401\)"),
        (status(403, "GatedRepo"), r"access refused \(403\): the dataset is gated"),
        (status(429), "HTTP error 429"),
        (status(500), "HTTP error 500"),
    ],
)
def test_an_unhelpful_api_is_named_and_the_next_source_is_used(
    hub: HubServer, store, physics, capfd, fault, reason
):
    hub.fail("GET", "/api/datasets/", fault)
    ensure(physics, store, [HubSource(), InstalledPackage(MANI_SKILL)])
    assert_all_verified(store, physics)
    said = capfd.readouterr().err
    assert re.search(rf"Hub at \S+: 0 of 11 files; .*{reason}", said)
    assert "installed mani_skill: 11 of 11 files" in said
    assert "Traceback" not in said


def test_one_server_error_is_retried(hub: HubServer, store, physics):
    hub.fail("GET", "/api/datasets/", status(500), times=1)
    hub.fail("GET", f"resolve/{COMMIT}", status(500), times=1)
    fetch_from_hub(store, physics)
    assert_all_verified(store, physics)


@pytest.mark.long
@pytest.mark.parametrize(
    ("code", "reason"),
    [
        (403, r"hand\.stl: access refused \(403\)"),
        (500, r"hand\.stl: HTTP error 500"),
        (429, r"nothing arrived for 4 s \(it warned: .*429"),
    ],
)
def test_a_file_that_stays_refused_is_named(hub: HubServer, store, physics, code, reason):
    hub.fail("GET", HAND, status(code))
    with pytest.raises(AssetError, match=reason):
        fetch_from_hub(store, physics, patience=4.0)


def test_a_missing_mesh_is_named_and_the_others_are_kept(hub: HubServer, store, physics):
    del hub.files[f"robots/maniskill_panda/{HAND}"]
    with pytest.raises(AssetError, match=rf"lacks 1 files \(404\): .*{HAND}") as error:
        fetch_from_hub(store, physics)
    assert "1 robot files cannot be used" in str(error.value)
    assert [file.path for file in store.unusable(physics)] == [HAND]


def test_a_truncated_body_is_resumed(hub: HubServer, store, physics):
    hub.fail("GET", HAND, truncate, times=1)
    fetch_from_hub(store, physics)
    assert_all_verified(store, physics)


@pytest.mark.long
def test_a_slow_download_that_goes_on_is_not_given_up(hub: HubServer, store):
    large = next(file for file in PANDA.files if file.path.endswith("visual/link0.glb"))
    hub.files[f"{large.origin.hub_folder}/{large.path}"] = contents(large)
    hub.fail("GET", large.path, drip(pieces=16, pause=0.3), times=1)
    fetch_from_hub(store, [large], patience=4.0)
    assert_all_verified(store, [large])
    assert len(hub.downloads()) == 1


@pytest.mark.long
@pytest.mark.parametrize("fault", [endless, inflated])
def test_a_body_without_end_is_read_no_further_than_the_manifest_says(
    hub: HubServer, store, physics, fault
):
    hub.fail("GET", HAND, fault)
    size = next(file for file in physics if file.path == HAND).bytes
    expected = rf"differ from the manifest, twice: .*{HAND} \(more than {size:,} bytes\)"
    with pytest.raises(AssetError, match=expected):
        fetch_from_hub(store, physics)
    assert hub.sent < 64 * 2**20  # mostly what fits into the buffers of two connections
    assert [file.path for file in store.unusable(physics)] == [HAND]


@pytest.mark.parametrize("fault", [without_length, compressed])
def test_a_body_whose_length_is_not_said_arrives(hub: HubServer, store, physics, fault):
    hub.fail("GET", HAND, fault)
    fetch_from_hub(store, physics)
    assert_all_verified(store, physics)


@pytest.mark.long
def test_a_download_that_drips_is_given_up(hub: HubServer, store):
    large = next(file for file in PANDA.files if file.path.endswith("visual/link0.glb"))
    hub.files[f"{large.origin.hub_folder}/{large.path}"] = contents(large)
    hub.fail("GET", large.path, drip(pieces=large.bytes // 100, pause=0.2))  # 500 bytes per second
    with pytest.raises(AssetError, match="nothing arrived for 2 s"):
        fetch_from_hub(store, [large], patience=2.0)


@pytest.mark.parametrize(
    ("header", "path"), [("ETag", "{tmp}/evil"), ("X-Linked-Etag", "../../../../../evil")]
)
def test_a_server_cannot_choose_where_files_are_written(
    hub: HubServer, store, physics, tmp_path, header, path
):
    (tmp_path / "hf_home").mkdir()
    hub.fail("HEAD", HAND, headers(**{header: f'"{path.format(tmp=tmp_path)}"'}))
    with pytest.raises(AssetError, match=rf"the server sends {header.lower()}: .*evil"):
        fetch_from_hub(store, physics)
    assert not list(tmp_path.rglob("evil*"))


def test_a_client_ends_with_the_process_that_fetches(hub: HubServer, store, physics):
    reached = threading.Event()
    hub.fail("GET", HAND, stall(reached))
    fetching = [sys.executable, "-m", "robots.fetch_assets", "panda", "--source", "hf"]
    command = [*fetching, "--physics-only"]
    with subprocess.Popen(command, cwd=CHECKOUT, stderr=subprocess.DEVNULL) as process:
        assert reached.wait(timeout=60)
        (client,) = children_of(process.pid)
        os.kill(client, signal.SIGSTOP)  # it cannot notice anything by itself
        process.kill()
    wait_until(lambda: not is_alive(client))


def test_a_server_dying_midway_leaves_the_rest_to_the_next_source(
    hub: HubServer, store, physics, capfd
):
    hub.fail("GET", HAND, die, times=1)
    ensure(physics, store, [HubSource(patience=4.0), InstalledPackage(MANI_SKILL)])
    assert_all_verified(store, physics)
    said = capfd.readouterr().err
    assert "Hugging Face Hub" in said
    assert "installed mani_skill" in said


def test_corrupt_bytes_of_the_right_size_are_fetched_again(hub: HubServer, store, physics):
    hub.fail("GET", HAND, corrupt, times=1)
    fetch_from_hub(store, physics)
    assert_all_verified(store, physics)
    assert sum(HAND in path for path in hub.downloads()) == 2


def test_a_corrupt_file_in_the_hubs_cache_is_replaced(hub: HubServer, store, physics, tmp_path):
    fetch_from_hub(store, physics)
    snapshot = next((tmp_path / "hf_home").rglob(f"snapshots/*/robots/*/{HAND}"))
    right = snapshot.read_bytes()
    snapshot.resolve().write_bytes(bytes(len(right)))
    file = next(file for file in physics if file.path == HAND)
    store.path(file).unlink()
    fetch_from_hub(store, physics)
    assert_all_verified(store, physics)
    assert snapshot.read_bytes() == right


def test_a_file_wrong_twice_is_refused_by_name(hub: HubServer, store, physics, capfd):
    hub.fail("GET", HAND, corrupt)
    expected = rf"refused, as 1 files differ from the manifest, twice: maniskill_panda/{HAND}"
    with pytest.raises(AssetError, match=expected):
        fetch_from_hub(store, physics)
    assert [file.path for file in store.unusable(physics)] == [HAND]
    assert not store.path(store.unusable(physics)[0]).exists()


@pytest.mark.long
def test_a_hub_that_never_answers_is_waited_for_once(store, physics, monkeypatch):
    with socket.create_server(("127.0.0.1", 0), backlog=64) as black_hole:
        monkeypatch.setenv("HF_ENDPOINT", f"http://127.0.0.1:{black_hole.getsockname()[1]}")
        start = time.monotonic()
        with pytest.raises(AssetError, match="nothing arrived for 8 s"):
            fetch_from_hub(store, physics)
        assert time.monotonic() - start < 2 * 8.0


def test_no_network_at_all_is_named(store, physics):
    with pytest.raises(AssetError, match="Hugging Face Hub at .*Connection refused"):
        fetch_from_hub(store, physics)


def test_offline_mode_of_the_hub_client_is_respected(hub, store, physics, monkeypatch):
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    with pytest.raises(AssetError, match="offline mode is enabled"):
        fetch_from_hub(store, physics)
    assert hub.requests == []


def test_a_read_only_cache_of_the_hub_is_a_reason_to_go_on(
    hub, store, physics, monkeypatch, read_only_folder, capfd
):
    monkeypatch.setenv("HF_HOME", str(read_only_folder))
    ensure(physics, store, [HubSource(), InstalledPackage(MANI_SKILL)])
    assert_all_verified(store, physics)
    assert "the Hub's cache cannot be written" in capfd.readouterr().err


def test_a_full_cache_of_the_hub_is_a_reason_to_go_on(hub, store, physics, monkeypatch, capfd):
    limit = "import resource as r; r.setrlimit(r.RLIMIT_FSIZE, (12_000, 12_000)); "
    monkeypatch.setattr(hub_source, "_BOOT", limit + hub_source._BOOT)
    ensure(physics, store, [HubSource(), InstalledPackage(MANI_SKILL)])
    assert_all_verified(store, physics)
    assert "the Hub's cache cannot be written: File too large" in capfd.readouterr().err


def test_a_missing_client_is_named(store, physics, monkeypatch, tmp_path: Path):
    missing = tmp_path / "shadow" / "huggingface_hub.py"
    missing.parent.mkdir()
    missing.write_text("raise ImportError('No module named huggingface_hub')")
    monkeypatch.syspath_prepend(str(missing.parent))
    with pytest.raises(AssetError, match="No module named huggingface_hub.*pip install"):
        fetch_from_hub(store, physics)


def test_a_client_that_crashes_is_a_reason_too(store, physics, monkeypatch):
    monkeypatch.setattr(hub_source, "_BOOT", "raise SystemExit('no such luck')")
    with pytest.raises(AssetError, match="the client ended unexpectedly: no such luck"):
        fetch_from_hub(store, physics)


def test_a_patience_that_is_no_number_is_named(store, physics, monkeypatch):
    monkeypatch.setenv("ROBOT_LAYOUTS_HF_PATIENCE", "soon")
    with pytest.raises(AssetError, match="ROBOT_LAYOUTS_HF_PATIENCE is 'soon'"):
        fetch_from_hub(store, physics)


def test_pictures_come_from_the_hub_too(hub, store):
    files = [file for file in PANDA.files if file.path.endswith("finger.glb")]
    assert files
    fetch_from_hub(store, files)
    assert_all_verified(store, files)
