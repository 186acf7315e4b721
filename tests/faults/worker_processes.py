"""Vectors with workers, as the faults of processes meet them, and what runs beside."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

from tests.process_trees import children_of

AREA = "processes"
ROOT = Path(__file__).parents[2]
PATIENCE = 30.0  # s, for processes to be gone on a busy machine
TASK = "PushCube-v1"

USES: dict[str, Callable[[Any], Any]] = {
    "step()": lambda env: env.step(actions(env)),
    "reset()": lambda env: env.reset(),
    "reset(seed=1)": lambda env: env.reset(seed=1),
    "reset(reconfigure)": lambda env: env.reset(options={"reconfigure": True}),
    "restart()": lambda env: env.restart(),
}


def failure(call: Callable[[], Any]) -> Any:
    """Return the `VectorWorkerError` that a call ends with."""
    from tasks.interfaces.workers import VectorWorkerError

    try:
        call()
    except VectorWorkerError as error:
        return error
    raise AssertionError("nothing failed")


def same_rows(results: Any, expected: Any, rows: list[int]) -> None:
    """Compare what two steps gave for some environments, bit for bit."""
    import numpy as np

    for result, wanted in zip(results[:4], expected[:4], strict=True):
        np.testing.assert_array_equal(result[rows], wanted[rows])


def play_own() -> bytes:
    """Make a vector with workers, and return what it observes after a step."""
    with vector(num_workers=2) as env:
        env.reset(seed=4)
        return env.step(actions(env))[0].tobytes()


def server_pid() -> int:
    """Return the number of the server that forks this process's workers."""
    with vector(num_workers=1):
        (server,) = [pid for pid in children_of(os.getpid()) if "forkserver" in command(pid)]
    return server


def command(pid: int) -> str:
    """Return the command line of a process; nothing if it is gone."""
    with suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_text()
    return ""


@contextmanager
def vector(task_id: str = TASK, num_envs: int = 2, **fields: Any) -> Generator[Any]:
    """Give a vector, and close it in the end."""
    from tasks.interfaces.vector import VectorTask
    from tests.tasks.breaking import offered

    with offered(), closing(VectorTask(task_id, num_envs, **{"num_workers": 1, **fields})) as env:
        yield env


def actions(env: Any) -> Any:
    """Return an action for each environment."""
    import numpy as np

    return np.full((env.num_envs, 8), 0.2, np.float32)


def worker_pid(env: Any, number: int) -> int:
    """Return the process of a vector's worker."""
    return env._backend.workers[number].pid


def living_workers(env: Any) -> list[int]:
    """Return the processes of a vector that live."""
    return [worker.pid for worker in env._backend.workers.values() if session_of(worker.pid)]


def session_of(pid: int) -> int:
    with suppress(OSError):
        state, *rest = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return 0 if state in "ZX" else int(rest[2])
    return 0


def children() -> set[int]:
    """Return the living processes that `multiprocessing` knows of."""
    return {child.pid for child in multiprocessing.active_children() if child.pid is not None}


def open_files() -> int:
    """Return how many file descriptors are open."""
    return len(os.listdir("/proc/self/fd")) - 1


@contextmanager
def later(seconds: float, call: Callable[[], Any]) -> Generator[None]:
    """Call something in a thread after some time (s)."""
    timer = threading.Timer(seconds, call)
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()


def wait_until(met: Callable[[], Any], otherwise: str) -> None:
    """Wait for something, for a while."""
    deadline = time.monotonic() + PATIENCE
    while not met():
        assert time.monotonic() < deadline, otherwise
        time.sleep(0.01)


def run_script(folder: Path, text: str) -> subprocess.CompletedProcess[str]:
    """Run a script of its own in a folder, and return what it printed."""
    (folder / "script.py").write_text(text)
    return subprocess.run(
        [sys.executable, "script.py"],
        cwd=folder,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        timeout=60 + PATIENCE,
        check=False,
    )
