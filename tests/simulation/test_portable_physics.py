"""What of physics a portable process computes otherwise: roots, and contacts of two boxes."""

from __future__ import annotations

import subprocess
import sys
from math import cos, sin

import numpy as np
import pytest
import torch

import tasks
from robot_layouts.simulation import maths
from robot_layouts.simulation.sapien3 import exact_division
from robots import SimulationError
from tests.fresh_process import in_fresh_process


def test_roots_are_rounded_as_ieee_says(monkeypatch):
    squares = np.random.default_rng(0).uniform(0, 4, 100_000).astype(np.float32)
    exact = np.sqrt(squares.astype(float)).astype(np.float32)
    monkeypatch.setattr(maths, "is_portable", lambda: True)
    np.testing.assert_array_equal(maths.sqrt(squares), exact)
    tensor = torch.from_numpy(squares).requires_grad_()
    root = maths.sqrt(tensor)
    np.testing.assert_array_equal(root.detach().numpy(), exact)
    assert root.dtype is torch.float32
    root.sum().backward()
    assert tensor.grad is not None


def cube_askew_on_another(exact: bool) -> bytes:
    """Return where a cube comes to rest that is let go askew on another one."""
    if exact:
        exact_division.divide_exactly()
        exact_division.divide_exactly()  # the second time does nothing
    task = tasks.make("StackCube-v1")
    task.reset(0, {"reconfigure": True})
    state = task.get_state_dict()
    x, y, z = state["actors"]["cubeB"][0, :3].tolist()
    top = [x + 0.011, y + 0.007, z + 0.0405, cos(0.3), 0.0, 0.0, sin(0.3)]
    state["actors"]["cubeA"][0] = torch.tensor(top + 6 * [0.0])
    task.set_state_dict(state)
    places: list[bytes] = []
    for _ in range(10):
        task.step(torch.zeros(1, 8))
        places.append(task.get_state_dict()["actors"]["cubeA"].numpy().tobytes())
    task.close()
    return b"".join(places)


@pytest.mark.long
def test_contacts_of_two_boxes_divide_exactly():
    estimated = in_fresh_process(cube_askew_on_another, False)
    exact = in_fresh_process(cube_askew_on_another, True)
    assert exact == in_fresh_process(cube_askew_on_another, True)
    assert exact != estimated  # or this tests nothing
    one, other = (np.frombuffer(data, np.float32).reshape(-1, 13) for data in (estimated, exact))
    assert np.abs(one - other)[:, :3].max() < 1e-3  # m; the estimate has 12 bits


def refuse_another_library() -> str:
    exact_division._AFTER = b"another version"
    before = cube_askew_on_another(False)
    with pytest.raises(SimulationError) as raised:
        exact_division.divide_exactly()
    assert cube_askew_on_another(False) == before
    return str(raised.value)


@pytest.mark.long
def test_another_library_is_left_alone():
    assert "libsapien.so is not that of sapien 3.0.3" in in_fresh_process(refuse_another_library)


def test_a_library_that_is_not_loaded_is_missed(monkeypatch):
    monkeypatch.setattr(exact_division, "LIBRARY", "libanother.so")
    exact_division.divide_exactly.cache_clear()
    with pytest.raises(SimulationError, match=r"libanother\.so is not loaded"):
        exact_division.divide_exactly()
    exact_division.divide_exactly.cache_clear()


@pytest.mark.long
def test_worlds_of_a_portable_process_divide_exactly():
    code = (
        "import tasks\n"
        "from robot_layouts.simulation.sapien3.exact_division import divide_exactly as d\n"
        "tasks.make('PickCube-v1', obs_mode='none').close(); print(d.cache_info().misses)"
    )
    for before, divided in (((), "0"), ((sys.executable, "-m", "robot_layouts", "portable"), "1")):
        done = subprocess.run(
            [*before, sys.executable, "-c", code], capture_output=True, text=True, check=True
        )
        assert done.stdout.strip() == divided
