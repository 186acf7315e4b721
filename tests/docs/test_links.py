"""What pages refer to is there, in the repository and in the site; what is not is seen."""

from types import SimpleNamespace

import pytest

from benchmarks.site.hooks import on_page_markdown
from benchmarks.site.links import FOLDERS, anchors_of, broken_in_site, broken_in_text
from tests.checkout import tracked_files
from tests.docs.blocks import ROOT, blocks

GENERATED = ("docs/faults.md", "docs/gallery/")  # they also name paths of other places
TEXTS = sorted(
    path
    for path in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"))
    if not path.relative_to(ROOT).as_posix().startswith(GENERATED)
)


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_and_paths_lead_somewhere(path):
    assert broken_in_text(path.read_text(encoding="utf-8"), path, ROOT) == []


@pytest.mark.parametrize("page", sorted((ROOT / "docs/project").glob("*.md")), ids=lambda p: p.stem)
def test_what_the_site_includes_has_links_that_lead_somewhere(page):
    name = page.relative_to(ROOT / "docs").as_posix()
    shown = on_page_markdown(
        page.read_text(), page=SimpleNamespace(file=SimpleNamespace(src_uri=name))
    )
    assert (ROOT / f"{page.stem.upper()}.md").read_text().splitlines()[0] in shown
    assert broken_in_text(shown, page, ROOT) == []


def test_the_readme_declares_the_tutorials_task():
    declared = [one.code for one in blocks(ROOT / "README.md") if "register_task" in one.code]
    assert declared == [(ROOT / "docs/tutorials/tray.py").read_text(encoding="utf-8")]


def test_paths_in_every_folder_of_the_repository_are_looked_at():
    folders = {file.relative_to(ROOT).parts[0] for file in tracked_files() if file.parent != ROOT}
    assert {*FOLDERS} == folders - {"assets_cache"}


class TestText:
    @pytest.fixture
    def root(self, tmp_path):
        (tmp_path / "docs").mkdir()
        (tmp_path / "docs" / "other.md").write_text("# A title: with `code`\n")
        for made in ("runs", "data", "site", "assets_cache", ".venv"):
            (tmp_path / made).mkdir()
        return tmp_path

    @pytest.mark.parametrize(
        ("text", "broken"),
        [
            ("[a](other.md) ![b](other.md)", []),
            ("[a](othr.md)", ["othr.md"]),
            ("![b](../pictures/b.png)", ["../pictures/b.png"]),
            ("[a](other.md#a-title-with-code)", []),
            ("[a](other.md#a-titel)", ["other.md#a-titel"]),
            ("# Here\n[a](#here)", []),
            ("# Here\n[a](#there)", ["#there"]),
            ("[a](https://example.org/x.md)", []),
            ("see `docs/other.md`", []),
            ("see `docs/othr.md`", ["docs/othr.md"]),
            ("see `docs/NAME.md`, `outside/trajectory.h5`", []),
            ("see `runs/demo`, `data/trajectory.h5`, `site/index.html`", []),
            ("see `assets_cache/robots/panda.urdf`, `.venv/bin/python`", []),
            ("```\n[a](othr.md) `docs/othr.md`\n```", []),
        ],
    )
    def test_what_is_broken(self, root, text, broken):
        assert broken_in_text(text, root / "docs" / "page.md", root) == broken

    def test_anchors_are_those_of_code_hosts(self):
        assert anchors_of("# A b\n## C: d, `e`\n```\n# no\n```\n") == {"a-b", "c-d-e"}


class TestSite:
    @pytest.mark.parametrize(
        ("html", "problem"),
        [
            ('<a href="other.html#there">', ""),
            ('<a href="#here"><p id="here">', ""),
            ('<a href="https://example.org">', ""),
            ('<img src="data:image/png;base64,AA==">', ""),
            ('<a href="gone.html">', "gone.html leads nowhere"),
            ('<a href="other.html#gone">', "other.html has no such anchor"),
            ('<a href="../outside.html">', "../outside.html leads nowhere"),
            ('<img src="gone.png">', "gone.png leads nowhere"),
            ('<script src="https://example.org/a.js"></script>', "readable offline"),
            ('<link rel="stylesheet" href="//example.org/a.css">', "readable offline"),
        ],
    )
    def test_what_is_broken(self, tmp_path, html, problem):
        (tmp_path / "outside.html").touch()
        site = tmp_path / "site"
        site.mkdir()
        (site / "page.html").write_text(html)
        (site / "other.html").write_text('<h1 id="there">')
        found = broken_in_site(site)
        assert len(found) == bool(problem)
        assert all(problem in line and line.startswith("page.html: ") for line in found)
