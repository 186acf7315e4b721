"""Records of what was measured, and the pages of Markdown that show them."""

from __future__ import annotations

import json
import re
import signal
from collections.abc import Collection, Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import jinja2

from robot_layouts.core.writing import write_whole
from robots import RobotLayoutsError, TaskError

DOCS = Path(__file__).parents[1] / "docs"
TEMPLATES = Path(__file__).with_name("pages")

Record = dict[str, Any]


class RecordError(RobotLayoutsError, ValueError):
    """A record, or a file of expectations, that cannot be read or lacks something."""


def read_record(path: Path, **blank: Any) -> Record:
    """Return a record from a JSON file.

    Args:
        path: The file.
        blank: The keys that it must have, and what they are while there is no file.

    Raises:
        RecordError: If it cannot be read.
    """
    if not path.exists():
        return blank
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        return {**found, **{key: type(value)(found[key]) for key, value in blank.items()}}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RecordError(f"cannot read {path}: {error!r}") from error


def write_record(path: Path, record: Mapping[str, Any]) -> None:
    """Write a record to a JSON file.

    Raises:
        UnwritableFileError: If it cannot be written.
    """
    write_whole(path, as_text(record))


def as_text(record: Mapping[str, Any]) -> str:
    """Return a record as JSON, every innermost list and mapping in a line, to be compared."""
    text = json.dumps(record, indent=1, ensure_ascii=False)
    inner = re.compile(r"([\[{])\n *([^\[\]{}]*?)\n *([\]}])")
    return inner.sub(lambda part: part[1] + re.sub(r"\n *", " ", part[2]) + part[3], text) + "\n"


def write_page(out: Path, template: str, **context: Any) -> None:
    """Write the page beside a record, and print where.

    Args:
        out: The record's file; the page has the same name and the suffix ``.md``.
        template: See `render`.
        context: What the template names.

    Raises:
        UnwritableFileError: If it cannot be written.
    """
    page = out.with_suffix(".md")
    write_whole(page, render(template, **context))
    print(f"{out}, {page}")


def render(template: str, **context: Any) -> str:
    """Return the page that ``pages/TEMPLATE.md.jinja`` makes of a context."""
    page = _environment().get_template(f"{template}.md.jinja")
    return page.render({"table": table, **context})


def table(
    headings: Sequence[str], rows: Iterable[Iterable[str]], numbers: Collection[int] | None = None
) -> str:
    """Return a table.

    Args:
        headings: One for each column.
        rows: The cells of each row.
        numbers: Columns that are aligned right; all but the first if None.
    """
    right = range(1, len(headings)) if numbers is None else numbers
    rule = ["---:" if column in right else "---" for column in range(len(headings))]
    return "\n".join(f"| {' | '.join(row)} |" for row in (headings, rule, *rows))


@contextmanager
def patience(seconds: int) -> Generator[None]:
    """Interrupt what takes longer, with a TaskError."""

    def give_up(*_: object) -> None:
        raise TaskError(f"no plan within {seconds} s")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def versions_of(*packages: str) -> dict[str, str]:
    """Return the versions of packages; of those that are not installed, none."""
    found: dict[str, str] = {}
    for package in packages:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def listed(versions: Mapping[str, str | None]) -> str:
    """Return packages and their versions in words."""
    return ", ".join(f"{name} {number}".strip() for name, number in versions.items())


@cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["listed"] = listed
    return environment
