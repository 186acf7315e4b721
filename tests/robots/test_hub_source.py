"""The real Hub client against a local server that misbehaves as networks and servers do."""

from __future__ import annotations

import re
import resource
import socket
import threading
import time

import pytest
from huggingface_hub import constants

from robots import AssetError
from robots.assets.fetching import ensure
from robots.assets.manifest import MANI_SKILL
from robots.assets.sources import HubSource, InstalledPackage
from robots.assets.store import FileState
from tests.robots.conftest import PANDA
from tests.robots.hub_server import COMMIT, Fault, HubServer, die, login_page, stall, status

pytestmark = pytest.mark.usefixtures("store", "hub_client")

HAND = "franka_description/meshes/collision/hand.stl"


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
        (status(401, "RepoNotFound"), r"access refused \(401\)"),
        (status(500), "HTTP error 500"),
        (login_page, "not JSON, such as a login page"),
    ],
)
def test_an_unhelpful_hub_is_named_and_the_next_source_is_used(
    hub: HubServer, store, physics, capfd, fault: Fault, reason
):
    hub.fail("GET", "/api/datasets/", fault)
    ensure(physics, store, [HubSource(), InstalledPackage(MANI_SKILL)])
    assert_all_verified(store, physics)
    said = capfd.readouterr().err
    assert re.search(rf"Hub at \S+: 0 of 11 files; .*{reason}", said)
    assert "installed mani_skill: 11 of 11 files" in said
    assert "Traceback" not in said


def test_a_missing_mesh_is_named_and_the_others_are_kept(hub: HubServer, store, physics):
    del hub.files[f"robots/maniskill_panda/{HAND}"]
    with pytest.raises(AssetError, match=rf"lacks 1 files \(404\): .*{HAND}") as error:
        fetch_from_hub(store, physics)
    assert "1 robot files cannot be used" in str(error.value)
    assert [file.path for file in store.unusable(physics)] == [HAND]


def test_a_server_dying_midway_leaves_the_rest_to_the_next_source(
    hub: HubServer, store, physics, capfd
):
    hub.fail("GET", HAND, die, times=1)
    ensure(physics, store, [HubSource(), InstalledPackage(MANI_SKILL)])
    assert_all_verified(store, physics)
    said = capfd.readouterr().err
    assert "Hugging Face Hub" in said
    assert "installed mani_skill" in said


def test_a_hub_that_never_answers_is_waited_for_once(store, physics, monkeypatch):
    with socket.create_server(("127.0.0.1", 0), backlog=64) as black_hole:
        monkeypatch.setenv("HF_ENDPOINT", f"http://127.0.0.1:{black_hole.getsockname()[1]}")
        start = time.monotonic()
        with pytest.raises(AssetError, match="ReadTimeout: timed out"):
            fetch_from_hub(store, physics)
        assert time.monotonic() - start < 3 * constants.HF_HUB_ETAG_TIMEOUT


@pytest.mark.long
def test_a_download_that_stalls_ends_after_the_clients_retries(hub: HubServer, store, physics):
    hub.fail("GET", HAND, stall(threading.Event()))
    with pytest.raises(AssetError, match=r"hand\.stl: ReadTimeout: timed out"):
        fetch_from_hub(store, physics)


def test_offline_mode_of_the_hub_client_is_respected(hub, store, physics, monkeypatch):
    monkeypatch.setattr(constants, "HF_HUB_OFFLINE", True)
    with pytest.raises(AssetError, match="offline mode is enabled"):
        fetch_from_hub(store, physics)
    assert hub.requests == []


def test_a_read_only_cache_of_the_hub_is_a_reason_to_go_on(
    hub, store, physics, monkeypatch, read_only_folder, capfd
):
    monkeypatch.setattr(constants, "HF_HUB_CACHE", str(read_only_folder))
    ensure(physics, store, [HubSource(), InstalledPackage(MANI_SKILL)])
    assert_all_verified(store, physics)
    assert "the Hub's cache cannot be written" in capfd.readouterr().err


def test_a_full_cache_of_the_hub_is_named(hub, store, physics, monkeypatch):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (12_000, before[1]))
    try:
        with pytest.raises(AssetError, match="the Hub's cache cannot be written: File too large"):
            fetch_from_hub(store, physics)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_pictures_come_from_the_hub_too(hub, store):
    files = [file for file in PANDA.files if file.path.endswith("finger.glb")]
    assert files
    fetch_from_hub(store, files)
    assert_all_verified(store, files)
