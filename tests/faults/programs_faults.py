"""What a user's program does around the library: threads, forks, homes that nobody may write."""

from __future__ import annotations

import ctypes
import functools
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from layouts import Layout, Placement
from robots import RobotLayoutsError
from tests.faults.fault import GOES_ON, Fault, run_command
from tests.faults.players import recorded
from tests.faults.toy_robots import BOX, descriptor, mesh, toy
from tests.faults.worker_processes import ROOT

AREA = "programs"
SECONDS = 120.0
PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH = 24, 1, 2  # linux/prctl.h, capability.h
HOMES = ("HOME", "TMPDIR", "XDG_CACHE_HOME")
RECORD = ("robot_layouts", "record", "--task", "PushCube-v1", "--episodes", "1", "--workers", "1")
EXPORT = ("layouts", "export", "single", "arm=panda", "--no-visuals", "--format", "mjcf")


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for workers in (0, 1):
        run = functools.partial(_in_threads, workers)
        yield Fault(AREA, f"threads record with {workers} workers each", run, GOES_ON)
        run = functools.partial(_in_a_fork, workers)
        yield Fault(AREA, f"a fork records with {workers} workers", run, GOES_ON)
    yield Fault(AREA, "threads record into one folder", _into_one_folder)
    yield Fault(AREA, "threads export to one file", _export, GOES_ON)
    what = f"{', '.join(HOMES)} may not be written"
    yield Fault(AREA, what, _recorded, GOES_ON)
    for words in (RECORD, EXPORT):
        run = functools.partial(_written_there, words)
        yield Fault(AREA, f"{words[1]} to where nobody may write", run)
    for what, seconds in {"back": -1e8, "on": 1e8}.items():
        run = functools.partial(_changed_file, seconds)
        yield Fault(AREA, f"the clock goes {what} between changes of a URDF", run)
        run = functools.partial(_resumed, seconds)
        yield Fault(AREA, f"the clock goes {what} between parts of a recording", run, GOES_ON)


# -- threads and forks -----------------------------------------------------------------------------


def _bytes(folder: Path) -> bytes:
    return (folder / "trajectory.h5").read_bytes()


def _all(*calls: Callable[[], object]) -> list[RobotLayoutsError]:
    """Call in a thread each, and return what was refused."""
    refused: list[RobotLayoutsError] = []
    ended: list[bool] = []

    def run(call: Callable[[], object]) -> None:
        try:
            call()
        except RobotLayoutsError as error:
            refused.append(error)
        ended.append(True)

    threads = [threading.Thread(target=run, args=(call,)) for call in calls]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(SECONDS)
    assert len(ended) == len(calls), "a thread hangs or has ended in a raw error"
    return refused


def _fork(call: Callable[[], object]) -> None:
    """Call in a fork, and wait for it."""
    pid = os.fork()
    if pid == 0:
        try:
            call()
        except BaseException:
            os._exit(1)
        os._exit(0)
    deadline = time.monotonic() + SECONDS
    while os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
        if time.monotonic() > deadline:
            os.kill(pid, 9)
        time.sleep(0.01)
    assert os.waitpid(pid, 0)[1] == 0, "the fork has failed or was ended"


def _in_threads(workers: int, folder: Path) -> str:
    names = ("one", "two", "three")
    calls = [functools.partial(recorded, (0, 1), folder / name, workers) for name in names]
    assert not _all(*calls)
    assert len({_bytes(folder / name) for name in names}) == 1
    return "each writes the same bytes"


def _in_a_fork(workers: int, folder: Path) -> str:
    recorded((0, 1), folder / "own", workers)
    _fork(lambda: recorded((0, 1), folder / "fork", workers))
    assert _bytes(folder / "own") == _bytes(folder / "fork")
    return "it writes the same bytes"


def _into_one_folder(folder: Path) -> None:
    errors = _all(*[functools.partial(recorded, (0, 1), folder / "out")] * 3)
    recorded((0, 1), folder / "alone")
    assert _bytes(folder / "out") == _bytes(folder / "alone")
    raise errors[0]


def _export(folder: Path) -> None:
    layout = _layout(folder)
    assert not _all(*[functools.partial(layout.to_mjcf, folder / "cell.xml")] * 4)
    assert {path.name for path in folder.iterdir()} == {"cell.xml", "cell_assets", "toy.urdf"}


def _layout(folder: Path, shape: str = BOX) -> Layout:
    urdf = folder / "toy.urdf"
    urdf.write_text(toy(shape))
    return Layout({"arm": Placement(descriptor(urdf))})


# -- homes and clocks ------------------------------------------------------------------------------


def _run(*words: str, **variables: str) -> None:
    """Run a command as somebody whom the modes of folders bind, which root is not."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **variables}
    run_command("tests.faults.programs_faults", *words, cwd=ROOT, env=environment, seconds=SECONDS)


def _closed(folder: Path) -> Path:
    (folder / "closed").mkdir(mode=0o555)
    return folder / "closed"


def _recorded(folder: Path) -> str:
    _run(*RECORD, "--out", str(folder / "as_ever"))
    _run(*RECORD, "--out", str(folder / "out"), **dict.fromkeys(HOMES, str(_closed(folder))))
    assert _bytes(folder / "out") == _bytes(folder / "as_ever")
    return "what is recorded is the same"


def _written_there(words: tuple[str, ...], folder: Path) -> None:
    closed = _closed(folder)
    try:
        _run(*words, "--out", str(closed / "out.xml"))
    finally:
        assert not list(closed.iterdir())


def _set_time(file: Path, seconds: float) -> None:
    changed = file.stat().st_mtime + seconds
    os.utime(file, (changed, changed))


def _changed_file(seconds: float, folder: Path) -> None:
    layout = _layout(folder)
    layout.validate(samples=1, workspaces=False)
    _layout(folder, mesh("gone.stl"))
    _set_time(folder / "toy.urdf", seconds)
    layout.validate(samples=1, workspaces=False)


def _resumed(seconds: float, folder: Path) -> str:
    recorded((0,), folder / "out")
    for file in (folder / "out").rglob("*"):
        _set_time(file, seconds)
    recorded((0, 1), folder / "out")
    recorded((0, 1), folder / "at_once")
    assert _bytes(folder / "out") == _bytes(folder / "at_once")
    return "the same as at once"


if __name__ == "__main__":
    for capability in (CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH):
        ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, capability, 0, 0, 0)
    os.execv(sys.executable, [sys.executable, "-m", *sys.argv[1:]])
