"""What mkdocs.yml calls while the site is built."""

from __future__ import annotations

import logging
import re
from importlib import metadata
from pathlib import Path
from typing import Any

from benchmarks.site import commands, links

ROOT = Path(__file__).parents[2]
INCLUDED = re.compile(r'^--8<-- "(\w+\.md)"$', re.MULTILINE)  # of the repository's own folder
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
        return links.moved_into_site(text, page.file.src_uri)

    markdown = INCLUDED.sub(included, markdown)
    return markdown.replace(COMMANDS, commands.markdown()) if COMMANDS in markdown else markdown


def on_post_page(output: str, page: Any, **_: Any) -> str:
    """Load our own script where the theme would load one from elsewhere."""
    return output.replace(ELSEWHERE, "../" * page.url.count("/") + HERE)


def on_post_build(config: Any) -> None:
    """Look whether every link of the site leads somewhere in it; files need no page for 404."""
    folder = Path(config["site_dir"])
    (folder / "404.html").unlink(missing_ok=True)
    for problem in links.broken_in_site(folder):
        _log.warning(problem)
