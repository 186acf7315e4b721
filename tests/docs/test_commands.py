"""The commands' reference holds every command, and what its parser says."""

import pytest

from benchmarks.site.hooks import COMMANDS as PLACE
from benchmarks.site.hooks import on_page_markdown, on_post_page
from robot_layouts.__main__ import PROGRAM
from tests.docs.blocks import ROOT


@pytest.mark.long
def test_every_command_is_there():
    page = (ROOT / "docs/reference/commands.md").read_text(encoding="utf-8")
    text = on_page_markdown(page, page=None)
    assert PLACE in page
    assert PLACE not in text
    assert all(f"\n## {name}\n" in text for name in PROGRAM.for_users)
    users, developers = text.split("\n## Commands for developers of the library\n")
    assert all(f"\n### {name}\n" in developers for name in PROGRAM.for_developers)
    assert "\n## layouts validate\n" in users
    assert "`--episodes N`\n:   Number of episodes (required).\n" in users


def test_nothing_is_loaded_from_elsewhere():
    class Page:
        url = "reference/commands.html"

    loads = '<script src="https://unpkg.com/iframe-worker/shim"></script>'
    assert on_post_page(loads, page=Page()) == '<script src="../worker.js"></script>'
    assert (ROOT / "docs/worker.js").exists()
