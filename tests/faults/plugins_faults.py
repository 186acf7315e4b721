"""Packages of other people that bring tasks, experts, presets and robots that are none."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

from layouts.presets import PRESETS
from robot_layouts.experts.registry import EXPERTS
from robots.registry import ROBOTS
from tasks.registry import TASKS
from tests.faults.fault import GOES_ON, Fault

AREA = "plug-ins"
KINDS: dict[str, tuple[Mapping[str, Any], str, str]] = {  # catalogue, a name, one that is taken
    "tasks": (TASKS, "Acme-v1", "PickCube-v1"),
    "experts": (EXPERTS, "Acme-v1", "PickCube-v1"),
    "presets": (PRESETS, "acme", "ring"),
    "robots": (ROBOTS, "acme", "panda"),
}
# What the module has, and what its entry point says; "{}" is the module.
WRONG = {
    "a module that is not there": (None, "{}:MADE"),
    "a module without it": ("", "{}:MADE"),
    "a module that raises": ("raise RuntimeError('no GPU')", "{}:MADE"),
    "a module that raises without a word": ("raise ValueError", "{}:MADE"),
    "a module that exits": ("raise SystemExit(3)", "{}:MADE"),
    "a module of no Python": ("task: acme", "{}:MADE"),
    "None": ("MADE = None", "{}:MADE"),
    "a text": ("MADE = 'acme'", "{}:MADE"),
    "only a module": ("MADE = 5", "{}"),
    "an entry point of nonsense": ("MADE = 5", "{} MADE !"),
}
WRONG_CLASSES = {
    "tasks": {"a function": "MADE = len", "a class": "MADE = dict"},
    "presets": {"a function of other arguments": "MADE = len", "a class": "MADE = dict"},
    "experts": {},
    "robots": {"a function": "MADE = len", "a class": "MADE = dict"},
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for kind in KINDS:
        own = {what: (text, "{}:MADE") for what, text in WRONG_CLASSES[kind].items()}
        for what, (text, value) in {**WRONG, **own}.items():
            yield Fault(AREA, f"{kind}: {what}", partial(_load, kind, text, value))
            yield Fault(
                AREA, f"{kind}: beside {what}", partial(_others, kind, text, value), GOES_ON
            )
        yield Fault(AREA, f"{kind}: one name twice", partial(_twice, kind))
        yield Fault(AREA, f"{kind}: a name that is taken", partial(_taken, kind), GOES_ON)


def _install(folder: Path, module: str, text: str | None, kind: str, lines: str) -> Any:
    """Write a package of someone else, and return what puts it on the path."""
    info = folder / f"{module}-1.0.dist-info"
    info.mkdir()
    if text is not None:
        (folder / f"{module}.py").write_text(text)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[robot_layouts.{kind}]\n{lines.format(module)}\n")
    importlib.invalidate_caches()
    return mock.patch.object(sys, "path", [*sys.path, str(folder)])


def _load(kind: str, text: str | None, value: str, folder: Path) -> None:
    catalogue, name, _ = KINDS[kind]
    with _install(folder, _module(folder), text, kind, f"{name} = {value}"):
        catalogue[name]


def _others(kind: str, text: str | None, value: str, folder: Path) -> str:
    catalogue, name, own = KINDS[kind]
    before = catalogue[own]
    with _install(folder, _module(folder), text, kind, f"{name} = {value}"):
        assert catalogue[own] is before
        assert name in list(catalogue)
    return "all others are there"


def _twice(kind: str, folder: Path) -> None:
    catalogue, name, _ = KINDS[kind]
    text = "ONE = None\nOTHER = None"
    with _install(folder, _module(folder), text, kind, f"{name} = {{0}}:ONE\n{name} = {{0}}:OTHER"):
        catalogue[name]


def _taken(kind: str, folder: Path) -> str:
    catalogue, _, own = KINDS[kind]
    before = catalogue[own]
    with _install(folder, _module(folder), "MADE = None", kind, f"{own} = {{}}:MADE"):
        assert catalogue[own] is before
        assert list(catalogue).count(own) == 1
    return "the library's own stays"


def _module(folder: Path) -> str:
    """Return a name that no other fault's module has in this process."""
    return f"acme_{abs(hash(str(folder)))}"
