"""A Ray cluster: being part of it, the code that it gets, and noticing when it is gone."""

from __future__ import annotations

import atexit
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent import futures
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from robot_layouts.core.importing import optional
from robot_layouts.core.own_packages import PACKAGES
from robot_layouts.core.portable import inherited_variables
from robot_layouts.core.processes.start import WorkerError
from robot_layouts.core.processes.transport import is_installed
from robots import TaskError, UnknownNameError
from robots.assets.manifest import manifest_path

_CONNECT_SECONDS = 10.0  # that a port may take to accept
_JOIN_SECONDS = 60.0  # that all of joining may take, the import of Ray included
_ANSWER_SECONDS = 20.0  # that the head may take to answer a question
_AWAY_SECONDS = 30.0  # that it may be gone; Ray ends this process after 60
_LOOK_SECONDS = 5.0  # between looks whether it is there
_THIS_MACHINE = ("localhost", "127.0.0.1", "::1")  # for which Ray takes an address of its own
_ADDRESS = re.compile(r"(?:\[(?P<ipv6>[0-9a-fA-F:.%]+)\]|(?P<name>[^\s:/\[\]]+)):(?P<port>\d{1,5})")
_JOIN = """
import sys, ray
ray.init(address=sys.argv[1], log_to_driver=False, logging_level="ERROR")
ray.shutdown()
"""
_TOKEN = (
    "the cluster asks for a token: on its head, `ray get-auth-token` prints it; here, put it into"
    " ~/.ray/auth_token or RAY_AUTH_TOKEN, and set RAY_AUTH_MODE=token"
)
_CACHES = shutil.ignore_patterns("__pycache__")

_T = TypeVar("_T")


def import_ray() -> Any:
    """Return the ray package.

    Raises:
        MissingPackageError: If it is not installed.
    """
    return optional("ray", "playing on many machines needs ray", "ray")


def check_address(address: object) -> None:
    """Refuse what cannot be the address of a cluster.

    Raises:
        TaskError: If it cannot.
    """
    found = _ADDRESS.fullmatch(address) if isinstance(address, str) else None
    if address != "auto" and (found is None or not 0 < int(found["port"]) < 2**16):
        raise TaskError(
            f'{address!r} is no address of a Ray cluster; it must be "HOST:PORT" of its head, such'
            ' as "192.0.2.1:6379", or "auto", the cluster that `ray start` joined on this machine'
        )


class RayCluster:
    """The cluster that this process has joined.

    Raises:
        WorkerError: From every method if the cluster is gone.
    """

    def __init__(self, ray: Any) -> None:
        """Note where its head is, and the node of this machine."""
        context = ray.get_runtime_context()
        self._ray, self._head, self._node = ray, context.gcs_address, context.get_node_id()
        self._looked = self._there = time.monotonic()

    @property
    def cpus(self) -> int:
        """How many CPUs it has."""
        cpus = sum(int(resources.get("CPU", 0)) for resources in self.nodes().values())
        if not cpus:
            raise WorkerError("no node of the Ray cluster offers a CPU; add one with `ray start`")
        return cpus

    @property
    def free_cpus(self) -> int:
        """How many CPUs are free."""
        return int(self._ask(self._ray.available_resources).get("CPU", 0))

    def nodes(self) -> dict[str, dict[str, float]]:
        """Return the resources of each node that lives; this process's own is one of them."""
        alive = {n["NodeID"]: n["Resources"] for n in self._ask(self._ray.nodes) if n["Alive"]}
        if self._node not in alive:
            raise WorkerError(
                "the Ray node of this machine has died, and with it all that was played for this"
                " process; start it again with `ray start`, then the same command"
            )
        return alive

    def look(self) -> None:
        """Look now and then whether the head is there; it may be away for a while."""
        now = time.monotonic()
        if now - self._looked < _LOOK_SECONDS:
            return
        self._looked = now
        if self._answers():
            self._there = now
        elif now - self._there > _AWAY_SECONDS:
            raise self._gone()

    def _answers(self) -> bool:
        try:
            _connect(self._head)
        except OSError:
            return False
        return True

    def _gone(self) -> WorkerError:
        return WorkerError(f"the head of the Ray cluster, {self._head}, is gone")

    def _ask(self, question: Callable[[], _T]) -> _T:
        if not self._answers():
            raise self._gone()
        try:
            return _within(_ANSWER_SECONDS, question)
        except futures.TimeoutError:
            raise WorkerError(
                f"the head of the Ray cluster, {self._head}, has not answered for"
                f" {_ANSWER_SECONDS:g} s"
            ) from None


@contextmanager
def joined(ray: Any, address: str, modules: Sequence[str]) -> Generator[None]:
    """Be part of a cluster, whose workers have the code of this process.

    Raises:
        WorkerError: If that is impossible.
    """
    if ray.is_initialized():
        yield
        return
    with TemporaryDirectory() as folder:
        gather_code(Path(folder), modules)
        _expect_cluster(ray, address)
        with _own_stop_signal():
            try:
                ray.init(
                    address=address,
                    runtime_env={"working_dir": folder, "env_vars": inherited_variables()},
                    log_to_driver=False,
                    logging_level="ERROR",
                )
            except (OSError, RuntimeError, ValueError, ray.exceptions.RayError) as error:
                raise _not_joined(address, str(error)) from error
    try:
        yield
    except BaseException:
        with suppress(WorkerError):  # the first error counts
            _leave(ray)
        raise
    _leave(ray)


def _expect_cluster(ray: Any, address: str) -> None:
    """Try to join in another process, which can be ended: Ray itself may try for ever.

    Raises:
        WorkerError: If that is impossible.
    """
    environment = {**os.environ, "RAY_gcs_server_port_wait_time_s": "1"}  # one attempt
    named = os.environ.get("RAY_ADDRESS", "") if address == "auto" else address
    try:
        _connect(named, ray.util.get_node_ip_address())
        subprocess.run(
            [sys.executable, "-c", _JOIN, address],
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            check=True,
            timeout=_JOIN_SECONDS,
        )
    except OSError as error:
        raise _not_joined(address, str(error)) from error
    except subprocess.TimeoutExpired:
        reason = f"it does not answer within {_JOIN_SECONDS:g} s"
        raise _not_joined(address, reason) from None
    except subprocess.CalledProcessError as error:
        raise _not_joined(address, error.stderr) from None


def _connect(address: str, own_host: str = "") -> None:
    """Open and close a connection.

    Raises:
        OSError: If nothing listens there.
    """
    found = _ADDRESS.fullmatch(address)
    if found is not None:
        host = found["ipv6"] or found["name"]
        host = own_host if own_host and host in _THIS_MACHINE else host
        socket.create_connection((host, int(found["port"])), _CONNECT_SECONDS).close()


def _not_joined(address: str, reason: str) -> WorkerError:
    """Return what to raise; the reason may be a traceback and what Ray has logged."""
    last = next((line for line in reversed(reason.splitlines()) if line.strip()), "no reason")
    if "AuthToken" in reason or "AuthenticationError" in reason:
        words = _TOKEN
    elif address == "auto":
        words = f"{last.strip().rstrip('.')}; `ray start` on each machine starts or joins one"
    else:
        words = f"{last.strip()}; its head must be there, and this machine part of it (`ray start`)"
    return WorkerError(f"the Ray cluster at {address!r} cannot be joined: {words}")


def _leave(ray: Any) -> None:
    """Leave the cluster.

    Raises:
        WorkerError: If it does not let go. Ray then waits for it until this process ends, and
            would keep that from ending, too: it ends at once, with exit code 1.
    """
    try:
        _within(_ANSWER_SECONDS, ray.shutdown)
    except futures.TimeoutError:
        atexit.unregister(ray.shutdown)
        atexit.register(_end_process)
        raise WorkerError(
            "the head of the Ray cluster does not answer, and so cannot be left"
        ) from None


def _end_process() -> None:
    with suppress(OSError, ValueError):  # closed streams
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(1)


def _within(seconds: float, function: Callable[[], _T]) -> _T:
    """Return what a function returns or raise what it raises.

    Raises:
        futures.TimeoutError: If it takes longer; it goes on in a thread.
    """
    result: futures.Future[_T] = futures.Future()

    def call() -> None:
        try:
            result.set_result(function())
        except BaseException as error:
            result.set_exception(error)

    threading.Thread(target=call, daemon=True).start()
    return result.result(seconds)


def gather_code(folder: Path, modules: Iterable[str] = ()) -> None:
    """Copy the rooms, and the packages of other modules, into an empty folder.

    Raises:
        UnknownNameError: If there is no such module.
    """
    for name in dict.fromkeys([*PACKAGES, *(module.partition(".")[0] for module in modules)]):
        spec = find_spec(name)
        if spec is None:
            raise UnknownNameError("module", name, (), "It must be importable here.")
        for path in reversed([*(spec.submodule_search_locations or ())]):  # the first one counts
            shutil.copytree(path, folder / name, ignore=_CACHES, dirs_exist_ok=True)
        if not spec.submodule_search_locations and spec.origin is not None:
            shutil.copy(spec.origin, folder)
    shutil.copy(manifest_path(), folder / "robots" / "manifest.json")


def is_own(module: str) -> bool:
    """Tell whether a module is not installed, but the user's own; ``__main__`` is pickled."""
    name = module.partition(".")[0]
    spec = None if name == "__main__" else find_spec(name)
    places = [] if spec is None else [*(spec.submodule_search_locations or [spec.origin or ""])]
    return any(Path(place).is_absolute() and not is_installed(Path(place)) for place in places)


@contextmanager
def _own_stop_signal() -> Generator[None]:
    """Keep what SIGTERM does here; Ray makes it an exit when it starts."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.getsignal(signal.SIGTERM)
    try:
        yield
    except SystemExit as stop:
        raise KeyboardInterrupt from stop
    finally:
        signal.signal(signal.SIGTERM, before)
