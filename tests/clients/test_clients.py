"""Packages of others, each in an environment of its own, used as their documentation says."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.clients.environments import ROOT, new_environment, play

HERE = Path(__file__).parent
CLIENTS = ("cleanrl", "minari", "rllib", "skrl", "supersuit", "tianshou", "torchrl")

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(sys.version_info < (3, 11), reason="their newest versions need Python 3.11"),
]


@pytest.mark.parametrize("client", CLIENTS)
def test_a_client(client, tmp_path):
    python = new_environment(tmp_path / "environment", HERE / "requirements" / f"{client}.txt")
    play(python, HERE / "programs" / f"{client}_program.py", tmp_path / "out")


def test_every_program_is_run():
    assert {path.name for path in (HERE / "programs").glob("*_program.py")} == {
        f"{client}_program.py" for client in CLIENTS
    }


def test_mypy_knows_what_places_take(tmp_path):
    python = new_environment(tmp_path / "environment", HERE / "requirements" / "mypy.txt")
    check = [python, "-m", "mypy", "--strict", "--follow-imports=silent", "typed.py"]
    variables = {"MYPYPATH": str(ROOT), "MYPY_CACHE_DIR": str(tmp_path / "cache")}
    done = subprocess.run(
        check, cwd=HERE, env=variables, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
