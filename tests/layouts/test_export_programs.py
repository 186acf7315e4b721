"""Exported cells, read by MuJoCo, usd-core, Pinocchio, Drake and SAPIEN themselves."""

import sys
from pathlib import Path

import pytest

from tests.clients.environments import new_environment, play

HERE = Path(__file__).parent
PROGRAMS = ("drake", "mujoco", "pinocchio", "usd")

pytestmark = [
    pytest.mark.long,
    pytest.mark.xdist_group("export_programs"),  # they share one environment
]


@pytest.fixture(scope="module")
def python(tmp_path_factory):
    if sys.version_info < (3, 11):
        pytest.skip("the newest versions of the other programs need Python 3.11")
    folder = tmp_path_factory.mktemp("programs") / "environment"
    return new_environment(folder, HERE / "programs" / "requirements.txt")


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_program_reads_every_cell(program, python, tmp_path):
    play(python, HERE / "programs" / f"{program}_program.py", tmp_path / "out")
