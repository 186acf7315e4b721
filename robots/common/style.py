"""How pages that are single files look: one palette, and the style of each."""

from __future__ import annotations

import base64
import hashlib
from importlib.resources import files


def read_style(package: str, name: str) -> str:
    """Return a style sheet of a package, after the colours that all pages share.

    Args:
        package: The package that holds the file, such as ``rollouts.dataset``.
        name: The file.
    """
    sheets = (files("robots.common") / "palette.css", files(package) / name)
    return "".join(sheet.read_text(encoding="utf-8") for sheet in sheets)


def source_hash(text: str) -> str:
    """Return what a page's content security policy calls a style or a script of its own."""
    digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
    return f"'sha256-{digest}'"
