"""Receipts that are damaged, or come from anyone: one clear error, and no code of theirs runs."""

import shutil
from pathlib import Path

import pytest

from rollouts.__main__ import main
from rollouts.receipts import ReceiptError
from tests.rollouts.receipt_files import again, edit, written


@pytest.fixture(scope="module")
def receipt(tmp_path_factory) -> Path:
    return written(tmp_path_factory.mktemp("receipt"))


@pytest.fixture
def copy(receipt, tmp_path) -> Path:
    return Path(shutil.copy(receipt, tmp_path))


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
