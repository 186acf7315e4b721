"""A folder of a stranger's: whatever of theirs runs leaves a file there."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

from tests.faults.fault import run_command


def lay_bait(folder: Path) -> None:
    """Write modules, programs and templates that would leave the file ``ran`` if they were run."""
    mark = folder / "ran"
    code = f"import pathlib\npathlib.Path({str(mark)!r}).touch()\n"
    for place in ("strange", "bait"):
        (folder / place).mkdir()
    for name in ("__init__", "inside"):
        (folder / "strange" / f"{name}.py").write_text(code)
    for program in ("agent", "browser"):
        (folder / "bait" / program).write_text(f"#!/bin/sh\ntouch {shlex.quote(str(mark))}\n")
        (folder / "bait" / program).chmod(0o700)
    (folder / "arm.xacro").write_text("<robot name=\"${open('ran', 'w')}\"/>")
    (folder / "cell.yaml").write_text("version: 1\nrobots: {arm: {robot: 'strange:ROBOT'}}")


def runs_nothing(folder: Path, *words: str) -> None:
    """Run a command in the folder, and see that nothing of the stranger's has run."""
    bait = folder / "bait"
    environment = {
        **os.environ,
        "PATH": f"{bait}:{os.environ['PATH']}",
        "BROWSER": str(bait / "browser"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    before = sorted(folder.rglob("*"))
    try:
        run_command("robot_layouts", *words, cwd=folder, env=environment)
    finally:
        assert sorted(folder.rglob("*")) == before, "something of it ran"
