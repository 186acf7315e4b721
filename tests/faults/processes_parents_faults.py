"""Processes that end while they have workers, and scripts that start some when they should not."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from tests.faults.fault import GOES_ON, Fault
from tests.faults.worker_processes import (
    AREA,
    PATIENCE,
    TASK,
    actions,
    command,
    run_script,
    vector,
    wait_until,
)


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for milliseconds in (0, 100, 400, 1600):
        what = f"a process is killed {milliseconds} ms after it began to start workers"
        yield Fault(AREA, what, lambda _, s=milliseconds / 1000: _parent_ends(s), GOES_ON)
    for name in ("SIGKILL", "SIGTERM", "SIGHUP", "SIGINT"):
        what = f"a process that steps a vector ends by {name}"
        yield Fault(AREA, what, lambda _, name=name: _parent_ends(None, name), GOES_ON)
    for who in ("worker", "server"):
        what = f"a process is killed whose {who} was stopped"
        yield Fault(AREA, what, lambda _, who=who: _parent_ends(None, stopped=who), GOES_ON)
    what = "a process is killed whose workers are in C code that never ends"
    yield Fault(AREA, what, lambda _: _parent_ends(None, task_id="BusySteps-v1"), GOES_ON)
    what = "a process is killed that plays episodes in workers"
    yield Fault(AREA, what, lambda _: _parent_ends(None, hold="plays"), GOES_ON)
    for what, (text, hint) in MAINS.items():
        yield Fault(AREA, f"a script {what}", partial(_run_main, text, hint))


def _parent_ends(
    seconds: float | None,
    name: str = "SIGKILL",
    *,
    stopped: str = "",
    task_id: str = TASK,
    hold: str = "steps",
) -> str:
    """End a process with workers in a session of its own, and see that the session empties.

    Args:
        seconds: After which time, from when it begins to start them; None: when it has them.
        name: By which signal.
        stopped: Who is stopped before: every ``worker``, the ``server``, or nobody.
        task_id: What its vector plays.
        hold: Whether it ``steps`` a vector or ``plays`` episodes.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    parent = context.Process(target=_hold, args=(theirs, hold, task_id))
    parent.start()
    theirs.close()
    pid = parent.pid or 0
    try:
        assert ours.recv() == "begins"
        if seconds is None:
            assert ours.recv() == "has workers"
            time.sleep(0.2)
        else:
            time.sleep(seconds)
        others = _session(pid) - {pid}
        server = {other for other in others if "forkserver" in command(other)}
        server &= {other for other in others if _parent_of(other) == pid}
        victims = {"worker": _session(pid) - server - {pid}, "server": server, "": set[int]()}
        for victim in victims[stopped]:
            if "resource_tracker" not in command(victim):  # Python's own ends by itself
                os.kill(victim, signal.SIGSTOP)
        os.kill(pid, signal.Signals[name])
        parent.join(PATIENCE)
        wait_until(lambda: not _session(pid), f"left: {_session(pid)}")
        return f"{len(others)} other processes ended with it"
    finally:
        for other in _session(pid):
            with suppress(ProcessLookupError):
                os.kill(other, signal.SIGKILL)
        parent.join()
        parent.close()


def _hold(connection: Any, how: str, task_id: str) -> None:
    """Be the process that is ended, like one that a shell starts."""
    os.setsid()
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    if how == "plays":
        from robot_layouts.data.playing.executor import ProcessExecutor
        from tests.data.plays import Play

        connection.send("begins")
        for event in ProcessExecutor(2).run(Play(lasts=0.05), range(10**6)):
            if event.seed == 0:
                connection.send("has workers")
        return
    connection.send("begins")
    with vector(task_id, 3, num_workers=3) as env:
        connection.send("has workers")
        while True:
            env.step(actions(env))


def _session(number: int) -> set[int]:
    """Return the living processes of a session."""
    found = set[int]()
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError, ProcessLookupError):
            state, _, _, session = (folder / "stat").read_text().rpartition(")")[2].split()[:4]
            if int(session) == number and state not in "ZX":
                found.add(int(folder.name))
    return found


def _parent_of(pid: int) -> int:
    with suppress(OSError):
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
    return 0


# -- main modules ---------------------------------------------------------------------------------


MAINS = {
    "starts a vector whenever it is imported": (
        "import gymnasium, tasks\n"
        "gymnasium.make_vec('RobotLayouts/PushCube-v1', num_envs=2, num_workers=2)\n",
        "`if __name__ == '__main__':`",
    ),
    "fails when a worker imports it": (
        "import gymnasium, tasks\n"
        "if __name__ != '__main__': raise ValueError('on purpose')\n"
        "gymnasium.make_vec('RobotLayouts/PushCube-v1', num_envs=2, num_workers=2)\n",
        "could not import the main module",
    ),
    "defines a task where only it is run": (
        "import gymnasium, tasks\n"
        "from tasks.maniskill.push_cube import PushCube\n"
        "if __name__ == '__main__':\n"
        "    class Mine(PushCube): pass\n"
        "    tasks.register_task('Mine-v1')(Mine)\n"
        "    gymnasium.make_vec('RobotLayouts/Mine-v1', num_envs=2, num_workers=2)\n",
        "define it in a module that they can import",
    ),
}


def _run_main(text: str, hint: str, folder: Path) -> None:
    from robots import RobotLayoutsError

    done = run_script(folder, text)
    assert done.returncode == 1, done.stderr[-2000:]
    last = done.stderr.strip().splitlines()[-1]
    assert hint in last, done.stderr[-2000:]
    raise RobotLayoutsError(last)
