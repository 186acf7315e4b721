"""Packages of others, each in an environment of its own, used as their documentation says."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.clients.environments import ROOT, new_environment, play

HERE = Path(__file__).parent
CLIENTS = (
    "cleanrl",
    "inspect_robots",
    "logs",
    "minari",
    "rllib",
    "skrl",
    "supersuit",
    "tianshou",
    "torchrl",
    "vla_eval",
)
LARGE = {  # that bring gigabytes of CUDA, and are not installed for a test
    "robomimic": "robomimic needs torchvision, which fits no CPU build of torch from the index",
}
PROGRAMS = [f"{client}{part}" for client in LARGE for part in ("", "_cameras")]

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(sys.version_info < (3, 11), reason="their newest versions need Python 3.11"),
]


@pytest.mark.parametrize("client", CLIENTS)
def test_a_client(client, tmp_path):
    python = new_environment(tmp_path / "environment", HERE / "requirements" / f"{client}.txt")
    play(python, HERE / "programs" / f"{client}_program.py", tmp_path / "out")


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_large_client(program, tmp_path):
    client = program.partition("_")[0]
    python = os.environ.get(variable := f"{client.upper()}_PYTHON")
    if python is None:
        pytest.skip(f"{LARGE[client]}; set {variable} to a Python that has it")
    play(Path(python), HERE / "programs" / f"{program}_program.py", tmp_path / "out")


def test_every_program_is_run():
    programs = {path.stem for path in (HERE / "programs").glob("*_program.py")}
    others = {name for name in programs if name.startswith("lerobot")}  # `test_lerobot` runs them
    assert programs - others == {f"{client}_program" for client in (*CLIENTS, *PROGRAMS)}


def test_mypy_knows_what_places_take(tmp_path):
    python = new_environment(tmp_path / "environment", HERE / "requirements" / "mypy.txt")
    check = [python, "-m", "mypy", "--strict", "--follow-imports=silent", "typed.py"]
    variables = {"MYPYPATH": str(ROOT), "MYPY_CACHE_DIR": str(tmp_path / "cache")}
    done = subprocess.run(
        check, cwd=HERE, env=variables, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
