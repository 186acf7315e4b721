"""Checks that each room is as small as agreed; `.ci/budget.toml` says what each may hold.

``--list`` names what the shares and counts at the end are of.
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import grimp

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

HOME = Path(__file__).resolve().parents[1]
NOT_CODE = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}


@dataclass
class Size:
    """What a folder of Python files holds."""

    files: int = 0
    code: int = 0  # lines without docstrings, imports, blank lines and comments
    lines: int = 0
    imports: int = 0  # lines
    names: int = 0  # in the `__all__` of its packages
    classes: Counter[str] = field(default_factory=Counter)

    def add(self, path: Path) -> None:
        """Add a file."""
        source = path.read_text()
        tree = ast.parse(source)
        imports, documentation = set[int](), set[int]()
        for node in ast.walk(tree):
            match node:
                case ast.Import() | ast.ImportFrom():
                    imports.update(range(node.lineno, node.end_lineno + 1))
                case ast.Expr(value=ast.Constant(value=str())):
                    documentation.update(range(node.lineno, node.end_lineno + 1))
                case ast.Assign(targets=[ast.Name(id="__all__")], value=ast.List(elts=names)):
                    self.names += len(names) if path.name == "__init__.py" else 0
                case _:
                    pass
        code = set[int]()
        for token in tokenize.generate_tokens(io.StringIO(source).readline):
            if token.type not in NOT_CODE:
                code.update(range(token.start[0], token.end[0] + 1))
        self.files += 1
        self.code += len(code - imports - documentation)
        self.lines += source.count("\n")
        self.imports += len(imports)
        self.classes.update(node.name for node in tree.body if isinstance(node, ast.ClassDef))


def measure(folder: Path) -> Size:
    """Return the size of a folder, subfolders included."""
    size = Size()
    for path in sorted(folder.rglob("*.py")):
        size.add(path)
    return size


def allowed(budget: Mapping[str, Any], room: str, what: str) -> int:
    """Return how much a room may have: what was agreed at first and all that was added since."""
    added = (raised for raised in budget.get("raised", []) if raised["room"] == room)
    return budget["rooms"][room][what] + sum(raised.get(what, 0) for raised in added)


def too_large(budget: Mapping[str, Any], sizes: dict[str, Size]) -> Iterator[str]:
    """Name the rooms that hold more than they may."""
    for raised in budget.get("raised", []):
        if not raised.get("why", "").strip():
            yield f'what raises the budget of {raised["room"]} needs a reason: why = "…"'
    for room, size in sizes.items():
        for what in ("code", "files", "names"):
            most, present = allowed(budget, room, what), getattr(size, what)
            if present > most:
                yield (
                    f"{room} has {present:,} {'lines of code' if what == 'code' else what}; "
                    f"{most:,} are agreed. Make it smaller, or add [[raised]] with its reason"
                )


def only_importers(rooms: list[str], data: list[str]) -> list[str]:
    """Return the modules that exactly one other module imports."""
    sys.path.insert(0, str(HOME))
    graph = grimp.build_graph(*rooms, cache_dir=None)
    return sorted(
        module
        for module in graph.modules
        if len(graph.find_modules_that_directly_import(module)) == 1
        and not graph.find_children(module)
        and not any(module.startswith(folder) for folder in data)
    )


def private_uses(path: Path, own: set[str]) -> Iterator[str]:
    """Name the private attributes of other packages that a file uses."""
    tree = ast.parse(path.read_text())
    foreign = set[str]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            foreign |= {
                (alias.asname or alias.name).partition(".")[0]
                for alias in node.names
                if alias.name.partition(".")[0] not in own
            }
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] not in own:
            foreign |= {alias.asname or alias.name for alias in node.names}
            for alias in node.names:
                if alias.name.startswith("_") or re.search(r"\._[a-z]", node.module or ""):
                    yield f"{path}:{node.lineno}: {node.module}.{alias.name}"
    for node in ast.walk(tree):
        if not isinstance(node, ast.Attribute) or not re.match(r"_[a-z]", node.attr):
            continue
        root = node.value
        while isinstance(root, ast.Attribute):
            root = root.value
        public = ast.unparse(node) in ("os._exit", "sys._getframe")  # as their documentation says
        if isinstance(root, ast.Name) and root.id in foreign and not public:
            yield f"{path}:{node.lineno}: {ast.unparse(node)}"


def main() -> int:
    """Print how large each room is and what is too large; 1 if anything is."""
    budget = tomllib.loads((HOME / ".ci/budget.toml").read_text())
    sizes = {room: measure(HOME / room) for room in budget["rooms"]}
    problems = list(too_large(budget, sizes))
    print(f"{'':28}{'files':>7}{'code':>9}{'agreed':>9}{'names':>7}{'imports':>9}")
    for room, size in sizes.items():
        print(
            f"{room:28}{size.files:7,}{size.code:9,}{allowed(budget, room, 'code'):9,}"
            f"{size.names:7,}{size.imports / max(size.lines, 1):9.1%}"
        )
    whole = budget["whole"]
    product = [room for room in sizes if room not in whole["not_product"]]
    lines, imports = (
        sum(getattr(sizes[room], w) for room in product) for w in ("lines", "imports")
    )
    files = sum(sizes[room].files for room in product)
    single = only_importers(sorted({room.partition("/")[0] for room in product}), whole["data"])
    classes = sum((sizes[room].classes for room in product), Counter[str]())
    several = sorted(name for name, count in classes.items() if count > 1)
    own = {room.partition("/")[0] for room in sizes}
    private = [
        use
        for room in product
        for path in sorted((HOME / room).rglob("*.py"))
        for use in private_uses(path.relative_to(HOME), own)
    ]
    for what, present, most, detail in (
        ("lines that import, in percent", round(100 * imports / lines, 1), whole["imports"], []),
        (
            "files with one importer, in percent",
            round(100 * len(single) / files, 1),
            whole["one_importer"],
            single,
        ),
        ("class names that exist twice", len(several), whole["classes_twice"], several),
        ("private names of other packages", len(private), whole["private"], private),
    ):
        print(f"{what}: {present} of {most}")
        if "--list" in sys.argv:
            print(*detail, sep="\n")
        if present > most:
            problems.append(f"{what}: {present}; {most} are agreed (--list names them)")
    print(f"product: {files} files, {sum(sizes[room].code for room in product):,} lines of code")
    for problem in problems:
        print(problem, file=sys.stderr)
    return bool(problems)


if __name__ == "__main__":
    sys.exit(main())
