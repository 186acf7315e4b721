"""Xacro templates: what is left of one in a URDF, and a URDF made of one by the xacro package.

A template is a program: expanding it evaluates its expressions, and reads the files that it
includes, wherever they are.
"""

from __future__ import annotations

import io
import os
import re
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from threading import Lock
from typing import Any
from urllib.parse import parse_qsl, urlencode
from xml.etree.ElementTree import Element, fromstring

from robot_layouts.core.errors import AssetError, MissingPackageError
from robots.urdf.cleaning.references import find_package

XACRO = "/xacro"  # what its namespaces end in: http://www.ros.org/wiki/xacro, …
DEFINITIONS = ("property", "arg", "macro")  # which do nothing where nothing uses them

_EXPRESSION = re.compile(r"\$\{|\$\((?!find\b)")  # finding packages is left to the readers

_turn = Lock()  # the package keeps what it is doing in its module
_expanded: dict[tuple[str, str], Expansion] = {}


def with_arguments(path: Path, arguments: Mapping[str, object]) -> Path:
    """Return the path of a template with arguments, as in ``arm.urdf.xacro?prefix=left_``.

    Args:
        path: The template.
        arguments: Its arguments; none of them returns the path as it is.
    """
    return Path(f"{path}?{urlencode(arguments)}") if arguments else path


def template_of(path: Path) -> tuple[Path, dict[str, str]]:
    """Return the file and the arguments of a path that `with_arguments` made, or any other."""
    name, mark, query = path.name.partition("?")
    if not mark or os.path.lexists(path):
        return path, {}
    # a value may hold a slash only in its escaped form, so the last part of the path has it all
    return path.with_name(name), dict(parse_qsl(query, keep_blank_values=True))


def is_unfinished(root: Element) -> bool:
    """Tell whether a URDF is a template, of which more is left than unused definitions.

    Expressions count only beside elements of xacro's: a name may hold a ``${`` of its own.
    """
    written_for_it = any([f"{XACRO}}}" in element.tag for element in root.iter()])
    return written_for_it and any(map(_is_instruction, _outside_definitions(root)))


def drop_leftovers(root: Element, urdf: str) -> Iterator[str]:
    """Leave out the definitions of a template that was expanded, and yield that it was done."""
    left = [element for element in root if _kind(element) in DEFINITIONS]
    for element in left:
        root.remove(element)
    if left:
        names = ", ".join(sorted({f"<xacro:{_kind(element)}>" for element in left}))
        yield f"left over from xacro, left out: {names} × {len(left)}"


@dataclass(frozen=True)
class Expansion:
    """What a template made.

    Attributes:
        xml: The URDF.
        arguments: Its ``<xacro:arg>`` and their values, by name.
        left_out: Includes of packages that are not there, which it did without.
        files: Times of change of the files that it was made of; none if some were not there.
    """

    xml: bytes
    arguments: Mapping[str, str]
    left_out: tuple[str, ...]
    files: Mapping[str, int]

    def reasons(self) -> Iterator[str]:
        """Say in words what can be chosen, and what is missing."""
        if self.arguments:
            listing = ", ".join(f"{name}={value!r}" for name, value in self.arguments.items())
            yield f"xacro: arguments {listing}; xacro={{…}} or --xacro KEY=VALUE chooses others"
        for file in self.left_out:
            yield f"xacro: did without {file}, as that package is not there"


def expand(template: Path, arguments: Mapping[str, str]) -> Expansion:
    """Return what a template makes; it is expanded again if a file of it changes.

    An include of a package that is not there is left out, if the template can do without.

    Args:
        template: The template.
        arguments: What it is given for its ``<xacro:arg>``.

    Raises:
        AssetError: If it cannot be expanded.
        MissingPackageError: If xacro is not installed.
    """
    key = (str(template), urlencode(arguments))
    with _turn:
        made = _expanded.get(key)
        if made is None or not made.files or made.files != _times(made.files):
            made = _expanded[key] = _expand(template, arguments)
    return made


def was_expanded(template: Path, arguments: Mapping[str, str]) -> bool:
    """Tell whether this process has expanded a template with these arguments before."""
    return (str(template), urlencode(arguments)) in _expanded


def _expand(template: Path, arguments: Mapping[str, str]) -> Expansion:
    xacro = _package(template)
    printed = io.StringIO()
    lost = _Lost()
    values = dict(arguments)  # xacro adds those that have a value of their own
    try:
        with redirect_stderr(printed), redirect_stdout(printed), _finding(xacro, template, lost):
            xacro.all_includes.clear()
            document: Any = xacro.process_file(str(template), mappings=values)
            xml = document.toxml(encoding="utf-8")
            files = () if lost.packages else (str(template), *xacro.all_includes)
    except (Exception, SystemExit) as error:  # whatever a template's expressions raise
        message = " ".join(f"{error or type(error).__name__} {printed.getvalue()}".split())
        advice = _advice(lost.packages, template)
        raise AssetError(f"xacro cannot expand {template}: {message[:300]}{advice}") from error
    meshes = [mesh.get("filename", "") for mesh in fromstring(xml).iterfind(".//collision//mesh")]
    needed = [name for name in lost.packages if any(f"$(find {name})" in file for file in meshes)]
    if needed:
        raise AssetError(f"{template} refers to meshes elsewhere{_advice(needed, template)}")
    return Expansion(xml, values, tuple(lost.includes), _times(files))


@dataclass
class _Lost:
    """What a template refers to in packages that are not there: these, and files to include."""

    packages: dict[str, None] = field(default_factory=dict[str, None])
    includes: list[str] = field(default_factory=list[str])


def _advice(packages: Iterable[str], template: Path) -> str:
    """Return what to do about packages that are not there, as the end of a message."""
    named = ", ".join(map(repr, packages))
    if not named:
        return ""
    there = "is" if "," not in named else "are"
    return (
        f"; the package {named} {there} not there: put it beside {template.name} or beside its"
        " package, in a folder of that name or with its package.xml, or name the folder that it"
        " lies in: folder=… (--folder DIR)"
    )


def _package(template: Path) -> Any:
    try:
        import xacro  # pyright: ignore[reportMissingImports]

        import_module("xacro.substitution_args")  # which xacro loads when it first needs it
    except ImportError as error:
        raise MissingPackageError(
            f"{template} is a xacro template; expanding it needs xacro: pip install xacro (ROS"
            " is not needed)"
        ) from error
    return xacro


@contextmanager
def _finding(xacro: Any, template: Path, lost: _Lost) -> Generator[None]:
    """Have ``$(find PACKAGE)`` look around the template, before ROS if that is installed.

    Of a package that is neither there nor in ROS it stays as it is, and is noted.
    """
    substitution = xacro.substitution_args
    installed, included = substitution._eval_find, xacro.get_include_files

    def find(package: str) -> str:
        if found := find_package(package, template.parent.as_posix()):
            return found
        try:
            return installed(package)
        except Exception:  # ROS's own, or Python's where ROS is not
            lost.packages[package] = None
            return f"$(find {package})"

    def files(spec: str, symbols: Any) -> Iterator[str]:
        for file in included(spec, symbols):
            if "$(find " in file:
                lost.includes.append(file[file.index("$(find ") :])
            else:
                yield file

    substitution._eval_find, xacro.get_include_files = find, files
    try:
        yield
    finally:
        substitution._eval_find, xacro.get_include_files = installed, included


def _times(files: Any) -> dict[str, int]:
    return {file: os.stat(file).st_mtime_ns if os.path.exists(file) else 0 for file in files}


def _kind(element: Element) -> str:
    """Return what an element is to xacro; nothing if it is not one of its own."""
    space, _, name = element.tag.rpartition("}")
    return name if space.endswith(XACRO) else ""


def _outside_definitions(root: Element) -> Iterator[Element]:
    yield root
    for child in root:
        if _kind(child) not in DEFINITIONS:
            yield from child.iter()


def _is_instruction(element: Element) -> bool:
    """Tell whether an element is an instruction to xacro, or has an expression for it."""
    texts = [*element.attrib.values(), element.text or ""]
    return bool(_kind(element)) or any(map(_EXPRESSION.search, texts))
