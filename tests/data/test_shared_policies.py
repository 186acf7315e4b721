"""Policies from the Hub: the client of huggingface_hub against a server of the tests' own."""

from __future__ import annotations

import json
import pickle
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import torch

import tasks
from robot_layouts.__main__ import main
from robot_layouts.data import evaluate, record
from robot_layouts.data.playing.policies import find_policy
from robot_layouts.data.playing.shared_policy import (
    SharedPolicy,
    read_tensors,
    save_policy,
    write_tensors,
)
from robot_layouts.data.reading.hub import HubError
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.receipts import Receipt, verify
from robots import TaskError, UnreadableFileError
from tests.data.writable_hub import WritableHub

TASK, NAME = "PushCube-v1", "lab/push"
HOW = {"control_mode": "pd_joint_pos", "obs_mode": "state_dict", "workers": 0}
WORDS = ["--control-mode", "pd_joint_pos", "--obs-mode", "state_dict", "--workers", "0"]

DECLARED = {
    "format": "robot-layouts policy 1",
    "task": TASK,
    "control_mode": "pd_joint_pos",
    "observed": [{"key": "agent/qpos"}, {"key": "extra/obj_pose", "symmetry": "cube"}],
    "action_dim": 8,
    "chunk": 3,
    "played": 2,
    "width": 4,
    "blocks": 1,
    "switches": [7, 15, 23],
}
INPUTS, OUTPUTS = 9 + 12, 3 * 8


def network(seed: int = 0) -> dict[str, np.ndarray]:
    """Weights that move the arm a little about where it is."""
    random = np.random.default_rng(seed)
    shapes = {
        **{"mean": (INPUTS,), "scale": (INPUTS,), "unit": (OUTPUTS,)},
        **{"linear.weight": (OUTPUTS, INPUTS), "linear.bias": (OUTPUTS,)},
        **{"network.0.weight": (4, INPUTS), "network.0.bias": (4,)},
        **{f"network.1.layers.0.{part}": (4,) for part in ("weight", "bias")},
        **{f"network.1.layers.{i}.weight": (4, 4) for i in (1, 3)},
        **{f"network.1.layers.{i}.bias": (4,) for i in (1, 3)},
        **{f"network.2.{part}": (4,) for part in ("weight", "bias")},
        **{"network.3.weight": (OUTPUTS, 4), "network.3.bias": (OUTPUTS,)},
    }
    found = {name: random.uniform(0.0, 0.1, shape) for name, shape in shapes.items()}
    return {name: numbers.astype(np.float32) for name, numbers in found.items()}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    save_policy(tmp_path / "shared", DECLARED, network())
    return tmp_path / "shared"


def upload(hub: WritableHub, folder: Path) -> str:
    """Push a folder as `hf upload` does, and return the commit."""
    from huggingface_hub import HfApi

    api = HfApi(endpoint=hub.endpoint)
    api.create_repo(NAME, exist_ok=True)
    return api.upload_folder(repo_id=NAME, folder_path=folder).oid


def test_a_policy_comes_from_the_hub_with_the_same_scores(hub, folder, capsys):
    commit = upload(hub, folder)
    words = ["evaluate", "--task", TASK, "--policy", f"hub:{NAME}", "--episodes", "2", *WORDS]
    assert main(words) == 0
    assert f"{TASK}, hub:{NAME}@{commit}: 0 of 2 episodes" in capsys.readouterr().out
    here = evaluate(SharedPolicy.load(folder), TASK, range(2), **HOW)
    assert evaluate(f"hub:{NAME}", TASK, range(2), **HOW).scores == here.scores


def test_a_receipt_names_the_commit_and_the_files(hub, folder, tmp_path):
    first, path = upload(hub, folder), tmp_path / "receipt.json"
    evaluate(f"hub:{NAME}", TASK, [3], receipt=path, **HOW)
    receipt = Receipt.read(path)
    assert receipt.policy["name"] == f"hub:{NAME}@{first}"
    assert {*receipt.policy["files"]} == {"policy.json", "weights.safetensors"}
    assert verify(receipt, workers=0, policy=f"hub:{NAME}").equal
    save_policy(folder, DECLARED, network(seed=1))
    second = upload(hub, folder)
    assert second != first
    assert verify(receipt, workers=0, policy=f"hub:{NAME}@{first}").equal
    found = verify(receipt, workers=0, policy=f"hub:{NAME}")
    assert not found.equal
    assert "weights.safetensors" in str(found)


def test_a_recording_names_who_acted(hub, folder, tmp_path):
    commit = upload(hub, folder)
    record(TASK, [0], tmp_path / "data", policy=f"hub:{NAME}", **HOW)
    with Recording(tmp_path / "data") as recording:
        source = recording[0].source
    assert source["name"] == f"hub:{NAME}@{commit}"
    assert len(source["sha256"]) == 64


def test_files_that_lie_are_refused_in_words(folder):
    policy = SharedPolicy.load(folder)
    turned = [{"key": "extra/goal_pos", "symmetry": "cube"}]
    wrong = SharedPolicy({**DECLARED, "observed": turned}, network(), "lying")
    env = tasks.make(TASK, obs_mode="state_dict")
    seen, _ = env.reset(seed=0)
    env.close()
    with pytest.raises(TaskError, match="lying takes 'extra/goal_pos' for the pose of a cube"):
        wrong(seen)
    with pytest.raises(TaskError, match="no number|lack a tensor 'unit'"):
        SharedPolicy(policy.declared, {**network(), "unit": np.float32(1)}, "lying")


def test_it_looks_again_after_the_actions_it_plays(folder):
    policy = SharedPolicy.load(folder)
    env = tasks.make(TASK, obs_mode="state_dict")
    seen, _ = env.reset(seed=0)
    env.close()
    first, second, third = (policy(seen) for _ in range(3))
    assert torch.equal(first, third)
    assert not torch.equal(first, second)
    assert {*torch.stack([first, second])[:, 7].tolist()} <= {-1.0, 1.0}


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"obs_mode": "state"}, "observes obs_mode='state_dict', not 'pd_joint_pos' and 'state'"),
        ({"control_mode": "pd_ee_delta_pos"}, "add --control-mode pd_joint_pos --obs-mode state"),
        (
            {"robots": {"arm": "panda_stick"}},
            "with actions of 8 numbers; those of PushCube-v1 have",
        ),
    ],
)
def test_what_it_did_not_learn_is_refused(folder, changed, message):
    with pytest.raises(TaskError, match=message):
        evaluate(SharedPolicy.load(folder), TASK, [0], **{**HOW, **changed})


@pytest.mark.parametrize(
    ("observed", "message"),
    [
        ([{"key": "extra/cube_pose"}], "observes 'extra/cube_pose', which is not observed here"),
        ([{"key": "agent/qpos"}], "observes 21 numbers; here are 9"),
    ],
)
def test_what_is_not_observed_is_named(tmp_path, observed, message):
    policy = save_policy(tmp_path, {**DECLARED, "observed": observed}, network())
    with pytest.raises(TaskError, match=message):
        evaluate(policy, TASK, [0], **HOW)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"format": "robot-layouts policy 2"}, "format is .*it must be 'robot-layouts policy 1'"),
        ({"played": 0}, "played is 0"),
        ({"observed": [{"key": "a", "symmetry": "ball"}]}, "symmetry"),
        ({"width": 5}, "lack a tensor 'network.0.weight' of the shape \\[5, 21\\]"),
        ({"switches": [24]}, "its chunks have no number 24"),
    ],
)
def test_a_declaration_that_is_none_is_refused(folder, changed, message):
    (folder / "policy.json").write_text(json.dumps({**DECLARED, **changed}))
    with pytest.raises(TaskError, match=message):
        SharedPolicy.load(folder)


def test_weights_that_nothing_computes_with_are_refused(folder):
    write_tensors(folder / "weights.safetensors", {**network(), "more": np.zeros(2, np.float32)})
    with pytest.raises(TaskError, match="nothing is declared that computes with 'more'"):
        SharedPolicy.load(folder)


class Trap:
    """A pickle of it writes a file when it is read."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __reduce__(self) -> tuple[object, ...]:
        return Path.write_text, (self._path, "read")


def as_pickle(value: object, path: Path) -> None:
    path.write_bytes(pickle.dumps(value))


@pytest.mark.parametrize("write", [torch.save, as_pickle])
def test_a_pickle_is_never_read(hub, folder, tmp_path, write):
    sprung = tmp_path / "sprung"
    write(Trap(sprung), folder / "weights.safetensors")
    upload(hub, folder)
    with pytest.raises(TaskError, match=r"it is a pickle .* can run code when they are read"):
        find_policy(f"hub:{NAME}")
    (folder / "weights.safetensors").rename(folder / "policy.pt")
    (folder / "policy.json").unlink()
    hub.repositories.clear()
    upload(hub, folder)
    with pytest.raises(HubError, match=r"holds no policy\.json.*pickles \(\.pt, \.pth"):
        find_policy(f"hub:{NAME}")
    assert not [path for path in hub.downloads() if path.endswith(".pt")]
    assert not sprung.exists()


def of_header(header: object, numbers: bytes = bytes(8)) -> bytes:
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + numbers


def tensor(**changed: object) -> dict[str, object]:
    return {"dtype": "F32", "shape": [2], "data_offsets": [0, 8], **changed}


@pytest.mark.parametrize(
    "content",
    [
        b"",
        (2**40).to_bytes(8, "little") + b"{}",
        of_header(b"{"),
        of_header(b"[" * 5000),
        of_header({"a": tensor(dtype="F31")}),
        of_header({"a": tensor(shape=[3])}),
        of_header({"a": tensor(), "b": tensor()}),
        of_header({"a": tensor()}, bytes(4)),
    ],
)
def test_a_file_that_is_no_safetensors_is_refused(tmp_path, content):
    (tmp_path / "weights").write_bytes(content)
    with pytest.raises(UnreadableFileError, match="it is no safetensors file: "):
        read_tensors(tmp_path / "weights")


@pytest.mark.parametrize(
    "content",
    [
        of_header({"a": tensor()}, np.float32([np.nan, 0]).tobytes()),
        of_header({"a": tensor(dtype="F64", shape=[1])}),
    ],
)
def test_numbers_of_weights_are_finite_and_have_32_bits(tmp_path, content):
    (tmp_path / "weights").write_bytes(content)
    with pytest.raises(UnreadableFileError, match="'a' has other numbers than finite ones of 32"):
        read_tensors(tmp_path / "weights")


def test_tensors_come_back(tmp_path):
    written = {"b": np.float32([[1, 2, 3]]), "a": np.float32(4)}
    write_tensors(tmp_path / "weights", written)
    found = read_tensors(tmp_path / "weights")
    assert {name: values.tolist() for name, values in found.items()} == {"a": 4, "b": [[1, 2, 3]]}


@pytest.fixture
def examples(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of examples, whose modules are forgotten afterwards."""
    pytest.importorskip("matplotlib")
    folder = Path(__file__).parents[2] / "examples"
    monkeypatch.syspath_prepend(folder)
    yield folder
    for name in ("imitate", "share_policy"):
        sys.modules.pop(name, None)


@pytest.mark.parametrize("task", [TASK, "TwoRobotStackCube-v1"])
def test_what_imitate_has_learned_is_shared_with_its_bits(examples, tmp_path, task):
    import imitate
    import share_policy

    recipe = imitate.Recipe(task)
    env = tasks.make(task, control_mode=imitate.MODE, obs_mode=imitate.OBSERVED)
    seen, _ = env.reset(seed=5)
    numbers = imitate.Senses(task)(seen)
    torch.manual_seed(0)
    inputs, outputs = numbers.shape[1], recipe.chunk * env.layout.action_dim
    network = imitate.ChunkNetwork(inputs, outputs, recipe.width, recipe.blocks)
    few = numbers + torch.randn(40, inputs)
    network.fit(few, torch.cat([torch.randn(40, outputs - 1), torch.ones(40, 1)], dim=1))
    imitate.Training(recipe, network, few, torch.randn(40, outputs)).save(tmp_path / "policy.pt")
    learned = imitate.ClonedPolicy.load(tmp_path / "policy.pt")
    assert share_policy.main([str(tmp_path / "policy.pt"), str(tmp_path / "shared")]) == 0
    shared = SharedPolicy.load(tmp_path / "shared").playing(env)
    for _ in range(6):
        action = learned(seen)
        assert torch.equal(shared(seen), action)
        seen = env.step(action.clamp(-1, 1))[0]
    env.close()
