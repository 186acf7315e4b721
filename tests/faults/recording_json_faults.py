"""Hostile json beside a recording: every field with every wrong value, and files that are none."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from robot_layouts.data.playing.replay import open_recording
from robot_layouts.data.reading.recorded_task import task_for
from tests.faults.fault import GOES_ON, NO_FILES, Fault, each
from tests.faults.recording_files import AREA, contents, edit_json, expect_whole, read, recording

NOT_NUMBERS = ("seven", 3.5, -1, True, {}, float("nan"), 10**30)
NOT_OBJECTS = ("text", 3, [], ["a", "b"], True)
NOT_TEXTS = (3, True, ["a"], {"a": "b"})

# Where a field is, and what it must not be.
FIELDS: dict[tuple[str | int, ...], tuple[Any, ...]] = {
    ("env_info",): (*NOT_OBJECTS, None),
    ("env_info", "env_id"): (*NOT_TEXTS, None, "", "x" * 10**6, "No-Such-Task-v1"),
    ("env_info", "env_kwargs"): NOT_OBJECTS,
    ("env_info", "env_kwargs", "control_mode"): NOT_TEXTS[:3],
    ("env_info", "max_episode_steps"): (*NOT_NUMBERS, 0),
    ("source_type",): NOT_TEXTS,
    ("episodes",): ("text", 3, {}, None, ["a"], [3], [None], [[]]),
    ("episodes", 1): ("text", 3, [], None, {}),
    ("episodes", 1, "episode_id"): (*NOT_NUMBERS, None, 0, 99),
    ("episodes", 1, "episode_seed"): ("seven", 3.5, -1, 10**30, ["a"], 13),
    ("episodes", 1, "control_mode"): (*NOT_TEXTS, "", {"arm": 3}, "pd_ee_dance", "pd_joint_pos"),
    ("episodes", 1, "elapsed_steps"): (*NOT_NUMBERS, 0, 3, 5, 10**6, 10**6 + 1),
    ("episodes", 1, "reset_kwargs"): NOT_OBJECTS,
    ("episodes", 1, "reset_kwargs", "seed"): ("seven", -1, 2**32, ["a"]),
}

_ABSENT = (("env_info",), ("episodes",), ("env_info", "env_id"), ("episodes", 1, "episode_id"))


def faults() -> Iterator[Fault]:
    """Go through them."""
    for place, values in FIELDS.items():
        for value in values:
            what = f"json: {'.'.join(map(str, place))} is {value!r:.40}"
            yield Fault(AREA, what, partial(_change, place, value))
    for place in _ABSENT:
        yield Fault(AREA, f"json: no {'.'.join(map(str, place))}", partial(_remove, place))
    yield from each(AREA, "json: the file is {}", _put, _FILES)
    yield from each(AREA, "json: {}", _harmless, _HARMLESS, GOES_ON)


def _inside(summary: Any, place: tuple[str | int, ...]) -> Any:
    for key in place[:-1]:
        summary = summary[key]
    return summary


def _change(place: tuple[str | int, ...], value: Any, folder: Path) -> None:
    path = recording(folder)
    edit_json(path, lambda summary: _inside(summary, place).__setitem__(place[-1], value))
    _play(path)


def _remove(place: tuple[str | int, ...], folder: Path) -> None:
    path = recording(folder)
    edit_json(path, lambda summary: _inside(summary, place).pop(place[-1]))
    _play(path)


def _play(path: Path) -> None:
    """Do with a recording what a replay does before it plays."""
    with open_recording(path, None) as file:
        task_for(file).close()
    read(path)


def _put(folder: Path, make: Callable[[Path], Any]) -> None:
    path = recording(folder)
    path.with_suffix(".json").unlink()
    make(path.with_suffix(".json"))
    read(path)


def _bytes(make: Callable[[bytes], bytes]) -> Callable[[Path], Any]:
    return lambda path: path.write_bytes(make(contents()[1]))


_FILES: dict[str, Callable[[Path], Any]] = {
    **NO_FILES,
    "empty": _bytes(lambda content: b""),
    "cut in half": _bytes(lambda content: content[: len(content) // 2]),
    "UTF-16": _bytes(lambda content: content.decode().encode("utf-16")),
    "100,000 lists deep": _bytes(lambda content: b"[" * 100_000),
    "deep where nobody looks": _bytes(
        lambda content: content.replace(b"{", b'{"x": ' + b"[" * 500 + b"]" * 500 + b",", 1)
    ),
    "of a key twice": _bytes(lambda content: content.replace(b"{", b'{"episodes": [],', 1)),
    "of a number of 5,000 digits": _bytes(
        lambda content: content.replace(b'": 10,', b'": ' + b"9" * 5000 + b",")
    ),
    "a list": _bytes(lambda content: b"[1, 2]"),
}


def _harmless(folder: Path, edit: Callable[[Path], None]) -> None:
    path = recording(folder)
    edit(path)
    expect_whole(path)


def _edit(edit: Callable[[dict[str, Any]], Any]) -> Callable[[Path], None]:
    return lambda path: edit_json(path, edit)


def _each(edit: Callable[[dict[str, Any]], Any]) -> Callable[[Path], None]:
    return _edit(lambda summary: [edit(episode) for episode in summary["episodes"]])


_HARMLESS: dict[str, Callable[[Path], None]] = {
    "begins with a byte order mark": lambda path: (
        path.with_suffix(".json").write_bytes(b"\xef\xbb\xbf" + contents()[1]),
        None,
    )[1],
    "has fields that nobody knows": _edit(lambda s: s.update(more={"x": [1, {"y": None}]})),
    "has no limit of steps": _edit(lambda s: s["env_info"].pop("max_episode_steps")),
    "seeds are lists of one": _each(lambda e: e["reset_kwargs"].update(seed=[e["episode_seed"]])),
    "options are null": _each(lambda e: e["reset_kwargs"].update(options=None)),
    "success is 1": _each(lambda e: e.update(success=1)),
    "control modes are those of the environment": _each(lambda e: e.pop("control_mode")),
    "is one line": lambda path: (
        path.with_suffix(".json").write_text(json.dumps(json.loads(contents()[1]))),
        None,
    )[1],
}
