"""A package of a user's own, outside the checkout, and the console script as pip writes it."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

CHECKOUT = Path(__file__).parents[2]
PACKAGE = Path(__file__).parent / "package"
TRAY = "mylab.tray:TwoArmTray-v1"
SCRIPT = """\
import shlex, sys
from robot_layouts.__main__ import main
if __name__ == "__main__":
    for line in sys.argv[1:]:
        try:
            code = main(shlex.split(line))
        except SystemExit as stop:  # argparse
            code = stop.code
        sys.stderr.flush()
        print(f"exit {code}", flush=True)
"""


def make_folder(folder: Path, *, shadows: bool = False) -> Path:
    """Put the package into a folder, and if asked, files that are called like our packages."""
    shutil.copytree(PACKAGE / "mylab", folder / "mylab", ignore=shutil.ignore_patterns("__py*"))
    (folder / "bin").mkdir()
    (folder / "bin" / "several").write_text(SCRIPT)
    if shadows:
        for name in ("objects.py", "tasks.py"):
            (folder / name).write_text("raise RuntimeError('hidden')")
        (folder / "robots").mkdir()
        (folder / "robots" / "__init__.py").write_text("")
    return folder


def add_metadata(folder: Path) -> None:
    """Write what pip would: the package's name, version and entry points."""
    project = tomllib.loads((PACKAGE / "pyproject.toml").read_text())["project"]
    info = folder / "mylab-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    groups = (
        "\n".join([f"[{group}]", *(f"{name} = {value}" for name, value in points.items())])
        for group, points in project["entry-points"].items()
    )
    (info / "entry_points.txt").write_text("\n".join(groups))


def run(folder: Path, *lines: str, installed: bool = False) -> tuple[list[int], str]:
    """Run commands of the console script, one after the other in one process.

    Args:
        folder: Where; the package lies there.
        lines: Each command's words.
        installed: Whether Python finds the package without the present folder.

    Returns:
        Their exit codes, and all that they printed.
    """
    places = [*([str(folder)] if installed else []), str(CHECKOUT)]
    done = subprocess.run(
        [sys.executable, str(folder / "bin" / "several"), *lines],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(places), "COLUMNS": "200"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    said = done.stdout.splitlines()
    codes = [int(line[5:]) for line in said if line.startswith("exit ")]
    assert len(codes) == len(lines), done.stdout
    return codes, done.stdout


def row(printed: str, task_id: str) -> list[str]:
    """Return the words of a task's row in a list of tasks."""
    return next(line.split() for line in printed.splitlines() if line.strip().startswith(task_id))


def words(**options: object) -> str:
    """Return options as words of a command line."""
    return " ".join(f"--{key} {shlex.quote(str(value))}" for key, value in options.items())
