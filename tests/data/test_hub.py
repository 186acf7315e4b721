"""Data sets on the Hub: the client of huggingface_hub against a server of the tests' own."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from robot_layouts.__main__ import main
from robot_layouts.data.export.described import Described, describe, licence_for, parts_of
from robot_layouts.data.reading import hub as hub_reading
from robot_layouts.data.reading.hub import HubError, local_place
from robot_layouts.data.reading.recording import Recording
from tests.data.recordings import record
from tests.data.writable_hub import TOKEN
from tests.robots.hub_server import page, status

TASK, NAME = "PushT-v1", "lab/pushes"


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data") / "recording"
    folder.mkdir()
    record(folder / "trajectory.h5", TASK, [3, 2])
    return folder


def push(*words: object) -> int:
    return main(["data", "push", *map(str, words)])


def export(recording: object, *words: object) -> int:
    return main(["export", str(recording), "--include-failures", *map(str, words)])


def contents(folder: Path) -> dict[str, bytes]:
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def test_a_recording_comes_back_with_the_same_bytes(hub, recording, capsys):
    assert push(recording, NAME) == 0
    commit = hub.repositories[NAME].head
    assert capsys.readouterr().out == f"hub:{NAME}@{commit}: recording, 3 files\n"
    pulled = contents(local_place(f"hub:{NAME}"))
    assert pulled == contents(recording)
    assert main(["replay", f"hub:{NAME}@{commit}"]) == 0
    assert "in 2 all states are equal" in capsys.readouterr().out
    with Recording(f"hub:{NAME}") as there, Recording(recording) as here:
        assert len(there) == 2
        assert (there[1].actions == here[1].actions).all()


def test_the_card_says_what_it_is_and_how_to_play_it_again(hub, recording):
    assert push(recording, NAME, "--licence", "cc-by-4.0") == 0
    card = hub.repositories[NAME].commits[hub.repositories[NAME].head]["README.md"].decode()
    for words in (
        "license: cc-by-4.0\n",
        "A recording of the task `PushT-v1`: 2 episodes, 5 steps.",
        "| control mode | `pd_joint_delta_pos` |",
        "| arm | `panda_stick` | -0.615, 0, 0 |",
        f"$ robot-layouts replay hub:{NAME}\n",
        "- panda_stick (arm): CC BY-NC 4.0 (",
        "| made with | robot-layouts ",
    ):
        assert words in card


@pytest.mark.parametrize(("form", "shown"), [("lerobot", "LeRobot"), ("robomimic", "robomimic")])
def test_an_export_is_pushed_as_it_is_written(hub, recording, tmp_path, capsys, form, shown):
    out = tmp_path / "out"
    words = ("--format", form, "--out", out, "--push-to-hub", NAME, "--private")
    assert export(recording, *words) == 0
    assert f": {shown}, " in capsys.readouterr().out
    repository = hub.repositories[NAME]
    there = dict(repository.commits[repository.head])
    card = there.pop("README.md").decode()
    del there[".gitattributes"]
    assert there == contents(out)
    assert f"A {shown} dataset of the task `PushT-v1`: 2 episodes, 5 steps." in card
    assert repository.tags == ({"v3.0": repository.head} if form == "lerobot" else {})
    assert describe(out).layout.keys() == {"arm"}


def test_an_export_of_a_recording_on_the_hub_is_the_same(hub, recording, tmp_path):
    assert push(recording, NAME) == 0
    for name, where in (("a", recording), ("b", f"hub:{NAME}")):
        assert export(where, "--format", "lerobot", "--out", tmp_path / name) == 0
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


@pytest.mark.long  # a process of its own
def test_a_push_that_was_killed_goes_on(hub, recording, tmp_path):
    """A process is killed when one of two large files has arrived; the other is then sent alone."""
    out = tmp_path / "out"
    assert export(recording, "--format", "lerobot", "--out", out) == 0
    large = [name for name in contents(out) if name.endswith(".parquet")]
    hub.stop_after = 1
    words = [sys.executable, "-m", "robot_layouts", "data", "push", str(out), NAME]
    process = subprocess.Popen(words, stderr=subprocess.PIPE)
    assert hub.reached.wait(60)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    repository = hub.repositories[NAME]
    assert set(repository.commits[repository.head]) == {".gitattributes"}  # nothing half-done
    hub.stop_after = None
    assert push(out, NAME) == 0
    sent = hub.uploads()
    assert len(sent) == len(set(sent)) == len(large)


def test_the_same_data_set_is_pushed_twice(hub, recording):
    assert push(recording, NAME) == push(recording, NAME) == 0
    assert len(hub.uploads()) == 1


def test_files_of_another_data_set_stay(hub, recording, capsys):
    assert push(recording, NAME) == 0
    repository = hub.repositories[NAME]
    repository.commit({"data/other.parquet": b"precious"})
    assert push(recording, NAME) == 1
    assert "holds files that this data set lacks (data/other.parquet)" in capsys.readouterr().err
    assert repository.commits[repository.head] == {"data/other.parquet": b"precious"}


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (status(401), "access refused (401)"),
        (status(403), "access refused (403): the token may not do this"),
        (status(500), "HTTP error 500"),
        (page(400, f"<p>bad token {TOKEN}</p>"), "HTTP error 400"),
    ],
)
def test_the_hub_refuses_and_the_token_stays_secret(hub, recording, capfd, fault, words):
    hub.fail("POST", "/api/repos/create", fault)
    assert push(recording, NAME) == 1
    said = capfd.readouterr()
    assert f"cannot push to {NAME}: {words}" in said.err
    assert TOKEN not in said.out + said.err


def test_without_a_token_nothing_is_asked(hub, recording, monkeypatch, capsys):
    monkeypatch.delenv("HF_TOKEN")
    assert push(recording, NAME) == 1
    assert "pushing needs a token" in capsys.readouterr().err
    assert hub.requests == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["pushes"], "'pushes' is no name on the Hub; it must be OWNER/NAME"),
        ([f"{NAME}@main"], "names a revision"),
        ([NAME, "--licence", "CC BY"], "the licence is 'CC BY'"),
    ],
)
def test_a_wrong_name_is_refused(hub, recording, capsys, words, message):
    assert push(recording, *words) == 1
    assert message in capsys.readouterr().err
    assert hub.requests == []


def test_an_export_is_no_recording(hub, recording, tmp_path, capsys):
    words = ("--format", "lerobot", "--out", tmp_path / "out", "--push-to-hub", NAME)
    assert export(recording, *words) == 0
    assert main(["replay", f"hub:{NAME}"]) == 1
    assert f"hub:{NAME} holds no recording" in capsys.readouterr().err


def test_what_was_read_once_is_read_without_the_hub(hub, recording, monkeypatch):
    assert push(recording, NAME) == 0
    first = local_place(f"hub:{NAME}")
    hub_reading._downloaded.cache_clear()
    hub.dead = True
    hub.fail("GET", "/", status(500))
    assert local_place(f"hub:{NAME}@{first.name}") == first


def test_it_is_certified_merged_and_reported_where_it_is_named(hub, recording, tmp_path, capsys):
    other = tmp_path / "other"
    other.mkdir()
    record(other / "trajectory.h5", TASK, [2], first=20)
    assert push(recording, NAME) == push(other, "lab/others") == 0
    name, certificate = f"hub:{NAME}", tmp_path / "certificate.json"
    assert main(["certify", name, "--workers", "0", "--out", str(certificate)]) == 0
    page = tmp_path / "page.html"
    shown = ["--clips", "0", "--clearances", "0", "--out", str(page)]
    assert main(["report", name, *shown]) == 0
    assert f"<title>{name}</title>" in page.read_text()
    merged = str(tmp_path / "merged")
    assert main(["merge", name, "hub:lab/others", "--out", merged]) == 0
    with Recording(merged) as file:
        assert file.seeds == (10, 11, 20)


def test_a_certificate_needs_a_place(hub, recording, capsys, tmp_path):
    assert push(recording, NAME) == 0
    assert main(["certify", f"hub:{NAME}", "--workers", "0"]) == 1
    assert f"hub:{NAME} has no room for its certificate; say where" in capsys.readouterr().err


def test_a_recording_with_pictures_is_refused_under_a_free_licence(
    hub, recording, tmp_path, capsys
):
    folder = tmp_path / "seen"
    shutil.copytree(recording, folder)
    about = json.loads((folder / "trajectory.json").read_text())
    about["env_info"]["env_kwargs"]["obs_mode"] = "rgb"
    (folder / "trajectory.json").write_text(json.dumps(about))
    assert push(folder, NAME, "--licence", "mit") == 1
    said = capsys.readouterr().err
    assert "(observations (rgb)) show panda_stick (arm), CC BY-NC 4.0, table and floor" in said
    assert hub.requests == []
    assert push(folder, NAME) == 0
    repository = hub.repositories[NAME]
    assert b"license: cc-by-nc-4.0\n" in repository.commits[repository.head]["README.md"]


def described(pictures: tuple[str, ...], robot: str = "panda", task: str = TASK) -> Described:
    layout = {"agent": {"robot": robot}}
    about = {"control_mode": "pd_joint_pos", "episodes": 1, "steps": 1, "sources": ()}
    return Described(
        "LeRobot", {}, task_id=task, layout=layout, pictures=pictures, version="v3.0", **about
    )


def test_pictures_of_what_a_task_is_made_of_name_its_licence():
    about = described(("image",), task="FMBAssembly1Easy-v1")
    names = {part.name: part.licence for part in parts_of(about)}
    assert names["bodies of FMBAssembly1Easy-v1"] == "CC BY-NC 4.0"
    assert "bodies of FMBAssembly1Easy-v1" not in {
        part.name for part in parts_of(described((), task="FMBAssembly1Easy-v1"))
    }


def test_numbers_may_be_shared_as_one_likes_and_pictures_of_meshes_as_those_may():
    assert licence_for(described(()), None) is None
    assert licence_for(described(()), "mit") == "mit"
    assert licence_for(described(("base_camera",)), None) == "cc-by-nc-4.0"
    hand = described(("base_camera",), "fixed_inspire_hand_left")
    assert licence_for(hand, None) == "cc-by-nc-sa-4.0"
    with pytest.raises(HubError, match=r"may not be shared under mit, but under cc-by-nc-4\.0"):
        licence_for(described(("base_camera",)), "mit")
    with pytest.raises(HubError, match=r"under cc-by-nc-4\.0, but under cc-by-nc-sa-4\.0"):
        licence_for(hand, "cc-by-nc-4.0")


@pytest.mark.parametrize(
    "data", [described(("base_camera",), "my_robot"), described(("base_camera",), task="Mine-v1")]
)
def test_pictures_of_files_of_ones_own_need_a_word_of_their_author(data):
    with pytest.raises(HubError, match="whose licence is not known here; if you may share"):
        licence_for(data, None)
    assert licence_for(data, "cc-by-nc-4.0") == "cc-by-nc-4.0"
