"""A policy that another process serves acts as the same policy in this process does."""

import pickle
import re
from contextlib import closing

import numpy as np
import pytest

import tasks
from robot_layouts.__main__ import main
from robot_layouts.data import evaluate, record
from robot_layouts.data.playing.served.client import pack, unpack
from robot_layouts.data.playing.served.keys import PRESETS, Keys, load_keys, vla_eval
from robot_layouts.data.playing.served.policy import ServedPolicy
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.receipts import Receipt, ReceiptError, verify
from robot_layouts.simulation.rendering import vulkan_problem
from robots import TaskError, UnknownNameError
from tasks.description import instruction_of
from tests.data import policy_server
from tests.data.policy_server import server
from tests.data.served import ACTIONS, TASK, Replays, leans, session_action

SHORT = {"max_episode_steps": 10}
WRISTS = {"left": "panda_wristcam", "right": "panda_wristcam"}


@pytest.fixture(scope="module")
def leaning():
    with server("tests.data.served:leans_served") as address:
        yield address


@pytest.fixture(scope="module")
def chunks():
    with server("tests.data.served:Chunks") as address:
        yield address


def test_messages_are_those_of_msgpack_itself():
    message = {
        "a/b": np.arange(12, dtype=np.uint8).reshape(2, 2, 3),
        "state": np.array([np.pi, -0.0], np.float32),
        "deep": {"list": [1, 2.5, None, "words", True]},
        "none": np.zeros((0, 3)),
    }
    assert pack(message) == policy_server.pack(message)
    there = policy_server.unpack(pack(message))
    back = unpack(policy_server.pack({**there, "number": np.float32(0.5)}))
    assert back.pop("number") == 0.5
    assert pack(back) == pack(message)


def test_a_served_policy_scores_as_it_does_here(leaning):
    """Whether episodes are played at once or one after the other; the states are the same."""
    here = evaluate(leans, TASK, range(2), workers=0, **SHORT)
    served = evaluate(leaning, TASK, range(2), workers=0, **SHORT)
    assert served.scores == here.scores
    assert len(set(here.returns.values())) == 2
    assert evaluate(leaning, TASK, range(2), workers=0, num_envs=2, **SHORT).scores == here.scores
    assert len(served.waits) == 20
    assert not here.waits
    said = re.search(r"policy server: 20 answers, median (.*) ms, longest (.*) ms", repr(served))
    assert said is not None
    assert 0 < float(said[1]) <= float(said[2])
    assert served.policy == leaning


class SessionHere:
    """What `tests.data.served.Session` does, without a server."""

    def __init__(self):
        self.asked = 0

    def __call__(self, obs):
        self.asked += 1
        return session_action(obs["agent"]["qpos"][0].numpy(), self.asked)


def test_each_episode_is_a_session_of_a_model_server_of_vla_eval():
    """Also of episodes that are played at once, whose questions take turns."""
    making = {"workers": 0, "obs_mode": "state_dict", **SHORT}
    here = evaluate(SessionHere(), TASK, range(3), **making)
    assert len(set(here.returns.values())) == 3
    with server("tests.data.served:Session", "vla-eval") as address:
        for together in (1, 2):
            served = evaluate(address, TASK, range(3), num_envs=together, **making)
            assert served.scores == here.scores
        assert served.policy == address
        assert len(served.waits) == 30


def test_pictures_go_to_a_model_server_of_vla_eval_by_camera():
    with closing(tasks.make("TwoRobotPickCube-v1", obs_mode="state_dict", robots=WRISTS)) as env:
        assert [*vla_eval(env)["observation"]] == ["state", "task_description"]
    if vulkan_problem() is not None:
        pytest.skip(vulkan_problem())
    making = {"obs_mode": "rgb", "camera_size": (32, 24), "robots": WRISTS}
    with closing(tasks.make("TwoRobotPickCube-v1", **making)) as env:
        obs, _ = env.reset(seed=0)
        sent = Keys(vla_eval(env), env).sent(obs, 0)
        assert [*sent["images"]] == [*env.observer.cameras]
        for name, picture in sent["images"].items():
            assert np.array_equal(picture, obs["sensor_data"][name]["rgb"][0])
        assert sent["state"].shape == (16,)


@pytest.mark.long
def test_workers_have_a_connection_each(leaning):
    here = evaluate(leans, TASK, range(4), workers=0, **SHORT)
    assert evaluate(leaning, TASK, range(4), workers=2, **SHORT).scores == here.scores


@pytest.mark.long
def test_two_robots_pick_a_cube_as_a_server_tells_them(tmp_path, monkeypatch):
    """The server finds its actions by the observation's bits: none is lost on the way."""
    task, seeds = "TwoRobotPickCube-v1", range(3)
    plans = record(task, seeds, tmp_path / "plans", workers=0, obs_mode="state")
    monkeypatch.setenv("SERVED_RECORDING", str(plans.path))
    here = evaluate(Replays(plans.path), task, seeds, workers=0, receipt=tmp_path / "here.json")
    with server("tests.data.served:Replays") as address:
        served = evaluate(address, task, seeds, workers=0, receipt=tmp_path / "served.json")
    assert here.success_rate == 1
    assert served.receipt.episodes == here.receipt.episodes
    assert len(served.waits) == sum(-(-steps // Replays.CHUNK) for steps in here.lengths.values())


def test_the_whole_of_a_chunk_is_carried_out_or_its_first_steps(chunks, tmp_path):
    keys = tmp_path / "keys.yaml"
    keys.write_text("observation: {state: {entry: state}}\nsteps: 4\n")
    whole = record(TASK, [0], tmp_path / "whole", workers=0, policy=chunks, **SHORT)
    part = record(TASK, [0], tmp_path / "part", workers=0, policy=f"{chunks}#{keys}", **SHORT)
    for folder, steps in ((whole, 6), (part, 4)):
        with Recording(folder) as file:
            (episode,) = file
        asked = np.repeat([1, 2, 3], steps)[:10] / 100
        np.testing.assert_array_equal(
            episode.actions, np.tile(asked[:, None], ACTIONS).astype(np.float32)
        )


def test_recordings_and_receipts_name_the_server_without_its_secrets(leaning, tmp_path):
    secret = leaning.replace("://", "://me:secret@")
    folder = tmp_path / "recorded"
    assert "secret" not in repr(ServedPolicy(secret))
    summary = record(TASK, [0], folder, workers=0, policy=secret, **SHORT)
    assert "policy server: 10 answers, median" in str(summary)
    with Recording(folder) as file:
        assert file[0].source == {"kind": "policy", "name": leaning}
    file = tmp_path / "receipt.json"
    evaluate(secret, TASK, [0], workers=0, receipt=file, **SHORT)
    for path in (file, *folder.iterdir()):
        assert b"secret" not in path.read_bytes()
    policy = {"kind": "policy", "name": leaning, "sha256": None, "served": True}
    assert Receipt.read(file).policy == policy
    with pytest.raises(ReceiptError, match=f"a policy that {leaning} served, and nothing but that"):
        verify(file, workers=0)
    assert verify(file, workers=0, policy=leaning).equal


def test_the_command_says_how_long_the_server_took(leaning, tmp_path, capsys):
    words = ["--task", TASK, "--episodes", "1", "--workers", "0", "--policy", leaning]
    assert main(["evaluate", *words, "--receipt", str(tmp_path / "r.json")]) == 0
    out = capsys.readouterr().out
    assert "policy server: 100 answers, median" in out
    assert out.endswith("it cannot be verified without the policy's server\n")


KEYS = """\
observation:
  observation/state: {joints: [left.arm, left.gripper, right]}
  images:
    top: {camera: base_camera, order: chw}
    wrist: {camera: right.hand_camera}
  cube: {entry: extra/cube_pose}
  prompt: {text: instruction}
  language: {text: english}
actions: action
steps: 2
gripper: {closed: 1, open: 0}
control_mode: pd_joint_delta_pos
timeout: 5
"""


@pytest.fixture(scope="module")
def two_arms(renderer):
    env = tasks.make("TwoRobotPickCube-v1", obs_mode="rgb+state_dict")
    yield env
    env.close()


def test_keys_say_what_is_sent_and_what_actions_become(two_arms, tmp_path):
    file = tmp_path / "keys.yaml"
    file.write_text(KEYS)
    keys = Keys(load_keys(file), two_arms)
    observation, _ = two_arms.reset(seed=3)
    observation["agent"]["panda_wristcam-0"]["qpos"][0, 7:] = 0.01  # m, of 0.04
    sent = keys.sent(observation, 3)
    qpos = [observation["agent"][f"panda_wristcam-{i}"]["qpos"][0].numpy() for i in range(2)]
    fingers = [1 - q[7:8] / np.float32(0.04) for q in qpos]
    assert np.ravel(fingers) == pytest.approx([0.75, 0.0], abs=1e-6)
    expected = np.concatenate([qpos[0][:7], fingers[0], qpos[1][:7], fingers[1]])
    np.testing.assert_allclose(sent["observation/state"], expected, atol=1e-6)
    assert sent["observation/state"].dtype == np.float32
    pictures = observation["sensor_data"]
    top = pictures["base_camera"]["rgb"][0].numpy()
    np.testing.assert_array_equal(sent["images"]["top"], top.transpose(2, 0, 1))
    np.testing.assert_array_equal(
        sent["images"]["wrist"], pictures["panda_wristcam-1-hand_camera"]["rgb"][0].numpy()
    )
    np.testing.assert_array_equal(sent["cube"], observation["extra"]["cube_pose"][0])
    assert sent["prompt"] == instruction_of(two_arms.task_class)
    assert sent["language"] == "english"
    assert [*sent] == ["observation/state", "images", "cube", "prompt", "language"]
    chunk = np.tile(np.linspace(-0.5, 0.5, 16), (3, 1))
    chunk[0, 7], chunk[0, 15], chunk[1, 7] = 0.0, 1.0, 0.25
    actions = keys.carried_out(chunk)
    assert actions.shape == (2, 16)
    np.testing.assert_array_equal(actions[0, [7, 15]], [1.0, -1.0])
    assert actions[1, 7] == 0.5
    np.testing.assert_array_equal(actions[0, :7], chunk[0, :7].astype(np.float32))


def test_presets_are_the_conventions_of_openpi(two_arms):
    with pytest.raises(TaskError, match="the server's actions are pd_joint_pos, and the task take"):
        Keys(PRESETS["aloha"](two_arms), two_arms)
    with pytest.raises(TaskError, match="'droid' are of one robot; the task has left, right"):
        PRESETS["droid"](two_arms)
    observation, _ = two_arms.reset(seed=0)
    sent = Keys({**PRESETS["aloha"](two_arms), "control_mode": None}, two_arms).sent(observation, 0)
    assert sent["state"].shape == (16,)
    assert {name: image.shape for name, image in sent["images"].items()} == {
        name: (3, 128, 128) for name in ("cam_high", "cam_left_wrist", "cam_right_wrist")
    }
    env = tasks.make("PickCube-v1", robots={"arm": "panda_wristcam"}, obs_mode="rgb")
    observation, _ = env.reset(seed=0)
    sent = Keys(PRESETS["droid"](env), env).sent(observation, 0)
    assert {key: getattr(value, "shape", None) for key, value in sent.items()} == {
        "observation/exterior_image_1_left": (128, 128, 3),
        "observation/wrist_image_left": (128, 128, 3),
        "observation/joint_position": (7,),
        "observation/gripper_position": (1,),
        "prompt": None,
    }
    assert sent["observation/gripper_position"] == pytest.approx(0, abs=1e-6)  # it begins open
    env.close()


def test_without_keys_everything_is_sent(tmp_path, monkeypatch):
    monkeypatch.setenv("SERVED_FILE", str(tmp_path / "sent"))
    monkeypatch.setenv("SERVED_ACTIONS", "8")
    with server("tests.data.served:Writes") as address:
        evaluate(address, "PickCube-v1", [0], workers=0, obs_mode="state_dict", max_episode_steps=1)
    sent = pickle.loads((tmp_path / "sent").read_bytes())
    assert sent["agent/qpos"].shape == (9,)
    assert sent["extra/is_grasped"].dtype == bool
    assert sent["prompt"].endswith(".")


@pytest.mark.parametrize("seed", [1, 2])
def test_the_instruction_is_the_one_of_the_seed(tmp_path, monkeypatch, seed):
    with closing(tasks.make("CellPressTogether-v1", obs_mode="state_dict")) as env:
        told = env.reset(seed=seed)[1]["instruction"][0]
        width = env.layout.action_dim
    monkeypatch.setenv("SERVED_FILE", str(tmp_path / "sent"))
    monkeypatch.setenv("SERVED_ACTIONS", str(width))
    with server("tests.data.served:Writes") as address:
        making = {"obs_mode": "state_dict", "max_episode_steps": 1}
        evaluate(address, "CellPressTogether-v1", [seed], workers=0, **making)
    assert pickle.loads((tmp_path / "sent").read_bytes())["prompt"] == told


@pytest.mark.parametrize(
    ("address", "error", "message"),
    [
        ("ws://", TaskError, "the policy's address is 'ws://'; it must be ws://HOST:PORT, wss"),
        ("http://host:80", TaskError, "'http://host:80'; it must be ws://HOST:PORT, wss://HOST"),
        ("vla-eval://host:80", TaskError, "or vla-eval+ws://HOST:PORT"),
        ("ws://host:80#alhoa", TaskError, "Did you mean 'aloha'"),
        ("ws://host:80#none.yaml", TaskError, "cannot read the keys 'none.yaml'"),
    ],
)
def test_wrong_addresses(address, error, message):
    with pytest.raises(error, match=re.escape(message)):
        evaluate(address, TASK, [0], workers=0)


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("", TaskError, "observation is missing: what the server is sent, by key"),
        ("observation: {a: 3}", TaskError, "observation: a is"),
        ("observation: {a: {joint: [left]}}", UnknownNameError, "Did you mean 'joints'"),
        ("observation: {a: {joints: [left], text: x}}", TaskError, "it must have one source"),
        ("observation: {a: {text: x}}\nsteps: 0", TaskError, "steps"),
        ("observation: {a: {camera: x, order: hcw}}", TaskError, "it must be 'chw'"),
    ],
)
def test_wrong_keys(text, error, message, tmp_path):
    file = tmp_path / "keys.yaml"
    file.write_text(text)
    with pytest.raises(error, match=re.escape(message)):
        ServedPolicy(f"ws://127.0.0.1:1#{file}")


@pytest.mark.parametrize(
    ("source", "error", "message"),
    [
        ({"joints": ["left.arn"]}, UnknownNameError, "Did you mean 'left.arm'"),
        ({"camera": "base"}, UnknownNameError, "base_camera"),
        ({"entry": "extra/cube"}, UnknownNameError, "Did you mean 'extra/cube_pose'"),
    ],
)
def test_keys_that_do_not_fit_the_task(source, error, message, two_arms):
    with pytest.raises(error, match=re.escape(message)):
        Keys({"observation": {"a": source}}, two_arms)
