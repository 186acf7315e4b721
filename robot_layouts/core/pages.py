"""HTML: pages that are single files, what they look like, and what notebooks show."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from jinja2 import Environment


from collections.abc import Sequence
from html import escape

COMMON = "robot_layouts.core"
_CELL = ' style="text-align: left; padding: 0 1em 0 0"'


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


def page(
    template: str,
    *sheets: tuple[str, str],
    kicker: str,
    title: str,
    note: str,
    tiles: Iterable[Tile],
    **content: Any,
) -> str:
    """Return a page, which loads nothing but the pictures and films that are in it.

    Args:
        template: The package that holds it and its name in ``templates`` there, as
            ``"robot_layouts.data.suite/report.html.jinja"``; it extends the page of this package.
        sheets: Style sheets besides the common one; see `read_style`.
        kicker: What kind of page it is.
        title: Its title.
        note: What it is about, in a sentence.
        tiles: Its main numbers.
        content: What the template shows.
    """
    style = read_style((COMMON, "page.css"), *sheets)
    policy = f"default-src 'none'; media-src data:; img-src data:; style-src {source_hash(style)}"
    head = {"kicker": kicker, "title": title, "note": note, "tiles": tiles}
    return fragment(template, style=style, policy=policy, **head, **content)


def fragment(template: str, **content: Any) -> str:
    """Return a template filled in, such as a chart, for another template; see `page`.

    Texts in it are escaped, and are not escaped again there.
    """
    from jinja2.filters import do_mark_safe

    return do_mark_safe(_environment().get_template(template).render(content))


@cache
def _environment() -> Environment:
    import jinja2

    def source(name: str) -> str:
        package, _, file = name.partition("/")
        return (files(package) / "templates" / file).read_text(encoding="utf-8")

    return jinja2.Environment(
        loader=jinja2.FunctionLoader(source),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )


def read_style(*sheets: tuple[str, str]) -> str:
    """Return style sheets, one after the other, after the colours that all pages share.

    Args:
        sheets: Of each the package that holds the file, such as ``core``, and its name.
    """
    places = [files(package) / name for package, name in ((COMMON, "palette.css"), *sheets)]
    return "".join(place.read_text(encoding="utf-8") for place in places)


def source_hash(text: str) -> str:
    """Return what a page's content security policy calls a style or a script of its own."""
    digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
    return f"'sha256-{digest}'"


def data_address(kind: str, content: bytes) -> str:
    """Return the address of a picture or film that is in the page itself."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def plural(count: int, word: str) -> str:
    """Return a number of things, in words."""
    return f"{count:,} {word}" + ("" if count == 1 else "s")


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
