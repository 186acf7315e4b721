"""The pages on what was learned are what their records, the receipts and the sources say."""

import json
from pathlib import Path

import pytest

pytest.importorskip("matplotlib")

from measurements import imitation, reinforcement
from rollouts.receipts import Receipt
from rollouts.receipts.provenance import describe_task
from tasks import get_task_class

ROOT = Path(__file__).parents[2]
PAGES = (imitation.PAGE, reinforcement.PAGE)
RECEIPTS = {
    page: sorted((ROOT / "docs" / "receipts" / page.record.stem).glob("*.json")) for page in PAGES
}


def record_of(page):
    return json.loads((ROOT / page.record).read_text(encoding="utf-8"))


def receipts():
    for page, paths in RECEIPTS.items():
        for path in paths:
            yield pytest.param(page, path, id=f"{page.record.stem}-{path.stem}")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.record.stem)
def test_a_page_says_what_its_record_says(page):
    written = (ROOT / page.record).with_suffix(".md").read_text(encoding="utf-8")
    assert "\n".join(page.markdown(record_of(page))) + "\n" == written


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.record.stem)
def test_every_run_has_a_receipt(page):
    assert len(RECEIPTS[page]) == len(record_of(page)["runs"]) > 0


@pytest.mark.parametrize(("page", "path"), [*receipts()])
def test_a_receipt_is_of_the_run(page, path):
    """The example may have changed since, which `verify` says; what it played is compared there."""
    receipt = Receipt.read(path)
    task, _, how = path.stem.partition("_")
    name = f"{task}, from pictures" if how == "pictures" else f"{task}, {how}" if how else task
    run = record_of(page)["runs"][name]
    first, last = run["test_seeds"]
    assert [episode.seed for episode in receipt.episodes] == [*range(first, last + 1)]
    assert [episode.seed for episode in receipt.episodes if not episode.success] == run["failed"]
    example = receipt.policy["name"].partition(":")[0]
    assert (ROOT / "examples" / f"{example}.py").exists()
    assert receipt.policy["files"]
    assert receipt.task == describe_task(get_task_class(receipt.task["id"]))
