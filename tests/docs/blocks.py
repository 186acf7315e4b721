"""Plays a page: its files are written, its Python and its commands run, from the first to the last.

``python tests/docs/blocks.py PAGE`` does so in the present folder. What a block defines, later
ones have, as in a notebook. A comment ``<!-- not run: reason -->`` before a block keeps it out.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from textwrap import dedent
from types import ModuleType
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
FENCE = re.compile(
    r"(?P<skipped><!-- not run: [^>]*-->\n\s*)?^(?P<indent> *)```(?:\{\.)?(?P<language>\w+)"
    r'(?: title="(?P<file>[^"]+)")?[^\n]*\n(?P<code>.*?)^(?P=indent)```$',
    re.MULTILINE | re.DOTALL,
)
INCLUDED = re.compile(r'--8<-- "([^"]+)"\n')  # what the site puts into pages
RUN = ("python", "console")
# What takes minutes, made short.
SHORTER = {
    "learn(100_000)": "learn(1)",
    "range(100)": "range(2)",
    "episodes=100": "episodes=2",
    "num_envs=64": "num_envs=4",
    "batch_size=32": "batch_size=2",
    "--episodes 20": "--episodes 2",
}


class Block(NamedTuple):
    """A block of code in a page.

    Attributes:
        language: As the fence says.
        file: Name of the file that the block is, or empty.
        code: Without the indentation of the fence.
        line: Of the page, on which the code begins.
    """

    language: str
    file: str
    code: str
    line: int


def blocks(page: Path) -> list[Block]:
    """Return the blocks of a page that are to be played, in order."""
    text = page.read_text(encoding="utf-8")
    return [
        Block(
            found["language"],
            found["file"] or "",
            INCLUDED.sub(_included, dedent(found["code"])),
            text.count("\n", 0, found.start("code")) + 1,
        )
        for found in FENCE.finditer(text)
        if not found["skipped"] and (found["file"] or found["language"] in RUN)
    ]


def _included(found: re.Match[str]) -> str:
    return (ROOT / found[1]).read_text(encoding="utf-8")


def shortened(code: str) -> str:
    for long, short in SHORTER.items():
        code = code.replace(long, short)
    return code


def commands(console: str) -> list[str]:
    """Return what is typed after each ``$``, with the lines that a backslash joins to it."""
    joined = console.replace("\\\n", "")
    return [line[2:] for line in joined.splitlines() if line.startswith("$ ")]


def play(page: Path) -> None:
    """Play a page in the present folder; the first thing that fails ends it."""
    main = ModuleType("__main__")
    sys.path.insert(0, os.getcwd())
    for block in blocks(page):
        code = shortened(block.code)
        if block.file:
            Path(block.file).parent.mkdir(parents=True, exist_ok=True)
            Path(block.file).write_text(code, encoding="utf-8")
        elif block.language == "python":
            numbered = "\n" * (block.line - 1) + code  # errors name the page's lines
            exec(compile(numbered, str(page), "exec"), vars(main))
        else:
            for command in commands(code):
                print(f"$ {command}", flush=True)
                subprocess.run(["bash", "-c", command], check=True)


def play_apart(page: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """Play a page in another process and an empty folder, where our commands are found."""
    own = folder / "bin"
    own.mkdir()
    script = "from robot_layouts.__main__ import run; run()"
    for name, words in (("python", ""), ("robot-layouts", f"-c '{script}'")):
        (own / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {words} "$@"\n')
        (own / name).chmod(0o755)
    (folder / "empty").mkdir()
    return subprocess.run(
        [sys.executable, __file__, str(page)],
        cwd=folder / "empty",
        env={**os.environ, "PATH": f"{own}:{os.environ['PATH']}", "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )


if __name__ == "__main__":
    play(Path(sys.argv[1]).resolve())
