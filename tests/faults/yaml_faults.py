"""Layout files that are wrong, hostile, endless or no files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from layouts import Layout, ring, side_by_side
from robots import LayoutError
from tests.faults.fault import GOES_ON, NO_FILES, Fault, each, shown

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

WRONG = (
    *("", "true", "maybe", "[]", "[1, 2]", "[[0, 0, 0]]", "{b: 1}", "nan", "1e999", "0x10"),
    *("12:30:45", "2026-01-01", "!!python/object/apply:os.system [id]", "!!int 5", "!!set {a}"),
    *("!unknown x", '"\\x00"', "*nothing", "&a [*a]", "9" * 100_000, "[" * 5_000),
)


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    wrong = {shown(value): f"{_ROBOT[:-3]}, position: {value}}}}}" for value in WRONG}
    yield from each(AREA, "position is {}", _read, wrong)
    yield from each(AREA, "{}", _read, _TEXTS)
    yield from each(AREA, "the file is {}", _load, _NO_FILES)
    for what, run in _RIGHT.items():
        yield Fault(AREA, what, run, GOES_ON)


def _read(folder: Path, text: str) -> None:
    (folder / "cell.yaml").write_text(text, encoding="utf-8")
    Layout.load(folder / "cell.yaml")


_ROBOT = "version: 1\nrobots: {a: {robot: panda}}\n"

_TEXTS = {
    "two documents": f"{_ROBOT}---\n{_ROBOT}",
    "half": GOOD[: len(GOOD) // 2],
    "one robot twice": "version: 1\nrobots: {a: {robot: panda}, a: {robot: so100}}",
    "merged keys": "version: 1\nrobots: {a: &a {robot: panda}, b: {<<: *a}}",
    "a mapping as key": "version: 1\nrobots: {? {a: b} : {robot: panda}}",
    "on each other": "version: 1\nrobots: {a: {robot: panda, on: b}, b: {robot: panda, on: a}}",
    "a circle of 5,000": "version: 1\nrobots:\n"
    + "".join(f"  r{i}: {{robot: panda, on: r{(i + 1) % 5000}}}\n" for i in range(5000)),
    "billion laughs": "a0: &a0 [ha, ha]\n"
    + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 12)),
    "a quaternion of a billion aliases": "version: 1\nrobots: {a: {robot: panda, position: "
    + "[&a [1, 1], &b [*a, *a], &c [*b, *b], [*c, *c]]}}",
    "100,000 brackets": "[" * 100_000,
    "100,000 mappings in one another": "{a: " * 100_000,
    "2 MB of text": "version: 1\nrobots: {"
    + ", ".join(f"r{i}: {{robot: panda}}" for i in range(80_000))
    + "}",
    "a character that does not exist": '"\\UFFFFFFFF"',
    "a version of 5,000 digits": f"%YAML 1.{'9' * 5000}\n---\n{_ROBOT}",
    "an escape character": "version: 1\x1b[2J",
    "a Python object": "!!python/object/apply:os.system ['touch pwned']",
    "JSON of something else": '{"robots": [{"name": "panda"}]}',
}


_NO_FILES: dict[str, Callable[[Path], object]] = {
    **NO_FILES,
    "/proc/self/mem": lambda path: path.symlink_to("/proc/self/mem"),
    "not UTF-8": lambda path: path.write_bytes(GOOD.encode().replace(b"left", b"l\xffft")),
    "UTF-16": lambda path: path.write_bytes(GOOD.encode("utf-16")),
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
    "JSON": lambda folder: _same_again('{"version": 1, "robots": {"a": {"robot": "panda"}}}'),
    "20,000 robots": lambda folder: _many(20_000),
    "5,000 robots on each other": lambda folder: _hung(5_000),
    "a broken file, then a good one": _mended,
}
