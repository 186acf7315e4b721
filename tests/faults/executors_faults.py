"""Workers that die, hang and lie, and executors that forget."""

from __future__ import annotations

import functools
import json
import textwrap
from collections.abc import Iterator
from pathlib import Path

from robot_layouts.data.playing.executor import ProcessExecutor
from robot_layouts.data.reading.recording import Recording
from robots import RobotLayoutsError
from tests.faults.fault import GOES_ON, Fault
from tests.faults.players import AREA, Mischief, Nobody, evaluated, expect_squares, recorded
from tests.faults.worker_processes import run_script


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    yield from _deaths()
    yield from _programs()
    yield from _executors()


# -- deaths and hangs -----------------------------------------------------------------------------


def _deaths() -> Iterator[Fault]:
    for name in ("SIGKILL", "SIGTERM", "SIGSEGV", "SIGABRT", "SIGSTOP"):
        run = functools.partial(_plays_again, f"signal {name}")
        yield Fault(AREA, f"an episode gets {name}", run, GOES_ON)
    yield Fault(AREA, "an episode is stopped for a while", _naps, GOES_ON)
    for what in ("exit 0", "busy", "lock", "fifo", "half an answer"):
        run = functools.partial(_plays_again, what)
        yield Fault(AREA, f"an episode's end: {what}", run, GOES_ON)
    for what in ("signal SIGKILL", "exit 5", "sleep"):
        run = functools.partial(_gives_up, what, during="play")
        yield Fault(AREA, f"every worker at one seed: {what}", run)
    for what in ("signal SIGKILL", "exit 5"):
        run = functools.partial(_gives_up, what, during="begin")
        yield Fault(AREA, f"every worker before it is ready: {what}", run)
    run = functools.partial(_plays_again, "signal SIGKILL", during="begin")
    yield Fault(AREA, "a worker is killed before it is ready", run, GOES_ON)


def _plays_again(what: str, folder: Path, during: str = "play") -> str:
    executor = ProcessExecutor(1, episode_timeout=1.0)
    return expect_squares(executor, Mischief(folder, what, during))


def _naps(folder: Path) -> str:
    return expect_squares(ProcessExecutor(1), Mischief(folder, "nap", "play"), deaths=0)


def _gives_up(what: str, folder: Path, during: str) -> None:
    executor = ProcessExecutor(1, attempts=2, episode_timeout=0.3)
    for event in executor.run(Mischief(folder, what, during, again=True), range(3)):
        if event.error is not None:
            assert "seed 1" in str(event.error)
            raise event.error


# -- programs -------------------------------------------------------------------------------------


def _programs() -> Iterator[Fault]:
    for what, (program, promise) in _PROGRAMS.items():
        run = functools.partial(_program, textwrap.dedent(program))
        yield Fault(AREA, what, run, promise)


def _program(text: str, folder: Path) -> str:
    """Run a program in a file of its own; its last line on stdout is what happened, as json."""
    done = run_script(folder, text)
    assert done.stdout, done.stderr[-2000:]
    kind, words = json.loads(done.stdout.splitlines()[-1])
    if kind == "refused":
        raise RobotLayoutsError(words)
    return words


_OPENING = """
import json, multiprocessing, os, resource, signal, sys, time
from robots import RobotLayoutsError
from robot_layouts.data.playing.executor import ProcessExecutor
from tests.data.plays import Play

def tell(*words):
    print(json.dumps(words), flush=True)

def play():
    try:
        tell("goes on", str(len(list(ProcessExecutor(2).run(Play(), range(4))))) + " are played")
    except RobotLayoutsError as error:
        tell("refused", str(error))
"""
_PROGRAMS = {
    "a program without `if __name__ == '__main__'`": (
        _OPENING + "\nplay()\n",
        GOES_ON,
    ),
    "no file can be opened any more": (
        _OPENING
        + """
if __name__ == "__main__":
    list(ProcessExecutor(1).run(Play(), [0]))
    left = os.open("/dev/null", os.O_RDONLY)
    resource.setrlimit(resource.RLIMIT_NOFILE, (left + 1, left + 1))
    play()
""",
        "one clear error",
    ),
    "the program is stopped for longer than an episode may take": (
        _OPENING
        + """
if __name__ == "__main__":
    if os.fork() == 0:
        time.sleep(2)
        os.kill(os.getppid(), signal.SIGSTOP)
        time.sleep(8)
        os.kill(os.getppid(), signal.SIGCONT)
        os._exit(0)
    events = list(ProcessExecutor(1, episode_timeout=6).run(Play(lasts=1.0), range(4)))
    assert [event.seed for event in events] == [0, 1, 2, 3], events
    tell("goes on", "nobody is late; all four episodes are played")
""",
        GOES_ON,
    ),
    "what plays is defined in a program read from stdin": (
        _OPENING.replace("def play", "def _play")
        + """
if __name__ == "__main__":
    import subprocess
    text = "def play():\\n    return str\\n"
    text += "from robot_layouts.data.playing.executor import ProcessExecutor\\n"
    text += "next(ProcessExecutor(1).run(play, [0]))\\n"
    done = subprocess.run([sys.executable], input=text, capture_output=True, text=True)
    assert done.stderr.count("Traceback") == 1, done.stderr
    tell("refused", done.stderr.splitlines()[-1].partition("WorkerError: ")[2])
""",
        "one clear error",
    ),
    "whoever follows the events raises": (
        _OPENING
        + """
def follow(event):
    raise LookupError("of the caller")

if __name__ == "__main__":
    from robot_layouts.data import evaluate
    from tests.data.policies import still
    try:
        evaluate(still, "PushT-v1", range(4), workers=2, on_event=follow)
    except LookupError as error:
        assert multiprocessing.active_children() == []
        tell("goes on", f"the caller's error arrives: {error}; no worker is left")
""",
        GOES_ON,
    ),
    "the program is killed": (
        _OPENING
        + """
if __name__ == "__main__":
    pid = os.fork()
    if pid == 0:
        for event in ProcessExecutor(2).run(Play(lasts=0.2), range(1000)):
            (open("pids", "a")).write(f"{event.result[0]}\\n")
        os._exit(0)
    deadline = time.monotonic() + 60
    pids = set()
    while len(pids) < 2 and time.monotonic() < deadline:
        time.sleep(0.05)
        pids = set(open("pids").read().split()) if os.path.exists("pids") else set()
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    while any(os.path.exists(f"/proc/{p}") for p in pids):
        assert time.monotonic() < deadline, "a worker is left"
        time.sleep(0.05)
    tell("goes on", "its workers end with it")
""",
        GOES_ON,
    ),
}

# -- executors ------------------------------------------------------------------------------------


def _executors() -> Iterator[Fault]:
    for what in ("forgets one", "plays nothing", "returns at once", "raises", "answers for others"):
        run = functools.partial(_with_executor, what)
        yield Fault(AREA, f"an executor that {what}: evaluate", run)
    yield Fault(AREA, "an executor that forgets one: record", _recording_with_forgetful_executor)


def _with_executor(what: str, folder: Path) -> None:
    executor = Nobody()
    executor.what = what
    evaluated(executor=executor, workers=None)


def _recording_with_forgetful_executor(folder: Path) -> None:
    executor = Nobody()
    executor.what = "forgets one"
    try:
        recorded(folder=folder, seeds=[4, 5], executor=executor, workers=None)
    finally:
        with Recording(folder / "trajectory.h5") as file:
            assert file.seeds == (5,)
