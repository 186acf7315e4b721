"""``python -m benchmarks gallery``: pages are complete, fresh, and say what records say."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from benchmarks.__main__ import main
from benchmarks.gallery import pages as gallery
from benchmarks.gallery.pages import FOLDER, _read, all_pages, complaints, solved
from benchmarks.gallery.pictures import LARGEST_CLIP, LARGEST_PORTRAIT
from benchmarks.records import RecordError
from robots.registry import CATALOGUE as ROBOTS
from tasks.registry import CATALOGUE as TASKS

LARGEST_GALLERY = 12_000_000  # bytes
LINK = re.compile(r"\]\(([^)#]+)\)")
PICTURE = re.compile(r"!\[([^]]*)\]")


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    return all_pages(_read(), FOLDER)


@pytest.fixture
def copy(tmp_path, monkeypatch) -> Path:
    """Return a copy of the gallery, which the command takes for the gallery."""
    folder = Path(shutil.copytree(FOLDER, tmp_path / "gallery"))
    monkeypatch.setattr(gallery, "FOLDER", folder)
    return folder


class TestCommitted:
    def test_pages_are_fresh(self, capsys):
        assert main(["gallery", "--check"]) == 0, capsys.readouterr().err

    def test_links_resolve_and_pictures_say_in_words_what_they_show(self):
        for page in FOLDER.rglob("*.md"):
            text = page.read_text(encoding="utf-8")
            assert LINK.findall(text)
            assert not [link for link in LINK.findall(text) if not (page.parent / link).is_file()]
            assert all(len(words.split()) > 2 for words in PICTURE.findall(text)), page

    def test_pictures_are_small(self):
        for folder, limit in (("robots", LARGEST_PORTRAIT), ("tasks", LARGEST_CLIP)):
            for path in (FOLDER / "media" / folder).iterdir():
                assert path.stat().st_size <= limit, path
        files = (path for path in FOLDER.rglob("*") if path.is_file())
        assert sum(path.stat().st_size for path in files) <= LARGEST_GALLERY


@pytest.mark.long
def test_what_was_altered_is_named_and_written_again(copy, capsys):
    (copy / "tasks" / "PickCube-v1.md").write_text("changed")
    (copy / "robots" / "panda.md").unlink()
    (copy / "robots" / "nobody.md").touch()
    (copy / "media" / "robots" / "so100.webp").unlink()
    (copy / "media" / "tasks" / "Nothing-v1.webp").touch()
    record = _read()
    record["robots"]["koch"]["urdf_sha256"] = "0" * 64
    found = list(complaints(record, copy))
    for expected in (
        "tasks/PickCube-v1.md is stale; run `python -m benchmarks gallery`",
        "robots/panda.md is missing; run `python -m benchmarks gallery`",
        "robots/nobody.md is of no task or robot",
        "media/robots/so100.webp is missing; run `.* --pictures so100`",
        "media/tasks/Nothing-v1.webp is of no task or robot; remove it",
        "the URDF of koch has changed; run `.* --measure koch`",
    ):
        assert any(re.match(expected, line) for line in found), expected
    # The page of a robot, and the cards, show no picture that there is not.
    stale = {line.split()[0] for line in found if " is stale" in line}
    assert stale == {"tasks/PickCube-v1.md", "robots/so100.md", "index.md"}
    assert main(["gallery", "--check"]) == 1
    assert main(["gallery"]) == 0
    assert len(list(copy.rglob("*.md"))) == 1 + len(TASKS) + len(ROBOTS)


def test_what_the_record_lacks_is_named_with_the_command():
    record = _read()
    del record["tasks"]["PushT-v1"]
    with pytest.raises(RecordError, match="no tasks PushT-v1; run `.* --measure PushT-v1`"):
        all_pages(record, FOLDER)
    assert solved({"episodes": 3, "failed": {"0": "dropped", "2": "late"}}) == [1]
