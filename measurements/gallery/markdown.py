"""What pages are put together from: tables, pictures, links, and where everything lies."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence

from rich.table import Table

INDEX = "index.md"

# No list of pages beside the page, which is wider then; and the way back.
WIDE = ("---", "hide:", "  - navigation", "---", "")
BACK = "[Back to the gallery](../index.md)"


def task_path(task_id: str) -> str:
    """Return the path of a task's page in the gallery's folder."""
    return f"tasks/{task_id}.md"


def robot_path(name: str) -> str:
    """Return the path of a robot's page in the gallery's folder."""
    return f"robots/{name}.md"


def clip_path(task_id: str) -> str:
    """Return the path of a task's clip in the gallery's folder."""
    return f"media/tasks/{task_id}.webp"


def portrait_path(name: str) -> str:
    """Return the path of a robot's picture in the gallery's folder."""
    return f"media/robots/{name}.webp"


def picture(path: str, alt: str, *, height: int = 320, lazy: bool = False) -> str:
    """Return a picture of 320 × ``height`` pixels, at most as wide as the page."""
    loading = " loading=lazy" if lazy else ""
    return f'![{alt}]({path}){{ width="320" height="{height}"{loading} }}'


def table(
    headings: Sequence[str], rows: Iterable[Sequence[str]], numbers: Collection[int] = ()
) -> Iterator[str]:
    """Yield the lines of a table; the columns of some positions are numbers."""
    yield _row(headings)
    yield _row(["---:" if i in numbers else "---" for i in range(len(headings))])
    yield from map(_row, rows)


def printed(rows: Table, quote: Collection[int] = ()) -> Iterator[str]:
    """Yield the lines of a table that is made to be printed; some columns are code."""
    cells = [[str(cell) for cell in column.cells] for column in rows.columns]
    quoting = [[f"`{c}`" for c in row] if i in quote else row for i, row in enumerate(cells)]
    numbers = [i for i, column in enumerate(rows.columns) if column.justify == "right"]
    headings = [str(column.header) for column in rows.columns]
    yield from table(headings, zip(*quoting, strict=True), numbers)


def facts(rows: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Yield the lines of a list of names and values; what has no value is left out."""
    yield from (f"- **{name}:** {value}" for name, value in rows if value)


def code(language: str, text: str) -> Iterator[str]:
    """Yield the lines of a block of code."""
    yield f"```{language}"
    yield from text.strip().splitlines()
    yield "```"


def section(title: str, *blocks: Iterable[str]) -> Iterator[str]:
    """Yield the lines of a section, if there is anything in it; blocks stand apart."""
    bodies = [lines for block in blocks if (lines := list(block))]
    if bodies:
        yield f"## {title}"
        yield ""
        for lines in bodies:
            yield from lines
            yield ""


def sentence(text: str) -> str:
    """Return a text with a capital at its beginning."""
    return text[:1].upper() + text[1:]


def quoted(names: Iterable[str]) -> str:
    """Return names as code, one after the other."""
    return ", ".join(f"`{name}`" for name in names)


def breakable(name: str) -> str:
    """Return a name that may go on in a new line behind each underscore."""
    return name.replace("_", "_<wbr>")


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(_escaped(cell) for cell in cells)} |"


def _escaped(cell: str) -> str:
    return cell.replace("|", r"\|")
