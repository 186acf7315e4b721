"""The commands' reference as Markdown, from the parsers that read the command line."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Iterator
from typing import Any

from robot_layouts.__main__ import PROGRAM


def markdown() -> str:
    """Return every command of `robot-layouts`: what it does, how it is used, and its options."""
    users = (line for name in PROGRAM.for_users for line in _command(name, "##"))
    developers = (line for name in PROGRAM.for_developers for line in _command(name, "###"))
    return "\n".join([*users, "", "## Commands for developers of the library", *developers])


def _command(name: str, level: str) -> Iterator[str]:
    prog = f"{PROGRAM.name} {name}"
    yield from ("", f"{level} {name}", "")
    yield from _parser(PROGRAM.commands[name].parser(prog), prog, f"{level}#")


def _parser(parser: argparse.ArgumentParser, heading: str, level: str) -> Iterator[str]:
    """Yield what a parser reads; below it, that of the commands that it has."""
    if parser.prog != heading:
        yield from ("", f"{level} {parser.prog}", "")
    if parser.description:
        yield from (_sentence(_markdown_text(parser.description)), "")
    below = _Below()
    parser.description, parser.formatter_class = None, below.formatter
    yield from (parser.format_help(), "")
    for one in below.parsers:
        yield from _parser(one, heading, level)


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
    """Return a text with a capital letter and a full stop."""
    text = text if text[:1] in "`" else f"{text[:1].upper()}{text[1:]}"
    return f"{text.rstrip('.')}." if text else "–"
