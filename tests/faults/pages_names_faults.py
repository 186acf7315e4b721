"""Pages: names of files, robots, links and joints that are markup, paths or addresses."""

from __future__ import annotations

from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

from layouts import single
from layouts.viewer.page import NO_SLIDERS, save_html
from layouts.viewer.text import as_html, printable
from tests.faults.fault import GOES_ON, REFUSED, Fault, run_command
from tests.layouts.guests import Guest, site, small_cell
from tests.layouts.hostile_names import HOSTILE_NAMES

AREA = "pages"
NAMES = (*HOSTILE_NAMES, "a" * 10_000)


def faults() -> Iterator[Fault]:
    """Go through the names, wherever they can stand."""
    for name in NAMES:
        in_urdf = GOES_ON if name.isprintable() and len(name) <= 200 else REFUSED
        for place in ("title", "note", "link", "joint"):
            what = f"a {place} called {name[:40]!r}"
            promise = GOES_ON if place in ("title", "note") else in_urdf
            yield Fault(AREA, what, lambda f, n=name, place=place: _name(f, place, n), promise)
        what = f"a saved page of names such as {name[:40]!r}"
        yield Fault(AREA, what, lambda folder, name=name: _saved_name(folder, name), in_urdf)
    for name in ("<img src=x onerror=alert(1)>.yaml", "b\udcff\x1b[31m.yaml"):
        what = f"a layout's file called {name!r}"
        yield Fault(AREA, what, lambda folder, name=name: _file(folder, name), GOES_ON)


def _name(folder: Path, place: str, name: str) -> str:
    names = {"link": {"lower": name}, "joint": {"elbow": name}}.get(place, {})
    cell = small_cell(folder, name if place == "title" else "cell", **names)
    cell.notes += [name] if place == "note" else []
    with site(cell) as running, Guest(running.address) as guest:
        guest.wait_for("ReplayDoneMessage")
    assert all(m["type"] != "GuiMarkdownMessage" for m in guest.received)
    text = "".join(_plain(m) for m in guest.received if m["type"] == "GuiHtmlMessage")
    labels = [m.get("props", {}).get("label") for m in guest.received]
    shown = printable(name)
    if place == "joint":
        assert f"{shown} (rad)" in labels
    else:
        assert (f"in arm.{shown}, " if place == "link" else shown) in text
    nodes = {m["name"] for m in guest.received if m["type"] == "MeshMessage"}
    assert len(nodes) == 6, nodes  # three links, each with its shape and its mark of contact
    assert all(node.count("/") == 3 for node in nodes)
    return "it is shown as it is"


class _Tags(HTMLParser):
    """The tags of a page, and its text."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.text = ""
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(" ".join([tag, *(name for name, _ in attrs)]))

    def handle_data(self, data: str) -> None:
        self.text += data


def _plain(message: dict[str, Any]) -> str:
    parsed = _Tags(message["props"]["content"])
    assert set(parsed.tags) <= {"div style", "br"}, parsed.tags
    return parsed.text


def _saved_name(folder: Path, name: str) -> str:
    pages = []
    for called in (name, "harmless"):
        cell = small_cell(folder, called, upper=f"{called} 1", lower=called, elbow=f"{called} 2")
        cell.notes.append(called)
        pages.append(_Tags(save_html(cell, folder / "cell.html").read_text(encoding="utf-8")))
    page, harmless = pages
    assert page.tags == harmless.tags
    assert NO_SLIDERS in page.text
    assert f"in arm.{printable(name)}, " in page.text
    return "it has the same tags as a page of harmless names"


def _file(folder: Path, name: str) -> str:
    (folder / name).write_text(single({"arm": "so100"}).to_yaml())
    done = run_command("layouts", "view", str(folder / name), "--html", str(folder / "p.html"))
    assert "\x1b" not in done.stdout
    title = f"<title>{as_html(str(folder / name))}</title>"
    assert title in (folder / "p.html").read_text()
    return printable(done.stdout.splitlines()[0].replace(str(folder), "…"))
