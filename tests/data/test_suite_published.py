"""The published results of the standard suite are what their receipts say, and are played again."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from robot_layouts.data.reading.provenance import describe_layout, descriptor_digest
from robot_layouts.data.receipts import Receipt
from robot_layouts.data.receipts.provenance import describe_expert, describe_task
from robot_layouts.data.suite.report import render_markdown
from robot_layouts.data.suite.run import expect_untouched, read_run
from robot_layouts.data.suite.suite import load_suite
from robot_layouts.experts import find_expert
from robots import RobotRegistry
from tasks import get_task_class

DOCS = Path(__file__).parents[2] / "docs"
FOLDER = DOCS / "receipts" / "standard"
RECEIPTS = sorted((FOLDER / "receipts").glob("*.json"))


def test_the_page_says_what_the_receipts_say():
    text = render_markdown([expect_untouched(read_run(FOLDER))])
    assert text == (DOCS / "suite.md").read_text(encoding="utf-8")


def test_all_of_the_suite_was_played_portably():
    run = expect_untouched(read_run(FOLDER))
    assert run.suite.hash == load_suite("standard").hash
    assert not run.missing
    assert len(RECEIPTS) == 21
    for receipt in run.receipts.values():
        assert receipt.environment["processor"]["portable"] is True


@pytest.mark.parametrize("path", RECEIPTS, ids=lambda path: path.stem)
def test_it_was_played_by_the_code_that_is_here(path):
    receipt = Receipt.read(path)
    task = get_task_class(receipt.task["id"])
    assert receipt.task == describe_task(task)
    assert receipt.policy == describe_expert(find_expert(task.task_id))
    described = describe_layout(
        task.layout
    )  # also fields that descriptors had not when it was played
    for name, place in receipt.making["layout"].items():
        assert place["descriptor"] == descriptor_digest(RobotRegistry.load(place["robot"]))
        assert place["joint_groups"] == json.loads(json.dumps(described[name]["joint_groups"]))


@pytest.mark.long
@pytest.mark.parametrize("path", RECEIPTS, ids=lambda path: path.stem)
def test_it_is_so_on_this_processor(path, tmp_path):
    receipt = Receipt.read(path)
    few = replace(receipt, episodes=receipt.episodes[:2], claimed="")
    few.write(tmp_path / "few.json")
    portable = [
        sys.executable,
        "-m",
        "robot_layouts",
        "portable",
        sys.executable,
        "-m",
        "robot_layouts",
    ]
    words = ["verify", "few.json", "--workers", "0"]
    done = subprocess.run(
        [*portable, *words], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert "2 of 2 episodes equal to the last bit" in done.stdout, done.stdout + done.stderr
