"""URDFs and SRDFs whose contents are wrong, hostile or endless."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from tests.faults.fault import GOES_ON, Fault
from tests.faults.toy_robots import (
    INERTIAL,
    LIMIT,
    joint,
    link,
    mesh,
    read_by_all,
    read_repaired,
    robot,
    toy,
)

AREA = "robot files"

NOT_NUMBERS = ("", "wide", "nan", "inf", "1e300", "0x10", "1,5")
ENTITY = '<!DOCTYPE robot [<!ENTITY a "0.1 0.1 0.1">]>'
BOMB = "<!DOCTYPE robot [" + '<!ENTITY e0 "ha">' + "".join(
    f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 10)
)  # fmt: skip


def faults() -> Iterator[Fault]:
    """Go through this area's faults of URDFs and SRDFs."""
    for what, text in _wrong_texts():
        if what in _REPAIRED:
            yield Fault(AREA, f"URDF: {what}", lambda f, text=text: _repair(f, text), GOES_ON)
        else:
            yield Fault(AREA, f"URDF: {what}", lambda folder, text=text: _read(folder, text))
    for what, data in _wrong_bytes():
        yield Fault(AREA, f"URDF: {what}", lambda folder, data=data: _read_bytes(folder, data))
    for what, data in _wrong_srdfs():
        yield Fault(AREA, f"SRDF: {what}", lambda folder, data=data: _read_srdf(folder, data))


# --- what the text says ---------------------------------------------------------------------------


def _wrong_texts() -> Iterator[tuple[str, str]]:
    for what, old in _NUMBERS.items():
        key = old.partition("=")[0]
        count = len(old.split())
        for value in NOT_NUMBERS:
            yield f"{what} {value!r}", _replaced(old, f'{key}="{" ".join([value] * count)}"')
        if count == 3:
            yield f"{what} of two numbers", _replaced(old, f'{key}="1 1"')
            yield f"{what} of four numbers", _replaced(old, f'{key}="1 1 1 1"')
    for what, old, new in _CHANGES:
        yield what, _replaced(old, new)
    for what, shape in (_SHAPES | _FLAT | _MISSING).items():
        yield f"collision {what}", toy(shape)
    for what, shape in _SHAPES.items():
        yield f"visual {what}", toy(more=f"<visual><geometry>{shape}</geometry></visual>")
    for count in (256, 1000, 10000):
        yield f"a chain of {count} links", _chain(count, "revolute")
        yield f"a chain of {count} fixed links", _chain(count, "fixed")
    for count in (256, 10000):
        links = "".join(
            f'<link name="l{i}"/>{joint(f"j{i}", "base", f"l{i}")}' for i in range(count)
        )
        yield f"a star of {count} links", robot(link("base"), links)
    yield from _TREES.items()


# Numbers of the toy, by what they are.
_NUMBERS = {
    "joint origin xyz": 'xyz="0 0 0.3"',
    "origin rpy": 'rpy="0 0 0"',
    "axis": 'xyz="0 1 0"',
    "mass": 'value="1"',
    "inertia ixx": 'ixx="0.1"',
    "limit lower": 'lower="-1"',
    "limit effort": 'effort="10"',
    "limit velocity": 'velocity="1"',
    "box size": 'size="0.1 0.1 0.1"',
}

_CHANGES = (
    ("axis of length 0", 'xyz="0 1 0"', 'xyz="0 0 0"'),
    ("lower above upper", 'lower="-1"', 'lower="2"'),
    ("no limit", LIMIT, ""),
    ("effort below 0", 'effort="10"', 'effort="-1"'),
    ("mass 0", 'value="1"', 'value="0"'),
    ("moment below 0", 'ixx="0.1"', 'ixx="-0.1"'),
    ("products of inertia that no body has", 'ixy="0"', 'ixy="5"'),
    ("no inertia", '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>', ""),
    ("an empty inertial", INERTIAL, "<inertial/>"),
    ("no parent", '<parent link="base"/>', ""),
    ("an unknown parent", '<parent link="base"/>', '<parent link="bse"/>'),
    ("a joint on itself", '<parent link="base"/>', '<parent link="arm"/>'),
    ("a joint without a type", 'type="revolute"', ""),
    ("a joint of unknown type", 'type="revolute"', 'type="hinge"'),
    ("a floating joint", 'type="revolute"', 'type="floating"'),
    ("two joints of one name", 'joint name="wrist"', 'joint name="shoulder"'),
    ("two links of one name", 'link name="hand"', 'link name="arm"'),
    ("a link with an empty name", 'link name="hand"', 'link name=""'),
    ("a newline in a link's name", 'link name="hand"', 'link name="ha&#10;nd"'),
    ("a name that is read backwards", 'link name="hand"', 'link name="ha&#x202e;nd"'),
    ("a name of 100,000 letters", 'link name="hand"', f'link name="{"h" * 100_000}"'),
    ("mimic of an unknown joint", LIMIT, f'{LIMIT}<mimic joint="elbow"/>'),
    ("mimic of itself", LIMIT, f'{LIMIT}<mimic joint="wrist"/>'),
    ("mimic with multiplier 0", LIMIT, f'{LIMIT}<mimic joint="shoulder" multiplier="0"/>'),
    ("damping that is no number", LIMIT, f'{LIMIT}<dynamics damping="much"/>'),
)

# Shapes that nobody can make sense of.
_SHAPES = {
    "without a shape": "",
    "of unknown shape": '<cone radius="1" length="1"/>',
    "box without size": "<box/>",
    "cylinder without length": '<cylinder radius="1"/>',
    "box of size nan": '<box size="nan 1 1"/>',
    "box of size below 0": '<box size="-1 1 1"/>',
    "cylinder of length inf": '<cylinder radius="0.1" length="inf"/>',
    "mesh without a file": "<mesh/>",
    "mesh of an empty name": mesh(""),
    "mesh with scale 0": mesh("no.stl", ' scale="1 1 0"'),
    "mesh with scale nan": mesh("no.stl", ' scale="nan 1 1"'),
    "mesh with one scale": mesh("no.stl", ' scale="0.001"'),
}

# Meshes that only those miss who use them.
_MISSING = {
    "mesh that is missing": mesh("no.stl"),
    "mesh that is a folder": mesh("."),
    "mesh with a name of 100,000 letters": mesh("m" * 100_000 + ".stl"),
}

# Shapes that can be drawn, but that nothing can touch.
_FLAT = {
    "box of size 0": '<box size="0 0 0"/>',
    "box of 1e-9 m": '<box size="1e-9 1e-9 1e-9"/>',
    "cylinder of length 0": '<cylinder radius="0.1" length="0"/>',
}

# What has a clear meaning all the same.
_REPAIRED = {
    "mass 0",
    "moment below 0",
    "products of inertia that no body has",
    "no inertia",
    "an empty inertial",
    "visual mesh with one scale",
    "xacro",
    *(f"collision {what}" for what in _FLAT),
    *(
        f"{kind} {what}"
        for kind in ("collision", "visual")
        for what in (
            "without a shape",
            "mesh without a file",
            "mesh of an empty name",
            "mesh with scale 0",
        )
    ),
}

_TREES = {
    "nothing inside": robot(),
    "no root": robot(
        link("a"), link("b"), joint("shoulder", "a", "b"), joint("wrist", "b", "a")
    ),
    "two roots": toy().replace("</robot>", f"{link('stray')}</robot>"),
    "two joints on one link": toy().replace("</robot>", joint("x", "base", "hand") + "</robot>"),
    "an SDF": '<sdf version="1.7"><model name="m"><link name="l"/></model></sdf>',
    "xacro": toy().replace(
        "</robot>", '<x:macro xmlns:x="http://www.ros.org/wiki/xacro" name="m"/></robot>'
    ),
    "an entity": ENTITY + toy().replace("0.1 0.1 0.1", "&a;"),
    "an entity from a file": '<!DOCTYPE robot [<!ENTITY a SYSTEM "file:///etc/passwd">]>' + toy(),
    "an entity from the network": '<!DOCTYPE robot SYSTEM "http://127.0.0.1:9/x.dtd">' + toy(),
    "billion laughs": f"{BOMB}]>" + toy().replace("toy", "&e9;"),
    "100,000 elements in one another": "<robot>" + "<a>" * 100_000 + "</a>" * 100_000 + "</robot>",
}  # fmt: skip


def _replaced(old: str, new: str) -> str:
    """Return the toy with another number in the link and joint that move."""
    before, found, after = toy().rpartition(old)
    assert found, old
    return before + new + after


def _chain(count: int, kind: str) -> str:
    parts = [link("l0")]
    for i in range(1, count):
        parts += [f'<link name="l{i}"/>', joint(f"j{i}", f"l{i - 1}", f"l{i}", kind=kind)]
    return robot(*parts)


# --- what the bytes are ---------------------------------------------------------------------------


def _wrong_bytes() -> Iterator[tuple[str, bytes]]:
    good = toy().encode()
    header = '<?xml version="1.0" encoding="{}"?>'
    declared = header + ENTITY + toy().replace("0.1 0.1 0.1", "&a;")
    for encoding in ("utf-16", "utf-8-sig", "latin-1"):
        yield f"an entity in {encoding}", declared.format(encoding).encode(encoding)
    yield "an entity in EBCDIC", declared.format("cp037").encode("cp037")
    yield "an entity in UTF-7", declared.format("utf-7").encode("utf-7")
    yield "an unknown encoding", header.format("x").encode() + good
    yield "bytes that are not UTF-8", good.replace(b"toy", b"\xff\xfe\xfd")
    yield "empty", b""
    yield "zeros", bytes(1000)
    yield "random bytes", bytes(range(256)) * 20
    yield "a control character", good.replace(b"toy", b"to\x01y")
    for share in (1, 9):
        yield f"the first {share * 10} %", good[: len(good) * share // 10]


def _wrong_srdfs() -> Iterator[tuple[str, bytes]]:
    good = robot('<disable_collisions link1="base" link2="hand" reason="Default"/>')
    utf16 = '<?xml version="1.0" encoding="utf-16"?>'
    yield "billion laughs", f"{BOMB}]>{good.replace('toy', '&e9;')}".encode()
    yield "an entity", (ENTITY + good).encode()
    yield "an entity in UTF-16", (utf16 + ENTITY + good).encode("utf-16")
    yield "bytes that are not UTF-8", good.replace("toy", "\xff").encode("latin-1")
    yield "empty", b""
    yield "another file", b"<launch/>"
    yield "half", good.encode()[: len(good) // 2]
    yield "a pair of no link", robot('<disable_collisions reason="Default"/>').encode()
    yield "100,000 elements in one another", b"<robot>" + b"<a>" * 100_000


def _read(folder: Path, text: str) -> None:
    _read_bytes(folder, text.encode())


def _repair(folder: Path, text: str) -> str:
    urdf = folder / "toy.urdf"
    urdf.write_text(text)
    return read_repaired(urdf)


def _read_bytes(folder: Path, data: bytes) -> None:
    urdf = folder / "toy.urdf"
    urdf.write_bytes(data)
    read_by_all(urdf)


def _read_srdf(folder: Path, data: bytes) -> None:
    (folder / "toy.urdf").write_text(toy())
    (folder / "toy.srdf").write_bytes(data)
    read_by_all(folder / "toy.urdf", ("check", "build"))
