"""Whether what pages refer to exists: in the site as it was built, and in the repository."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# Of the repository. What programs write into it, such as runs/demo, is not there yet.
FOLDERS = (
    *(".ci", "benchmarks", "constraints", "docs", "examples", "integrations", "layouts", "parity"),
    *("robot_layouts", "robots", "tasks", "tests"),
)
LOADED = {"img": "src", "script": "src", "link": "href", "source": "src", "iframe": "src"}
NEEDS_NOTHING_LOADED = {"canonical", "next", "prev"}  # <link rel=…> that browsers do not load
FENCED = re.compile(r"^ *(```+).*?^ *\1$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"`([\w.-]+(?:/[\w.-]+)*/?)`")


@dataclass
class Page:
    """What one page of the site refers to, and what may be referred to in it.

    Attributes:
        links: Addresses that a click leads to.
        loaded: Addresses that the page loads by itself.
        anchors: What a ``#fragment`` may be.
    """

    links: list[str] = field(default_factory=list)
    loaded: list[str] = field(default_factory=list)
    anchors: set[str] = field(default_factory=set)


def read_page(html: str) -> Page:
    """Return what a page of HTML refers to."""
    reader = _Reader()
    reader.feed(html)
    return reader.page


def broken_in_site(folder: Path) -> list[str]:
    """Return a line for each link in a site that leads nowhere, or that loads from elsewhere."""
    files = sorted(folder.rglob("*.html"))
    pages = {file: read_page(file.read_text(encoding="utf-8")) for file in files}
    return [
        f"{file.relative_to(folder)}: {problem}"
        for file, page in pages.items()
        for problem in _problems(file, page, pages, folder)
    ]


def broken_in_text(text: str, file: Path, root: Path) -> list[str]:
    """Return what a Markdown file of the repository refers to that is not there.

    Args:
        text: The Markdown.
        file: Where it lies; links are relative to its folder.
        root: Of the repository; paths in code are relative to it.
    """
    prose = FENCED.sub("", text)
    relative = [link for link in LINK.findall(prose) if not urlsplit(link).scheme]
    missing = [link for link in relative if not _leads_somewhere(link, text, file)]
    named = [path for path in CODE.findall(prose) if _is_of_repository(path)]
    return missing + [path for path in named if not (root / path).exists()]


def moved_into_site(text: str, page: str) -> str:
    """Return Markdown of the repository's folder with links that lead somewhere from a page.

    Args:
        text: The Markdown.
        page: The page that shows it, by its path in ``docs/``.
    """

    def moved(found: re.Match[str]) -> str:
        path = found[1].removeprefix("docs/")
        return (
            f"]({posixpath.relpath(path, posixpath.dirname(page))})"
            if path != found[1]
            else found[0]
        )

    return LINK.sub(moved, text)


def anchors_of(text: str) -> set[str]:
    """Return what a ``#fragment`` of a Markdown file may be, as code hosts make it of headings."""
    headings = re.findall(r"^#+ (.+)$", FENCED.sub("", text), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.page = Page()

    def handle_starttag(self, tag: str, attrs: Iterable[tuple[str, str | None]]) -> None:
        values = {name: value for name, value in attrs if value}
        self.page.anchors |= {values[key] for key in ("id", "name") if key in values}
        if tag == "a" and "href" in values:
            self.page.links.append(values["href"])
        if LOADED.get(tag) in values and values.get("rel") not in NEEDS_NOTHING_LOADED:
            self.page.loaded.append(values[LOADED[tag]])


def _problems(file: Path, page: Page, pages: Mapping[Path, Page], root: Path) -> Iterator[str]:
    for address in (*page.links, *page.loaded):
        parts = urlsplit(address)
        if parts.scheme or parts.netloc:
            if address in page.loaded and parts.scheme != "data":
                yield f"loads {address}; the site must be readable offline"
            continue
        target = (file.parent / unquote(parts.path)).resolve() if parts.path else file
        if not target.is_relative_to(root.resolve()) or not target.exists():
            yield f"{address} leads nowhere"
        elif parts.fragment and target in pages and not _has(pages[target], parts.fragment):
            yield f"{address}: {target.name} has no such anchor"


def _has(page: Page, fragment: str) -> bool:
    return unquote(fragment) in page.anchors or fragment.startswith("__")  # the theme's own


def _leads_somewhere(link: str, text: str, file: Path) -> bool:
    path, _, fragment = unquote(link).partition("#")
    if not path:
        return fragment in anchors_of(text)
    target = file.parent / path
    if not fragment or target.suffix != ".md":
        return target.exists()
    return target.exists() and fragment in anchors_of(target.read_text(encoding="utf-8"))


def _is_of_repository(path: str) -> bool:
    """Return whether a path begins in a folder of the repository; NAME stands for any name."""
    first, slash, _ = path.partition("/")
    return bool(slash) and "NAME" not in path and first in FOLDERS
