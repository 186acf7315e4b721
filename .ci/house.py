"""Checks rules of the house that neither ruff nor import-linter can: owners, names, words.

``--list`` names every place. What cannot be mended at once has a limit here, which may only fall.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

HOME = Path(__file__).resolve().parents[1]
PRODUCT = ("robots", "objects", "layouts", "tasks", "robot_layouts")
LIMITS = {
    "strings that name modules of rooms below": 0,
    "files that are opened for writing outside of core": 9,
    "words in the documentation that no native speaker would write": 0,
    "words in the code that no native speaker would write": 0,
}
WRITERS = ("write_text", "write_bytes")
# Pages that the benchmarks write, and what was written in the past.
NOT_OURS = ("docs/gallery/", "docs/receipts/", "CHANGELOG.md")
DIALECT = re.compile(
    r"""
    (?<!there\ )\b(?:is|are|was|were)\ none\b(?!\ of)  # not a valid one, missing
    | \b(?:no|some|any|every)body\b | \bwhoever\b      # a role: the user, another process
    | \bas\ (?:it|they)\ (?:was|were|is|are)\ told\b | \bis\ told\ (?:of|on)\b
    | \bmakes?\ no\ sense\b                            # is invalid
    | \bbe\ had\b | \bfor\ want\ of\b                   # is available, is missing
    | \b(?:that|which)\ there\ (?:is|are)\ not\b       # does not exist
    | \b(?:what|which)\ c[ao]mes?\ of\b                # the result
    | \bas\ one\ likes\b | \blonger\ strokes\b | \bbetter(?:ed|s)\b
    | \bmend(?:s|ed|ing)?\b | \bstrangers?\b              # fix, repair; a request without a token
    | \bhire[sd]?\b | \bcrews?\b | \bbur(?:y|ies|ied)\b | \bfarewell\b
    """,
    re.VERBOSE,
)


def rooms() -> list[str]:
    """Return the rooms, the lowest first, as the contract of import-linter lists them."""
    contracts = tomllib.loads((HOME / "pyproject.toml").read_text())["tool"]["importlinter"]
    (layers,) = (c["layers"] for c in contracts["contracts"] if "benchmarks" in c.get("layers", ()))
    return layers[::-1]


def room_of(module: str, known: list[str]) -> int | None:
    """Return the number of the room that a module is in; None if it is in none."""
    inside = (i for i, room in enumerate(known) if f"{module}.".startswith(f"{room}."))
    return next(inside, None)


def is_module(name: str) -> bool:
    """Return whether there is a module, or a package, of that name here."""
    path = HOME / name.replace(".", "/")
    return path.is_dir() or path.with_name(f"{path.name}.py").exists()


def names_below(tree: ast.Module, here: int, known: list[str]) -> Iterator[tuple[int, str]]:
    """Yield strings that name a module of a room which this one may not import."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            found = re.fullmatch(r"(\w+(?:\.\w+)+)(?::\w+)?", node.value)
            room = room_of(found[1], known) if found and is_module(found[1]) else None
            if room is not None and room > here:
                yield node.lineno, node.value


def writes(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield calls that open a file for writing."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        called = node.func.attr if isinstance(node.func, ast.Attribute) else ast.unparse(node.func)
        modes = [*node.args, *(word.value for word in node.keywords if word.arg == "mode")]
        given = {mode.value for mode in modes if isinstance(mode, ast.Constant)}
        opened = called in ("open", "File") and any(
            re.fullmatch(r"[rwax]?[wax+]b?", str(m)) for m in given
        )
        if opened or called in WRITERS:
            yield node.lineno, ast.unparse(node)[:60]


def dialect(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the words of a file that no native speaker would write."""
    for number, line in enumerate(path.read_text().splitlines(), 1):
        yield from ((number, found[0]) for found in DIALECT.finditer(line))


def main() -> int:
    """Print how often each rule is broken; 1 if it is more often than its limit allows."""
    known = rooms()
    found: list[list[str]] = [[] for _ in LIMITS]
    for path in sorted(path for room in PRODUCT for path in (HOME / room).rglob("*.py")):
        tree, name = ast.parse(path.read_text()), path.relative_to(HOME).as_posix()
        here = room_of(name.removesuffix(".py").replace("/", "."), known)
        places = (
            names_below(tree, here, known) if here is not None else (),
            writes(tree) if not name.startswith("robot_layouts/core/") else (),
            (),
            dialect(path),
        )
        for lines, seen in zip(found, places, strict=True):
            lines += [f"{name}:{number}: {what}" for number, what in seen]
    pages = [HOME / "README.md", HOME / "CONTRIBUTING.md", *sorted((HOME / "docs").rglob("*.md"))]
    for path in pages:
        name = path.relative_to(HOME).as_posix()
        if not name.startswith(NOT_OURS):
            found[2] += [f"{name}:{number}: {what}" for number, what in dialect(path)]
    problems = 0
    for (rule, limit), lines in zip(LIMITS.items(), found, strict=True):
        print(f"{rule}: {len(lines)} of {limit}")
        if "--list" in sys.argv or len(lines) > limit:
            print(*lines, sep="\n")
        problems += len(lines) > limit
    return int(problems > 0)


if __name__ == "__main__":
    sys.exit(main())
