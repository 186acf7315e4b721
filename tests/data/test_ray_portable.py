"""Actors of a Ray cluster are as portable as the process that hires them."""

import subprocess
import sys

import pytest

from tests.data.clusters import running_cluster


@pytest.mark.long
@pytest.mark.parametrize("portable", [False, True])
def test_actors_are_as_portable_as_who_hires_them(portable):
    before = [sys.executable, "-m", "robot_layouts", "portable"] if portable else []
    with running_cluster() as nodes:
        nodes.grow(1)
        command = [*before, sys.executable, "-m", "tests.data.asking_process", nodes.address]
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=240)
    assert done.stdout.split() == [str(portable)]
