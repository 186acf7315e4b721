"""Xacro templates: what is left of one in a URDF, and a URDF made of one by the xacro package.

A template is a program: expanding it evaluates its expressions, and reads the files that it
includes, wherever they are.
"""

from __future__ import annotations

import io
import os
import re
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from importlib import import_module
from pathlib import Path
from threading import Lock
from typing import Any
from urllib.parse import parse_qsl, urlencode
from xml.etree.ElementTree import Element

from robots.common.errors import AssetError, MissingPackageError
from robots.urdf.cleaning.references import find_package

XACRO = "/xacro"  # what its namespaces end in: http://www.ros.org/wiki/xacro, …
DEFINITIONS = ("property", "arg", "macro")  # which do nothing where nothing uses them

_EXPRESSION = re.compile(r"\$\{|\$\((?!find\b)")  # finding packages is left to the readers

_turn = Lock()  # the package keeps what it is doing in its module
_expanded: dict[tuple[str, str], tuple[dict[str, int], bytes]] = {}


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
    """Tell whether a URDF is a template, of which more is left than definitions nobody uses.

    Expressions count only beside elements of xacro's: a name may hold a ``${`` of its own.
    """
    written_for_it = any(map(_kind, root.iter()))
    return written_for_it and any(map(_is_instruction, _outside_definitions(root)))


def drop_leftovers(root: Element, urdf: str) -> Iterator[str]:
    """Leave out the definitions of a template that was expanded, and yield that it was done."""
    left = [element for element in root if _kind(element) in DEFINITIONS]
    for element in left:
        root.remove(element)
    if left:
        names = ", ".join(sorted({f"<xacro:{_kind(element)}>" for element in left}))
        yield f"left over from xacro, left out: {names} × {len(left)}"


def expand(template: Path, arguments: Mapping[str, str]) -> bytes:
    """Return the URDF that a template makes; it is expanded again if a file of it changes.

    Args:
        template: The template.
        arguments: What it is given for its ``<xacro:arg>``.

    Raises:
        AssetError: If it cannot be expanded.
        MissingPackageError: If xacro is not installed.
    """
    key = (str(template), urlencode(arguments))
    with _turn:
        files, xml = _expanded.get(key, ({}, b""))
        if not files or files != _times(files):
            included, xml = _expand(template, arguments)
            _expanded[key] = (_times([str(template), *included]), xml)
    return xml


def was_expanded(template: Path, arguments: Mapping[str, str]) -> bool:
    """Tell whether this process has expanded a template with these arguments before."""
    return (str(template), urlencode(arguments)) in _expanded


def _expand(template: Path, arguments: Mapping[str, str]) -> tuple[list[str], bytes]:
    xacro = _package(template)
    printed = io.StringIO()
    try:
        with redirect_stderr(printed), redirect_stdout(printed), _finding(xacro, template):
            xacro.all_includes.clear()
            document: Any = xacro.process_file(str(template), mappings=dict(arguments))
            return list(xacro.all_includes), document.toxml(encoding="utf-8")
    except (Exception, SystemExit) as error:  # whatever a template's expressions raise
        message = " ".join(f"{error or type(error).__name__} {printed.getvalue()}".split())
        raise AssetError(f"xacro cannot expand {template}: {message[:300]}") from error


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
def _finding(xacro: Any, template: Path) -> Generator[None]:
    """Have ``$(find PACKAGE)`` look around the template, before ROS if that is installed."""
    substitution = xacro.substitution_args
    installed = substitution._eval_find

    def find(package: str) -> str:
        return find_package(package, template.parent.as_posix()) or installed(package)

    substitution._eval_find = find
    try:
        yield
    finally:
        substitution._eval_find = installed


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
