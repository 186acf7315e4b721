"""Which processes belong to another one; read from Linux's ``/proc``."""

from pathlib import Path


def children_of(pid: int) -> list[int]:
    """Return the processes that any thread of a process started and that are not reaped."""
    threads = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(child) for thread in threads for child in thread.read_text().split()]


def workers_of(pid: int) -> list[int]:
    """Return a process's workers: forks of a server that is its child."""
    return [worker for child in children_of(pid) for worker in children_of(child)]
