"""The ladder learns, plays and goes on where it was, in processes of its own."""

import json
import os

import pytest

pytest.importorskip("matplotlib")

from benchmarks.__main__ import main
from benchmarks.ladder import EXAMPLES
from robot_layouts.data.receipts import Receipt, verify

pytestmark = pytest.mark.long  # they record and learn

TASK = "PushCube-v1"


def climb(folder, *words):
    places = ["--runs", str(folder / "runs"), "--out", str(folder / "ladder.json")]
    numbers = ["--episodes", "2", "--steps", "20", "--tests", "1"]
    return main(["ladder", *numbers, *places, "--tasks", *words])


@pytest.fixture(scope="module")
def climbed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ladder")
    assert climb(folder, TASK) == 0
    return folder


def seen(folder):
    return json.loads((folder / "ladder.json").read_text())["tasks"]


def test_a_row_says_what_its_receipt_says(climbed):
    one = seen(climbed)[TASK]
    assert (one["arms"], one["recipe"]["episodes"], one["recipe"]["steps"]) == (["panda"], 2, 20)
    assert one["minutes"] > 0
    receipt = Receipt.read(climbed / "receipts" / "ladder" / f"{TASK}.json")
    (episode,) = receipt.episodes
    found = one["layouts"]["its own"]
    assert (found["solved"], found["steps"]) == (episode.success, episode.steps)
    assert found["stage_score"] is None
    row = f"| {TASK} | panda | its own | "
    assert row in (climbed / "ladder.md").read_text()


def test_its_receipt_can_be_verified(climbed, monkeypatch):
    receipt = Receipt.read(climbed / "receipts" / "ladder" / f"{TASK}.json")
    monkeypatch.syspath_prepend(EXAMPLES)
    monkeypatch.setenv("IMITATE_POLICY", str(climbed / "runs" / TASK / "policy.pt"))
    assert verify(receipt, workers=0, policy="imitate:policy").equal


def test_what_is_known_is_not_done_again(climbed):
    before = (climbed / "ladder.json").read_text()
    weights = climbed / "runs" / TASK / "policy.pt"
    kept = os.stat(weights).st_mtime_ns
    assert climb(climbed, TASK) == 0
    assert (climbed / "ladder.json").read_text() == before
    assert os.stat(weights).st_mtime_ns == kept
