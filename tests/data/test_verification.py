"""Whatever is not as a receipt says is named: seed and step, files, sources, versions."""

import base64
import importlib
import shutil
import sys
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
import torch

from robot_layouts.__main__ import main
from robot_layouts.core.progress import Progress
from robot_layouts.data.receipts import EpisodeReceipt, Receipt, ReceiptError
from robot_layouts.data.receipts.verification import first_step
from robots import LocalUrdf, RobotDescriptor, RobotRegistry
from tasks.registry import TASKS
from tests.data.policies import LEANS, still
from tests.data.receipt_files import NAMED, again, edit, written

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


def test_a_changed_action_is_named_by_seed_and_step(modules, tmp_path, capsys):
    modules("my_policy", POLICY)
    path = written(tmp_path, policy="my_policy:policy", seeds=[5, 6])
    modules("my_policy", POLICY.replace("0.5 if", "0.6 if"))
    assert main(["verify", str(path), "--workers=0", "--policy=my_policy:policy"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "PushT-v1, my_policy:policy: 0 of 2 episodes equal to the last bit"
    assert lines[1].startswith("seed 5: states differ from step 8 on; return ")
    assert lines[2].startswith("seed 6: states differ from step 8 on; return ")
    assert lines[3] == "not as in the receipt:"
    assert lines[4].startswith("  policy my_policy:policy, source of the module my_policy: ")
    assert lines[5:] == ["not equal: this is not what the receipt says"]


def test_a_policy_that_is_named_is_compared(modules, tmp_path, capsys):
    modules("my_policy", POLICY)
    path = written(tmp_path, policy="my_policy:policy")
    sys.modules.pop("my_policy")
    words = ["verify", str(path), "--workers=0"]
    assert main(words) == 1
    assert capsys.readouterr().err.endswith("type: --policy my_policy:policy\n")
    assert "my_policy" not in sys.modules
    assert main([*words, "--policy=my_policy:policy"]) == 0
    assert capsys.readouterr().out.endswith("\nequal: this is what the receipt says\n")


def test_a_changed_weight_of_a_policy_is_named(modules, tmp_path):
    modules("my_policy", POLICY)
    path = written(tmp_path, policy="my_policy:policy")
    weights = tmp_path / "weights.npy"
    data = bytearray(weights.read_bytes())
    data[-2] ^= 1  # of the last action number
    weights.write_bytes(data)
    modules("my_policy", POLICY)
    found = again(path, policy="my_policy:policy")
    assert not found.equal
    assert [difference.step for difference in found.differences] == [1, 1, 1]
    (change,) = found.changed
    assert (change.about, change.name) == ("policy", "policy my_policy:policy, file weights.npy")


def test_a_variable_that_the_policy_needs_is_named(modules, tmp_path, monkeypatch, capsys):
    found_late = "def __getattr__(name):\n    return {'policy': Policy()}[name]"
    text = POLICY.replace("policy = Policy()", f"import os\n{found_late}")
    modules(
        "my_policy", text.replace("np.load(WEIGHTS)", 'np.load(os.environ.get("MINE", "none"))')
    )
    monkeypatch.setenv("MINE", str(tmp_path / "weights.npy"))
    path = written(tmp_path, policy="my_policy:policy")
    assert Receipt.read(path).environment["variables"] == "MINE"
    words = ["verify", str(path), "--workers=0", "--policy=my_policy:policy"]
    assert main(words) == 0
    monkeypatch.delenv("MINE")
    capsys.readouterr()
    hint = "; environment variables that were set when the receipt was written, and are not"
    hint += " here: MINE\n"
    assert main(words[:-1]) == 1
    assert capsys.readouterr().err.endswith(f"type: --policy my_policy:policy{hint}")
    assert main(words) == 1
    assert capsys.readouterr().err == (
        "error: no policy 'my_policy:policy': FileNotFoundError: [Errno 2] No such file or"
        f" directory: 'none'{hint}"
    )
    assert main([*words[:-1], f"--policy={NAMED}"]) == 1
    assert "variables that the policy reads: MINE in the receipt, nothing here" in (
        capsys.readouterr().out
    )


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
    assert again(path, policy=NAMED).equal
    mesh = arm.parent / "franka_description/meshes/collision/link2.stl"
    data = bytearray(mesh.read_bytes())
    data[100] ^= 1
    mesh.write_bytes(data)
    found = again(path, policy=NAMED)
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
        again(path, policy=NAMED)
    found = again(path, policy=NAMED, robots={"arm": robot})
    assert [change.name for change in found.changed] == [
        f"file {arm.name} of the robot arm (panda_stick)"
    ]
    assert found.differences[0].step == 1


def test_the_source_of_a_task_is_named(modules, tmp_path, capsys):
    modules("my_task", OWN_TASK)
    path = tmp_path / "receipt.json"
    task, policy = "--task=my_task:ShortPush-v1", f"--policy={NAMED}"
    words = ["evaluate", task, policy, "--episodes=1", "--workers=0", f"--receipt={path}"]
    try:
        assert main(words) == 0
        assert capsys.readouterr().out.endswith(f"{path}: receipt {Receipt.read(path).hash}\n")
        _forget("ShortPush-v1")
        modules("my_task", f"{OWN_TASK}\n# nothing that matters\n")
        words = ["verify", str(path), "--workers=0", policy]
        assert main(words) == 1
        assert capsys.readouterr().err.endswith("type: --task my_task:ShortPush-v1\n")
        assert "my_task" not in sys.modules
        assert main([*words, task]) == 1
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
        ("processor", "torch", "DEFAULT", "processor, torch: DEFAULT in the receipt, "),
    ],
)
def test_versions_and_processors_are_named_and_do_not_count(copy, part, name, value, about, capsys):
    edit(copy, lambda found: found["environment"][part].update({name: value}))
    assert main(["verify", str(copy), "--workers=0", f"--policy={NAMED}"]) == 0
    printed = capsys.readouterr().out
    assert f"\nnot as in the receipt:\n  {about}" in printed
    assert len(printed.splitlines()) == 4


def test_progress_counts_episodes_that_are_equal_in_everything(copy, monkeypatch):
    said = []
    monkeypatch.setattr(Progress, "update", lambda line, done, text: said.append(text))
    edit(copy, lambda found: found["episodes"][2].update(total=0.5))
    assert main(["verify", str(copy), "--workers=0", f"--policy={NAMED}"]) == 1
    assert said[-1] == "verifying, 2 of 3 equal"


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
    found = again(edit(copy, change), policy=NAMED)
    assert not found.equal
    assert found.changed[0].about == "receipt"
    assert "changed after it was written" in str(found)
    assert [str(d)[:30] for d in found.differences] == ([difference] if difference else [])
    assert any(c.name.startswith(name) for c in found.changed[0 if difference else 1 :])


def test_an_episode_is_played_one_step_further_than_the_receipts_at_most(copy):
    """However long it may be here, as a receipt of somebody else may say."""
    played = []

    def policy(obs):
        played.append(obs)
        return LEANS(obs)

    edit(copy, lambda found: found["making"].update(max_episode_steps=2**31 - 1))
    assert not again(copy, policy=policy).equal
    assert len(played) == 3 * (10 + 1)
    played.clear()
    edit(copy, lambda found: found["making"].update(max_episode_steps=10))
    assert again(copy, policy=policy).differences == ()
    assert len(played) == 3 * 10


def test_the_first_step_is_named_where_lengths_differ():
    trace = base64.b64encode(bytes(range(12))).decode()
    short = base64.b64encode(bytes(range(8))).decode()
    five = EpisodeReceipt(0, False, 5, 1.0, "a" * 64, trace)
    assert first_step(five, EpisodeReceipt(0, True, 3, 1.0, "b" * 64, short)) == 4
    assert first_step(five, replace(five, states="b" * 64)) == 5
    assert first_step(five, five) is None
