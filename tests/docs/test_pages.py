"""Every page of the documentation whose code can run does, from the first block to the last."""

import pytest

from tests.docs.blocks import ROOT, SHORTER, blocks, play_apart

DOCS = ROOT / "docs"
PAGES = sorted(page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md"))
GENERATED = "gallery/"  # its pages all show the same commands, once for each task and robot
PLAYED = [page for page in PAGES if not page.startswith(GENERATED) and blocks(DOCS / page)]
QUICK = {"concepts/robots.md"}  # the others take longer than five seconds


@pytest.mark.parametrize(
    "page", [p if p in QUICK else pytest.param(p, marks=pytest.mark.long) for p in PLAYED]
)
def test_it_runs(page, tmp_path):
    done = play_apart(DOCS / page, tmp_path)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"


@pytest.mark.parametrize(
    ("block", "words"),
    [("```python\nassert 1 == 2\n```", '", line 6'), ("```console\n$ false\n```", "false")],
)
def test_what_fails_is_told_with_its_line_or_command(block, words, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"```python\nx = 1\n```\n\n{block}\n")
    (tmp_path / "run").mkdir()
    done = play_apart(page, tmp_path / "run")
    assert done.returncode != 0
    assert words in done.stderr


def test_every_tutorial_is_played():
    tutorials = {page for page in PAGES if page.startswith("tutorials/")}
    assert tutorials - {*PLAYED} == {"tutorials/index.md"}
    assert QUICK <= {*PLAYED}


def test_nothing_that_is_made_shorter_is_missing():
    pages = [ROOT / "README.md", *(DOCS / page for page in PLAYED)]
    code = "\n".join(block.code for page in pages for block in blocks(page))
    assert [long for long in SHORTER if long not in code] == []
