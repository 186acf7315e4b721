"""A line that tells how far work is, is never a reason to stop."""

import os
import sys

import pytest

import robot_layouts.core.progress as progress
from robot_layouts.core.progress import Progress


def closed(tmp_path):
    stream = (tmp_path / "log").open("w")
    stream.close()
    return stream


def unread(tmp_path):
    reading, writing = os.pipe()
    os.close(reading)
    return os.fdopen(writing, "w", buffering=1)


@pytest.mark.parametrize("stderr", [lambda tmp_path: None, closed, unread])
def test_work_goes_on_without_stderr(monkeypatch, tmp_path, capsys, stderr):
    monkeypatch.setattr(progress, "PATIENCE", 0)
    monkeypatch.setattr(progress, "PLAIN_INTERVAL", 0)
    monkeypatch.setattr(sys, "stderr", stderr(tmp_path))
    with Progress(3, "episodes") as line:
        for _ in range(3):
            line.advance(1, "recording")
        line.say("done")
    assert capsys.readouterr().out == ""
