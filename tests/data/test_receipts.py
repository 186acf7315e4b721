"""A receipt is the same whoever plays, and holds all that it takes to play again."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
import sapien

import tasks
from robot_layouts.core.errors import UnwritableFileError
from robot_layouts.data import Evaluation, evaluate
from robot_layouts.data.receipts import Receipt, ReceiptError
from robot_layouts.data.receipts.provenance import describe_making, make_again
from robot_layouts.simulation import Camera
from robots import TaskError
from tasks.engine.cameras import cameras_of, configured
from tasks.episode import REBUILT
from tasks.registry import make_scenario
from tests.data.policies import LEANS, TASK, Leans, Wanders
from tests.data.receipt_files import NAMED, again, written

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def receipt(tmp_path_factory) -> Path:
    return written(tmp_path_factory.mktemp("receipt"))


def test_the_states_are_those_of_the_state_dict(receipt):
    """Every byte of every entry after the reset and each step, played here by hand."""
    env = tasks.make(TASK, max_episode_steps=10)
    recorded = Receipt.read(receipt).episodes[1]
    obs, _ = env.reset(1, options=REBUILT)
    digest, kept, over = sha256(), [], None
    while over is None or not over:
        entries = {
            f"{kind}/{name}": rows[0].numpy()
            for kind, by_name in env.get_state_dict().items()
            for name, rows in by_name.items()
        }
        if over is None:
            for name, row in sorted(entries.items()):
                digest.update(f"{name} {row.dtype.str} {row.shape}\n".encode())
        for _, row in sorted(entries.items()):
            digest.update(row.tobytes())
        kept.append(digest.digest()[:2])
        if len(kept) <= 10:
            obs, _, terminated, truncated, _ = env.step(LEANS(obs))
            over = False
        else:
            over = bool(terminated | truncated)
    assert len(kept) == 11
    assert recorded.states == digest.hexdigest()
    assert [row.tobytes() for row in recorded.digests()] == kept
    assert len({e.states for e in Receipt.read(receipt).episodes}) == 3


@pytest.mark.long
@pytest.mark.parametrize(
    "who", [{"workers": 1}, {"workers": 2}, {"num_envs": 4}, {"workers": 2, "num_envs": 2}], ids=str
)
def test_who_plays_makes_no_difference(tmp_path, who):
    """Not a byte, with a policy that draws from every generator and remembers."""
    alone = written(tmp_path, policy=Wanders(0.5), seeds=range(5))
    other = written(tmp_path, "other.json", policy=Wanders(0.5), seeds=range(5), **who)
    assert other.read_bytes() == alone.read_bytes()


def test_episodes_of_different_lengths_that_are_played_at_once(tmp_path):
    plays = {"policy": "expert", "seeds": range(3), "max_episode_steps": None}
    alone = written(tmp_path, task="PickCube-v1", **plays)
    assert len({episode.steps for episode in Receipt.read(alone).episodes}) > 1
    other = written(tmp_path, "other.json", task="PickCube-v1", num_envs=3, **plays)
    assert other.read_bytes() == alone.read_bytes()


def test_the_order_of_seeds_is_that_of_the_receipt(receipt, tmp_path):
    turned = Receipt.read(written(tmp_path, seeds=[2, 0, 1], workers=1))
    assert [episode.seed for episode in turned.episodes] == [2, 0, 1]
    assert set(turned.episodes) == set(Receipt.read(receipt).episodes)


@pytest.mark.long
def test_threads_of_the_processor_make_no_difference(tmp_path):
    """Experts plan with matrices, which libraries share among threads."""
    for threads in ("1", "2"):
        words = ["evaluate", "--task=PickCube-v1", "--episodes=2", "--workers=1"]
        subprocess.run(
            [sys.executable, "-m", "robot_layouts", *words, f"--receipt={tmp_path / threads}.json"],
            cwd=ROOT,
            env={**os.environ, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads},
            check=True,
            capture_output=True,
        )
    assert (tmp_path / "1.json").read_bytes() == (tmp_path / "2.json").read_bytes()
    assert again(tmp_path / "2.json").equal


def test_scores_with_and_without_a_receipt_are_the_same(tmp_path):
    without = evaluate(Wanders(), TASK, [3, 4], workers=0)
    found = evaluate(Wanders(), TASK, [3, 4], workers=0, receipt=tmp_path / "there" / "one.json")
    assert isinstance(found, Evaluation)
    assert found == without
    assert without.receipt is None
    assert found.receipt == Receipt.read(tmp_path / "there" / "one.json")
    assert found.receipt.success_rate == found.success_rate
    assert [e.total for e in found.receipt.episodes] == list(found.returns.values())


def test_what_is_equal(receipt):
    found = again(receipt, policy=NAMED, num_envs=2)
    assert found.equal
    assert found.differences == found.changed == ()
    assert str(found) == "PushT-v1, tests.data.policies:LEANS: 3 of 3 episodes equal to the " + (
        "last bit"
    )
    assert found.here == Receipt.read(receipt)


@pytest.mark.long
def test_everything_that_a_task_is_made_with_comes_back(tmp_path):
    path = tmp_path / "receipt.json"
    ring = tasks.get_task_class("TwoRobotPickCube-v1").layout
    moved = replace(ring["right"], position=(0.8, 0.01, 0.0), qpos_noise=0.01)
    evaluate(
        "expert",
        "TwoRobotPickCube-v1",
        [0],
        workers=0,
        receipt=path,
        layout=type(ring)({**ring, "right": moved}),
        robots={"left": "panda"},
        control_mode={"left": "pd_joint_pos"},
        control_frequency=25.0,
        physics=tasks.PhysicsSettings(timestep=0.008, position_iterations=12),
        randomization=tasks.Randomization(mass={"cube": {"uniform": [0.5, 2.0]}}),
        reward_mode="sparse",
        max_episode_steps=30,
    )
    found = again(path)
    assert found.equal, str(found)
    making = Receipt.read(path).making
    assert making["layout"]["right"]["position"] == [0.8, 0.01, 0.0]
    assert making["control_mode"] == {"left": "pd_joint_pos"}
    assert making["randomization"] == {"mass": {"cube": {"uniform": [0.5, 2.0]}}}


def test_what_cameras_and_links_sense_comes_back():
    cls = tasks.get_task_class("TwoRobotPickCube-v1")
    configs = {
        "far": np.float32(50),
        "base_camera": {"pose": sapien.Pose([0.6, 0.0, 0.4], [0.0, -0.6, 0.0, 0.8])},
        "right.hand_camera": {"intrinsic": np.array([[80.0, 0, 48], [0, 80, 32], [0, 0, 1]])},
    }
    making = {"touch": {"left": True, "right": ("panda_hand",)}, "enable_shadow": True}
    camera = Camera((0.0, 0.0, 0.1), mount=("left", "panda_hand"), quaternion=(1.0, 0.0, 0.0, 0.0))
    scenario = make_scenario(cls, cameras=[camera], sensor_configs=configs, **making)
    written = json.loads(json.dumps(describe_making(cls, scenario)))
    back = make_scenario(cls, **make_again(written, {}, cls, {}))
    assert (back.touch, back.enable_shadow) == ({"left": True, "right": ["panda_hand"]}, True)
    assert [*back.cameras] == [camera]
    cameras = cameras_of(cls.layout, cls.cameras)
    made, again = (configured(cameras, s.sensor_configs, "") for s in (scenario, back))
    assert made == again != cameras
    plain = describe_making(cls, cls.scenario)
    assert not {"sensor_configs", "enable_shadow", "touch"} & set(plain)


def test_batched_policies_are_verified_as_many_at_once(tmp_path):
    path = written(tmp_path, policy=Leans(batched=True), num_envs=2)
    assert Receipt.read(path).making["num_envs"] == 2
    assert again(path, policy=Leans(batched=True)).equal
    assert "num_envs" not in Receipt.read(written(tmp_path, num_envs=2)).making


def test_no_place_for_a_receipt(tmp_path, monkeypatch):
    """It is said before anything is played."""
    calls = []
    with pytest.raises(UnwritableFileError, match=f"cannot write {tmp_path}: "):
        evaluate(calls.append, TASK, [0], workers=0, receipt=tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(UnwritableFileError, match="cannot write .*file/one.json: "):
        evaluate(calls.append, TASK, [0], workers=0, receipt=tmp_path / "file" / "one.json")
    assert calls == []


def test_files_of_a_policy_that_cannot_be_read(tmp_path):
    policy = Leans()
    policy.files = [tmp_path / "none.pt"]
    with pytest.raises(ReceiptError, match=r"names files that cannot be read: .*none.pt"):
        written(tmp_path, policy=policy)
    with pytest.raises(TaskError, match="it must be callable"):
        again(written(tmp_path), policy=5)
