"""Parts of pages that are single files: the document, its head, sections, tables and figures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import NamedTuple

from robots.common.style import COMMON, read_style, source_hash

STYLE = (COMMON, "page.css")


class Tile(NamedTuple):
    """A number that a page begins with.

    Attributes:
        label: What it counts.
        value: The number, in words.
        note: What to know about it.
        kind: ``"good"``, ``"bad"``, or empty.
    """

    label: str
    value: str
    note: str
    kind: str = ""


def document(title: str, head: str, sections: Iterable[str], *sheets: tuple[str, str]) -> str:
    """Return a page, which loads nothing but the pictures and films that are in it.

    Args:
        title: Its title.
        head: Markup of its beginning; see `heading`.
        sections: Markup of each of its parts; see `section`.
        sheets: Style sheets besides the common one; see `robots.common.style.read_style`.
    """
    style = read_style(STYLE, *sheets)
    policy = f"default-src 'none'; media-src data:; img-src data:; style-src {source_hash(style)}"
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        f'<title>{escape(title)}</title>\n<link rel="icon" href="data:,">\n'
        f"<style>{style}</style>\n</head>\n<body>\n{head}<main>\n{''.join(sections)}</main>\n"
        "</body>\n</html>\n"
    )


def heading(kicker: str, title: str, note: str, tiles: Iterable[Tile]) -> str:
    """Return the beginning of a page: what it is about, and its main numbers."""
    shown = "".join(
        f'<div class="tile"><dt>{escape(tile.label)}</dt>'
        f'<dd class="value {tile.kind}">{escape(tile.value)}</dd>'
        f'<dd class="note">{escape(tile.note)}</dd></div>'
        for tile in tiles
    )
    return (
        f'<header><p class="kicker">{escape(kicker)}</p><h1>{escape(title)}</h1>'
        f'<p class="note">{escape(note)}</p><dl class="tiles">{shown}</dl></header>\n'
    )


def section(title: str, content: str) -> str:
    """Return a part of a page, of which the content is markup."""
    return f"<section><h2>{escape(title)}</h2>{content}</section>\n"


def table(names: Sequence[str], rows: Iterable[Sequence[str]], *, text: int = 1) -> str:
    """Return a table; the first ``text`` columns hold text, the others numbers.

    A cell that is `Markup` is taken as it is.
    """

    def cell(tag: str, place: int, words: str) -> str:
        kind = ' class="number"' if place >= text else ""
        content = words if isinstance(words, Markup) else escape(words)
        return f"<{tag}{kind}>{content}</{tag}>"

    head = "".join(cell("th", i, name) for i, name in enumerate(names)) if any(names) else ""
    body = "".join(
        f"<tr>{''.join(cell('td', i, words) for i, words in enumerate(row))}</tr>" for row in rows
    )
    return (
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'
        "</div>"
    )


class Markup(str):
    """Text of a page that is markup already."""

    __slots__ = ()


def plural(count: int, word: str) -> str:
    """Return a number of things, in words."""
    return f"{count:,} {word}" + ("" if count == 1 else "s")
