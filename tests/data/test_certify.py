"""A certificate says whether every bit of every episode comes back, and whether arms touched."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import tasks
from layouts import face_to_face
from robot_layouts.__main__ import main
from robot_layouts.data.dataset.certificate import RecordingCertificate, certify, sentences
from robot_layouts.data.playing.executor import InProcessExecutor
from robot_layouts.data.playing.replay import first_difference
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording.recorder import Recorder
from robots import RecordingError
from tasks.episode import play
from tests.data.recordings import edited
from tests.data.test_recorder import short_episode

COUNT = 6


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    env = tasks.make("PushT-v1")
    path = tmp_path_factory.mktemp("recorded") / "trajectory.h5"
    with Recorder(path, env, file_size=0.02) as recorder:
        for seed in range(COUNT):
            recorder.add(short_episode(env, seed))
    return path.parent


@pytest.fixture
def copy(recorded, tmp_path) -> Path:
    return Path(shutil.copytree(recorded, tmp_path / "copy"))


def read(folder: Path) -> dict:
    return json.loads((folder / "certificate.json").read_text())


@pytest.mark.long
def test_other_processes_certify_the_same_as_this_one(copy, tmp_path, capsys):
    assert main(["certify", str(copy), "--workers=1"]) == 0
    assert f"{COUNT} of {COUNT} episodes equal to the last bit" in capsys.readouterr().out
    here = tmp_path / "here.json"
    assert main(["certify", str(copy), "--workers=0", f"--out={here}"]) == 0
    assert here.read_bytes() == (copy / "certificate.json").read_bytes()
    about = read(copy)
    assert about["holds"]
    assert about["checked"] == [[0, COUNT - 1]]
    assert about["steps"] == 3 * COUNT
    assert about["arm_contacts"] == {"episodes": 0, "steps": 0, "pairs": {}, "touching": []}
    assert [file["file"] for file in about["files"]][:3] == [
        *("trajectory.h5", "trajectory.json", "trajectory_0001.h5")
    ]
    assert about["versions"]["sapien"]


def test_the_first_difference_is_named(copy, capsys):
    file = copy / "trajectory.h5"
    with edited(file) as opened:
        tee = opened["traj_1/env_states/actors/Tee"]
        rows = tee[:]
        rows.view(np.uint32)[2, 0] ^= 1  # the last bit
        tee[...] = rows
        opened["traj_0/rewards"][1] += 1
    assert main(["certify", str(file), "--workers=0"]) == 1
    assert "first difference: seed 0, step 2 in rewards" in capsys.readouterr().out
    about = json.loads((copy / "trajectory.certificate.json").read_text())
    assert about["complete"]
    assert not about["holds"]
    assert about["differing"] == [
        {"seed": 0, "step": 2, "array": "rewards"},
        {"seed": 1, "step": 2, "array": "env_states/actors/Tee"},
    ]


def test_a_zero_of_another_sign_is_a_difference(recorded):
    env = tasks.make("PushT-v1")
    with Recording(recorded) as file:
        episode = file[0]
    played = play(env, 0, episode.actions)
    assert first_difference(episode, played) is None
    speeds = played.states["actors"]["Tee"]
    speeds[0, 10] = -0.0
    assert str(first_difference(episode, played)) == "at the start in Tee, max |Δ| 0.0e+00"


def test_a_damaged_episode_does_not_hide_the_others(copy):
    file = copy / "trajectory.h5"
    with edited(file) as opened:
        opened["traj_1/actions"][0, 0] = np.nan
    found = certify(file, InProcessExecutor())
    assert [entry["seed"] for entry in found.not_played] == [1]
    assert "not all finite" in found.not_played[0]["reason"]
    assert found.complete
    assert found.equal == found.episodes - 1


def test_files_that_are_not_as_the_manifest_says(copy):
    with edited(copy / "trajectory_0001.h5"):
        pass
    with pytest.raises(TrajectoryError, match=r"trajectory_0001\.h5 or its json was changed"):
        certify(copy, InProcessExecutor())
    assert not (copy / "certificate.json").exists()


class Interrupted(InProcessExecutor):
    """Is interrupted after so many episodes, and remembers which were asked for."""

    def __init__(self, after: int) -> None:
        self.after, self.asked = after, list[int]()

    def run(self, prepare, seeds):
        self.asked = list(seeds)
        for number, event in enumerate(super().run(prepare, seeds)):
            if number == self.after:
                raise KeyboardInterrupt
            yield event


def test_it_goes_on_where_it_was_interrupted(copy, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        certify(copy, Interrupted(2))
    assert read(copy)["checked"] == [[0, 1]]
    rest = Interrupted(COUNT)
    assert certify(copy, rest).holds
    assert rest.asked == [2, 3, 4, 5]
    straight = certify(copy, InProcessExecutor(), tmp_path / "straight.json")
    assert straight.to_json() == read(copy)
    again = Interrupted(COUNT)
    certify(copy, again)  # a complete one is begun anew
    assert again.asked == list(range(COUNT))


def test_something_else_in_the_place_of_the_certificate_stays(copy):
    (copy / "certificate.json").write_text('{"mine": 1}')
    with pytest.raises(RecordingError, match="is no certificate: it has no format"):
        certify(copy, InProcessExecutor())
    assert read(copy) == {"mine": 1}


def test_a_certificate_of_more_than_there_is(copy):
    certify(copy, InProcessExecutor())
    about = read(copy)
    about["checked"] = [[0, 2**32 - 1]]
    (copy / "certificate.json").write_text(json.dumps(about))
    with pytest.raises(RecordingError, match="it checked more than there is"):
        certify(copy, InProcessExecutor())


def test_arms_that_touch_are_counted(tmp_path):
    near = face_to_face({"left": "panda_wristcam", "right": "panda_wristcam"}, spacing=1.26)  # m
    env = tasks.make("TwoRobotPickCube-v1", layout=near, check_layout=False, obs_mode="none")
    path = tmp_path / "trajectory.h5"
    with Recorder(path, env) as recorder:
        recorder.add(play(env, 0, np.zeros((3, 16), np.float32)))
    found = certify(path, InProcessExecutor())
    assert found.holds
    assert found.arm_contacts.episodes == 1
    assert found.arm_contacts.steps == 3
    assert found.arm_contacts.touching == [{"seed": 0, "success": False, "steps": 3}]
    assert sentences(found)[1].endswith("; seeds 0 (no success)")
    assert all("left." in pair and "right." in pair for pair in found.arm_contacts.pairs)
    assert RecordingCertificate.read(path.with_suffix(".certificate.json")) == found
