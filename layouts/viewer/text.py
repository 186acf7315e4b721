"""Names on a page: shown as they are, whatever is in them, and never taken for markup."""

from __future__ import annotations

import html
from typing import Any
from urllib.parse import quote

STYLE = "padding: 0 0.75rem 0.5rem; font-size: 0.875rem; overflow-wrap: anywhere"


def printable(text: str) -> str:
    r"""Return a text as one line, with escapes such as ``\n`` for what cannot be printed."""
    return "".join(
        letter if letter.isprintable() else letter.encode("unicode_escape").decode()
        for letter in text
    )


def as_html(text: str) -> str:
    """Return HTML that shows a text, line by line."""
    return "<br>".join(html.escape(printable(line)) for line in text.split("\n"))


def node(*names: str) -> str:
    """Return the path of a node in the scene's tree; a slash in a name begins no other node."""
    return "".join(f"/{''.join(map(_in_a_node, name))}" for name in names)


def _in_a_node(letter: str) -> str:
    plain = letter.isprintable() and letter not in "/%"
    return letter if plain else quote(letter, safe="", errors="surrogatepass")


class Text:
    """A text on a page's panel.

    viser's own Markdown takes HTML, and turns addresses in it into links; all text of a page is
    this instead.
    """

    def __init__(self, gui: Any, text: str, *, bold: bool = False) -> None:
        """Add it to the panel.

        Args:
            gui: The ``gui`` of a viser server.
            text: What to show, as lines.
            bold: Whether to write it in bold letters.
        """
        self._weight = "bold" if bold else "normal"
        self._handle: Any = gui.add_html("")
        self.text = text

    @property
    def text(self) -> str:
        """What is shown, as lines."""
        return self._text

    @text.setter
    def text(self, text: str) -> None:
        self._text = text
        style = f"{STYLE}; font-weight: {self._weight}"
        self._handle.content = f'<div style="{style}">{as_html(text)}</div>'
