"""What pages refer to is there, in the repository and in the site; what is not is seen."""

import re
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import unquote, urlsplit

import pytest

from benchmarks.site.hooks import LINK, loaded_from_elsewhere, on_page_markdown
from tests.checkout import tracked_files
from tests.docs.blocks import ROOT, blocks

FENCED = re.compile(r"^ *(```+).*?^ *\1$", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"`([\w.-]+(?:/[\w.-]+)*/?)`")
# What programs write into the repository, such as runs/demo, is not there yet.
FOLDERS = {file.relative_to(ROOT).parts[0] for file in tracked_files() if file.parent != ROOT} - {
    "assets_cache"
}
GENERATED = ("docs/faults.md", "docs/gallery/")  # they also name paths of other places
TEXTS = sorted(
    path
    for path in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"))
    if not path.relative_to(ROOT).as_posix().startswith(GENERATED)
)


def broken_in_text(text: str, file: Path, root: Path) -> list[str]:
    """Return what a Markdown file of the repository refers to that is not there.

    Links are relative to the file's folder, paths in code to the repository's.
    """
    prose = FENCED.sub("", text)
    relative = [link for link in LINK.findall(prose) if not urlsplit(link).scheme]
    missing = [link for link in relative if not leads_somewhere(link, text, file)]
    named = [path for path in CODE.findall(prose) if is_of_repository(path)]
    return missing + [path for path in named if not (root / path).exists()]


def leads_somewhere(link: str, text: str, file: Path) -> bool:
    path, _, fragment = unquote(link).partition("#")
    target = file.parent / path if path else file
    if not fragment or target.suffix != ".md":
        return target.exists()
    if path and not target.exists():
        return False
    return fragment in anchors_of(target.read_text(encoding="utf-8") if path else text)


def is_of_repository(path: str) -> bool:
    """Return whether a path begins in a folder of the repository; NAME stands for any name."""
    first, slash, _ = path.partition("/")
    return bool(slash) and "NAME" not in path and first in FOLDERS


def anchors_of(text: str) -> set[str]:
    """Return what a ``#fragment`` of a Markdown file may be, as code hosts make it of headings."""
    headings = re.findall(r"^#+ (.+)$", FENCED.sub("", text), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_and_paths_lead_somewhere(path):
    assert broken_in_text(path.read_text(encoding="utf-8"), path, ROOT) == []


def test_what_leads_nowhere_is_named():
    wrong = ["othr.md", "index.md#a-titel", "#there", "../pictures/b.png"]
    text = "".join(f"[a]({link}) " for link in (*wrong, "index.md")) + "`docs/othr.md`"
    found = broken_in_text(f"# Here\n[a](#here) {text}", ROOT / "docs/page.md", ROOT)
    assert sorted(found) == sorted([*wrong, "docs/othr.md"])


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


@pytest.mark.parametrize(
    ("html", "address"),
    [
        ('<a href="https://example.org">', ""),
        ('<link rel="canonical" href="https://example.org">', ""),
        ('<link rel="stylesheet" href="//example.org/a.css">', "//example.org/a.css"),
        ("<img alt=a src=http://example.org/a.png>", "http://example.org/a.png"),
    ],
)
def test_what_is_loaded_from_elsewhere(tmp_path, html, address):
    (tmp_path / "page.html").write_text(html)
    found = list(loaded_from_elsewhere(tmp_path))
    assert found == [f"page.html: loads {address}; the site must be readable offline"] * bool(
        address
    )
