"""What users and their tools leave in a checkout changes no test that reads its files."""

import shutil
import subprocess
import sys

import pytest

from tests.checkout import ROOT, tracked_files

READERS = (
    "tests/docs/test_command_lines.py",
    "tests/docs/test_commands.py",
    "tests/docs/test_links.py",
    "tests/docs/test_pages.py",
    "tests/benchmarks/test_gallery.py",
    "tests/benchmarks/test_pages.py",
    "tests/test_packaging.py",
)
LEFT_BEHIND = (
    ".venv/lib/python3.11/site-packages/other/tasks.md",
    "assets_cache/maniskill_panda/panda_v2.urdf",
    "assets_cache/maniskill_panda/meshes/link0.stl",
    "data/trajectory.h5",  # not ignored, but the README's own `record --out data`
    "runs/bench/bench.png",
    "runs/demo/trajectory.h5",
    "site/index.html",
    "site/project/changelog/index.html",
)
WORDS = "[gone](../gone.md) {}home/me/lab `docs/gone.md`".format("/")


@pytest.mark.long
def test_what_is_left_behind_changes_nothing(tmp_path):
    for file in tracked_files():
        copy = tmp_path / file.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, copy)
    for command in ("init --quiet", "add --all"):
        subprocess.run(["git", *command.split()], cwd=tmp_path, check=True)
    for name in LEFT_BEHIND:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(WORDS)
    tests = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-n", "0", *READERS]
    done = subprocess.run(tests, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-4000:]
    assert "skipped" not in done.stdout
