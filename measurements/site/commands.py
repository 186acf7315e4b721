"""The commands' reference as Markdown, from the parsers that read the command line."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Iterator, Sequence
from importlib import import_module
from typing import Any, NoReturn
from unittest.mock import patch

from parity.__main__ import COMMANDS as COMPARISONS
from robots.common.commands import commands_spelt
from robots.common.console import COMMANDS, NAME, spellings

WITH_COMMANDS_OF_THEIR_OWN = {"parity": tuple(COMPARISONS)}


def markdown() -> str:
    """Return every command of `robot-layouts`: what it does, how it is used, and its options."""
    return "\n".join(line for name in COMMANDS for line in _command(name))


def parser_of(module: str, words: Sequence[str]) -> argparse.ArgumentParser:
    """Return the parser that a command reads its words with.

    Args:
        module: The command's module, with ``main(words)``.
        words: What comes before the command's own words.

    Raises:
        LookupError: If the command does not print help.
    """
    main: Any = import_module(module).main
    with patch.object(argparse.ArgumentParser, "print_help", _give), commands_spelt(spellings()):
        try:
            main([*words, "--help"])
        except _ParserError as given:
            return given.parser
    raise LookupError(f"{' '.join([module, *words])} --help printed no help of a parser")


class _ParserError(Exception):
    """Brings a parser out of the function that made it."""

    def __init__(self, parser: argparse.ArgumentParser) -> None:
        super().__init__(parser.prog)
        self.parser = parser


def _give(parser: argparse.ArgumentParser, file: object = None) -> NoReturn:
    raise _ParserError(parser)


def _command(name: str) -> Iterator[str]:
    command = COMMANDS[name]
    yield from ("", f"## {name}", "")
    if name in WITH_COMMANDS_OF_THEIR_OWN:
        yield from (_sentence(command.about), "")
    for word in WITH_COMMANDS_OF_THEIR_OWN.get(name, (None,)):
        words = command.words if word is None else (*command.words, word)
        yield from _parser(parser_of(command.module, words), f"{NAME} {name}")


def _parser(parser: argparse.ArgumentParser, heading: str) -> Iterator[str]:
    """Yield what a parser reads; below it, that of the commands that it has."""
    if parser.prog != heading:
        yield from ("", f"### {parser.prog}", "")
    if parser.description:
        yield from (_sentence(_markdown_text(parser.description)), "")
    below = _Below()
    parser.description, parser.formatter_class = None, below.formatter
    yield from (parser.format_help(), "")
    for one in below.parsers:
        yield from _parser(one, heading)


class _Below:
    """Gathers the parsers of a parser's own commands while its help is written."""

    def __init__(self) -> None:
        self.parsers: list[argparse.ArgumentParser] = []

    def formatter(self, prog: str, **_: object) -> _Markdown:
        return _Markdown(prog, self.parsers)


class _Markdown(argparse.HelpFormatter):
    """Writes a parser's help as Markdown: the usage in a block, then a list of definitions."""

    def __init__(self, prog: str, below: list[argparse.ArgumentParser]) -> None:
        super().__init__(prog, width=80)
        self._below, self._lines = below, list[str]()

    def add_usage(self, usage: str | None, actions: Any, groups: Any, prefix: Any = None) -> None:
        text = self._format_usage(usage, actions, groups, "").strip()
        self._lines += ["```text", text, "```", ""]

    def add_text(self, text: str | None) -> None:
        if text:
            self._lines += [_sentence(_markdown_text(text)), ""]

    def start_section(self, heading: str | None) -> None:
        """Nothing: usage says what is an option."""

    def end_section(self) -> None:
        """Nothing: see `start_section`."""

    def add_arguments(self, actions: Iterable[argparse.Action]) -> None:
        for action in actions:
            choices = action.choices.values() if isinstance(action.choices, dict) else ()
            if below := [one for one in choices if isinstance(one, argparse.ArgumentParser)]:
                self._below += below
            elif action.help != argparse.SUPPRESS and "--help" not in action.option_strings:
                about = self._expand_help(action) if action.help else ""
                self._lines += [
                    f"`{self._format_action_invocation(action)}`",
                    f":   {_sentence(_markdown_text(about))}",
                    "",
                ]

    def format_help(self) -> str:
        return "\n".join(self._lines)


def _markdown_text(text: str) -> str:
    """Return a text of a parser without reST's double backticks, and with nothing that is HTML."""
    return re.sub(r"``(.+?)``", r"`\1`", " ".join(text.split())).replace("<", "&lt;")


def _sentence(text: str) -> str:
    text = text if text[:1] in "`" else f"{text[:1].upper()}{text[1:]}"
    return f"{text.rstrip('.')}." if text else "–"
