"""``python -m parity tables``: the table, and the ways in which it can be stale."""

import json

import pytest

from parity.__main__ import main
from parity.lockstep import QUANTITIES
from tasks import list_clones

PAGE = """# Title

<!-- parity table: begin; written by `python -m parity tables` -->
<!-- parity table: end -->

The end.
"""
ENTRY = {
    "robots": "2 × panda",
    "observation_size": 66,
    "action_size": 16,
    "equal": True,
    "episodes": 12,
    "steps": 3456,
    "contact_steps": 789,
    "success": {"native": 5, "ours": 4, "both": 4},
    "max_difference": {quantity: 0.0 for quantity in QUANTITIES if quantity != "reward"},
    "reward": {"normalized_dense": 0.0, "dense": 2.5e-7, "sparse": 0.0},
}


@pytest.fixture
def files(tmp_path):
    (tmp_path / "parity.md").write_text(PAGE)
    return tmp_path


def run(folder, *options: str, lacking: str = "", extra: str = "", entry=ENTRY) -> int:
    record = {task: entry for task in (*list_clones(), extra) if task not in ("", lacking)}
    versions = {"python": "3.11.7", "mani_skill": "3.0.1"}
    about = {"versions": versions, "machine": "x86_64", "tasks": record}
    (folder / "results.json").write_text(json.dumps(about))
    paths = ("--page", str(folder / "parity.md"), "--results", str(folder / "results.json"))
    return main(["tables", *paths, *options])


def test_a_row_says_everything(files):
    assert run(files) == 0
    text = (files / "parity.md").read_text(encoding="utf-8")
    assert text.startswith("# Title\n\n<!--")
    assert text.endswith("\n\nThe end.\n")
    heading, rule, *rows = (line for line in text.splitlines() if line.startswith("|"))
    assert heading.count("|") == rule.count("|") == rows[0].count("|")
    names, cells = ([c.strip() for c in line.strip("|").split("|")] for line in (heading, rows[0]))
    assert dict(zip(names, cells, strict=True)) == {
        "task": f"`{list_clones()[0]}`",
        "robots": "2 × panda",
        "obs": "66",
        "actions": "16",
        "episodes": "12",
        "steps": "3456",
        "contact steps": "789",
        "object pose": "0",
        "qpos": "0",
        "observation": "0",
        "reward, normalized_dense": "0",
        "reward, dense": "2.5e-07",
        "reward, sparse": "0",
        "reward, none": "–",
        "success and info": "0",
        "succeeded native / here": "5 / 4",
    }
    assert len(rows) == len(list_clones())
    assert "Measured on x86_64 with python 3.11.7, mani_skill 3.0.1." in text


def test_a_stale_page_and_a_record_of_other_tasks_are_noticed(files, capsys):
    assert run(files, "--check") == 1
    assert "parity.md is stale; run `python -m parity tables`" in capsys.readouterr().err
    assert (files / "parity.md").read_text() == PAGE
    assert run(files) == run(files, "--check") == 0
    assert run(files, "--check", entry={**ENTRY, "steps": 3457}) == 1
    lacking = list_clones()[0]
    assert run(files, lacking=lacking) == 0
    assert run(files, "--check", lacking=lacking) == 1
    assert f"the record lacks {lacking}; run `make parity`" in capsys.readouterr().err
    assert run(files, extra="Gone-v1") == 0
    assert run(files, "--check", extra="Gone-v1") == 1
    assert "Gone-v1" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("page", "complaint"),
    [
        ("", "begin; written by `python -m parity tables` -->' 0 times"),
        (PAGE + PAGE, "-->' 2 times"),
        ("\n".join(reversed(PAGE.splitlines())), "end -->' before '<!-- parity table: begin"),
    ],
)
def test_a_page_without_its_markers_is_left_alone(files, page, complaint, capsys):
    (files / "parity.md").write_text(page)
    assert run(files) == 2
    assert complaint in capsys.readouterr().err
    assert (files / "parity.md").read_text() == page


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"versions": {}, "machine": "", "tasks": 3}'])
def test_what_is_no_record(files, text, capsys):
    (files / "results.json").write_text(text)
    words = ("--page", str(files / "parity.md"), "--results", str(files / "results.json"))
    assert main(["tables", *words]) == 2
    assert "`make parity`" in capsys.readouterr().err


def test_this_project_s_own_page_shows_its_record():
    assert main(["tables", "--check"]) == 0
