"""How pages that are single files look: one palette, and the style of each."""

from __future__ import annotations

import base64
import hashlib
from importlib.resources import files

COMMON = "robots.common"


def read_style(*sheets: tuple[str, str]) -> str:
    """Return style sheets, one after the other, after the colours that all pages share.

    Args:
        sheets: Of each the package that holds the file, such as ``robots.common``, and its name.
    """
    places = [files(package) / name for package, name in ((COMMON, "palette.css"), *sheets)]
    return "".join(place.read_text(encoding="utf-8") for place in places)


def source_hash(text: str) -> str:
    """Return what a page's content security policy calls a style or a script of its own."""
    digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
    return f"'sha256-{digest}'"
