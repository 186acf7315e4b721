"""Hostile h5 files: their groups, attributes and bytes."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from tests.faults.fault import GOES_ON, NO_FILES, Fault, each
from tests.faults.recording_files import (
    AREA,
    BODY,
    contents,
    edited,
    expect_whole,
    read,
    read_edited,
    recording,
)


def faults() -> Iterator[Fault]:
    """Go through them."""
    yield from each(AREA, "h5: {}", read_edited, _GROUPS)
    for name in ("layout", "simulation"):
        what = f"h5: attribute {name} is {{}}"
        yield from each(AREA, what, partial(_read_attribute, name), _ATTRIBUTES)
    yield from each(AREA, "h5: attribute layout has {}", _read_layout, _LAYOUTS)
    for name in ("episode", "checksum"):
        what = f"h5: attribute {name} of an episode is {{}}"
        yield from each(AREA, what, partial(_keep_checksum, name), _ATTRIBUTES)
    yield from each(AREA, "h5: the file is {}", _file, _FILES)
    yield from each(AREA, "h5: {}", _harmless, _HARMLESS, GOES_ON)


def _cycle(file: h5py.File, folder: Path) -> None:
    file["traj_0/env_states/again"] = file["traj_0"]


def _deep(file: h5py.File, folder: Path) -> None:
    group = file["traj_0/env_states"]
    for _ in range(500):
        group = group.create_group("deeper")
    group["rows"] = np.zeros((4, 1), "f4")


def _wide(file: h5py.File, folder: Path) -> None:
    for number in range(10_001):
        file["traj_0/env_states/actors"].create_group(str(number))


def _many_of_one(file: h5py.File, folder: Path) -> None:
    rows = np.zeros((4, 2**22), "f4")
    file["large"] = rows
    for number in range(20):
        file[f"traj_0/env_states/actors/{number}"] = file["large"]


def _delete(name: str) -> Callable[[h5py.File, Path], None]:
    return lambda file, folder: file.__delitem__(name)


def _instead(name: str, value: Any) -> Callable[[h5py.File, Path], None]:
    def edit(file: h5py.File, folder: Path) -> None:
        del file[name]
        file[name] = value

    return edit


_GROUPS: dict[str, Callable[[h5py.File, Path], None]] = {
    "an episode is not there": _delete("traj_1"),
    "an episode is an array": _instead("traj_1", np.zeros((3, 7), "f4")),
    "an episode is a link to another file": lambda file, folder: (
        file.__delitem__("traj_1"),
        file.__setitem__("traj_1", h5py.ExternalLink(str(folder / "secret"), "/")),
    ),
    "an episode is a link to another episode": _instead("traj_1", h5py.SoftLink("/traj_0")),
    "an episode is another episode, too": lambda file, folder: (
        file.__delitem__("traj_1"),
        file.__setitem__("traj_1", file["traj_0"]),
    ),
    "an episode contains itself": _cycle,
    "states are 500 groups deep": _deep,
    "10,001 groups are where bodies are": _wide,
    "one large array has 20 names": _many_of_one,
    "states are not by kind": _instead("traj_0/env_states/actors", np.zeros((4, 3), "f4")),
    "states are by kind, name and more": lambda file, folder: file.__setitem__(
        "traj_0/env_states/actors/more/rows", np.zeros((4, 3), "f4")
    ),
    "states are in another file": lambda file, folder: (
        file.__delitem__("traj_0/env_states"),
        file.__setitem__("traj_0/env_states", h5py.ExternalLink(str(folder / "secret"), "/")),
    ),
}
_GROUPS["actions are by robot"] = lambda file, folder: (
    file.__delitem__("traj_0/actions"),
    file.__setitem__("traj_0/actions/panda-0", np.zeros((3, 7), "f4")),
)

_ATTRIBUTES: dict[str, Any] = {
    "a number": 3,
    "an array of numbers": np.zeros(5),
    "not json": "{",
    "the json of a number": "3",
    "json with a key twice": '{"arm": 1, "arm": 2}',
    "json 100,000 deep": "[" * 100_000,
    "json with a number of 5,000 digits": "9" * 5000,
    "a reference": "reference",
    "nothing at all": h5py.Empty("f4"),
}


def _attribute(holder: Any, name: str, value: Any) -> None:
    holder.attrs.pop(name, None)
    if isinstance(value, str) and value == "reference":
        holder.attrs.create(name, holder.file["traj_0"].ref, dtype=h5py.ref_dtype)
    else:
        holder.attrs[name] = value


def _read_attribute(name: str, folder: Path, value: Any) -> None:
    read_edited(folder, lambda file, _: _attribute(file, name, value))


def _keep_checksum(name: str, folder: Path, value: Any) -> None:
    path = recording(folder)
    with h5py.File(path, "r+") as file:
        _attribute(file["traj_0"], name, value)
    read(path)


def _read_layout(folder: Path, edit: Callable[[dict[str, Any]], None]) -> None:
    read_edited(folder, lambda file, _: _layout(file, edit))


def _layout(file: h5py.File, edit: Callable[[dict[str, Any]], None]) -> None:
    described = json.loads(file.attrs["layout"])
    edit(described)
    file.attrs["layout"] = json.dumps(described)


def _robot(name: str, value: Any) -> Callable[[dict[str, Any]], None]:
    def edit(described: dict[str, Any]) -> None:
        if value is None:
            del described["arm"][name]
        else:
            described["arm"][name] = value

    return edit


_LAYOUTS: dict[str, Callable[[dict[str, Any]], None]] = {
    "a robot that is a list": lambda described: described.update(arm=[1, 2]),
    **{
        f"{name} = {value!r:.40}": _robot(name, value)
        for name, values in {
            "action": [None, "ab", [0], [0, "7"], [-1, 6], [7, 0], [0, 10**30], {"a": 1}],
            "position": [None, "far", [0, 0], [0, 0, "x"], [0, 0, float("nan")], [0, 0, 10**400]],
            "quaternion": [None, 1, [1, 0, 0], [1, 0, 0, None], [float("inf"), 0, 0, 0]],
            "robot": [None, 5, "", "x" * 500, ["panda"]],
            "keyframe": [5, ["rest"], "k" * 500],
            "qpos_noise": [None, "much", float("nan"), [0.1]],
        }.items()
        for value in values
    },
}


def _file(folder: Path, change: Callable[[Path], None]) -> None:
    path = recording(folder)
    change(path)
    read(path)


def _write(make: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        path.write_bytes(make(contents()[0]))

    return change


def _put(make: Callable[[Path], Any]) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        path.unlink()
        make(path)

    return change


def _endless_texts(content: bytes) -> bytes:
    """Say that after the first text there is free space of no size: HDF5 looks on for ever."""
    first = content.index(b"GCOL") + 16
    size = int.from_bytes(content[first + 8 : first + 16], "little")
    second = first + 16 + -(-size // 8) * 8
    return content[:second] + bytes(16) + content[second + 16 :]


_FILES: dict[str, Callable[[Path], None]] = {
    **{what: _put(make) for what, make in NO_FILES.items()},
    "empty": _write(lambda content: b""),
    "a text": _write(lambda content: b"not even h5"),
    **{
        f"cut to {share:.1%}": _write(lambda content, s=share: content[: int(s * len(content))])
        for share in (0.01, 0.1, 0.3, 0.5, 0.9, 0.999)
    },
    "behind a script": _write(lambda content: b"#!/bin/sh\n".ljust(512) + content),
    "the numbers of another": _write(lambda content: content[:2000] + content[2008:] + bytes(8)),
    "of texts without end": _write(_endless_texts),
}


def _harmless(folder: Path, change: Callable[[Path], None]) -> None:
    path = recording(folder)
    change(path)
    expect_whole(path)


def _repack(**how: Any) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        with edited(path) as file:
            for episode in file.values():
                for name in (*("actions", "rewards", "success"), BODY):
                    rows = episode[name][()]
                    del episode[name]
                    episode.create_dataset(name, data=rows, **how)

    return change


def _bystander(path: Path) -> None:
    with edited(path) as file:
        file["elsewhere"] = h5py.SoftLink("/traj_0")
        file["traj_0/obs"] = h5py.SoftLink("/nowhere")


_HARMLESS: dict[str, Callable[[Path], None]] = {
    "arrays are packed by shuffle and gzip, with checksums": _repack(
        compression="gzip", shuffle=True, fletcher32=True
    ),
    "there are links that nothing reads": _bystander,
    "the h5 file has no checksums, as those of earlier versions": _repack(),
}
