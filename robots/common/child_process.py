"""Runs other programs that end with this process, and that cannot take all of its machine."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import IO

MEMORY = 2**30  # bytes; what a server sends is never a reason for more

# Becomes another program, which keeps the limits, and the signal that comes when the parent dies.
_BECOME = """
import ctypes, os, resource, signal, sys
parent, memory, *command = sys.argv[1:]
if sys.platform == "linux":
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # 1: PR_SET_PDEATHSIG
    if os.getppid() != int(parent):  # it died before
        os._exit(1)
    limit, most = int(memory), resource.getrlimit(resource.RLIMIT_DATA)[1]
    if most == resource.RLIM_INFINITY or limit < most:
        resource.setrlimit(resource.RLIMIT_DATA, (limit, most))
os.execv(command[0], command)
"""


@contextmanager
def running(
    command: Sequence[str],
    *,
    stdin: IO[bytes] | int,
    stdout: IO[bytes] | int,
    stderr: IO[bytes] | int,
    env: Mapping[str, str],
    memory: int = MEMORY,
) -> Generator[subprocess.Popen[bytes]]:
    """Run a program while the context lasts.

    It is killed at the end of the context, and whenever the thread that started it ends or this
    process dies, be that by SIGKILL, whatever it is doing then. (Where that happens in the first
    hundredths of a second, it ends by itself.) It sees no Ctrl-C of the terminal.

    Args:
        command: Absolute path of the program, and its arguments.
        stdin: As for `subprocess.Popen`.
        stdout: As for `subprocess.Popen`.
        stderr: As for `subprocess.Popen`.
        env: Its environment.
        memory: How much it may have at most (bytes).

    Raises:
        OSError: If no process can be started.
    """
    become = [sys.executable, "-I", "-S", "-c", _BECOME, str(os.getpid()), str(memory)]
    process = subprocess.Popen(
        [*become, *command],
        stdin=stdin,
        stdout=stdout,
        stderr=stderr,
        env=env,
        start_new_session=True,  # so that what it starts can be ended with it
    )
    with process:
        try:
            yield process
        finally:
            end(process)


def end(process: subprocess.Popen[bytes]) -> None:
    """Kill a program that is `running`, and what it has started."""
    if process.poll() is None:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
