"""Receipts of policies that see: a digest of every picture, and where the first other one is."""

import io
import json
from base64 import b64decode, b64encode
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
import torch

import tasks
from robot_layouts.__main__ import main
from robot_layouts.data import evaluate
from robot_layouts.data.playing.evaluation_job import PictureTrace
from robot_layouts.data.receipts import Receipt, ReceiptError
from robot_layouts.data.receipts.pictures import kept, pictures_folder
from robot_layouts.data.receipts.provenance import describe_making
from robot_layouts.simulation.sapien3 import studio
from robots import TaskError
from tasks.episode import REBUILT
from tasks.registry import scenario_of
from tests.data.receipt_files import again, edit, written

pytestmark = pytest.mark.usefixtures("renderer")

TASK = "PickCube-v1"
MAKING = {
    "robots": {"arm": "panda_wristcam"},
    "obs_mode": "rgb+segmentation",
    "camera_size": (24, 16),
    "max_episode_steps": 5,
}
NAMES = [f"{c}/{t}" for c in ("base_camera", "hand_camera") for t in ("rgb", "segmentation")]


def looks(obs):
    """Go by the brightness of what the hand sees."""
    bright = obs["sensor_data"]["hand_camera"]["rgb"].float().mean() / 255
    return torch.full((1, 8), float(bright) - 0.3)


def plan(obs):
    """Go by nothing that is seen."""
    return torch.full((1, 8), 0.2)


def seen(tmp_path, name="receipt.json", policy=looks, **details) -> Path:
    details = {"seeds": range(2), **MAKING, **details}
    return written(tmp_path, name, policy=policy, task=TASK, **details)


@pytest.fixture(scope="module")
def receipt(tmp_path_factory, renderer) -> Path:
    return seen(tmp_path_factory.mktemp("receipt"), keep_pictures=True)


def test_the_digests_are_those_of_what_is_observed(receipt):
    env = tasks.make(TASK, **MAKING)
    obs, _ = env.reset(1, options=REBUILT)
    digests = {name: [] for name in NAMES}
    for step in range(6):
        for name in NAMES:
            camera, texture = name.split("/")
            image = obs["sensor_data"][camera][texture][0].numpy()
            about = f"{image.dtype.str} {image.shape}\n".encode()
            digests[name].append(sha256(about + image.tobytes()).digest())
        if step < 5:
            obs, *_ = env.step(looks(obs))
    recorded = Receipt.read(receipt).episodes[1]
    assert list(recorded.pictures) == NAMES
    for name, every in digests.items():
        assert recorded.pictures[name]["pictures"] == sha256(b"".join(every)).hexdigest()
        assert b64decode(recorded.pictures[name]["trace"]) == b"".join(d[:2] for d in every)


def test_what_is_equal_and_on_what_it_was_drawn(receipt):
    found = again(receipt, policy=looks)
    assert found.equal
    assert found.differences == found.changed == ()
    assert found.images == {0: {}, 1: {}}
    graphics = Receipt.read(receipt).environment["graphics"]
    assert graphics["device"]
    assert graphics["driver"] != "unknown"
    assert graphics["device"] != "cpu"
    assert int(graphics["threads"]) >= 0
    files = Receipt.read(receipt).making["layout"]["arm"]["files"]
    assert any("visual" in file for file in files)


@pytest.mark.parametrize(
    "who", [{"num_envs": 2}, pytest.param({"workers": 2}, marks=pytest.mark.long)], ids=str
)
def test_who_plays_makes_no_difference(receipt, tmp_path, who):
    other = Receipt.read(seen(tmp_path, policy="tests.data.test_picture_receipts:looks", **who))
    assert other.episodes == Receipt.read(receipt).episodes


def test_pictures_of_each_so_many_th_step(receipt, tmp_path):
    rare = Receipt.read(seen(tmp_path, picture_interval=2, seeds=[0]))
    every = Receipt.read(receipt)
    assert rare.pictures == {"interval": 2}
    for name in NAMES:
        expected = every.episodes[0].picture_digests()[name][::2]
        assert np.array_equal(rare.episodes[0].picture_digests()[name], expected)
    assert again(rare, policy=looks).equal
    assert rare.hash != every.hash


@pytest.mark.long
def test_an_expert_whose_plan_was_rehearsed(tmp_path):
    path = seen(tmp_path, policy="expert", seeds=[0], max_episode_steps=None)
    recorded = Receipt.read(path)
    assert recorded.episodes[0].success
    assert len(recorded.episodes[0].picture_digests()[NAMES[0]]) == recorded.episodes[0].steps + 1
    assert again(path).equal


def test_other_light_is_found_and_shown(tmp_path, monkeypatch):
    """The states are the same: a plan does not see. Of a kept file that is damaged nothing is."""
    path = seen(tmp_path, policy=plan, keep_pictures=True)
    monkeypatch.setattr(studio, "SKY", (0.3, 0.3, 0.35))
    found = again(path, policy=plan)
    assert not found.equal
    difference = found.differences[0]
    assert difference.step is None
    assert [one.name for one in difference.pictures] == ["base_camera/rgb", "hand_camera/rgb"]
    assert all(one.step == 0 for one in difference.pictures)
    counts = "pictures base_camera/rgb differ, first after the reset (6 of 6)"
    assert f"seed 0: states are the same; {counts}; " in str(found)
    files = found.write_pictures(tmp_path / "out", pictures_folder(path))
    assert [file.name for file in files] == [
        f"seed_{seed}_step_0_{camera}_rgb.png"
        for seed in (0, 1)
        for camera in ("base_camera", "hand_camera")
    ]
    image = _read(files[0])
    assert image.shape == (16, 3 * 24, 3)
    then, now, different = np.split(image, 3, axis=1)
    assert np.array_equal(now, difference.pictures[0].here)
    assert np.array_equal((then != now).any(-1), different[..., 0] == 255)
    assert (then != now).any()
    kept_of_first = next(pictures_folder(path).glob("seed_0*"))
    kept_of_first.write_bytes(kept_of_first.read_bytes()[:-100])
    shown = found.write_pictures(tmp_path / "alone", pictures_folder(path))
    assert [_read(one).shape[1] for one in shown] == [24, 24, 3 * 24, 3 * 24]


def test_the_step_of_the_first_picture_that_differs(receipt, tmp_path, capsys):
    """Of a receipt whose picture after step 3 is another; others' pictures are not shown."""

    def change(about):
        trace = bytearray(b64decode(about["episodes"][1]["pictures"]["hand_camera/rgb"]["trace"]))
        trace[6] ^= 1
        text = b64encode(trace).decode()
        about["episodes"][1]["pictures"]["hand_camera/rgb"] = {"pictures": "0" * 64, "trace": text}

    path = tmp_path / "changed.json"
    path.write_bytes(receipt.read_bytes())
    pictures_folder(receipt).rename(pictures_folder(path))
    try:
        words = ["verify", str(edit(path, change)), "--workers=0"]
        assert main([*words, "--policy=tests.data.test_picture_receipts:looks"]) == 1
    finally:
        pictures_folder(path).rename(pictures_folder(receipt))
    printed = capsys.readouterr().out
    assert (
        "seed 1: states are the same; pictures hand_camera/rgb differ, first after step 3 (1 of 6)"
        in (printed)
    )
    file = tmp_path / "changed.differences" / "seed_1_step_3_hand_camera_rgb.png"
    assert printed.endswith(f"{file}\n")
    assert _read(file).shape == (16, 24, 3)  # alone


def test_a_kept_file_that_claims_more_than_it_holds_is_not_shown(tmp_path):
    header = io.BytesIO()
    claim = {"descr": "|u1", "fortran_order": False, "shape": (10**7, 10**7)}
    np.lib.format.write_array_header_1_0(header, claim)
    with ZipFile(tmp_path / "seed_0.npz", "w") as file:
        file.writestr("camera/rgb.npy", header.getvalue())
    assert kept(tmp_path, 0, "camera/rgb", PictureTrace("", "")) is None


def test_points_have_digests_too(tmp_path):
    recorded = Receipt.read(seen(tmp_path, policy=plan, seeds=[0], obs_mode="pointcloud"))
    assert set(recorded.episodes[0].pictures) == {
        f"pointcloud/{part}" for part in ("xyzw", "rgb", "segmentation")
    }


def test_a_receipt_of_before_pictures_had_digests(receipt):
    """It holds none, nor the files of what is drawn."""
    now = Receipt.read(receipt)
    cls, scenario = scenario_of(TASK, 1, **MAKING)
    before = replace(
        now,
        making=describe_making(cls, scenario),
        pictures={},
        episodes=tuple(replace(episode, pictures={}) for episode in now.episodes),
        claimed="",
    )
    found = again(before, policy=looks)
    assert found.equal
    assert not found.here.pictures


def test_the_format_says_whether_there_are_digests_of_pictures(receipt, tmp_path):
    assert json.loads(receipt.read_text())["format"] == "robot-layouts receipt 2"
    state = written(tmp_path, policy=plan, seeds=[0], task=TASK)
    about = json.loads(state.read_text())
    assert about["format"] == "robot-layouts receipt 1"
    assert "pictures" not in about
    assert "pictures" not in about["episodes"][0]
    assert "graphics" not in about["environment"]


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda r: r.update(pictures={"interval": 0}), "interval is 0; it must be a whole number"),
        (
            lambda r: r.update(pictures={"interval": 2}),
            "must be 6 bytes in base64, 2 for each of 3",
        ),
        (lambda r: r.pop("pictures"), 'the receipt does not say of which; "pictures" must say'),
        (
            lambda r: r["episodes"][0]["pictures"].update(x={"pictures": "0" * 64, "trace": "?"}),
            "the trace of its pictures x must be 12 bytes",
        ),
        (lambda r: r["episodes"][0].update(pictures=[1]), "pictures is .*; it must be an object"),
    ],
)
def test_a_receipt_of_somebody_else(receipt, tmp_path, change, complaint):
    path = tmp_path / "receipt.json"
    path.write_bytes(receipt.read_bytes())
    with pytest.raises(ReceiptError, match=complaint):
        Receipt.read(edit(path, change))


def test_what_cannot_be_kept(tmp_path):
    with pytest.raises(TaskError, match="pictures belong to a receipt"):
        evaluate(plan, TASK, [0], workers=0, keep_pictures=True)
    with pytest.raises(TaskError, match="picture_interval is 0"):
        seen(tmp_path, picture_interval=0)
    with pytest.raises(TaskError, match="obs_mode 'state' observes no pictures"):
        seen(tmp_path, obs_mode="state", keep_pictures=True)
    assert not list(tmp_path.iterdir())


def _read(path):
    from PIL import Image

    return np.asarray(Image.open(path))
