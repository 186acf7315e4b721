"""A receipt is the same whoever plays, and whatever differs from it is named."""

import base64
import importlib
import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
import torch

import tasks
from robots import LocalUrdf, RobotDescriptor, RobotRegistry, TaskError
from robots.common.errors import UnwritableFileError
from rollouts import Evaluation, evaluate
from rollouts.__main__ import main
from rollouts.playing.executor import choose_executor
from rollouts.receipts import EpisodeReceipt, Receipt, ReceiptError, Verification, verify
from rollouts.receipts.comparison import first_step
from tasks.episode import REBUILT
from tasks.registry import TASKS
from tests.rollouts.policies import LEANS, TASK, Leans, Wanders, still

ROOT = Path(__file__).parents[2]
HERE = choose_executor(0)

# It acts alike but at one step; weights.npy is beside it.
POLICY = """
import numpy as np
from pathlib import Path

WEIGHTS = Path(__file__).with_name("weights.npy")

class Policy:
    files = [WEIGHTS]

    def __init__(self):
        self.weights, self.steps = np.load(WEIGHTS), 0

    def __call__(self, obs):
        self.steps += 1
        return self.weights * (0.5 if self.steps == 8 else 0.25)

policy = Policy()
"""
OWN_TASK = """
from tasks import register_task
from tasks.maniskill.push_t import PushT

@register_task("ShortPush-v1")
class ShortPush(PushT):
    max_episode_steps = 12
"""


def written(tmp_path, name="receipt.json", policy=LEANS, seeds=range(3), **details) -> Path:
    details = {"workers": 0, "max_episode_steps": 10, **details}
    evaluate(policy, TASK, seeds, receipt=tmp_path / name, **details)
    return tmp_path / name


def again(receipt, **details) -> Verification:
    return verify(receipt, HERE, **details)


def edit(path: Path, change) -> Path:
    """Change a receipt by hand."""
    about = json.loads(path.read_text())
    change(about)
    path.write_text(json.dumps(about))
    return path


@pytest.fixture(scope="module")
def receipt(tmp_path_factory) -> Path:
    return written(tmp_path_factory.mktemp("receipt"))


@pytest.fixture
def copy(receipt, tmp_path) -> Path:
    return Path(shutil.copy(receipt, tmp_path))


@pytest.fixture
def modules(tmp_path, monkeypatch):
    """A folder from which modules are imported anew whenever they have changed."""
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.syspath_prepend(tmp_path)
    np.save(tmp_path / "weights.npy", np.linspace(-1, 1, 7, dtype=np.float32))

    def write(name: str, text: str) -> None:
        (tmp_path / f"{name}.py").write_text(text)
        sys.modules.pop(name, None)
        importlib.invalidate_caches()

    yield write
    for name in ("my_policy", "my_task"):
        sys.modules.pop(name, None)


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
    assert recorded.moments() == kept
    assert len({e.states for e in Receipt.read(receipt).episodes}) == 3


@pytest.mark.parametrize(
    "who", [{"workers": 1}, {"workers": 2}, {"num_envs": 4}, {"workers": 2, "num_envs": 2}], ids=str
)
def test_who_plays_makes_no_difference(tmp_path, who):
    """Not a byte, with a policy that draws from every generator and remembers."""
    alone = written(tmp_path, policy=Wanders(0.5), seeds=range(5))
    other = written(tmp_path, "other.json", policy=Wanders(0.5), seeds=range(5), **who)
    assert other.read_bytes() == alone.read_bytes()


def test_the_order_of_seeds_is_that_of_the_receipt(receipt, tmp_path):
    turned = Receipt.read(written(tmp_path, seeds=[2, 0, 1], workers=1))
    assert [episode.seed for episode in turned.episodes] == [2, 0, 1]
    assert set(turned.episodes) == set(Receipt.read(receipt).episodes)


def test_threads_of_the_processor_make_no_difference(tmp_path):
    """Experts plan with matrices, which libraries share among threads."""
    for threads in ("1", "2"):
        words = ["evaluate", "--task=PickCube-v1", "--episodes=2", "--workers=1"]
        subprocess.run(
            [sys.executable, "-m", "rollouts", *words, f"--receipt={tmp_path / threads}.json"],
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
    found = again(receipt, num_envs=2)
    assert found.equal
    assert found.differences == found.changed == ()
    assert str(
        found
    ) == "PushT-v1, tests.rollouts.policies:LEANS: 3 of 3 episodes equal to the " + ("last bit")
    assert found.here == Receipt.read(receipt)


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


def test_batched_policies_are_verified_as_many_at_once(tmp_path):
    path = written(tmp_path, policy=Leans(batched=True), num_envs=2)
    assert Receipt.read(path).making["num_envs"] == 2
    assert again(path, policy=Leans(batched=True)).equal
    assert "num_envs" not in Receipt.read(written(tmp_path, num_envs=2)).making


def test_a_changed_action_is_named_by_seed_and_step(modules, tmp_path, capsys):
    modules("my_policy", POLICY)
    path = written(tmp_path, policy="my_policy:policy", seeds=[5, 6])
    modules("my_policy", POLICY.replace("0.5 if", "0.6 if"))
    words = ["verify", str(path), "--workers=0"]
    assert main(words) == 1
    assert capsys.readouterr().err == (
        "error: the source of the policy my_policy:policy is not that of the receipt: the module"
        " 'my_policy' cannot be found here or has changed since, and a receipt does not choose"
        " which code runs; to play what is here, name it: --policy my_policy:policy\n"
    )
    assert "my_policy" not in sys.modules
    assert main([*words, "--policy=my_policy:policy"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "PushT-v1, my_policy:policy: 0 of 2 episodes equal to the last bit"
    assert lines[1].startswith("seed 5: states differ from step 8 on; return ")
    assert lines[2].startswith("seed 6: states differ from step 8 on; return ")
    assert lines[3] == "not as in the receipt:"
    assert lines[4].startswith("  policy my_policy:policy, source of the module my_policy: ")
    assert lines[5:] == ["not equal: this is not what the receipt says"]


def test_a_policy_of_the_very_same_code_is_imported(modules, tmp_path, capsys):
    modules("my_policy", POLICY)
    path = written(tmp_path, policy="my_policy:policy")
    sys.modules.pop("my_policy")
    assert main(["verify", str(path), "--workers=0"]) == 0
    assert capsys.readouterr().out.endswith("\nequal: this is what the receipt says\n")


def test_a_changed_weight_of_a_policy_is_named(modules, tmp_path):
    modules("my_policy", POLICY)
    path = written(tmp_path, policy="my_policy:policy")
    weights = tmp_path / "weights.npy"
    data = bytearray(weights.read_bytes())
    data[-2] ^= 1  # of the last action number
    weights.write_bytes(data)
    modules("my_policy", POLICY)
    found = again(path)
    assert not found.equal
    assert [difference.step for difference in found.differences] == [1, 1, 1]
    (change,) = found.changed
    assert (change.about, change.name) == ("policy", "policy my_policy:policy, file weights.npy")


class Network(torch.nn.Linear):
    def forward(self, obs):
        return torch.tanh(super().forward(obs))


class Holder:
    def __init__(self, network):
        self.network = network

    def __call__(self, obs):
        return self.network(obs)


@pytest.mark.parametrize(("wrap", "name"), [(Holder, "network"), (lambda network: network, "self")])
def test_weights_of_a_network_are_named(tmp_path, wrap, name):
    torch.manual_seed(0)
    policy = wrap(Network(31, 7))
    path = written(tmp_path, policy=policy)
    assert again(path, policy=policy).equal
    with torch.no_grad():
        next(iter(getattr(policy, "network", policy).parameters()))[0, 0] += 0.5
    found = again(path, policy=policy)
    assert found.changed[0].name.endswith(f"weights of {name}")
    assert len(found.differences) == 3


def test_what_cannot_be_imported_is_passed_again(tmp_path):
    path = written(tmp_path, policy=lambda obs: still(obs))
    with pytest.raises(ReceiptError, match="<lambda> was no variable of a module.*policy=…"):
        again(path)
    assert again(path, policy=lambda obs: still(obs)).differences == ()


@pytest.fixture
def arm(tmp_path) -> Path:
    urdf = RobotRegistry.load("panda_stick").urdf.locate()
    return Path(shutil.copytree(urdf.parent, tmp_path / "copy")) / urdf.name


def test_a_changed_byte_of_a_robot_file_is_named(tmp_path, arm):
    """Of a mesh that touches nothing: no state differs, and it is caught all the same."""
    path = written(tmp_path, robots=RobotDescriptor.from_urdf(arm, quiet=True), seeds=[0])
    assert again(path).equal
    mesh = arm.parent / "franka_description/meshes/collision/link2.stl"
    data = bytearray(mesh.read_bytes())
    data[100] ^= 1
    mesh.write_bytes(data)
    found = again(path)
    assert not found.equal
    (change,) = found.changed
    robot = Receipt.read(path).making["layout"]["arm"]["robot"]
    assert change.about == "file"
    assert change.name == (
        f"file franka_description/meshes/collision/link2.stl of the robot arm ({robot})"
    )
    assert change.here == sha256(data).hexdigest()


def test_a_changed_urdf_is_named_with_the_states_that_it_changes(tmp_path, arm):
    robot = replace(RobotRegistry.load("panda_stick"), urdf=LocalUrdf(arm))
    path = written(tmp_path, robots=robot)
    text = arm.read_text()
    assert 'mass value="3' in text
    arm.write_text(text.replace('mass value="3', 'mass value="4', 1))
    with pytest.raises(ReceiptError, match=rf"{arm}, which has changed since; name the robot"):
        again(path)
    found = again(path, robots={"arm": robot})
    assert [change.name for change in found.changed] == [
        f"file {arm.name} of the robot arm (panda_stick)"
    ]
    assert found.differences[0].step == 1


def test_the_source_of_a_task_is_named(modules, tmp_path, capsys):
    modules("my_task", OWN_TASK)
    path = tmp_path / "receipt.json"
    words = ["--task=my_task:ShortPush-v1", "--policy=tests.rollouts.policies:LEANS"]
    try:
        assert main(["evaluate", *words, "--episodes=1", "--workers=0", f"--receipt={path}"]) == 0
        assert capsys.readouterr().out.endswith(f"{path}: receipt {Receipt.read(path).hash}\n")
        _forget("ShortPush-v1")
        sys.modules.pop("my_task")
        assert main(["verify", str(path), "--workers=0"]) == 0
        _forget("ShortPush-v1")
        modules("my_task", f"{OWN_TASK}\n# nothing that matters\n")
        capsys.readouterr()
        assert main(["verify", str(path), "--workers=0"]) == 1
        assert capsys.readouterr().err.endswith("name it: --task my_task:ShortPush-v1\n")
        assert main(["verify", str(path), "--workers=0", words[0]]) == 1
        said = capsys.readouterr().out
        assert "1 of 1 episodes equal to the last bit" in said
        assert "\n  task ShortPush-v1, source of the module my_task: " in said
    finally:
        _forget("ShortPush-v1")


def _forget(task_id):
    TASKS.registered.pop(task_id, None)


@pytest.mark.parametrize(
    ("part", "name", "value", "about"),
    [
        ("versions", "torch", "2.4.0", "version of torch: 2.4.0 in the receipt, "),
        ("versions", "python", "3.10.1", "version of python: 3.10.1 in the receipt, "),
        ("processor", "torch", "DEFAULT", "processor, torch: DEFAULT in the receipt, "),
        ("processor", "name", "Other", "processor, name: Other in the receipt, "),
    ],
)
def test_versions_and_processors_are_named_and_do_not_count(copy, part, name, value, about, capsys):
    edit(copy, lambda found: found["environment"][part].update({name: value}))
    assert main(["verify", str(copy), "--workers=0"]) == 0
    printed = capsys.readouterr().out
    assert f"\nnot as in the receipt:\n  {about}" in printed
    assert len(printed.splitlines()) == 4


@pytest.mark.parametrize(
    ("change", "difference", "name"),
    [
        (
            lambda found: found["episodes"][1].update(success=True),
            "seed 1: states are the same; s",
            "",
        ),
        (
            lambda found: found["episodes"][2].update(total=0.5),
            "seed 2: states are the same; r",
            "",
        ),
        (
            lambda found: found["making"]["layout"]["arm"]["joint_groups"]["arm"].update(
                damping=9.0
            ),
            None,
            "layout.arm.joint_groups.arm.damping",
        ),
        (lambda found: found["task"].update(sha256="0" * 64), None, "task PushT-v1, source of the"),
    ],
)
def test_a_receipt_changed_by_hand_is_not_equal(copy, change, difference, name):
    found = again(edit(copy, change))
    assert not found.equal
    assert found.changed[0].about == "receipt"
    assert "changed after it was written" in str(found)
    assert [str(d)[:30] for d in found.differences] == ([difference] if difference else [])
    assert any(c.name.startswith(name) for c in found.changed[0 if difference else 1 :])


def test_the_first_step_is_named_where_lengths_differ():
    trace = base64.b64encode(bytes(range(12))).decode()
    short = base64.b64encode(bytes(range(8))).decode()
    five = EpisodeReceipt(0, False, 5, 1.0, "a" * 64, trace)
    assert first_step(five, EpisodeReceipt(0, True, 3, 1.0, "b" * 64, short)) == 4
    assert first_step(five, replace(five, states="b" * 64)) == 5
    assert first_step(five, five) is None


def _cut(text: str, share: float) -> str:
    return text[: int(len(text) * share)]


@pytest.mark.parametrize("share", [0, 0.001, 0.3, 0.7, 0.99])
def test_a_truncated_receipt(copy, share, capsys):
    copy.write_text(_cut(copy.read_text(), share))
    assert main(["verify", str(copy), "--workers=0"]) == 1
    assert capsys.readouterr().err.startswith(f"error: cannot read {copy}: it is not json")


def _set(*path):
    *keys, last, value = path

    def change(found):
        for key in keys:
            found = found[key]
        found[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (
            _set("format", "receipt 7"),
            "format is 'receipt 7'; it must be 'robot-layouts receipt 1'",
        ),
        (_set("episodes", []), "a receipt has one episode or more; this has none"),
        (_set("episodes", 0, "seed", -1), r"episodes\[0\].seed is -1; it must be a whole number"),
        (_set("episodes", 1, "seed", 0), "this has seed 0 twice"),
        (_set("episodes", 0, "trace", "AA"), "its trace must be 22 bytes in base64"),
        (_set("episodes", 0, "steps", 9), "its trace must be 20 bytes in base64"),
        (_set("episodes", 0, "states", "x" * 64), r"states is .* it must be a SHA-256: 64 of the"),
        (_set("episodes", 0, "total", float("nan")), r"total is nan; it must be a finite number"),
        (_set("task", "id", "os:abort"), "id is 'os:abort'; it must be a task's id, without a mod"),
        (_set("task", "id", "PushX-v1"), "the receipt's task cannot be made here: unknown task"),
        (_set("policy", {}), "it has no policy.kind; that must be a text"),
        (_set("policy", "name", "os:abort"), "the source of the policy os:abort is not that of"),
        (_set("policy", "name", ""), "policy.name is ''; it must be a text of 1 to 200"),
        (_set("making", "physics", {"timestp": 1}), "the receipt's task cannot be made here: "),
        (_set("making", "physics", [1]), "making.physics is .*; it must be an object or null"),
        (_set("making", "num_envs", 10**6), "the receipt's task cannot be made here: num_envs is"),
        (_set("making", "obs_mode", "smell"), "the receipt's task cannot be made here: "),
        (_set("making", "layout", "arm", "robot", "pandy"), "a robot at 'arm' that cannot be had"),
        (_set("making", "layout", {}), "the receipt's task cannot be made here: "),
        (_set("making", "layout", "arm", "position", [1, 2]), "a list of 3 values"),
        (_set("making", "cameras", [{"eye": 1}]), "the receipt's task cannot be made here: "),
        (_set("making", "randomization", {"mas": {}}), "the receipt's task cannot be made here: "),
        (_set("making", "control_mode", {"arm": "x"}), "the receipt's task cannot be made here: "),
        (_set("environment", []), "environment is .*; it must be an object"),
    ],
)
def test_a_receipt_of_somebody_else(copy, change, complaint):
    with pytest.raises(ReceiptError, match=complaint):
        again(edit(copy, change))


def test_no_receipt_at_all(tmp_path, capsys):
    assert main(["verify", str(tmp_path)]) == 1
    assert "it is a directory, not a regular file" in capsys.readouterr().err
    (tmp_path / "x").write_bytes(b"\xff\xfe\x00")
    assert main(["verify", str(tmp_path / "x")]) == 1
    assert "it is not UTF-8" in capsys.readouterr().err
    with pytest.raises(SystemExit, match="2"):
        main(["verify"])


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
