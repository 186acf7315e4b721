"""Environments of their own for the packages of others, on top of the one that tests run in."""

import os
import subprocess
import sys
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
UNREACHABLE = ("Temporary failure in name resolution", "Failed to establish a new connection")


def new_environment(folder: Path, requirements: Path) -> Path:
    """Install packages beside those that tests have, and return the Python that sees both.

    What the tests have installed (torch, sapien …) is taken from there. A package that is wanted in
    another version is installed here, and found first.
    """
    venv.create(folder, with_pip=True)
    (own,) = folder.glob("lib/python*/site-packages")
    theirs = [path for path in sys.path if path.endswith(("site-packages", "dist-packages"))]
    lines = [f"import site; site.addsitedir({path!r})\n" for path in theirs]
    (own / "tests.pth").write_text("".join(lines))
    python = folder / "bin" / "python"
    installed(python, ["-r", str(requirements)], requirements.name)
    return python


def installed(python: Path, words: list[str], what: str) -> None:
    """Let pip install something; skip where the package index cannot be reached."""
    install = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    done = subprocess.run([*install, *words], capture_output=True, text=True, check=False)
    if done.returncode and any(text in done.stderr for text in UNREACHABLE):
        pytest.skip(f"the package index cannot be reached for {what}")
    assert done.returncode == 0, done.stderr


def play(python: Path, program: Path, folder: Path) -> None:
    """Run a program, with this checkout's packages and a folder of its own."""
    folder.mkdir()
    variables = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [python, program, folder],
        cwd=folder,
        env=variables,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{program.name}: {done.stderr[-4000:]}"
