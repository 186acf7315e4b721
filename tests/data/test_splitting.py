"""A recording goes on in further files, and these do not depend on who was first."""

import json
import os
import random
from contextlib import suppress
from pathlib import Path

import h5py
import pytest

import tasks
from robot_layouts.data.reading.json_files import manifest_path, matches, read_manifest, seeds_of
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording import recorder as recorders
from robot_layouts.data.recording.recorder import Recorder
from robots import RecordingError
from tests.data.kills import Kill, Killed
from tests.data.test_recorder import short_episode

SIZE = 0.03  # MB; four or five episodes of 3 steps
COUNT = 14


@pytest.fixture(scope="module")
def push_t():
    env = tasks.make("PushT-v1")
    return env, [short_episode(env, seed, 2 + seed % 3) for seed in range(COUNT)]


def write(path: Path, env, episodes, *, size: float = SIZE, expect=(), **how) -> Path:
    with Recorder(path, env, file_size=size, **how) as recorder:
        recorder.expect(expect)
        for episode in episodes:
            recorder.add(episode)
    return path


@pytest.fixture(scope="module")
def straight(push_t, tmp_path_factory) -> Path:
    return write(tmp_path_factory.mktemp("straight") / "trajectory.h5", *push_t)


def contents(path: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in sorted(path.parent.iterdir()) if p.is_file()}


def seeds_by_file(path: Path) -> list[tuple[int, ...]]:
    found = []
    for file in sorted(path.parent.glob("*.h5")):
        with Recording(file) as opened:
            found.append(opened.seeds)
            assert [episode.seed for episode in opened] == list(opened.seeds)
    return found


def test_each_file_is_a_recording_by_itself(straight):
    by_file = seeds_by_file(straight)
    assert len(by_file) >= 3
    assert [seed for seeds in by_file for seed in seeds] == list(range(COUNT))
    for number, file in enumerate(sorted(straight.parent.glob("*.h5"))):
        assert file.stat().st_size < 1.2 * SIZE * 1e6
        with h5py.File(file) as opened:
            assert opened.attrs.get("file_number", "0") == str(number)


def test_the_manifest_says_what_there_is(straight):
    manifest = read_manifest(straight)
    files = sorted(straight.parent.glob("*.h5"))
    assert all(matches(entry, p) for entry, p in zip(manifest.files, files, strict=True))
    assert [tuple(seeds_of(entry)) for entry in manifest.files] == seeds_by_file(straight)
    about = json.loads(manifest_path(straight).read_text())
    assert about["episodes"] == COUNT
    assert about["steps"] == sum(2 + seed % 3 for seed in range(COUNT))
    assert about["successes"] == 0


def test_what_fits_into_one_file_has_no_manifest(tmp_path, push_t):
    env, episodes = push_t
    path = write(tmp_path / "a" / "trajectory.h5", env, episodes, size=0.5)
    assert sorted(contents(path)) == ["trajectory.h5", "trajectory.json"]


def test_expected_episodes_may_come_in_any_order(tmp_path, push_t, straight):
    env, episodes = push_t
    crooked = random.Random(1).sample(episodes, COUNT)
    path = tmp_path / "trajectory.h5"
    with Recorder(path, env, file_size=SIZE) as recorder:
        recorder.expect(range(COUNT))
        most = 0
        for episode in crooked:
            recorder.add(episode)
            most = max(most, len(list(recorder.parts.iterdir())))
        assert len(recorder) == COUNT
        assert most < COUNT  # a full file does not wait for the end
    assert contents(path) == contents(straight)


def test_an_episode_that_does_not_come_keeps_nobody_waiting(tmp_path, push_t):
    env, episodes = push_t
    path = tmp_path / "trajectory.h5"
    with Recorder(path, env, file_size=SIZE) as recorder:
        recorder.expect(range(COUNT))
        recorder.give_up(0)
        for episode in episodes[1:]:
            recorder.add(episode)
        assert len(list(recorder.parts.iterdir())) < COUNT / 2
    assert sum(map(len, seeds_by_file(path))) == COUNT - 1


def test_files_are_the_same_however_often_it_was_interrupted(tmp_path, push_t, straight):
    env, episodes = push_t
    path = tmp_path / "trajectory.h5"
    for came in ([1, 2, 3, 4, 5, 6], [7, 0, 9, 8, 10, 12], [13, 11]):
        chosen = [episodes[seed] for seed in came]
        write(path, env, chosen, expect=range(COUNT), resume=True)
        assert not path.with_suffix(".parts").exists()
    assert contents(path) == contents(straight)


def test_full_files_are_not_read_again(tmp_path, push_t, straight, monkeypatch):
    env, _ = push_t
    path = copied(straight, tmp_path)
    looked: list[str] = []

    def read(file: Path):
        looked.append(file.name)
        return original(file)

    original = recorders.read_joined
    monkeypatch.setattr(recorders, "read_joined", read)
    Recorder(path, env, resume=True, file_size=SIZE).close()
    assert looked == [sorted(p.name for p in path.parent.glob("*.h5"))[-1]]
    assert contents(path) == contents(straight)


def copied(path: Path, folder: Path) -> Path:
    for name, content in contents(path).items():
        (folder / name).write_bytes(content)
    return folder / path.name


def test_a_damaged_episode_of_a_full_file_comes_back_to_its_place(tmp_path, push_t, straight):
    env, episodes = push_t
    path = copied(straight, tmp_path)
    with h5py.File(path, "r+") as file:
        file["traj_1/actions"][0] = 7
    with Recorder(path, env, resume=True, file_size=SIZE) as recorder:
        assert recorder.damaged == [f"traj_1 of {path}"]
        assert recorder.seeds == set(range(COUNT)) - {1}
    with Recorder(path, env, resume=True, file_size=SIZE) as recorder:
        recorder.add(episodes[1])
    assert contents(path) == contents(straight)


def test_a_file_that_is_gone_is_recorded_again(tmp_path, push_t, straight):
    env, episodes = push_t
    path = copied(straight, tmp_path)
    gone = tmp_path / "trajectory_0001.h5"
    lost = seeds_of(read_manifest(path).files[1])
    gone.unlink()
    with Recorder(path, env, resume=True, file_size=SIZE) as recorder:
        assert "trajectory_0001.h5 with its" in recorder.damaged[0]
        for seed in reversed(lost):
            recorder.add(episodes[seed])
    assert contents(path) == contents(straight)


@pytest.mark.parametrize("what", ["gone", "damaged", "another's"])
def test_a_manifest_that_is_lost_is_written_anew(tmp_path, push_t, straight, what):
    env, _ = push_t
    path = copied(straight, tmp_path)
    manifest = manifest_path(path)
    if what == "gone":
        manifest.unlink()
    elif what == "damaged":
        manifest.write_text("{")
    else:
        manifest.write_text(manifest.read_text().replace('"header": "', '"header": "0')[:-1])
    Recorder(path, env, resume=True, file_size=SIZE).close()
    assert contents(path) == contents(straight)


def test_another_recording_in_the_place_of_a_later_file_is_refused(tmp_path, push_t):
    env, episodes = push_t
    other = write(tmp_path / "run_0001.h5", env, episodes[:2])
    before = other.read_bytes()
    with pytest.raises(RecordingError, match=r"run_0001\.h5 is a recording of its own"):
        write(tmp_path / "run.h5", env, episodes)
    with pytest.raises(RecordingError, match=r"run_0001\.h5 is a recording of its own"):
        write(tmp_path / "run.h5", env, episodes, overwrite=True)
    assert other.read_bytes() == before


def test_overwriting_takes_all_files_away(tmp_path, push_t, straight):
    env, episodes = push_t
    path = copied(straight, tmp_path)
    with pytest.raises(RecordingError, match="is there already"):
        write(path, env, episodes)
    write(path, env, episodes[:2], overwrite=True)
    assert sorted(contents(path)) == ["trajectory.h5", "trajectory.json"]


@pytest.mark.long
def test_a_kill_at_any_moment_loses_nothing(tmp_path, push_t, straight, monkeypatch):
    """Stop at every change of the disk, as a kill would, while files fill up out of order."""
    env, episodes = push_t
    calls = [(os, "replace"), (Path, "unlink"), (Path, "rmdir"), (os, "fsync")]
    order = [*range(3, COUNT), 0, 1, 2]

    stops = 0
    while True:
        path = write(tmp_path / f"{stops}" / "trajectory.h5", env, [episodes[i] for i in order[:9]])
        first = {order[i] for i in range(9)}
        kill, kept = Kill(stops), set(first)
        with monkeypatch.context() as patch, suppress(Killed):
            recorder = Recorder(path, env, resume=True, file_size=SIZE)
            kill.watch(patch, calls)
            for i in order[9:]:
                recorder.add(episodes[i])
                kept.add(i)
            recorder.close()
        with suppress(UnboundLocalError):
            recorder._release()  # as the death of the process would
        with Recorder(path, env, resume=True, file_size=SIZE) as again:
            assert again.damaged == []
            assert kept <= again.seeds, f"after {stops} calls"
            for seed in set(range(COUNT)) - again.seeds:
                again.add(episodes[seed])
        listed = [seed for seeds in seeds_by_file(path) for seed in seeds]
        assert sorted(listed) == list(range(COUNT)), f"after {stops} calls"
        assert not again.parts.exists()
        if kill.remaining > 0:
            break
        stops += 1
    assert stops >= 20


def test_each_file_says_who_played_its_own_episodes(tmp_path, push_t):
    env, episodes = push_t
    path = tmp_path / "trajectory.h5"
    for who, part in (("ann", episodes[:7]), ("bob", episodes[7:])):
        write(path, env, part, resume=True, source="human", source_desc=who)
    said = []
    for file in sorted(tmp_path.glob("*.json")):
        about = json.loads(file.read_text())
        said += [(about["source_type"], about["source_desc"])] if "source_type" in about else []
    assert [said[0], said[1], said[-1]] == [
        ("human", "ann"),
        ("mixed", "ann; bob"),
        ("human", "bob"),
    ]
