"""The page on what was learned by imitation is what its record and the receipts say."""

import json
from pathlib import Path

import pytest

pytest.importorskip("matplotlib")

from measurements.imitation import main, markdown
from rollouts.receipts import Receipt
from rollouts.receipts.sources import checksum, describe_task
from tasks import get_task_class

DOCS = Path(__file__).parents[2] / "docs"
RECORD = DOCS / "imitation.json"
RECEIPTS = sorted((DOCS / "receipts" / "imitation").glob("*.json"))
RUN = {
    "recipe": {"task": "PushCube-v1", "episodes": 3, "steps": 20, "batch": 4},
    "test_seeds": [1_000_000, 1_000_003],
    "success": 0.75,
    "failed": [1_000_002],
    "curve": [
        {"steps": 10, "error": 0.5, "success": 0.5},
        {"steps": 20, "error": 0.4, "success": 1},
    ],
}


def test_the_page_says_what_the_record_says():
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    page = "\n".join(markdown(record)) + "\n"
    assert page == (DOCS / "imitation.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("path", RECEIPTS, ids=lambda path: path.stem)
def test_receipts_say_what_the_record_says(path):
    receipt = Receipt.read(path)
    pictures = receipt.making["obs_mode"] == "rgb"
    name = receipt.task["id"] + (", from pictures" if pictures else "")
    run = json.loads(RECORD.read_text(encoding="utf-8"))["runs"][name]
    first, last = run["test_seeds"]
    assert [episode.seed for episode in receipt.episodes] == [*range(first, last + 1)]
    assert [episode.seed for episode in receipt.episodes if not episode.success] == run["failed"]
    assert receipt.policy["files"]
    assert receipt.policy["weights"]


@pytest.mark.parametrize("path", RECEIPTS, ids=lambda path: path.stem)
def test_receipts_are_of_the_code_that_is_here(path):
    receipt = Receipt.read(path)
    example = receipt.policy["name"].partition(":")[0]
    assert receipt.policy["sha256"] == checksum(DOCS.parent / "examples" / f"{example}.py")
    assert receipt.task == describe_task(get_task_class(receipt.task["id"]))


def test_every_run_has_a_receipt():
    assert len(RECEIPTS) == len(json.loads(RECORD.read_text(encoding="utf-8"))["runs"])


def test_a_run_is_added_and_takes_the_place_of_an_older_one(tmp_path):
    out, run = tmp_path / "record.json", tmp_path / "run"
    run.mkdir()
    seen = {**RUN, "recipe": {**RUN["recipe"], "size": 96}}
    for found in (RUN, seen, {**seen, "success": 1.0, "failed": []}):
        (run / "learning_curve.json").write_text(json.dumps(found))
        assert main([str(run), "--out", str(out)]) == 0
    rows = (tmp_path / "record.md").read_text().splitlines()
    assert "| PushCube-v1 | 3 | 20 of 4 | 4 | 75 (30.1 to 95.4) | 1000002 |" in rows
    assert "| PushCube-v1, from pictures | 3 | 20 of 4 | 4 | 100 (51.0 to 100.0) | none |" in rows
    assert (tmp_path / "record.png").read_bytes().startswith(b"\x89PNG")


def test_a_folder_without_a_run(tmp_path, capsys):
    assert main([str(tmp_path), "--out", str(tmp_path / "record.json")]) == 1
    assert "learning_curve.json cannot be read" in capsys.readouterr().err
    assert not (tmp_path / "record.json").exists()
