"""Programs that are run for a while end with whoever runs them, and take no more than they may."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

from robots.common.child_process import end, running
from tests.robots.processes import is_alive, wait_until

CHECKOUT = Path(__file__).parents[2]
QUIET = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
PARENT = """
import os, subprocess, sys
from robots.common.child_process import running
nothing = subprocess.DEVNULL
command = [sys.executable, "-c", "import time; time.sleep(600)"]
with running(command, stdin=nothing, stdout=nothing, stderr=nothing, env=os.environ) as child:
    print(child.pid, flush=True)
    input()
"""


def python(code: str):
    return running([sys.executable, "-c", code], env=os.environ, **QUIET)


def test_it_ends_with_the_context_and_what_it_started_too():
    code = (
        "import subprocess, sys; p = subprocess.Popen(['sleep', '600']); print(p.pid, flush=True)"
    )
    with python(f"{code}; p.wait()") as child:
        grandchild = int(child.stdout.readline())
        assert is_alive(grandchild)
    assert child.returncode == -signal.SIGKILL
    wait_until(lambda: not is_alive(grandchild))


def test_it_ends_with_a_parent_that_is_killed_even_if_it_is_stopped():
    with subprocess.Popen(
        [sys.executable, "-c", PARENT],
        cwd=CHECKOUT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as parent:
        child = int(parent.stdout.readline())
        commands = Path(f"/proc/{child}/cmdline")
        # It is the program by now; it has no words for a moment while it becomes one.
        wait_until(lambda: "prctl" not in (commands.read_text() or "prctl"))
        os.kill(child, signal.SIGSTOP)
        parent.kill()
    wait_until(lambda: not is_alive(child))


def test_one_that_takes_too_much_memory_fails_alone():
    with python("x = bytearray(3 * 2**30); print('took it')") as child:
        assert child.stdout.read() == b""
        child.wait()
        assert child.returncode == 1


def test_ending_twice_is_no_error():
    with python("pass") as child:
        child.wait()
        end(child)
    assert child.returncode == 0
