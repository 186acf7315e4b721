"""The page on what was learned by reinforcement is what its record and the receipts say."""

import json
from pathlib import Path
from shutil import copy

import pytest

pytest.importorskip("matplotlib")

from measurements.reinforcement import main, markdown
from rollouts.receipts import Receipt
from rollouts.receipts.sources import checksum, describe_task
from tasks import get_task_class

DOCS = Path(__file__).parents[2] / "docs"
RECORD = DOCS / "reinforcement.json"
RECEIPTS = sorted((DOCS / "receipts" / "reinforcement").glob("*.json"))
ANY_RECEIPT = DOCS / "receipts" / "imitation" / "TwoRobotPickCube-v1.json"
SETTINGS = {"task": "TwoRobotPickCube-v1", "steps": 20_000, "torchrl": "0.13.3"}
POINT = {"seconds": 1800.0, "reward": 0.5, "learning_success": 0.1}


def test_the_page_says_what_the_record_says():
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    page = "\n".join(markdown(record)) + "\n"
    assert page == (DOCS / "reinforcement.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("path", RECEIPTS, ids=lambda path: path.stem)
def test_receipts_say_what_the_record_says_and_are_of_the_code_that_is_here(path):
    receipt = Receipt.read(path)
    run = json.loads(RECORD.read_text(encoding="utf-8"))["runs"][path.stem.replace("_", ", ")]
    first, last = run["tested"]
    assert [episode.seed for episode in receipt.episodes] == [*range(first, last + 1)]
    assert [episode.seed for episode in receipt.episodes if not episode.success] == run["failed"]
    example = receipt.policy["name"].partition(":")[0]
    assert receipt.policy["sha256"] == checksum(DOCS.parent / "examples" / f"{example}.py")
    assert receipt.policy["files"]
    assert receipt.task == describe_task(get_task_class(receipt.task["id"]))


def test_every_run_has_a_receipt():
    assert len(RECEIPTS) == len(json.loads(RECORD.read_text(encoding="utf-8"))["runs"])


def test_a_run_is_added_as_far_as_it_has_come(tmp_path):
    run, out = tmp_path / "run", tmp_path / "record.json"
    (run / "checkpoint-0002").mkdir(parents=True)
    (run / "settings.json").write_text(json.dumps(SETTINGS))
    curve = [{**POINT, "steps": steps, "success": share} for steps, share in ((5, 0), (9, 0.5))]
    (run / "checkpoint-0002" / "curve.json").write_text(json.dumps(curve))
    copy(ANY_RECEIPT, run / "receipt.json")
    assert main([str(run), "--out", str(out)]) == 0
    row = "PickCube-v1, MAPPO | torchrl 0.13.3 | 9 of 20,000 | 0.5 | 100 | 95 (88.8 to 97.8) |"
    assert row in out.with_suffix(".md").read_text()
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")


def test_folders_that_hold_no_run(tmp_path, capsys):
    out = ["--out", str(tmp_path / "record.json")]
    assert main([str(tmp_path), *out]) == 1
    assert "settings.json cannot be read" in capsys.readouterr().err
    (tmp_path / "settings.json").write_text("{}")
    assert main([str(tmp_path), *out]) == 1
    assert "holds no run of PPO or MAPPO" in capsys.readouterr().err
    assert not (tmp_path / "record.json").exists()
