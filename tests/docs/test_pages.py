"""Every page of the documentation whose code can run does, from the first block to the last."""

from pathlib import Path

import pytest

from tests.docs.blocks import ROOT, SHORTER, blocks, commands, play_apart

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


def test_every_tutorial_is_played():
    tutorials = {page for page in PAGES if page.startswith("tutorials/")}
    assert tutorials - {*PLAYED} == {"tutorials/index.md"}
    assert QUICK <= {*PLAYED}


class TestThePlayer:
    PAGE = """\
Text.

```python
x = 1
```

```python title="lab/one.py"
y = 2
```

<!-- not run: it fails -->
```python
1 / 0
```

=== "A tab"

    ```console
    $ python -c "from lab.one import y; \\
    print(y, file=open('y', 'w'))"
    2
    ```

```text
1 / 0
```

```python
from lab.one import y
assert x + y == {sum}
```
"""

    @pytest.fixture
    def page(self, tmp_path):
        def write(total: int) -> Path:
            page = tmp_path / "page.md"
            page.write_text(self.PAGE.replace("{sum}", str(total)))
            return page

        return write

    def test_it_plays_in_order(self, page, tmp_path):
        (tmp_path / "run").mkdir()
        done = play_apart(page(3), tmp_path / "run")
        assert done.returncode == 0, done.stderr
        assert (tmp_path / "run" / "empty" / "y").read_text() == "2\n"

    def test_what_fails_names_the_line_of_the_page(self, page, tmp_path):
        (tmp_path / "run").mkdir()
        done = play_apart(page(4), tmp_path / "run")
        assert done.returncode != 0
        assert 'page.md", line 30' in done.stderr

    def test_a_command_that_fails_fails(self, tmp_path):
        page = tmp_path / "page.md"
        page.write_text("```console\n$ false\n$ touch reached\n```\n")
        (tmp_path / "run").mkdir()
        assert play_apart(page, tmp_path / "run").returncode != 0
        assert not (tmp_path / "run" / "empty" / "reached").exists()


def test_continued_lines_are_one_command():
    assert commands("$ one \\\n  two\noutput\n$ three\n") == ["one   two", "three"]


def test_nothing_that_is_made_shorter_is_missing():
    pages = [ROOT / "README.md", *(DOCS / page for page in PLAYED)]
    code = "\n".join(block.code for page in pages for block in blocks(page))
    assert [long for long in SHORTER if long not in code] == []
