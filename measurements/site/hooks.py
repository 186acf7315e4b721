"""What mkdocs.yml calls while the site is built."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

from measurements.site import commands, links

COMMANDS = "<!-- commands: written here when the site is built -->"
ELSEWHERE, HERE = "https://unpkg.com/iframe-worker/shim", "worker.js"  # for searching files

_log = logging.getLogger("mkdocs.hooks.site")  # a warning here fails a strict build


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Write the commands into the page that has a place for them."""
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
