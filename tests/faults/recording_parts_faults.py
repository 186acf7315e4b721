"""Recordings that stopped halfway, and what lies among their parts."""

from __future__ import annotations

import functools
import json
import os
import tempfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import tasks
from robot_layouts.data.recording.recorder import Recorder
from tests.faults.fault import GOES_ON, Fault, each
from tests.faults.recording_files import AREA, SECRET, episodes, go_on, recorder

FIRST, SECOND = "seed-0000000010.part", "seed-0000000011.part"


def faults() -> Iterator[Fault]:
    """Go through them."""
    yield from each(AREA, "parts: {}", _foreign, _FOREIGN)
    yield from each(AREA, "parts: a part is {}", _damaged, _DAMAGES, GOES_ON)
    yield from each(AREA, "parts: a part with a right checksum has {}", _crafted, _CRAFTED, GOES_ON)
    yield Fault(AREA, "parts: a part has the name of another seed", _renamed, GOES_ON)
    yield Fault(AREA, "parts: a part of another task", _other_task)
    yield from each(AREA, "recording: {}", _place, _PLACES)


def _stopped(folder: Path) -> Path:
    """Leave a recording as a kill would: three parts and no h5 file; return its path."""
    path = folder / "trajectory.h5"
    path.with_suffix(".parts").mkdir()
    for name, part in _parts().items():
        (path.with_suffix(".parts") / name).write_bytes(part)
    return path


@functools.cache
def _parts() -> dict[str, bytes]:
    with tempfile.TemporaryDirectory() as folder, recorder(Path(folder) / "x.h5") as recording:
        for episode in episodes():
            recording.add(episode)
        return {part.name: part.read_bytes() for part in recording.parts.iterdir()}


def _foreign(folder: Path, put: Callable[[Path], Any]) -> None:
    path = _stopped(folder)
    put(path.with_suffix(".parts"))
    before = sorted(path.with_suffix(".parts").iterdir())
    try:
        recorder(path, resume=True)
    finally:
        assert sorted(path.with_suffix(".parts").iterdir()) == before, "something was deleted"


def _fifo(name: str) -> Callable[[Path], None]:
    return lambda parts: ((parts / name).unlink(missing_ok=True), os.mkfifo(parts / name))[1]


def _folder(name: str) -> Callable[[Path], None]:
    return lambda parts: ((parts / name).unlink(missing_ok=True), (parts / name).mkdir())[1]


def _link(name: str, target: str) -> Callable[[Path], None]:
    def put(parts: Path) -> None:
        (parts / name).unlink(missing_ok=True)
        (parts / name).symlink_to(target)

    return put


def _file(name: str) -> Callable[[Path], None]:
    return lambda parts: ((parts / name).write_bytes(SECRET), None)[1]


_FOREIGN: dict[str, Callable[[Path], Any]] = {
    "a part is a FIFO": _fifo(SECOND),
    "a part is a directory": _folder(SECOND),
    "a part is a link to another file": _link(SECOND, "/etc/passwd"),
    "a part is a link to itself": _link(SECOND, SECOND),
    "a part is a link to /dev/zero": _link(SECOND, "/dev/zero"),
    "a FIFO lies there": _fifo("something"),
    "a directory as if half written": _folder("seed-0000000013.part.7.partial"),
    "somebody's notes lie there": _file("notes.txt"),
    "a seed of letters": _file("seed-0000000xyz.part"),
    "a seed of too many digits": _file("seed-00000000012.part"),
    "a seed of Arabic digits": _file(f"seed-{chr(0x661) * 10}.part"),
    "a copy of a part": _file("seed-0000000010.part~"),
    "a part of an earlier version": _file("seed-0000000009.h5"),
}


def _damaged(folder: Path, damage: Callable[[bytes], bytes]) -> str:
    path = _stopped(folder)
    part = path.with_suffix(".parts") / SECOND
    part.write_bytes(damage(part.read_bytes()))
    return go_on(path)


def _flipped(place: float) -> Callable[[bytes], bytes]:
    def damage(content: bytes) -> bytes:
        index = int(place * (len(content) - 1))
        return content[:index] + bytes([content[index] ^ 4]) + content[index + 1 :]

    return damage


_DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda content: b"",
    "a text": lambda content: SECRET,
    "cut in half": lambda content: content[: len(content) // 2],
    "followed by a byte": lambda content: content + b"\0",
    "of another version": lambda content: content.replace(b"episode 1", b"episode 2", 1),
    **{f"changed in a bit at {place:.0%}": _flipped(place) for place in (0, 0.1, 0.3, 0.5, 0.9, 1)},
}


def _crafted(folder: Path, edit: Callable[[list[Any], bytes], list[Any]]) -> str:
    """Change a part's content and write the checksum that belongs to it."""
    path = _stopped(folder)
    part = path.with_suffix(".parts") / SECOND
    opening, header, about, numbers = part.read_bytes()[:-4].split(b"\n", 3)
    lines = edit([json.loads(header), json.loads(about)], numbers)
    texts = [line if isinstance(line, bytes) else json.dumps(line).encode() for line in lines]
    content = b"\n".join([opening, *texts[:2], texts[2] if len(texts) > 2 else numbers])
    part.write_bytes(content + zlib.crc32(content).to_bytes(4, "little"))
    return go_on(path)


def _about(**values: Any) -> Callable[[list[Any], bytes], list[Any]]:
    return lambda lines, numbers: [lines[0], {**lines[1], **values}]


def _episode(**values: Any) -> Callable[[list[Any], bytes], list[Any]]:
    def edit(lines: list[Any], numbers: bytes) -> list[Any]:
        header, about = lines
        episode = {**json.loads(about["attributes"]["episode"]), **values}
        about["attributes"]["episode"] = json.dumps(episode)
        return [header, about]

    return edit


def _array(index: int, value: Any) -> Callable[[list[Any], bytes], list[Any]]:
    def edit(lines: list[Any], numbers: bytes) -> list[Any]:
        lines[1]["arrays"][0][index] = value
        return lines

    return edit


_CRAFTED: dict[str, Callable[[list[Any], bytes], list[Any]]] = {
    "a header that is not json": lambda lines, numbers: [b"{", lines[1]],
    "a header 100,000 deep": lambda lines, numbers: [b"[" * 100_000, lines[1]],
    "no json of its arrays": lambda lines, numbers: [lines[0], b"nothing"],
    "bytes that are no text": lambda lines, numbers: [lines[0], b"\xff\xfe"],
    "no arrays": _about(arrays=[]),
    "arrays that are a number": _about(arrays=3),
    "arrays of two words": _about(arrays=[["actions", "<f4"]]),
    "attributes without an episode": _about(attributes={}),
    "an episode that is not json": _about(attributes={"episode": "{"}),
    **{f"an array called {name!r}": _array(0, name) for name in ("../x", "", "a\0b", 3)},
    **{f"an array of kind {kind!r}": _array(1, kind) for kind in ("O", "<U9", None)},
    **{
        f"an array of shape {shape!r}": _array(2, shape)
        for shape in ([-1, 7], [2**40, 7], ["4", 7], 28, [4, 7] * 40)
    },
    "numbers too few": lambda lines, numbers: [*lines, numbers[:-4]],
    "numbers too many": lambda lines, numbers: [*lines, numbers + bytes(4)],
    **{
        f"an episode with {name} = {value!r}": _episode(**{name: value})
        for name, value in (
            *(("episode_seed", value) for value in (12, -1, "11", None)),
            *(("elapsed_steps", value) for value in (5, 0, "4", None)),
            *(("reset_kwargs", value) for value in ("x", [1])),
            ("control_mode", 3),
        )
    },
}


def _renamed(folder: Path) -> str:
    path = _stopped(folder)
    parts = path.with_suffix(".parts")
    (parts / SECOND).rename(parts / "seed-0000000099.part")
    return go_on(path)


def _other_task(folder: Path) -> None:
    path = _stopped(folder)
    Recorder(path, tasks.make("PullCube-v1"), resume=True)


def _place(folder: Path, put: Callable[[Path], Any]) -> None:
    path = folder / "trajectory.h5"
    put(path)
    recorder(path, resume=True)


def _at(suffix: str, put: Callable[[Path], Any]) -> Callable[[Path], Any]:
    return lambda path: put(path.with_suffix(suffix))


_KINDS: dict[str, Callable[[Path], Any]] = {
    "a directory": lambda path: path.mkdir(),
    "a FIFO": os.mkfifo,
    "/dev/zero": lambda path: path.symlink_to("/dev/zero"),
    "a file": lambda path: (path.write_bytes(SECRET), None)[1],
}
_PLACES: dict[str, Callable[[Path], Any]] = {
    f"where its {what} belongs is {kind}": _at(suffix, put)
    for what, suffix in {"h5 file": ".h5", "json": ".json", "folder of parts": ".parts"}.items()
    for kind, put in _KINDS.items()
    if (what, kind) not in (("json", "a file"), ("folder of parts", "a directory"))
}
