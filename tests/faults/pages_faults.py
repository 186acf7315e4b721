"""Pages: addresses at which none can be served, and files as which none can be saved."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from layouts.viewer.page import save_html, serve
from tests.faults.fault import Fault
from tests.faults.served_page import cell

AREA = "pages"
BAD_PLACES = {
    "an empty host": ("", 0),
    "a host that nobody has": ("nowhere.invalid", 0),
    "another machine's address": ("192.0.2.1", 0),
    "a host of 300 letters": ("a" * 300, 0),
    "a host with a zero byte": ("a\0b", 0),
    "port -1": ("127.0.0.1", -1),
    "port 65536": ("127.0.0.1", 65536),
}
BAD_FILES = (
    "", "page.pdf", ".html", "folder.html", "file/page.html", "n\0.html", "/proc/page.html",
    "a" * 300 + ".html",
)  # fmt: skip


def faults() -> Iterator[Fault]:
    """Go through the addresses and files."""
    for what, (host, port) in BAD_PLACES.items():
        yield Fault(AREA, f"served at {what}", lambda _, at=(host, port): _serve(*at))
    for name in BAD_FILES:
        yield Fault(AREA, f"saved as {name[:20]!r}", lambda folder, name=name: _save(folder, name))


def _serve(host: str, port: int) -> None:
    serve(cell(), host, port, lambda line: None)


def _save(folder: Path, name: str) -> None:
    (folder / "folder.html").mkdir()
    (folder / "file").write_text("")
    try:
        save_html(cell(), folder / name)
    finally:
        assert sorted(path.name for path in folder.iterdir()) == ["file", "folder.html"]
