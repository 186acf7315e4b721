"""Layout files that are wrong, hostile, endless or no files."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

from layouts import Layout, ring, side_by_side
from robots import LayoutError
from tests.faults.fault import GOES_ON, Fault, each

AREA = "layout files"

GOOD = side_by_side({"left": "panda", "right": "so100"}, spacing=1.0).to_yaml()

FRAMED = """\
version: 1
frames:
  wall: {position: [0.0, 0.0, 1.0], rpy: [0.0, 1.5, 0.0]}
robots:
  left: {robot: panda, on: wall, position: [0.1, 0.2, 0.3], quaternion: [1.0, 0.0, 0.0, 0.0],
         keyframe: rest, qpos_noise: 0.02}
  right: {robot: so100, position: [2.0, 0.0, 0.0]}
"""

_FRAME = "version: 1\nframes: {{f: {{{}}}}}\nrobots: {{a: {{robot: panda}}}}"

VALUES = {
    "version": "version: {}\nrobots: {{a: {{robot: panda}}}}",
    "robots": "version: 1\nrobots: {}",
    "frames": "version: 1\nframes: {}\nrobots: {{a: {{robot: panda}}}}",
    "a robot": "version: 1\nrobots: {{a: {}}}",
    "a frame": "version: 1\nframes: {{f: {}}}\nrobots: {{a: {{robot: panda}}}}",
    "robot": "version: 1\nrobots: {{a: {{robot: {}}}}}",
    "position": "version: 1\nrobots: {{a: {{robot: panda, position: {}}}}}",
    "a coordinate": "version: 1\nrobots: {{a: {{robot: panda, position: [0, {}, 0]}}}}",
    "quaternion": "version: 1\nrobots: {{a: {{robot: panda, quaternion: {}}}}}",
    "rpy": "version: 1\nrobots: {{a: {{robot: panda, rpy: {}}}}}",
    "on": "version: 1\nrobots: {{a: {{robot: panda, on: {}}}}}",
    "keyframe": "version: 1\nrobots: {{a: {{robot: panda, keyframe: {}}}}}",
    "qpos_noise": "version: 1\nrobots: {{a: {{robot: panda, qpos_noise: {}}}}}",
    "control_mode": "version: 1\nrobots: {{a: {{robot: panda, control_mode: {}}}}}",
    "a frame's position": _FRAME.replace("{}", "position: {}"),
    "a frame's on": _FRAME.replace("{}", "on: {}"),
}

WRONG = (
    "",
    "null",
    "true",
    "maybe",
    "[]",
    "[1, 2]",
    "[a, b, c]",
    "[[0, 0, 0]]",
    "{b: 1}",
    "nan",
    "-inf",
    "1e999",
    "0x10",
    "1_000",
    "12:30:45",
    "2026-01-01",
    "!!python/object/apply:os.system [id]",
    "!!python/name:os.system",
    "!!int 5",
    "!!float 5",
    "!!binary AAAA",
    "!!set {a}",
    "!unknown x",
    '"\\x00"',
    "*nothing",
    "&a [*a]",
    "'" + "x" * 100_000 + "'",
    "9" * 100_000,
    "[" * 5_000,
    "{a: " * 5_000,
)


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for what, text in VALUES.items():
        for value in WRONG:
            yield _fault(f"{what} is {_shortened(value)}", text.format(value))
    for what, text in _TEXTS.items():
        yield _fault(what, text)
    yield from each(AREA, "the file is {}", _load, _NO_FILES)
    for what, value in (("None", None), ("bytes", GOOD.encode()), ("a list", [GOOD]), ("5", 5)):
        yield Fault(AREA, f"the text is {what}", lambda folder, v=value: _from(v))
    for what, run in _RIGHT.items():
        yield Fault(AREA, what, run, GOES_ON)


def _fault(what: str, text: str) -> Fault:
    def run(folder: Path) -> None:
        path = folder / "cell.yaml"
        path.write_text(text, encoding="utf-8")
        Layout.load(path)

    return Fault(AREA, what, run)


def _shortened(text: str) -> str:
    return repr(text) if len(text) < 40 else f"{text[:12]!r}, {len(text)} characters"


def _from(text: object) -> None:
    Layout.from_yaml(text)  # type: ignore[arg-type]


_ROBOT = "version: 1\nrobots: {a: {robot: panda}}\n"

_TEXTS = {
    "empty": "",
    "spaces": " \n" * 1000,
    "a comment": "# nothing",
    "a number": "5",
    "a list of layouts": "[1, 2]",
    "two documents": f"{_ROBOT}---\n{_ROBOT}",
    "a tab": "version: 1\nrobots:\n\ta: {robot: panda}",
    "half": GOOD[: len(GOOD) // 2],
    "the last brace is missing": _ROBOT.rstrip("}\n"),
    "no version": "robots: {a: {robot: panda}}",
    "version 2": "version: 2\nrobots: {a: {robot: panda}}",
    "no robots": "version: 1",
    "two versions": f"version: 1\n{_ROBOT}",
    "robots twice": f"{_ROBOT}robots: {{b: {{robot: panda}}}}",
    "one robot twice": "version: 1\nrobots: {a: {robot: panda}, a: {robot: so100}}",
    "a key twice": "version: 1\nrobots: {a: {robot: panda, robot: so100}}",
    "an unknown key": "version: 1\nrobots: {a: {robot: panda, positon: [0, 0, 0]}}",
    "an unknown key above": f"{_ROBOT}robot: panda",
    "an unknown robot": "version: 1\nrobots: {a: {robot: pand}}",
    "an unknown keyframe": "version: 1\nrobots: {a: {robot: panda, keyframe: rst}}",
    "merged keys": "version: 1\nrobots: {a: &a {robot: panda}, b: {<<: *a}}",
    "a list as key": "version: 1\nrobots: {? [a, b] : {robot: panda}}",
    "a mapping as key": "version: 1\nrobots: {? {a: b} : {robot: panda}}",
    "a name that is no word": 'version: 1\nrobots: {"a b": {robot: panda}}',
    "a name with a slash": "version: 1\nrobots: {../a: {robot: panda}}",
    "a name that is HTML": 'version: 1\nrobots: {"<b>": {robot: panda}}',
    "an empty name": 'version: 1\nrobots: {"": {robot: panda}}',
    "a robot and a frame of one name": f"{_ROBOT}frames: {{a: {{}}}}",
    "two positions": "version: 1\nrobots: {a: {robot: panda, position: [0, 0]}}",
    "four positions": "version: 1\nrobots: {a: {robot: panda, position: [0, 0, 0, 0]}}",
    "a quaternion of length 2": "version: 1\nrobots: {a: {robot: panda, quaternion: [2, 0, 0, 0]}}",
    "a quaternion of zeros": "version: 1\nrobots: {a: {robot: panda, quaternion: [0, 0, 0, 0]}}",
    "quaternion and rpy": (
        "version: 1\nrobots: {a: {robot: panda, quaternion: [1, 0, 0, 0], rpy: [0, 0, 0]}}"
    ),
    "noise below 0": "version: 1\nrobots: {a: {robot: panda, qpos_noise: -0.1}}",
    "on nothing": "version: 1\nrobots: {a: {robot: panda, on: shelf}}",
    "on itself": "version: 1\nrobots: {a: {robot: panda, on: a}}",
    "on each other": "version: 1\nrobots: {a: {robot: panda, on: b}, b: {robot: panda, on: a}}",
    "a circle of 5,000": "version: 1\nrobots:\n"
    + "".join(f"  r{i}: {{robot: panda, on: r{(i + 1) % 5000}}}\n" for i in range(5000)),
    "an anchor that contains itself": "version: 1\nrobots: &r {a: *r}",
    "an unknown alias": "version: 1\nrobots: *r",
    "billion laughs": "a0: &a0 [ha, ha]\n"
    + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 12)),
    "a quaternion of a billion aliases": "version: 1\nrobots: {a: {robot: panda, position: "
    + "[&a [1, 1], &b [*a, *a], &c [*b, *b], [*c, *c]]}}",
    "100,000 brackets": "[" * 100_000,
    "100,000 dashes": "- " * 100_000,
    "100,000 question marks": "? " * 100_000,
    "100,000 mappings in one another": "{a: " * 100_000,
    "2 MB of text": "version: 1\nrobots: {"
    + ", ".join(f"r{i}: {{robot: panda}}" for i in range(80_000))
    + "}",
    "2 MB of comments": "#" * 2_000_000,
    "a character that does not exist": '"\\UFFFFFFFF"',
    "half a character": 'version: 1\nrobots: {a: {robot: "\\ud800"}}',
    "a version of 5,000 digits": f"%YAML 1.{'9' * 5000}\n---\n{_ROBOT}",
    "another YAML": f"%YAML 9.1\n---\n{_ROBOT}",
    "a null character": "version: 1\0",
    "an escape character": "version: 1\x1b[2J",
    "a Python object": "!!python/object/apply:os.system ['touch pwned']",
    "a Python module": "!!python/module:os",
    "a document that is tagged": f"!!map\n{_ROBOT}".replace("robots", "robts"),
    "JSON of something else": '{"robots": [{"name": "panda"}]}',
    "HTML": "<!DOCTYPE html><html></html>",
    "a URDF": '<robot name="panda"></robot>',
    "shell": "#!/bin/sh\nrm -rf /\n",
}


def _link(target: str) -> Callable[[Path], object]:
    return lambda path: path.symlink_to(target)


def _sparse(path: Path) -> None:
    path.touch()
    os.truncate(path, 5 << 30)


_NO_FILES: dict[str, Callable[[Path], object]] = {
    "missing": lambda path: None,
    "a folder": Path.mkdir,
    "a FIFO": os.mkfifo,
    "/dev/zero": _link("/dev/zero"),
    "/dev/tty": _link("/dev/tty"),
    "/proc/self/mem": _link("/proc/self/mem"),
    "a link to itself": lambda path: path.symlink_to(path),
    "5 GB of nothing": _sparse,
    "not UTF-8": lambda path: path.write_bytes(GOOD.encode().replace(b"left", b"l\xffft")),
    "UTF-16": lambda path: path.write_bytes(GOOD.encode("utf-16")),
    "zeros": lambda path: path.write_bytes(bytes(1000)),
    "random bytes": lambda path: path.write_bytes(bytes(range(256)) * 10),
}


def _load(folder: Path, place: Callable[[Path], object]) -> None:
    place(folder / "cell.yaml")
    Layout.load(folder / "cell.yaml")


# --- what goes on ---------------------------------------------------------------------------------


def _same_again(text: str) -> str:
    layout = Layout.from_yaml(text)
    assert Layout.from_yaml(layout.to_yaml()) == layout
    return "read, and written as it was"


def _many(count: int) -> str:
    lines = (f"  r{i}: {{robot: panda, position: [{i}, 0, 0]}}" for i in range(count))
    layout = Layout.from_yaml("\n".join(["version: 1", "robots:", *lines]))
    assert len(layout) == count
    assert len(str(layout).splitlines()) == count + 2
    assert layout.action_dim == 8 * count
    return f"{count} robots, read and shown"


def _hung(count: int) -> str:
    lines = [f"  r{i}: {{robot: panda, on: r{i + 1}, position: [0, 0, 1]}}" for i in range(count)]
    text = "\n".join(["version: 1", "robots:", *lines, f"  r{count}: {{robot: panda}}"])
    layout = Layout.from_yaml(text)
    assert layout["r0"].base_position[2] == count
    return f"a tower of {count} robots"


def _mended(folder: Path) -> str:
    """A file that could not be read is as it was, and can be replaced."""
    path = folder / "cell.yaml"
    path.write_text("version: 1\nrobots: {")
    try:
        Layout.load(path)
    except LayoutError:
        assert path.read_text() == "version: 1\nrobots: {"
    layout = Layout.load(ring({"a": "panda", "b": "so100"}, radius=1.0).save(path))
    assert list(layout) == ["a", "b"]
    return "replaced whole"


_RIGHT: dict[str, Callable[[Path], str]] = {
    "a file as the library writes it": lambda folder: _same_again(GOOD),
    "every key": lambda folder: _same_again(FRAMED),
    "a byte order mark": lambda folder: _same_again(f"\ufeff{GOOD}"),
    "carriage returns": lambda folder: _same_again(GOOD.replace("\n", "\r\n")),
    "aliases": lambda folder: _same_again(
        "version: 1\nrobots: {a: &a {robot: panda}, b: *a, c: *a}"
    ),
    "JSON": lambda folder: _same_again('{"version": 1, "robots": {"a": {"robot": "panda"}}}'),
    "300 robots": lambda folder: _many(300),
    "20,000 robots": lambda folder: _many(20_000),
    "300 robots on each other": lambda folder: _hung(300),
    "5,000 robots on each other": lambda folder: _hung(5_000),
    "a broken file, then a good one": _mended,
}
