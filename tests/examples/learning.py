"""Runs of the examples that learn: started as their users do, killed, and compared."""

import importlib.util
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
import torch

from tests.process_trees import children_of

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
ENVIRONMENT = {
    **os.environ,
    "PYTHONPATH": os.pathsep.join(map(str, (ROOT, EXAMPLES))),
    "OMP_NUM_THREADS": "1",
}


@pytest.fixture
def examples(monkeypatch):
    """Let modules of the folder be imported, and be forgotten afterwards."""
    before = set(sys.modules)
    monkeypatch.syspath_prepend(EXAMPLES)
    yield
    for name in set(sys.modules) - before:
        if (EXAMPLES / f"{name}.py").exists():
            del sys.modules[name]


@contextmanager
def loaded(name):
    """Yield an example as a module of its name, which is forgotten afterwards."""
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    sys.modules[name] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    del sys.modules[name]


def start(example, folder, *words, python=sys.executable):
    """Start an example, as a process of its own."""
    command = [python, EXAMPLES / f"{example}.py", "--out", folder, *words]
    return subprocess.Popen(
        command, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def finish(process):
    """Wait until a run is over, and return what it printed."""
    printed, errors = process.communicate(timeout=600)
    assert process.returncode in (0, 1), errors  # 1: it has not learned enough yet
    return printed + errors


def kill_while_it_learns(process, folder, number):
    """Kill a run with SIGKILL while it learns what comes after a checkpoint."""
    unfinished = f"checkpoint-{number + 1:04d}.*"
    while not ((folder / f"checkpoint-{number:04d}").exists() and list(folder.glob(unfinished))):
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    children = children_of(process.pid)
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.communicate()
    wait_for_the_end_of(children)
    assert not (folder / f"checkpoint-{number + 1:04d}").exists()


def wait_for_the_end_of(processes):
    """Wait until the workers of a killed run have noticed it."""
    deadline = time.monotonic() + 60
    while any(Path(f"/proc/{pid}").exists() for pid in processes):
        assert time.monotonic() < deadline, f"workers {processes} are still there"
        time.sleep(0.05)


def assert_same(one, other):
    """Compare nested tensors and numbers to the last bit."""
    assert type(one) is type(other)
    if isinstance(one, dict):
        assert list(one) == list(other)
        for name in one:
            assert_same(one[name], other[name])
    else:
        assert torch.equal(torch.as_tensor(one), torch.as_tensor(other))
