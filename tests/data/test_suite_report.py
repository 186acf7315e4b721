"""The report of a suite's runs says what their receipts say, and needs nothing else."""

import re
from dataclasses import replace
from html import unescape

import pytest
from markdown_it import MarkdownIt

from layouts import single
from robot_layouts.data.receipts.receipt import Receipt, ReceiptError
from robot_layouts.data.suite.report import (
    ALL,
    comparisons,
    failures,
    lengths,
    render_markdown,
    successes,
)
from robot_layouts.data.suite.results import compare, overall
from robot_layouts.data.suite.run import expect_untouched, read_run, receipt_path
from robot_layouts.data.suite.suite import Case, Suite
from robots import TaskError
from tasks import Randomization
from tests.data.suites import made_run, receipt

SUITE = Suite(
    "mine",
    (
        Case("PickCube-v1", range(4)),
        Case("PushCube-v1", range(20), name="Push"),
        Case("PushT-v1", [3]),
    ),
)
EVERY = range(20)
OTHERWISE = {
    "layout": {"layout": single({"arm": "panda_wristcam"})},
    "control_mode": {"control_mode": "pd_joint_pos"},
    "obs_mode": {"obs_mode": "state_dict"},
    "randomization": {"randomization": Randomization(mass={"cube": 2.0})},
}


def read_runs(folders):
    return [expect_untouched(read_run(folder)) for folder in folders]


@pytest.fixture
def folders(tmp_path):
    """The second run failed at more seeds, and has not played PushT."""
    made_run(tmp_path / "first", SUITE, {"PickCube-v1": [0, 1, 2], "Push": EVERY, "PushT-v1": []})
    made_run(tmp_path / "second", SUITE, {"PickCube-v1": [0, 3], "Push": EVERY[:8]})
    return [tmp_path / "first", tmp_path / "second"]


def test_successes(folders):
    table = successes(read_runs(folders))
    assert table.names == ("case", "A: success", "B: success", "episodes")
    rows = {row[0]: row[1:] for row in table.rows}
    assert rows["PickCube-v1"] == ("75.0 (30.1 to 95.4)", "50.0 (15.0 to 85.0)", "4")
    assert rows["Push"] == ("100.0 (83.9 to 100.0)", "40.0 (21.9 to 61.3)", "20")
    assert rows["PushT-v1"] == ("0.0 (0.0 to 79.3)", "–", "1")
    assert rows[ALL] == ("92.0 (75.0 to 97.8)", "41.7 (24.5 to 61.2)", "24 / 25")
    assert successes(read_runs(folders[:1])).names == ("case", "success", "episodes")


def test_runs_are_compared_seed_by_seed(folders):
    ((title, table),) = comparisons(read_runs(folders))
    assert title == "B beside A, seed by seed"
    rows = {row[0]: row[1:] for row in table.rows}
    assert set(rows) == {"PickCube-v1", "Push", ALL}
    assert rows["PickCube-v1"][:3] == ("1", "2", "−25.0")
    # 12 seeds that one alone solved: 2 / 2**12, and twice that for two cases
    assert rows["Push"] == ("0", "12", "−60.0", "−78.9 to −30.2", "0.00049", "0.00098")
    assert rows[ALL][:2] == ("1", "14")
    assert list(comparisons(read_runs(folders[:1]))) == []


def test_pairs_are_of_equal_seeds():
    one = receipt(SUITE.cases[0], {0: True, 1: True, 5: False})
    other = receipt(SUITE.cases[0], {5: True, 1: False, 0: True})
    case, all_cases = compare([(one, other)])
    assert (case.gained, case.lost, case.episodes) == (1, 1, 3)
    assert all_cases == case
    assert case.difference == 0


def test_all_cases_together():
    found = overall(
        [receipt(SUITE.cases[0], {0: True, 1: False}), receipt(SUITE.cases[1], {7: True})]
    )
    assert found is not None
    assert (found.successes, found.episodes, found.lengths) == (2, 3, (1, 8))
    assert (found.length, found.total) == (2, (1 + 2 + 8) / 6)
    assert overall([]) is None


def test_lengths_and_failures(folders):
    runs = read_runs(folders)
    assert lengths(runs).rows[0] == (
        "PickCube-v1", "2.5", "1 to 4", "1.25", "2.5", "1 to 4", "1.25"
    )  # fmt: skip
    assert lengths(runs).rows[2][4:] == ("–", "–", "–")
    assert failures(runs).rows[0] == ("A", "PickCube-v1", "1", "3", "1 × it was <dropped>")
    assert failures(runs).rows[-1][2:4] == ("12", "8, 9, 10, 11, 12, 13, 14, 15, 16, 17, …")


STRANGE = (
    "[a](javascript:alert(1)) ![b](http://x.y/z.png) <http://x.y> [c]: www.x.y\n\nhttps://x.y"
    " | `d` **e** _f_ ~~g~~ \\[h](http://x.y)"
)


def test_no_text_of_a_receipt_is_markup(folders):
    """Whoever publishes a report of somebody else's run publishes no links of theirs."""
    path = receipt_path(folders[0], SUITE.cases[0])
    good = Receipt.read(path)
    policy = {**good.policy, "name": STRANGE}
    failed = replace(good.episodes[3], reason=STRANGE)
    processor = {"versions": {"python": STRANGE}, "processor": {"name": STRANGE}}
    replace(
        good, policy=policy, episodes=(*good.episodes[:3], failed), environment=processor
    ).write(path)
    text = render_markdown(read_runs(folders))
    html = MarkdownIt("commonmark").enable(["table", "strikethrough"]).render(text)
    assert unescape(html).count(STRANGE.replace("\n", " ").replace("  ", " ")) == 4
    assert not re.search(r"<(a|img|em|strong|s)\b|<code>d", html)
    assert not re.search(r"://|www\.", text)  # which some renderers make links of


def test_a_folder_without_a_run(tmp_path):
    with pytest.raises(TaskError, match="none holds no run of a suite; `robot-layouts suite run"):
        read_run(tmp_path / "none")


def test_receipts_that_are_not_what_they_should_be(folders):
    path = receipt_path(folders[0], SUITE.cases[0])
    good = Receipt.read(path)
    path.write_text(path.read_text().replace('"success": false', '"success": true'))
    with pytest.raises(ReceiptError, match="PickCube-v1.json was changed after it was written"):
        read_runs(folders)
    replace(good, episodes=good.episodes[1:]).write(path)
    with pytest.raises(ReceiptError, match="has other seeds than the case PickCube-v1"):
        read_runs(folders)
    receipt(SUITE.cases[2], dict.fromkeys(range(4), True)).write(path)
    with pytest.raises(ReceiptError, match="is of PushT-v1, not of PickCube-v1"):
        read_runs(folders)
    for otherwise, what in OTHERWISE.items():
        receipt(replace(SUITE.cases[0], **what), dict.fromkeys(range(4), True)).write(path)
        with pytest.raises(ReceiptError, match=f"as the case PickCube-v1 .* are {otherwise}$"):
            read_runs(folders)
    path.write_text("{}")
    with pytest.raises(ReceiptError, match="PickCube-v1.json is no receipt"):
        read_runs(folders)
