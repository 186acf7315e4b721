"""``python -m benchmarks teleop``: the time from drag to picture, measured by the page itself."""

import json
import re
import sys

import numpy as np
import pytest

from benchmarks import teleop
from benchmarks.__main__ import main
from robots import MissingPackageError


@pytest.mark.long
@pytest.mark.browser
def test_what_the_page_measures_is_what_is_said(tmp_path, capsys):
    out, picture = tmp_path / "latency.json", tmp_path / "page.png"
    code = main(["teleop", "--drags", "14", "--out", str(out), "--picture", str(picture)])
    seen = json.loads(out.read_text())
    assert len(seen["times"]) >= 14
    assert all(0 < time < 60_000 for time in seen["times"])
    said = re.match(r"Time from .*: (\d+) ms \(median\), (\d+) ms \(95 %\), of (\d+)", seen["page"])
    assert said
    median, most, count = map(int, said.groups())
    assert count == len(seen["times"])
    assert abs(seen["median"] - median) < 1
    printed = capsys.readouterr().out
    latency = re.search(r"(\d+) ms from drag to picture \(median\), (\d+) ms", printed)
    assert latency
    assert abs(np.subtract([median, most], [*map(int, latency.groups())])).max() <= 1
    assert code == int(seen["median"] > 150)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_an_installation_without_playwright_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "playwright.sync_api", None)
    with (
        pytest.raises(MissingPackageError, match=r"pip install 'robot-layouts\[browser\]'"),
        teleop.running_browser(),
    ):
        pass
