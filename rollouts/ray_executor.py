"""Plays whole episodes on a Ray cluster, in actors, and survives actors and nodes that die."""

from __future__ import annotations

import os
import pickle
import re
import shutil
import signal
import socket
import sysconfig
import threading
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from robots import MissingPackageError, UnknownNameError
from robots.manifest import load_manifest
from rollouts.executor import (
    DEATHS_ALLOWED,
    UNSENDABLE,
    Event,
    Play,
    Shift,
    Worker,
    WorkerError,
    portable,
    unsendable,
)
from tasks.processes import Sendable

ROOMS = ("robots", "layouts", "simulation", "tasks", "rollouts")
PACKAGES = ("sapien", "torch", "numpy")  # which decide the bits of an episode

_PATIENCE = 10.0  # s that the head of a cluster may take to answer
_THIS_MACHINE = ("localhost", "127.0.0.1", "[::1]")  # for which Ray takes an address of its own
_NODE_DIED = "its node has died"  # in Ray's words
_CACHES = shutil.ignore_patterns("__pycache__")
_SILENCE = 30.0  # s without any worker at play, until that is told


class RayExecutor:
    """Actors on the machines of a Ray cluster; none is left when `run` ends, whatever ends it.

    The cluster gets the code of this library from here, and modules of yours that define the task,
    expert or policy. What they need (``sapien``, ``torch`` and so on) must be installed on every
    node, in the versions of this machine; each node finds robot files as it would without Ray. If
    Ray is in use already, that connection stays as it is, and its own ``runtime_env`` says which
    code the nodes have.
    """

    def __init__(
        self,
        address: str = "auto",
        workers: int | None = None,
        *,
        modules: Sequence[str] = (),
        attempts: int = DEATHS_ALLOWED,
        fresh: bool = False,
    ) -> None:
        """Choose a cluster that this machine has joined.

        Args:
            address: ``"HOST:PORT"`` of its head, or ``"auto"``.
            workers: How many actors, each on one CPU; None: one for each CPU of the cluster.
            modules: More packages or modules of yours that the nodes get, such as those that your
                tasks, experts and policies import.
            attempts: How many workers may die of one episode before it is given up; those that are
                out of reach do not count.
            fresh: Whether every episode gets a process of its own.

        Raises:
            MissingPackageError: If Ray is not installed.
        """
        self._ray = import_ray()
        self._address, self._workers, self._modules = address, workers, tuple(modules)
        self._attempts, self._fresh = attempts, fresh

    def run(self, prepare: Callable[[], Play], seeds: Iterable[int]) -> Generator[Event]:
        """Play the episode of every seed; see `rollouts.executor.Executor`."""
        seeds = list(seeds)
        if not seeds:
            return
        modules = [*self._modules, *filter(_is_own, getattr(prepare, "modules", ()))]
        with _joined(self._ray, self._address, modules):
            crew = _Actors(self._ray, prepare)
            count = self._workers or crew.cpus
            shift = Shift(crew, seeds, count, attempts=self._attempts, fresh=self._fresh)
            yield from shift.events()


def import_ray() -> Any:
    """Return the ray package.

    Raises:
        MissingPackageError: If it is not installed.
    """
    try:
        import ray
    except ImportError as error:
        raise MissingPackageError(
            "playing on many machines needs ray: pip install 'robot-layouts[ray]'"
        ) from error
    return ray


@contextmanager
def _joined(ray: Any, address: str, modules: Sequence[str]) -> Generator[None]:
    """Be part of a cluster, whose workers have the code of this process.

    Raises:
        WorkerError: If that is impossible.
    """
    if ray.is_initialized():
        yield
        return
    with TemporaryDirectory() as folder:
        gather_code(Path(folder), modules)
        with _own_stop_signal():
            try:
                _expect_somebody(address)
                ray.init(
                    address=address,
                    runtime_env={"working_dir": folder},
                    log_to_driver=False,
                    logging_level="ERROR",
                )
            except (OSError, RuntimeError, ValueError) as error:
                raise WorkerError(
                    f"the Ray cluster at {address!r} cannot be joined: {error}"
                ) from error
    try:
        yield
    finally:
        ray.shutdown()


def _expect_somebody(address: str) -> None:
    """Raise OSError if nobody listens at an address; Ray itself would try for minutes."""
    host, _, port = address.rpartition(":")
    if port.isdigit() and "/" not in host and host not in _THIS_MACHINE:
        socket.create_connection((host.strip("[]"), int(port)), _PATIENCE).close()


def gather_code(folder: Path, modules: Iterable[str] = ()) -> None:
    """Copy the rooms, and the packages of other modules, into an empty folder.

    Raises:
        UnknownNameError: If there is no such module.
    """
    for name in dict.fromkeys([*ROOMS, *(module.partition(".")[0] for module in modules)]):
        spec = find_spec(name)
        if spec is None:
            raise UnknownNameError("module", name, (), "It must be importable here.")
        for path in spec.submodule_search_locations or ():
            shutil.copytree(path, folder / name, ignore=_CACHES, dirs_exist_ok=True)
        if not spec.submodule_search_locations and spec.origin is not None:
            shutil.copy(spec.origin, folder)
    (folder / "robots" / "manifest.json").write_text(load_manifest().to_json(), encoding="utf-8")


def _is_own(module: str) -> bool:
    """Tell whether a module is not installed, but the user's own; ``__main__`` is pickled."""
    name = module.partition(".")[0]
    spec = None if name == "__main__" else find_spec(name)
    places = [] if spec is None else [*(spec.submodule_search_locations or [spec.origin or ""])]
    return any(Path(place).is_absolute() and not _is_installed(Path(place)) for place in places)


def _is_installed(path: Path) -> bool:
    return any(path.is_relative_to(sysconfig.get_path(kind)) for kind in ("stdlib", "platlib"))


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


class _Actors:
    """Actors of a cluster."""

    def __init__(self, ray: Any, prepare: Callable[[], Play]) -> None:
        self._ray = ray
        try:
            self._prepare: bytes = ray.cloudpickle.dumps(prepare)
        except UNSENDABLE as error:
            raise unsendable(error) from error
        self._class = ray.remote(_Player).options(
            num_cpus=1, max_restarts=0, max_task_retries=0, scheduling_strategy="SPREAD"
        )

    @property
    def cpus(self) -> int:
        """How many CPUs the cluster has."""
        alive = [about["Resources"] for about in self._ray.nodes() if about["Alive"]]
        cpus = sum(int(resources.get("CPU", 0)) for resources in alive)
        if not cpus:
            raise WorkerError("no node of the Ray cluster offers a CPU; add one with `ray start`")
        return cpus

    def hire(self) -> _Actor:
        """Ask for an actor, which begins when a node has room for it."""
        return _Actor(self._ray, self._class.remote(), self._prepare)

    def wait(self, workers: Sequence[Worker]) -> list[Worker] | str:
        """Return the actors whose answers are there; if none can begin for long, why."""
        waiting = {worker.answer: worker for worker in workers if isinstance(worker, _Actor)}
        patience = None if any(worker.seed is not None for worker in workers) else _SILENCE
        if not self._ray.wait(list(waiting), timeout=patience)[0]:
            free = self._ray.available_resources().get("CPU", 0)
            return (
                f"no worker could begin for {_SILENCE:.0f} s: {free:.0f} CPUs of the Ray cluster"
                " are free; still waiting"
            )
        ready = self._ray.wait(list(waiting), num_returns=len(waiting), timeout=0)[0]
        return [waiting[answer] for answer in ready]


@dataclass(frozen=True)
class _Home:
    """Where an actor lives.

    Attributes:
        node: Id of the node.
        address: Its IP address.
        process: Its process number there.
        packages: Version of each package that counts.
    """

    node: str
    address: str
    process: int
    packages: dict[str, str]


class _Actor:
    """One actor, as seen from here; it plays one seed at a time.

    Attributes:
        answer: What it has been asked for last.
    """

    def __init__(self, ray: Any, actor: Any, prepare: bytes) -> None:
        self.seed: int | None = None
        self.name = "actor"
        self._ray, self._actor = ray, actor
        self._home: _Home | None = None
        self.answer: Any = actor.begin.remote(prepare)

    def send(self, seed: int) -> None:
        """Let it play a seed."""
        self.seed = seed
        self.answer = self._actor.play.remote(seed)

    def receive(self) -> Event | None:
        """Return what it says; None if it has just become ready.

        Raises:
            RobotLayoutsError: What it could not begin for.
        """
        try:
            result, error = self._ray.get(self.answer)
        except self._ray.exceptions.RayError as death:
            return self._died(death)
        if self._home is None:
            self._settle(result, error)
            return None
        seed, self.seed = self.seed, None
        return Event(seed, result=result, error=error, worker=self.name)

    def dismiss(self) -> None:
        """Let it go; it has nothing to do."""
        self.kill()

    def kill(self) -> None:
        """End it at once."""
        with suppress(self._ray.exceptions.RayError, ValueError):
            self._ray.kill(self._actor, no_restart=True)

    def _settle(self, home: _Home, error: Exception | None) -> None:
        self._home, self.name = home, f"process {home.process} on node {home.address}"
        if error is not None:
            error.args = (f"{error} (on node {home.address})", *error.args[1:])
            raise error
        here = _versions()
        if home.packages != here:
            raise WorkerError(
                f"node {home.address} has {_listing(home.packages)}, this machine {_listing(here)};"
                " equal episodes need equal versions"
            )

    def _died(self, error: Exception) -> Event:
        self.kill()  # it may only be out of reach
        how = _reason(error)
        lost = isinstance(error, self._ray.exceptions.ActorUnavailableError) or (
            not self._node_lives(self._home.node) if self._home is not None else how == _NODE_DIED
        )
        died = f"worker {self.name} was lost: {'out of reach' if lost else how}"
        return Event(self.seed, died=died, excused=lost, worker=self.name)

    def _node_lives(self, node: str) -> bool:
        return any(about["NodeID"] == node and about["Alive"] for about in self._ray.nodes())


class _Player:
    """What runs on the cluster: one process, which plays one seed at a time."""

    _play: Play

    def begin(self, prepare: bytes) -> tuple[_Home, Sendable | None]:
        """Make what plays; returns where that is, and what went wrong."""
        ray, error = import_ray(), None
        try:
            self._play = pickle.loads(prepare)()
        except Exception as found:
            error = portable(found)
        node = ray.get_runtime_context().get_node_id()
        home = _Home(node, ray.util.get_node_ip_address(), os.getpid(), _versions())
        return home, error

    def play(self, seed: int) -> tuple[Any, Sendable | None]:
        """Play an episode; returns its result, and what went wrong."""
        try:
            return self._play(seed), None
        except Exception as error:
            return None, portable(error)


def _reason(error: Exception) -> str:
    """Return what Ray says of a death, out of the page that it makes of it."""
    text = " ".join(str(error).split())
    because = re.search(r" because (.+?)\.(?: |$)", text)
    return because[1] if because else text.partition(". ")[0]


def _versions() -> dict[str, str]:
    found: dict[str, str] = {}
    for package in PACKAGES:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


def _listing(packages: dict[str, str]) -> str:
    return ", ".join(f"{name} {found}" for name, found in packages.items()) or "none of them"
