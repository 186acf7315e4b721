"""What notebooks show of a robot, a layout and a task: HTML that holds no scripts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robots.action_split import ActionNumber

_CELL = ' style="text-align: left; padding: 0 1em 0 0"'


def robot_html(name: str, text: str, numbers: Iterable[ActionNumber]) -> str:
    """Return a robot as a heading, with a text behind its name, and a table of action numbers."""
    rows = [
        (str(n.index), n.name, f"{n.lower:g}", f"{n.upper:g}", n.unit, ", ".join(n.joints))
        for n in numbers
    ]
    heads = ("#", "action number", "lowest", "highest", "unit", "joints")
    return f"{heading(name, text)}{table(heads, rows)}"


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
