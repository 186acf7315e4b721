"""Plays whole episodes on a Ray cluster, in actors, and survives actors and nodes that die."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from rollouts.playing.dispatch import (
    DEATHS_ALLOWED,
    EPISODE_SECONDS,
    Rules,
    Shift,
    Sign,
    Worker,
    check_count,
)
from rollouts.playing.events import Event, Play, WorkerError
from rollouts.playing.ray_cluster import Cluster, check_address, import_ray, is_own, joined
from rollouts.playing.transport import loaded, portable, unsendable
from tasks.processes.process import Sendable

PACKAGES = ("sapien", "torch", "numpy")  # which decide the bits of an episode

_FETCH_SECONDS = 60.0  # that an answer may take from the node where it lies


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
        episode_timeout: float | None = EPISODE_SECONDS,
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
            episode_timeout: Seconds that an episode may take until its worker is ended, which
                counts as a death; None if it may take for ever.

        Raises:
            MissingPackageError: If Ray is not installed.
            TaskError: If it cannot be an address, or a number makes no sense.
        """
        self._ray = import_ray()
        check_address(address)
        if workers is not None:
            check_count("workers on a Ray cluster", workers, 1)
        self._address, self._workers, self._modules = address, workers, tuple(modules)
        self._rules = Rules(attempts, fresh, episode_timeout)

    def run(self, prepare: Callable[[], Play], seeds: Iterable[int]) -> Generator[Event]:
        """Play the episode of every seed; see `rollouts.playing.executor.Executor`."""
        seeds = list(seeds)
        if not seeds:
            return
        modules = [*self._modules, *filter(is_own, getattr(prepare, "modules", ()))]
        with joined(self._ray, self._address, modules):
            cluster = Cluster(self._ray)
            crew = _Actors(self._ray, cluster, prepare)
            yield from Shift(crew, seeds, self._workers or cluster.cpus, self._rules).events()


class _Actors:
    """Actors of a cluster."""

    def __init__(self, ray: Any, cluster: Cluster, prepare: Callable[[], Play]) -> None:
        self._ray, self._cluster = ray, cluster
        try:
            self._prepare: bytes = ray.cloudpickle.dumps(prepare)
        except Exception as error:  # whatever a class of the user's own raises
            raise unsendable(error) from error
        self._class = ray.remote(_Player).options(
            num_cpus=1, max_restarts=0, max_task_retries=0, scheduling_strategy="SPREAD"
        )

    def hire(self) -> _Actor:
        """Ask for an actor, which begins when a node has room for it."""
        nodes = self._cluster.nodes  # which raises if the head is gone, before it is asked
        return _Actor(self._ray, self._cluster, self._class.remote(), self._prepare, nodes)

    def wait(self, workers: Sequence[Worker], seconds: float) -> list[Worker]:
        """Return the actors whose answers arrive within a while."""
        self._cluster.look()
        waiting = {worker.answer: worker for worker in workers if isinstance(worker, _Actor)}
        if not self._ray.wait(list(waiting), timeout=seconds)[0]:
            return []
        ready = self._ray.wait(list(waiting), num_returns=len(waiting), timeout=0)[0]
        return [waiting[answer] for answer in ready]

    def remark(self) -> str:
        """Return how much room there is.

        Raises:
            WorkerError: If the cluster is gone, or the node of this machine.
        """
        nodes, free = len(self._cluster.nodes), self._cluster.free_cpus
        return f"{free} CPUs of the Ray cluster, of {nodes} nodes, are free"


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

    def __init__(
        self, ray: Any, cluster: Cluster, actor: Any, prepare: bytes, nodes: frozenset[str]
    ) -> None:
        self.seed: int | None = None
        self.name = "actor"
        self._ray, self._cluster, self._actor, self._prepare = ray, cluster, actor, prepare
        self._nodes = nodes  # it will be on one of them
        self._home: _Home | None = None
        self._ready = False
        self.answer: Any = actor.home.remote()

    def send(self, seed: int) -> None:
        """Let it play a seed."""
        self.seed = seed
        self.answer = self._actor.play.remote(seed)

    def receive(self) -> Event | Sign:
        """Return its next message.

        Raises:
            RobotLayoutsError: What it could not begin for.
        """
        try:
            result, error = self._ray.get(self.answer, timeout=_FETCH_SECONDS)
        except self._ray.exceptions.RayError as death:
            return self._died(death)
        if self._home is None:
            self._settle(result)
            return Sign.BEGUN
        if not self._ready:
            if error is not None:
                error.args = (f"{error} (on node {self._home.address})", *error.args[1:])
                raise error
            self._ready = True
            return Sign.READY
        seed, self.seed = self.seed, None
        return Event(seed, result=result, error=error, worker=self.name)

    def late(self, seconds: float) -> Event:
        """Return how it dies if it is ended because it took longer than so many seconds."""
        if self._home is None:
            return self._death(f"was given no place within {seconds:g} s", machine_lost=True)
        what = "did not finish the episode" if self._ready else "was not ready"
        return self._death(f"{what} within {seconds:g} s and was ended")

    def dismiss(self) -> None:
        """Let it go; it has nothing to do."""
        self.kill()

    def kill(self) -> None:
        """End it at once."""
        with suppress(self._ray.exceptions.RayError, ValueError):
            self._ray.kill(self._actor, no_restart=True)

    def _settle(self, home: _Home) -> None:
        self._home, self.name = home, f"process {home.process} on node {home.address}"
        self._nodes = frozenset({home.node})
        here = _versions()
        if home.packages != here:
            raise WorkerError(
                f"node {home.address} has {_listing(home.packages)}, this machine {_listing(here)};"
                " equal episodes need equal versions"
            )
        self.answer = self._actor.begin.remote(self._prepare)

    def _died(self, error: Exception) -> Event:
        lost = isinstance(error, self._ray.exceptions.ActorUnavailableError)
        if not isinstance(error, self._ray.exceptions.ActorDiedError):
            self.kill()  # it may only be out of reach
        if self._ready:
            lost = lost or not self._nodes <= self._cluster.nodes
        else:  # several of one node would be too many deaths
            lost = lost or self._cluster.lose(self._nodes)
        how = "out of reach" if lost else _reason(error)
        return self._death(f"was lost: {how}", machine_lost=lost)

    def _death(self, how: str, *, machine_lost: bool = False) -> Event:
        died = f"worker {self.name} {how}"
        return Event(self.seed, died=died, machine_lost=machine_lost, worker=self.name)


class _Player:
    """What runs on the cluster: one process, which plays one seed at a time."""

    _play: Play

    def home(self) -> tuple[_Home, None]:
        """Return where this is."""
        ray = import_ray()
        node = ray.get_runtime_context().get_node_id()
        return _Home(node, ray.util.get_node_ip_address(), os.getpid(), _versions()), None

    def begin(self, prepare: bytes) -> tuple[None, Sendable | None]:
        """Make what plays; returns what went wrong."""
        try:
            self._play = loaded(prepare)()
        except Exception as error:
            return None, portable(error)
        return None, None

    def play(self, seed: int) -> tuple[Any, Sendable | None]:
        """Play an episode; returns its result, and what went wrong."""
        try:
            return self._play(seed), None
        except Exception as error:
            return None, portable(error)


def _reason(error: Exception) -> str:
    """Return what Ray says of a death, out of the page that it makes of it."""
    text = " ".join(str(error).split())
    if "error raised in its creation task" in text:  # it does nothing then but load
        return "its code could not be loaded"
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
