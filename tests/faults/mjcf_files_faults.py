"""MJCFs that are none, that lie, or that refer to other files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from robots import RobotDescriptor
from tests.faults.fault import GOES_ON, NO_FILES, Fault, each
from tests.robots.mjcf_parts import arm, mjcf

AREA = "MJCFs"
GOOD = mjcf(arm())


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    yield from each(AREA, "{}", _read, _TEXTS)
    yield from each(AREA, "the file is {}", _no_file, _FILES)
    for number in ("nan", "inf", "1e400", "one"):
        for what, (old, new) in _NUMBERS.items():
            changed = GOOD.replace(old, new.format(number))
            assert changed != GOOD
            yield Fault(AREA, f"{what} is {number}", lambda folder, t=changed: _read(folder, t))
    for file in _ELSEWHERE:
        for what, text in _NAMING.items():
            given = text.format(file)
            yield Fault(AREA, f"{what} names {file}", lambda folder, t=given: _read(folder, t))
    yield Fault(AREA, "good", lambda folder: _read(folder, GOOD), GOES_ON)


_TEXTS = {
    "nothing": "",
    "no XML": "hello",
    "a URDF": "<robot name='x'><link name='a'/></robot>",
    "half of it": GOOD[: len(GOOD) // 2],
    "an entity": GOOD.replace("<mujoco", "<!DOCTYPE a [<!ENTITY x 'y'>]><mujoco", 1),
    "a file as an entity": "<!DOCTYPE a [<!ENTITY x SYSTEM 'file:///etc/passwd'>]>" + GOOD,
    "bodies 3000 deep": mjcf("<body>" * 3000 + "</body>" * 3000),
    "nothing that moves": mjcf("<body><geom size='0.1'/></body>"),
    "two bodies of one name": GOOD.replace('name="link2"', 'name="link1"'),
    "an unknown element": GOOD.replace("</worldbody>", "<arms/></worldbody>"),
    "an unknown joint is driven": mjcf(arm(), "<actuator><motor joint='elbow'/></actuator>"),
    "a loop of includes": GOOD.replace("</mujoco>", "<include file='arm.xml'/></mujoco>"),
    "a mesh that is not there": GOOD.replace(
        "</mujoco>", "<asset><mesh name='m' file='m.stl'/></asset></mujoco>"
    ),
}
_FILES: dict[str, Callable[[Path], object]] = {
    **NO_FILES,
    "bytes that are no text": lambda path: path.write_bytes(bytes(range(256))),
}
_NUMBERS = {
    "a place": ('pos="0.12 0 0"', 'pos="0.12 {} 0"'),
    "an axis": ('axis="0 1 0"', 'axis="0 {} 0"'),
    "a limit": ('range="-100 100"', 'range="-100 {}"'),
    "a size": ('size="0.04 0.015 0.015"', 'size="0.04 {} 0.015"'),
    "a density": ('density="800"', 'density="{}"'),
}
_ELSEWHERE = ("/etc/passwd", "../../secret.xml", "~/secret.xml", "/proc/self/environ", "/dev/zero")
_NAMING = {
    "an include": GOOD.replace("</mujoco>", "<include file='{}'/></mujoco>"),
    "a mesh": GOOD.replace("</mujoco>", "<asset><mesh name='m' file='{}'/></asset></mujoco>"),
}


def _read(folder: Path, text: str) -> None:
    path = folder / "arm.xml"
    path.write_text(text, "utf-8")
    RobotDescriptor.from_mjcf(path, quiet=True)


def _no_file(folder: Path, make: Callable[[Path], object]) -> None:
    make(folder / "arm.xml")
    RobotDescriptor.from_mjcf(folder / "arm.xml", quiet=True)
