"""What mkdocs.yml calls while the site is built."""

from __future__ import annotations

import logging
import posixpath
import re
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Any

from benchmarks.site import commands

ROOT = Path(__file__).parents[2]
INCLUDED = re.compile(r'^--8<-- "(\w+\.md)"$', re.MULTILINE)  # of the repository's own folder
LINK = re.compile(r"\]\(([^)\s]+)\)")
LOADED = re.compile(  # what a browser loads with a page, but for links that it does not follow
    r"""<(?:(?:img|script|source|iframe)\b[^>]*?\ssrc|link(?![^>]*\brel="?(?:canonical|next|prev)\b)"""
    r"""[^>]*?\shref)=["']?((?:https?:)?//[^"'\s>]+)"""
)
COMMANDS = "<!-- commands: written here when the site is built -->"
ELSEWHERE, HERE = "https://unpkg.com/iframe-worker/shim", "worker.js"  # for searching files

_log = logging.getLogger("mkdocs.hooks.site")  # a warning here fails a strict build


def on_config(config: Any) -> None:
    """Say the version below every page, and list the gallery's pages beside them."""
    config["copyright"] = (
        f"robot-layouts {metadata.version('robot-layouts')}, {config['copyright']}"
    )
    (gallery,) = (entry["Gallery"] for entry in config["nav"] if "Gallery" in entry)
    for kind in ("tasks", "robots"):
        pages = sorted(Path(config["docs_dir"], "gallery", kind).glob("*.md"))
        listed = [{page.stem: f"gallery/{kind}/{page.name}"} for page in pages]
        gallery.append({kind.capitalize(): listed})


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Include files of the repository's folder, and write the commands where they have a place."""

    def included(found: re.Match[str]) -> str:
        text = (ROOT / found[1]).read_text(encoding="utf-8")
        return moved_into_site(text, page.file.src_uri)

    markdown = INCLUDED.sub(included, markdown)
    return markdown.replace(COMMANDS, commands.markdown()) if COMMANDS in markdown else markdown


def on_post_page(output: str, page: Any, **_: Any) -> str:
    """Load our own script where the theme would load one from elsewhere."""
    return output.replace(ELSEWHERE, "../" * page.url.count("/") + HERE)


def on_post_build(config: Any) -> None:
    """See that no page loads anything from elsewhere; files need no page for 404."""
    folder = Path(config["site_dir"])
    (folder / "404.html").unlink(missing_ok=True)
    for problem in loaded_from_elsewhere(folder):
        _log.warning(problem)


def moved_into_site(text: str, page: str) -> str:
    """Return Markdown of the repository's folder with links that lead somewhere from a page.

    Args:
        text: The Markdown.
        page: The page that shows it, by its path in ``docs/``.
    """

    def moved(found: re.Match[str]) -> str:
        path = found[1].removeprefix("docs/")
        if path == found[1]:
            return found[0]
        return f"]({posixpath.relpath(path, posixpath.dirname(page))})"

    return LINK.sub(moved, text)


def loaded_from_elsewhere(folder: Path) -> Iterator[str]:
    """Yield a line for each address that a page of a site loads, which must be readable offline."""
    for file in sorted(folder.rglob("*.html")):
        for address in LOADED.findall(file.read_text(encoding="utf-8")):
            yield f"{file.relative_to(folder)}: loads {address}; the site must be readable offline"
