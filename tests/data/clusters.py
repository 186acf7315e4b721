"""Ray clusters of several nodes on this machine, whose nodes can be killed."""

import os
import shutil
import tempfile
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from tests.data.plays import BARRIER


class Nodes:
    """A cluster whose nodes are processes of this machine, each with an address of its own."""

    def __init__(self, temp_dir: str) -> None:
        from ray.cluster_utils import Cluster

        self._last, self.barrier = 1, Path(temp_dir, "barrier")
        self._cluster = Cluster()
        self._add(num_cpus=0, include_dashboard=False, temp_dir=temp_dir)
        self.workers = []
        self.address = self._cluster.address

    def _add(self, **about):
        self._last += 1
        return self._cluster.add_node(
            node_ip_address=f"127.0.0.{self._last}", object_store_memory=80 * 2**20, **about
        )

    def grow(self, count: int) -> None:
        """Have this many nodes with one CPU each."""
        while len(self.workers) < count:
            self.workers.append(self._add(num_cpus=1))

    def shrink(self) -> None:
        """Have no node with a CPU, and wait until the cluster knows."""
        while self.workers:
            self.kill(self.workers[0])
        while sum(about["Alive"] for about in self._cluster.global_state.node_table()) > 1:
            time.sleep(0.1)

    def kill(self, node) -> None:
        self.workers.remove(node)
        self._cluster.remove_node(node, allow_graceful=False)

    def kill_at(self, address: str) -> None:
        self.kill(next(node for node in self.workers if node.node_ip_address == address))

    def signal_head(self, what: str, how: int) -> int:
        """Send a signal to a process of the node without CPU, which this process is part of."""
        pid = self._cluster.head_node.all_processes[what][0].process.pid
        os.kill(pid, how)
        return pid

    def players(self) -> list[int]:
        """Return the processes of actors; Ray calls them by their class."""
        return [pid for pid, words in commands() if words.startswith("ray::_Player")]

    def wait_for_no_player(self) -> None:
        deadline = time.monotonic() + 60
        while self.players():
            assert time.monotonic() < deadline, "an actor is left"
            time.sleep(0.05)

    def shutdown(self) -> None:
        self._cluster.shutdown()


def commands():
    """Yield every process that is a descendant of this one, and its command line."""
    waiting = [os.getpid()]
    while waiting:
        pid = waiting.pop()
        with suppress(OSError):
            yield pid, Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ")
            for task in Path(f"/proc/{pid}/task").iterdir():
                waiting += map(int, (task / "children").read_text().split())


@contextmanager
def running_cluster():
    """Start a cluster without any CPU, and end it."""
    pytest.importorskip("ray")
    temp_dir = tempfile.mkdtemp(prefix="ray-")  # short: it holds sockets
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        patch.setenv("RAY_TMPDIR", temp_dir)  # where a cluster notes its address for `auto`
        Path(temp_dir, "ray").mkdir()
        patch.setenv(BARRIER, f"{temp_dir}/barrier")
        nodes = Nodes(temp_dir)
        try:
            yield nodes
        finally:
            nodes.shutdown()
            shutil.rmtree(temp_dir, ignore_errors=True)
