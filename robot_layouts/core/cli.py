"""Commands that are functions: signature and docstring say what their command lines are.

A parameter that may be given by position is a word of the command line, and one that is given by
keyword alone is an option; a dataclass stands for its fields. What they are for is read in the
docstring under ``Args`` (``Attributes`` of a dataclass), and `Word` adds what a type leaves open.
This is the only module that imports argparse.
"""

from __future__ import annotations

import argparse
import ast
import inspect
import os
import re
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, is_dataclass
from functools import cache
from importlib import import_module, metadata
from importlib.util import find_spec
from pathlib import Path
from textwrap import dedent
from types import UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    NamedTuple,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from robot_layouts.core.commands import FAILED, MEANINGLESS, exit_code, print_error
from robot_layouts.core.errors import RobotLayoutsError, UnknownNameError, closest_match


class Word(NamedTuple):
    """How values of a parameter are written, in its annotation: ``Annotated[T, Word(...)]``.

    Attributes:
        metavar: What stands for a value in the usage, such as ``FILE``.
        type: Returns the value of a word; its ValueError, or error of this library, refuses it.
        choices: The words that there are.
        nargs: ``"..."`` takes all words that are left, options of other programs included.
        action: ``"append"`` for an option that is given once for each of its values.
        about: What values there are, for the help.
    """

    metavar: str | tuple[str, ...] | None = None
    type: Callable[[str], Any] | None = None
    choices: Collection[str] | None = None
    nargs: str | None = None
    action: str | None = None
    about: str | None = None


def at_least(least: int) -> Callable[[str], int]:
    """Return what reads whole numbers that are not smaller than one."""

    def read(text: str) -> int:
        if (number := _whole(text)) < least:
            raise ValueError(f"{number} is too few; it must be {least} or more")
        return number

    return read


def by_name(
    words: Sequence[str], form: str, example: str, error: type[RobotLayoutsError], kind: str
) -> dict[str, str]:
    """Return what words ``NAME=VALUE`` say, by name.

    Args:
        words: The words.
        form: How they are written, for messages.
        example: One that is right.
        error: What is raised.
        kind: What the names are of.

    Raises:
        RobotLayoutsError: If a word is malformed, or a name is given twice.
    """
    found: dict[str, str] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not (name and equals and value):
            raise error(f"{word!r} should be {form}, for example {example}")
        if name in found:
            raise error(f"{kind} {name!r} is given twice; each needs its own name")
        found[name] = value
    return found


Count = Annotated[int, Word("N", at_least(1))]
Natural = Annotated[int, Word("N", at_least(0))]
Seed = Annotated[int, Word("S", at_least(0))]
File = Annotated[str, Word("FILE")]
Folder = Annotated[Path, Word("DIR")]
Corners = Annotated[tuple[float, float, float, float], Word(("X_MIN", "Y_MIN", "X_MAX", "Y_MAX"))]


class Call(NamedTuple):
    """A command as a command line asks for it: a function, its arguments, its code if it fails."""

    function: Callable[..., int | None]
    arguments: dict[str, Any]
    failed: int = FAILED

    def run(self) -> int:
        """Run it; returns its exit code."""
        return exit_code(lambda: self.function(**self.arguments), failed=self.failed)


class Command(NamedTuple):
    """A command of a program.

    Attributes:
        target: The function, or ``module:function``, which is imported when it is run.
        failed: The exit code after an error of this library.
    """

    target: Callable[..., int | None] | str
    failed: int = FAILED

    @property
    def about(self) -> str:
        """The first sentence of its docstring, which is read without importing its module."""
        if not isinstance(self.target, str):
            return _documentation(inspect.getdoc(self.target)).summary
        module, _, name = self.target.partition(":")
        return _documentation(_docstrings(module)[name]).summary

    def parser(self, prog: str) -> argparse.ArgumentParser:
        """Return what reads its command line."""
        parser = argparse.ArgumentParser(prog, description=self.about)
        function = self._load()
        parser.epilog = _documentation(inspect.getdoc(function)).more
        _add(parser, function)
        return parser

    def parse(self, words: Sequence[str], prog: str) -> Call:
        """Return what a command line asks for; a wrong one ends the process with 2."""
        parser, function = self.parser(prog), self._load()
        options, unknown = parser.parse_known_args(words)
        if unknown:
            flags = re.findall(r"--[\w-]+", parser.format_usage())
            match = closest_match(unknown[0], flags) if unknown[0].startswith("-") else None
            hint = f". Did you mean {match}?" if match else ""
            parser.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")
        return Call(function, _arguments(function, options), self.failed)

    def _load(self) -> Any:
        if not isinstance(self.target, str):
            return self.target
        module, _, name = self.target.partition(":")
        return getattr(import_module(module), name)


@dataclass(frozen=True)
class Program:
    """A program with several commands.

    Attributes:
        name: What is typed before them.
        for_users: Commands by name, which may be of two words.
        for_developers: Those that are listed apart.
    """

    name: str
    for_users: Mapping[str, Command]
    for_developers: Mapping[str, Command] = field(default_factory=dict[str, Command])

    @property
    def commands(self) -> dict[str, Command]:
        """All commands by name."""
        return {**self.for_users, **self.for_developers}

    def main(self, arguments: Sequence[str] | None = None) -> int:
        """Run a command.

        Args:
            arguments: Words after the program's name; by default those of this process.

        Returns:
            The command's exit code; 2 if there is no such command.
        """
        words = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
        if words[0] == "--version":
            print(f"robot-layouts {metadata.version('robot-layouts')}")
            return 0
        if words[0] == "help":
            words = [*words[1:], "--help"]
        if words[0] in ("-h", "--help"):
            print(f"usage: {self.name} COMMAND ...\n\n{_rows(self.for_users)}")
            if self.for_developers:
                print(f"\nfor developers of the library:\n{_rows(self.for_developers)}")
            print(f"\n`{self.name} help COMMAND` describes one of them.")
            return 0
        group = self._group(words[0])
        if group and (not words[1:] or words[1] in ("-h", "--help")):
            print(f"usage: {self.name} {words[0]} COMMAND ...\n\n{_rows(group)}")
            return 0
        with suppress(OSError):  # it may have been deleted
            if (folder := os.getcwd()) not in sys.path:
                sys.path.append(folder)  # for the modules of tasks, experts and policies
        try:
            call = self.parse(words)
        except RobotLayoutsError as error:
            print_error(error)
            return MEANINGLESS
        return call.run()

    def parse(self, words: Sequence[str]) -> Call:
        """Return what a command line asks for; wrong options end the process with 2.

        Raises:
            UnknownNameError: If there is no such command.
        """
        for count in (2, 1):
            if command := self.commands.get(name := " ".join(words[:count])):
                return command.parse(words[count:], f"{self.name} {name}")
        group = self._group(words[0])
        firsts = {name.split()[0]: None for name in self.commands}
        name = " ".join(words[: 1 + bool(group)])
        raise UnknownNameError("command", name, group or {**firsts, **self.commands})

    def _group(self, word: str) -> dict[str, Command]:
        return {name: one for name, one in self.commands.items() if name.startswith(f"{word} ")}


def main_of(function: Callable[..., int | None], prog: str) -> Callable[..., int]:
    """Return what ``python -m`` runs for a module that is one command.

    Args:
        function: The command.
        prog: The same command's name in `robot-layouts`.
    """

    def main(arguments: Sequence[str] | None = None) -> int:
        words = sys.argv[1:] if arguments is None else arguments
        return Command(function).parse(words, f"robot-layouts {prog}").run()

    return main


@cache
def _docstrings(module: str) -> dict[str, str | None]:
    """Return the docstrings of a module's functions, and its own as that of ``""``."""
    room, *path = module.split(".")
    spec = find_spec(room)
    assert spec is not None
    assert spec.origin is not None
    source = Path(spec.origin).parent.joinpath(*path).with_suffix(".py")
    tree = ast.parse(source.read_text(encoding="utf-8"))
    functions = [one for one in tree.body if isinstance(one, ast.FunctionDef)]
    return {"": ast.get_docstring(tree), **{f.name: ast.get_docstring(f) for f in functions}}


class _Documentation(NamedTuple):
    """What a docstring says: its first sentence, what follows, and what parameters are for."""

    summary: str
    more: str
    parameters: dict[str, str]


def _documentation(docstring: str | None) -> _Documentation:
    text = (docstring or "").replace("``", "`")
    head, *sections = re.split(r"^(\w+):$\n", text, flags=re.MULTILINE)
    summary, _, more = head.partition("\n\n")
    parameters: dict[str, str] = {}
    for title, body in zip(sections[::2], sections[1::2], strict=True):
        if title in ("Args", "Attributes"):
            entries = re.findall(r"^(\w+): (.*(?:\n +.*)*)", dedent(body), re.MULTILINE)
            parameters |= {name: _in_a_line(about) for name, about in entries}
    return _Documentation(_in_a_line(summary), _in_a_line(more), parameters)


def _parameters(function: Any) -> Iterator[tuple[inspect.Parameter, Any, str]]:
    """Yield the parameters of a function or dataclass, with their types and what they are for."""
    hints = get_type_hints(function, include_extras=True)
    about: dict[str, str] = {}
    for one in reversed(inspect.getmro(function)) if inspect.isclass(function) else [function]:
        about |= _documentation(inspect.getdoc(one)).parameters
    for name, parameter in inspect.signature(function).parameters.items():
        if get_origin(hints[name]) is not Callable:  # what only another program passes
            yield parameter, hints[name], about.get(name, "")


def _add(parser: argparse.ArgumentParser, function: Any) -> None:
    """Add the words and options that a function or dataclass takes."""
    for parameter, hint, about in _parameters(function):
        name, default = parameter.name, parameter.default
        if is_dataclass(hint):
            _add(parser, hint)
            continue
        options: dict[str, Any] = _options(hint)
        if values := options.pop("about", None):
            about = f"{about.rstrip('.')}: {values}"
        needed = default is parameter.empty
        if parameter.kind is parameter.KEYWORD_ONLY:
            flag = name.rstrip("_").replace("_", "-")
            if hint is bool:
                flag = f"no-{flag}" if default else flag
                options = {"action": "store_false" if default else "store_true"}
            options |= {"dest": name, "required": needed, "default": argparse.SUPPRESS}
            word = f"--{flag}"
        else:
            options.setdefault("metavar", name.upper())
            if not needed and options.get("nargs") != "...":
                options |= {"nargs": "*" if "nargs" in options else "?", "default": ()}
            word = name
        text = about.rstrip(".") + _remark(parameter)
        parser.add_argument(word, help=text.replace("%", "%%"), **options)


def _arguments(function: Any, options: argparse.Namespace) -> dict[str, Any]:
    """Return a function's arguments; those that are not given have its own default."""
    found: dict[str, Any] = {}
    for parameter, kind, _ in _parameters(function):
        if is_dataclass(kind):
            make: Any = kind
            found[parameter.name] = make(**_arguments(make, options))
        elif parameter.name in vars(options):
            value = getattr(options, parameter.name)
            if value == () and parameter.kind is not parameter.KEYWORD_ONLY:
                continue  # a word that is not there
            found[parameter.name] = tuple(value) if isinstance(value, list) else value
    return found


def _options(hint: Any) -> dict[str, Any]:
    """Return what argparse is to know of the values of a type."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin is Annotated:
        word: Word = parts[1]
        given = {name: value for name, value in word._asdict().items() if value is not None}
        if word.type is not None:
            return {**given, "type": _reader(word.type)}
        kind = get_args(parts[0])[0] if word.action else parts[0]
        return {**_options(kind), **given}
    if origin in (Union, UnionType):
        return _options(next(part for part in parts if part is not type(None)))
    if origin is Literal:
        return {"choices": parts}
    if origin is tuple and parts[1:] != (...,):
        return {**_options(parts[0]), "nargs": len(parts)}
    if origin in (Sequence, tuple):
        return {"nargs": "+" if origin is Sequence else "*", **_options(parts[0])}
    kind, metavar = {int: (_whole, "N"), float: (_number, "X")}.get(hint, (hint, None))
    return {"type": _reader(kind), **({"metavar": metavar} if metavar else {})}


def _reader(read: Callable[[str], Any]) -> Callable[[str], Any]:
    def typed(text: str) -> Any:
        try:
            return read(text)
        except (RobotLayoutsError, ValueError) as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return typed


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"{text!r} is not a whole number") from None


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{text!r} is not a number") from None


def _remark(parameter: inspect.Parameter) -> str:
    default = parameter.default
    if default is parameter.empty:
        return " (required)" if parameter.kind is parameter.KEYWORD_ONLY else ""
    is_shown = isinstance(default, str | int | float | Path) and not isinstance(default, bool)
    shown = f"{default:g}" if isinstance(default, float) else default
    return f" (default: {shown})" if is_shown else ""


def _in_a_line(text: str) -> str:
    return " ".join(text.split())


def _rows(commands: Mapping[str, Command]) -> str:
    width = max(map(len, commands))
    return "\n".join(f"  {name:<{width}}  {command.about}" for name, command in commands.items())
