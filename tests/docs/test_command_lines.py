"""Every command line in the documentation is understood by the parser of its program."""

import argparse
import io
import re
import runpy
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from itertools import dropwhile
from unittest.mock import patch

import pytest

from benchmarks.__main__ import PROGRAM as BENCHMARKS
from parity.__main__ import PROGRAM as PARITY
from robot_layouts.__main__ import PROGRAM
from robot_layouts.core.cli import Call
from robot_layouts.core.own_packages import PACKAGES
from tests.docs.blocks import ROOT
from tests.outside.lab import tomllib

FENCED = re.compile(r"^( *)(```+)\{?\.?(\w*)[^\n]*\n(.*?)^\1\2$", re.MULTILINE | re.DOTALL)
INDENTED = re.compile(r"^ {4,}\S.*$", re.MULTILINE)
SPAN = re.compile(r"`([^`]+)`")
PREFIX = r"(?:\w+=\S+ +)*(?:\S*/)?(?:robot-layouts|python[\d.]*|make|pip install)\b"
TYPED = re.compile(rf"^ *(?:\w*\$ +)?({PREFIX}.*)$", re.MULTILINE)
SENT = re.compile(r"'([^']*robot-layouts [^']*)'")  # to another machine
NO_COMMAND = re.compile(r" (COMMAND|ROOM|help|--version|recording 1)\b")
ENDS = {"|", ">", "&", "&&", ";"}  # of a command, in a line of several

PAGES = sorted(
    page
    for page in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md"))
    if page.name != "faults.md"
)
GALLERY = [page for page in PAGES if (ROOT / "docs/gallery") in page.parents]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8").replace("\\\n", "")
RECIPES = dict(re.findall(r"^([\w-]+):(?!=).*\n((?:\t.*\n)*)", MAKEFILE, re.MULTILINE))


def typed(text: str) -> Iterator[str]:
    """Yield the command lines in the blocks of a page, those that are not run included."""
    blocks = [found[4] for found in FENCED.finditer(text) if found[3] != "python"]
    blocks += INDENTED.findall(FENCED.sub("", text))
    for block in blocks:
        joined = re.sub(r"\\\n *", "", block)
        yield from TYPED.findall(joined)
        yield from SENT.findall(joined)


def named(text: str) -> Iterator[str]:
    """Yield the command lines in the text of a page; a command's mere name is none."""
    for span in SPAN.findall(FENCED.sub("", text)):
        line = " ".join(span.split())
        if re.match(PREFIX, line) and not _is_name(line):
            yield line


def _is_name(line: str) -> bool:
    return any(f"robot-layouts {name} ".startswith(f"{line} ") for name in PROGRAM.commands)


@cache
def problem(line: str) -> str:
    """Return why a command line would be refused; empty if it would not, or is of others."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars="|>&;")
    lexer.whitespace_split = True
    words = list(lexer)
    end = next((number for number, word in enumerate(words) if word in ENDS), len(words))
    said = io.StringIO()
    try:
        with redirect_stderr(said), redirect_stdout(io.StringIO()):
            _understand(words[:end])
    except SystemExit as stop:  # argparse's; 0 is help
        return f"{line}: {said.getvalue()}" if stop.code else ""
    except LookupError as error:
        return f"{line}: {error}"
    return ""


def _understand(line: Sequence[str]) -> None:
    program, *words = dropwhile(re.compile(r"\w+=").match, line)  # settings of its environment
    if program.endswith("robot-layouts"):
        call = PROGRAM.parse(words)
        if begun := call.arguments.get("program"):
            _understand(begun)
    elif "python" in program and words[:1] == ["-m"]:
        _of_module(words[1], words[2:])
    elif program == "make":
        if words[0] not in RECIPES:
            raise LookupError(f"the Makefile has no target {words[0]}")
        given = " ".join(words[1:]).removeprefix("ARGS=")
        recipe = RECIPES[words[0]].replace("$(ARGS)", given)
        for command in re.findall(r"\$\(RUN\) (-m .*)", recipe):
            _understand(["python", *shlex.split(command)])
    elif program == "pip":
        named = re.findall(r"^(?:robot-layouts|\.)\[([^\]]+)\]", "\n".join(words), re.MULTILINE)
        if unknown := {extra for extras in named for extra in extras.split(",")} - {*EXTRAS}:
            raise LookupError(f"there is no extra {', '.join(unknown)}")


def _of_module(name: str, words: Sequence[str]) -> None:
    if name in TOOLS:
        TOOLS[name].parse(words)
    elif name.partition(".")[0] in PACKAGES:
        found = find_spec(name)
        if found is None:
            raise LookupError(f"there is no module {name}")
        is_package = found.submodule_search_locations is not None
        main = import_module(f"{name}.__main__" if is_package else name).main
        parsed(lambda: main(words))


TOOLS = {"benchmarks": BENCHMARKS, "parity": PARITY}


class UnderstoodError(Exception):
    """Raised in place of what a program would do next."""


def parsed(run: Callable[[], object]) -> None:
    """Let a program read its words, and do nothing else."""
    read = argparse.ArgumentParser.parse_args

    def parse_args(parser, *words, **options):
        read(parser, *words, **options)
        raise UnderstoodError

    def understood(call):
        raise UnderstoodError

    with (
        patch.object(argparse.ArgumentParser, "parse_args", parse_args),
        patch.object(Call, "run", understood),
        suppress(UnderstoodError),
    ):
        raise SystemExit(run())


def lines_of(*pages) -> list[str]:
    texts = [page.read_text(encoding="utf-8") for page in pages]
    lines = dict.fromkeys(line for text in texts for line in (*typed(text), *named(text)))
    return [line for line in lines if not NO_COMMAND.search(line)]


def problems(*pages) -> list[str]:
    return [found for line in lines_of(*pages) if (found := problem(line))]


@pytest.mark.parametrize(
    "page",
    [page for page in PAGES if page not in GALLERY],
    ids=lambda page: page.relative_to(ROOT).as_posix(),
)
def test_the_commands_of_a_page_are_understood(page):
    assert problems(page) == []


def test_the_commands_of_the_gallery_are_understood():
    assert problems(*GALLERY) == []


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("robot-layouts evaluate expert --task X-v1", "unrecognized arguments: expert"),
        ("A=1 robot-layouts record --task X-v1", "required: --episodes, --out"),
        ("python -m layouts shwo", "Did you mean 'show'"),
        ('make bench ARGS="--recrod"', "unrecognized arguments: --recrod"),
        ("pip install 'robot-layouts[veiw]'", "no extra veiw"),
    ],
)
def test_a_wrong_command_is_found_and_told(tmp_path, line, words):
    (tmp_path / "page.md").write_text(f"```console\n$ robot-layouts tasks list\n$ {line}\n```\n")
    (found,) = problems(tmp_path / "page.md")
    assert words in found


EXAMPLES = [line for line in lines_of(*PAGES) if re.match(r"python examples/", line)]


@pytest.mark.long
@pytest.mark.parametrize("line", EXAMPLES)
def test_an_example_understands_its_words(line, monkeypatch):
    _, script, *words = shlex.split(line)
    monkeypatch.setattr(sys, "argv", [script, *words])
    monkeypatch.syspath_prepend(ROOT / "examples")
    if "mappo" in script:
        pytest.importorskip("torchrl", reason="no extra brings it")
    parsed(lambda: runpy.run_path(str(ROOT / script), run_name="__main__"))
