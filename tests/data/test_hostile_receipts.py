"""Receipts that are damaged, or come from anyone: one clear error, and no code of theirs runs."""

import shlex
import shutil
import sys
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path

import pytest

from robot_layouts import __main__ as console
from robot_layouts.data.receipts import ReceiptError
from tests.data.receipt_files import NAMED, again, edit, written


@pytest.fixture(scope="module")
def receipt(tmp_path_factory) -> Path:
    return written(tmp_path_factory.mktemp("receipt"))


@pytest.fixture
def copy(receipt, tmp_path) -> Path:
    return Path(shutil.copy(receipt, tmp_path))


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
        (_set("episodes", 0, "steps", 9), "its trace must be 20 bytes in base64"),
        (_set("episodes", 0, "states", "x" * 64), r"states is .* it must be a SHA-256: 64 of the"),
        (_set("episodes", 0, "total", float("nan")), r"total is nan; it must be a finite number"),
        (_set("task", "id", "os:abort"), "id is 'os:abort'; it must be a task's id, without a mod"),
        (_set("task", "id", "PushX-v1"), "type: --task tasks.maniskill.push_t:PushX-v1$"),
        (_set("policy", {}), "it has no policy.kind; that must be a text"),
        (_set("making", "physics", {"timestp": 1}), "the receipt's task cannot be made here: "),
        (_set("making", "layout", "arm", "robot", "pandy"), "a robot at 'arm' that is not"),
        (_set("making", "layout", "arm", "position", [1, 2]), "a list of 3 values"),
        (_set("environment", []), "environment is .*; it must be an object"),
    ],
)
def test_a_receipt_of_somebody_else(copy, change, complaint):
    with pytest.raises(ReceiptError, match=complaint):
        again(edit(copy, change), policy=NAMED)


STRANGE = """
from pathlib import Path

Path("ran").touch()

def policy(obs):
    Path("ran").touch()
"""


@pytest.fixture
def called(copy, monkeypatch) -> list:
    """What was called of some functions of Python's own, in the folder of a stranger's receipt."""
    calls = []
    for function in ("http.server.test", "venv.main", "subprocess.call", "webbrowser.open"):
        monkeypatch.setattr(function, lambda *words, name=function, **_: calls.append(name))
    (copy.parent / "strange.py").write_text(STRANGE)
    monkeypatch.chdir(copy.parent)
    monkeypatch.setattr(sys, "path", [*sys.path, str(copy.parent)])
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    for module in ("antigravity", "strange"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    return calls


def _expect_untouched(calls: list) -> None:
    assert calls == []
    assert "antigravity" not in sys.modules
    assert "strange" not in sys.modules
    assert not Path("ran").exists()


def _hash_of(module: str) -> str:
    return sha256(Path(find_spec(module).origin).read_bytes()).hexdigest()


@pytest.mark.parametrize(
    "name", ["subprocess:call", "antigravity:fly", "strange:policy; touch ran"]
)
def test_no_policy_is_imported_because_a_receipt_names_it(copy, called, name, capsys):
    """Whoever writes a receipt knows the hash of any file, and may bring one along."""

    def change(found):
        own = {"sha256": _hash_of(name.partition(":")[0]), "importable": True}
        found["policy"] = {"kind": "policy", "name": name, **own}
        found["making"]["obs_mode"] = "state_dict"

    edit(copy, change)
    assert console.main(["verify", copy.name, "--workers=0"]) == 1
    _expect_untouched(called)
    assert capsys.readouterr().err == (
        f"error: the receipt is of the policy {name}, and a receipt does not choose which code"
        f" runs; to play what is here, type: --policy {shlex.quote(name)}\n"
    )
