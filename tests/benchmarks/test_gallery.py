"""``python -m benchmarks gallery``: pages are complete, fresh, and say what records say."""

from __future__ import annotations

import re

import pytest

from benchmarks.__main__ import main
from benchmarks.gallery.pages import FOLDER, _read, all_pages, solved
from benchmarks.gallery.pictures import LARGEST_CLIP, LARGEST_PORTRAIT
from benchmarks.records import RecordError

LARGEST_GALLERY = 12_000_000  # bytes
LINK = re.compile(r"\]\(([^)#]+)\)")
PICTURE = re.compile(r"!\[([^]]*)\]")


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    return all_pages(_read(), FOLDER)


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


def test_what_the_record_lacks_is_named_with_the_command():
    record = _read()
    del record["tasks"]["PushT-v1"]
    with pytest.raises(RecordError, match="no tasks PushT-v1; run `.* --measure PushT-v1`"):
        all_pages(record, FOLDER)
    assert solved({"episodes": 3, "failed": {"0": "dropped", "2": "late"}}) == [1]
