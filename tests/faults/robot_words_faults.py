"""Words for robots, in Python and in files, and the xacro templates that they lead to."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from layouts import Layout, Placement, single
from robot_layouts.data.suite.suite import read_layout
from robot_layouts.motion import Motion
from robots import RobotDescriptor
from tests.experts.free_motions import swing
from tests.faults.fault import Fault, each

AREA = "robot words"
XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
MODULE = "import sys\nran = True\nARM = 'panda'\n"


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for what, word in _WORDS.items():
        yield Fault(AREA, what, lambda folder, w=word: _named(folder, w))
        yield Fault(AREA, f"{what}, in a layout", lambda folder, w=word: _in_layout(folder, w))
    yield from each(AREA, "a module that a {} names", _strange, _FILES)
    yield from each("xacro templates", "{}", _template, _TEMPLATES)


_WORDS = {
    "a module that is not there": "nowhere_at_all:ARM",
    "a module that raises": "raising:ARM",
    "a module that ends the process": "ending:ARM",
    "a name that its module lacks": "strange:ARN",
    "a name of what is no robot": "strange:ARM",
    "a name without a module": ":ARM",
    "a module by dots": "..strange:ARM",
    "a path to nothing": "nothing/there.urdf",
    "a path to a folder": "folder.urdf",
    "a path to /dev/zero": "zero.urdf",
    "a path with a NUL": "a\0.urdf",
    "an MJCF that is none": "text.xml",
}


def _named(folder: Path, word: str) -> None:
    _files(folder)
    with _working_in(folder):
        Placement(word)


def _in_layout(folder: Path, word: str) -> None:
    _files(folder)
    written = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in word)
    (folder / "cell.yaml").write_text(f'version: 1\nrobots: {{a: {{robot: "{written}"}}}}\n')
    with _working_in(folder):
        try:
            Layout.load(folder / "cell.yaml")
        finally:
            assert not {"strange", "raising", "ending"} & {*sys.modules}, "it was imported"


def _files(folder: Path) -> None:
    (folder / "strange.py").write_text(MODULE)
    (folder / "raising.py").write_text("raise ValueError('no')\n")
    (folder / "ending.py").write_text("raise SystemExit(3)\n")
    (folder / "folder.urdf").mkdir()
    (folder / "text.xml").write_text("hello")
    os.mkfifo(folder / "pipe.urdf")
    (folder / "zero.urdf").symlink_to("/dev/zero")


class _working_in:  # noqa: N801  # a context manager
    """Work in a folder from which modules are imported, and forget these in the end."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._before = str(folder), os.getcwd()

    def __enter__(self) -> None:
        os.chdir(self._folder)
        sys.path.insert(0, self._folder)

    def __exit__(self, *_: object) -> None:
        os.chdir(self._before)
        sys.path.remove(self._folder)
        for name in ("strange", "raising", "ending"):
            sys.modules.pop(name, None)


def _strange(folder: Path, run: Callable[[Path], object]) -> None:
    _files(folder)
    with _working_in(folder):
        try:
            run(folder)
        finally:
            assert "strange" not in sys.modules, "it was imported"


_ROBOTS = {"a": {"robot": "strange:ARM"}}
_FILES: dict[str, Callable[[Path], object]] = {
    "suite's preset": lambda folder: read_layout(
        {"preset": "single", "robots": {"a": "strange:ARM"}}, folder
    ),
    "suite's layout": lambda folder: read_layout({"robots": _ROBOTS}, folder),
    "saved motion": lambda folder: _motion(folder),
}


def _motion(folder: Path) -> None:
    path = swing(single({"a": "panda"})).save(folder / "a.json")
    path.write_text(path.read_text().replace("robot: panda", 'robot: \\"strange:ARM\\"'))
    Motion.load(path)


_TEMPLATES = {
    "an argument without a value": '<link name="$(arg nothing)"/>',
    "an unknown macro": "<xacro:nothing/>",
    "a macro of itself": '<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>',
    "an include that is not there": '<xacro:include filename="nothing.xacro"/>',
    "an include of /etc/passwd": '<xacro:include filename="/etc/passwd"/>',
    "an expression that imports": "<link name=\"${__import__('os').getpid()}\"/>",
    "nothing that moves": '<xacro:property name="x" value="1"/><link name="l"/>',
}


def _template(folder: Path, inside: str) -> None:
    path = folder / "arm.urdf.xacro"
    path.write_text(f'<robot name="arm" {XACRO}>{inside}</robot>', "utf-8")
    RobotDescriptor.from_urdf(path, quiet=True)
