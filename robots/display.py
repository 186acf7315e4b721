"""Headings and tables that notebooks show of a robot, a layout or a task, as HTML."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

_CELL = ' style="text-align: left; padding: 0 1em 0 0"'


def heading(title: str, text: str) -> str:
    """Return a title in bold and a text behind it."""
    return f"<div><b>{escape(title)}</b>: {escape(text)}</div>"


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table of texts."""
    first = "".join(f"<th{_CELL}>{escape(head)}</th>" for head in heads)
    others = ("".join(f"<td{_CELL}>{escape(cell)}</td>" for cell in row) for row in rows)
    head = f"<thead><tr>{first}</tr></thead>" if heads else ""
    body = "".join(f"<tr>{cells}</tr>" for cells in others)
    return f"<table>{head}<tbody>{body}</tbody></table>"
