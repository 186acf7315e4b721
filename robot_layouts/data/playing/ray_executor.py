"""Plays whole episodes on a Ray cluster, in actors, and survives actors and nodes that die."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from robot_layouts.core.bounds import checked_whole
from robot_layouts.core.processes.start import WorkerError
from robot_layouts.core.processes.transport import SentError, loaded, unsendable
from robot_layouts.core.processes.worker import Reply, Status
from robot_layouts.data.playing.environment import versions
from robot_layouts.data.playing.ray_cluster import (
    RayCluster,
    check_address,
    import_ray,
    is_own,
    joined,
)
from robot_layouts.data.playing.scheduler import (
    DEATHS_ALLOWED,
    EPISODE_SECONDS,
    Event,
    Play,
    RetryPolicy,
    Scheduler,
)
from robots import TaskError

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
            TaskError: If it cannot be an address, or a number is not valid.
        """
        self._ray = import_ray()
        check_address(address)
        if workers is not None:
            checked_whole("workers on a Ray cluster", workers, 1, None, TaskError)
        self._address, self._workers, self._modules = address, workers, tuple(modules)
        self._policy = RetryPolicy(attempts, fresh, episode_timeout)

    def run(self, prepare: Callable[[], Play], seeds: Iterable[int]) -> Generator[Event]:
        """Play the episode of every seed; see `robot_layouts.data.playing.executor.Executor`."""
        seeds = list(seeds)
        if not seeds:
            return
        modules = [*self._modules, *filter(is_own, getattr(prepare, "modules", ()))]
        with joined(self._ray, self._address, modules):
            cluster = RayCluster(self._ray)
            backend = _Actors(self._ray, cluster, prepare)
            workers = self._workers or cluster.cpus
            yield from Scheduler(backend, seeds, workers, self._policy).events()


class _Actors:
    """The backend of a cluster, whose workers are actors."""

    def __init__(self, ray: Any, cluster: RayCluster, prepare: Callable[[], Play]) -> None:
        """Take what makes the plays.

        Raises:
            WorkerError: If it cannot be sent to other machines.
        """
        self._ray, self._cluster = ray, cluster
        try:
            self._prepare: bytes = ray.cloudpickle.dumps(prepare)
        except Exception as error:  # whatever a class of the user's own raises
            raise unsendable(error) from error
        self._class = ray.remote(_Player).options(
            num_cpus=1, max_restarts=0, max_task_retries=0, scheduling_strategy="SPREAD"
        )
        self._actors: list[_RayActor] = []

    def spawn(self) -> _RayActor:
        """Ask for an actor, which begins when a node has room for it."""
        self._cluster.nodes()  # raises if the head is gone, before it is asked
        self._actors.append(_RayActor(self._class.remote()))
        return self._actors[-1]

    def wait(self, seconds: float) -> list[tuple[_RayActor, Reply]]:
        """Wait for replies for a while (s)."""
        self._cluster.look()
        waiting = {actor.answer: actor for actor in self._actors}
        if not self._ray.wait(list(waiting), timeout=seconds)[0]:
            return []
        ready = self._ray.wait(list(waiting), num_returns=len(waiting), timeout=0)[0]
        replies = [(waiting[answer], self._receive(waiting[answer])) for answer in ready]
        return [(actor, reply) for actor, reply in replies if reply is not None]

    def remove(self, worker: _RayActor, *, kill: bool) -> None:
        """End an actor."""
        self._actors.remove(worker)
        with suppress(self._ray.exceptions.RayError, ValueError):
            self._ray.kill(worker.handle, no_restart=True)

    def status(self) -> str:
        """Return how much room there is.

        Raises:
            WorkerError: If the cluster is gone, or the node of this machine.
        """
        nodes, free = len(self._cluster.nodes()), self._cluster.free_cpus
        return f"{free} CPUs of the Ray cluster, of {nodes} nodes, are free"

    def _receive(self, actor: _RayActor) -> Reply | None:
        try:
            result, error = self._ray.get(actor.answer, timeout=_FETCH_SECONDS)
        except self._ray.exceptions.RayError as death:
            return self._died(actor, death)
        if actor.home is None:
            actor.settle(result, self._prepare)
            return None
        if error is None:
            return Reply(0, Status.DONE, result)
        if not actor.ready:
            error.args = (f"{error} (on node {actor.home.address})", *error.args[1:])
        return Reply(0, Status.FAILED, error)

    def _died(self, actor: _RayActor, error: Exception) -> Reply:
        alive, reason = self._cluster.nodes(), _reason(error)
        out_of_reach = isinstance(error, self._ray.exceptions.ActorUnavailableError)
        if out_of_reach or "node" in reason or (actor.home and actor.home.node not in alive):
            return Reply(0, Status.LOST, "was lost: out of reach")
        return Reply(0, Status.DIED, f"was lost: {reason}")


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


class _RayActor:
    """One actor, as seen from here; it plays one seed at a time.

    Attributes:
        handle: What Ray knows it by.
        name: What it is called in messages.
        answer: What it has been asked for last.
        home: Where it lives; None while it waits for a place.
        begun: When it got that place, by the monotonic clock (s).
        ready: Whether it has been asked to play.
    """

    def __init__(self, handle: Any) -> None:
        self.handle, self.name = handle, "actor"
        self.home: _Home | None = None
        self.begun: float | None = None
        self.ready = False
        self.answer: Any = handle.home.remote()

    def request(self, seed: int) -> None:
        """Let it play a seed."""
        self.ready, self.answer = True, self.handle.play.remote(seed)

    def settle(self, home: _Home, prepare: bytes) -> None:
        """Let it make what plays, in its place."""
        self.home, self.begun = home, time.monotonic()
        self.name = f"process {home.process} on node {home.address}"
        here = versions(PACKAGES)
        if home.packages != here:
            raise WorkerError(
                f"node {home.address} has {_listing(home.packages)}, this machine {_listing(here)};"
                " equal episodes need equal versions"
            )
        self.answer = self.handle.begin.remote(prepare)


class _Player:
    """What runs on the cluster: one process, which plays one seed at a time."""

    _play: Play

    def home(self) -> tuple[_Home, None]:
        """Return where this is."""
        ray = import_ray()
        node = ray.get_runtime_context().get_node_id()
        return _Home(node, ray.util.get_node_ip_address(), os.getpid(), versions(PACKAGES)), None

    def begin(self, prepare: bytes) -> tuple[None, SentError | None]:
        """Make what plays; returns what went wrong."""
        try:
            self._play = loaded(prepare)()
        except Exception as error:
            return None, SentError(error)
        return None, None

    def play(self, seed: int) -> tuple[Any, SentError | None]:
        """Play an episode; returns its result, and what went wrong."""
        try:
            return self._play(seed), None
        except Exception as error:
            return None, SentError(error)


def _reason(error: Exception) -> str:
    """Return what Ray says of a death, out of the page that it makes of it."""
    text = " ".join(str(error).split())
    if "error raised in its creation task" in text:  # it does nothing then but load
        return "its code could not be loaded"
    because = re.search(r" because (.+?)\.(?: |$)", text)
    return because[1] if because else text.partition(". ")[0]


def _listing(packages: dict[str, str]) -> str:
    return ", ".join(f"{name} {found}" for name, found in packages.items()) or "none of them"
