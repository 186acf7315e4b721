"""``python -m benchmarks teleop``: the time from drag to picture, measured by the page itself."""

import sys

import pytest

from benchmarks import teleop
from robots import MissingPackageError


def test_an_installation_without_playwright_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "playwright.sync_api", None)
    with (
        pytest.raises(MissingPackageError, match=r"pip install 'robot-layouts\[browser\]'"),
        teleop.running_browser(),
    ):
        pass
