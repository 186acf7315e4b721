"""Every fault that is tried: those of all files ``…_faults.py`` beside this one."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from tests.faults.fault import Fault


def all_faults() -> Iterator[Fault]:
    """Go through the faults of all areas."""
    for file in sorted(Path(__file__).parent.glob("*_faults.py")):
        yield from import_module(f"tests.faults.{file.stem}").faults()
