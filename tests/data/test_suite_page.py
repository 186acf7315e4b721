"""The results page lists what was played again and is equal, and runs nobody's program for it."""

import re
from dataclasses import replace

import pytest

from robot_layouts.__main__ import main
from robot_layouts.data.receipts.receipt import EpisodeReceipt, Receipt
from robot_layouts.data.receipts.verification import verify
from robot_layouts.data.suite.page import PAGE, RUNS, TABLES, worst_seeds, write_page
from robot_layouts.data.suite.run import begin_run, read_run, receipt_path, run_suite
from robot_layouts.data.suite.suite import Case, Suite
from robot_layouts.data.video import video_problem
from robots import TaskError
from tests.data.suites import made_run, receipt

STILL = "tests.data.policies:still"
SUITE = Suite("pushes", (Case("PushT-v1", (0, 1), name="First"), Case("PushT-v1", (5,))))


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "still"
    run_suite(SUITE, folder, STILL, workers=0)
    return folder


def copy(played, folder, change=lambda receipt: receipt):
    """Write a run like another, with its first receipt changed, and the hash of what it became."""
    run = begin_run(folder, SUITE)
    for case in SUITE.cases:
        one = replace(read_run(played).receipts[case.name], claimed="")
        (change(one) if case.name == "First" else one).write(receipt_path(folder, case))
    return run.folder


def report(*words):
    return main(["suite", "report", *map(str, words), "--workers=0", "--episodes=1"])


def test_what_is_equal_is_listed(played, tmp_path, capsys):
    out = tmp_path / "page"
    assert report(played, f"--out={out}", "--policy", STILL) == 0
    assert capsys.readouterr().out == f"{out / PAGE}\n"
    text = (out / PAGE).read_text()
    assert "0.0 (0.0 to 65.8)" in text
    assert "1 of 2 played again" in text
    assert f"verify runs/still/receipts/First.json --policy {STILL}</code>" in text
    assert "Not verified here" not in text
    assert not re.search(r'src="(?!data:)', text)
    assert not re.search(r"url\(|@import|<script", text)
    links = set(re.findall(r'href="(?!data:)([^"]*)"', text))
    assert links == {"runs/still/receipts/First.json", "runs/still/receipts/PushT-v1.json"}
    for link in links:
        assert Receipt.read(out / link).untouched
    assert read_run(out / RUNS / "still").receipts == read_run(played).receipts
    assert "| First | 0.0 (0.0 to 65.8) | 2 |" in (out / TABLES).read_text()


def test_policies_that_are_not_named_stand_apart(played, tmp_path, monkeypatch):
    monkeypatch.setattr("tests.data.policies.still", None)  # playing it would fail
    assert report(played, f"--out={tmp_path / 'page'}") == 0
    text = (tmp_path / "page" / PAGE).read_text()
    assert "<h2>Success</h2>" not in text
    assert "Not verified here" in text
    assert text.count(f"--policy {STILL}") == 2
    assert read_run(tmp_path / "page" / RUNS / "still").missing == ()


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda r: replace(r, episodes=tuple(replace(e, total=9.0) for e in r.episodes)), "return"),
        (lambda r: replace(r, policy={**r.policy, "sha256": "0" * 64}), "source of the module"),
        (lambda r: replace(r, episodes=r.episodes[:1]), "has other seeds than the case First"),
    ],
)
def test_what_differs_is_not_listed(change, why, played, tmp_path, capsys):
    theirs = copy(played, tmp_path / "theirs", change)
    out = tmp_path / "page"
    assert report(theirs, f"--out={out}", "--policy", STILL) == 1
    assert capsys.readouterr().out.startswith("not listed: theirs, First\n")
    text = (out / PAGE).read_text()
    assert why in text
    assert str(tmp_path) not in text
    assert list(read_run(out / RUNS / "theirs").receipts) == ["PushT-v1"]


def test_a_receipt_that_was_edited_is_not_listed(played, tmp_path, capsys):
    theirs = copy(played, tmp_path / "theirs")
    path = receipt_path(theirs, SUITE.cases[0])
    path.write_text(path.read_text().replace('"success": false', '"success": true'))
    assert report(theirs, "--policy", STILL) == 1
    text = (theirs / "report" / PAGE).read_text()  # where it is unless another place is named
    assert "receipts/First.json was changed after it was written" in text


def test_a_page_takes_the_place_of_a_page_alone(played, tmp_path, capsys):
    out = tmp_path / "page"
    assert report(played, played, f"--out={out}") == 0
    assert {path.name for path in (out / RUNS).iterdir()} == {"still", "still-2"}
    assert report(played, f"--out={out}") == 0
    assert {path.name for path in (out / RUNS).iterdir()} == {"still"}
    (out / "thesis.tex").touch()
    capsys.readouterr()
    for place in (out, played.parent):
        assert report(played, f"--out={place}") == 1
        assert "holds something else; a report needs a folder" in capsys.readouterr().err
    with pytest.raises(TaskError, match="holds something else"):
        write_page(out, [])
    assert (out / "thesis.tex").exists()


def test_texts_of_receipts_are_no_markup(tmp_path):
    made_run(tmp_path / "strange", SUITE, {"First": [], "PushT-v1": []})
    path = receipt_path(tmp_path / "strange", SUITE.cases[0])
    policy = {"kind": "policy", "name": "<b>'a b'\n$(x)", "sha256": None}
    replace(Receipt.read(path), policy=policy, claimed="").write(path)
    assert report(tmp_path / "strange") == 0
    text = (tmp_path / "strange" / "report" / PAGE).read_text()
    assert "<b>" not in text
    assert "--policy &#39;&lt;b&gt;" in text  # quoted for the shell, too


def test_several_suites(played, tmp_path):
    other = Suite("other", (Case("PickCube-v1", (3,)),))
    made_run(tmp_path / "lab", other, {"PickCube-v1": [3]})
    assert report(played, tmp_path / "lab", f"--out={tmp_path / 'page'}", "--policy", STILL) == 0
    text = (tmp_path / "page" / PAGE).read_text()
    assert f"<h2>pushes {SUITE.id}: Success</h2>" in text
    assert "lab:POLICY" in text


def test_some_episodes_of_a_receipt(played):
    whole = read_run(played).receipts["First"]
    found = verify(whole, policy=STILL, workers=0, episodes=1)
    assert found.equal
    (one,) = found.here.episodes
    assert one in whole.episodes
    edited = replace(whole, claimed="0" * 64)
    assert not verify(edited, policy=STILL, workers=0, episodes=1).equal


def test_the_worst_seeds(tmp_path):
    suite = Suite("two", (Case("PickCube-v1", range(4)), Case("PushCube-v1", range(4))))
    one = made_run(tmp_path / "one", suite, {"PickCube-v1": [0], "PushCube-v1": range(4)})
    two = made_run(tmp_path / "two", suite, {"PickCube-v1": [0, 1], "PushCube-v1": [0, 1, 2]})
    found = [(case.name, seed) for case, seed in worst_seeds([one, two], 9)]
    # both failed, those that earned less first; then one of two, the worst of each case first
    assert found == [
        ("PickCube-v1", 2), ("PickCube-v1", 3), ("PushCube-v1", 3), ("PickCube-v1", 1)
    ]  # fmt: skip
    assert len(worst_seeds([one, two], 3)) == 3


def test_stage_scores_count_what_took_no_step():
    from robot_layouts.data.suite.results import result_of

    def episode(seed, stage_score):
        return EpisodeReceipt(seed, False, 0, 0.0, "0" * 64, "AAA=", stage_score=stage_score)

    assert result_of([episode(0, 0.6), episode(1, None)]).stage_score == 0.3
    assert result_of([episode(0, None)]).stage_score is None


def test_receipts_of_tasks_without_stages_are_as_they_were():
    plain = receipt(SUITE.cases[0], {0: True})
    (one,) = plain.episodes
    staged = replace(plain, episodes=(replace(one, stage_score=0.5),))
    assert staged.hash != plain.hash
    assert "stage_score" not in plain._content()["episodes"][0]


@pytest.mark.long
@pytest.mark.skipif(video_problem("sapien3") is not None, reason="needs Vulkan and imageio")
def test_clips(played, tmp_path, renderer):
    out = tmp_path / "page"
    assert report(played, f"--out={out}", "--policy", STILL, "--clips=2") == 0
    text = (out / PAGE).read_text()
    assert text.count("<video") == 2
    assert "<h3>First, seed" in text
    assert "<h3>PushT-v1, seed 5</h3>" in text
    assert "not filmed" not in text
