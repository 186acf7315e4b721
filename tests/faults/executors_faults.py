"""Workers that die, hang and lie, clusters that are not there, and wrong ways to ask for them."""

from __future__ import annotations

import atexit
import functools
import json
import math
import os
import signal
import socket
import subprocess
import sys
import textwrap
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

from robots import RobotLayoutsError
from tests.faults.fault import GOES_ON, Fault, run_command

AREA = "workers and Ray"
ROOT = Path(__file__).parents[2]
TASK = "PushT-v1"
NO_COUNT = (-1, -(10**9), True, 2.5, "2", math.nan, math.inf, [1], b"1")
NO_SECONDS = (0, -1, True, "5", math.nan, math.inf, -math.inf, [1])
NO_SEEDS = (5, None, [0.5], ["a"], "ab", [-1], [2**32], [1, 2, 1], [None], [[1]])
NO_ADDRESS = (
    *("", " ", "local", "head", "head:", ":6379", "head:0", "head:-1", "head:99999", "head:6379x"),
    *("ray://head:10001", "http://head:6379", "a b:6379", "::1:6379", "[]:6379", "head:6379\n"),
    *(None, 6379, True, ("head", 6379), b"head:6379"),
)
SILENT_SECONDS = 2.0  # that a cluster may take to answer here


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    yield from _wrong_arguments()
    yield from _wrong_addresses()
    yield from _wrong_policies()
    yield from _deaths()
    yield from _programs()
    yield from _executors()
    yield from _clusters()


# -- wrong arguments -----------------------------------------------------------------------------


def _wrong_arguments() -> Iterator[Fault]:
    for value in NO_COUNT:
        yield _fault(f"evaluate(workers={value!r})", _evaluate, workers=value)
        yield _fault(f"record(workers={value!r})", _record, workers=value)
        yield _fault(f"RayExecutor(workers={value!r})", _ray_executor, workers=value)
        yield _fault(f"ProcessExecutor(attempts={value!r})", _process_executor, attempts=value)
    for value in NO_SECONDS:
        yield _fault(f"evaluate(episode_timeout={value!r})", _evaluate, episode_timeout=value)
        yield _fault(f"record(episode_timeout={value!r})", _record, episode_timeout=value)
    for value in NO_SEEDS:
        yield _fault(f"evaluate(seeds={value!r})", _evaluate, seeds=value)
        yield _fault(f"record(seeds={value!r})", _record, seeds=value)
    yield _fault("evaluate(seeds=[])", _evaluate, seeds=[])
    yield _fault("ProcessExecutor(workers=0)", _process_executor, workers=0)
    yield _fault("RayExecutor(workers=0)", _ray_executor, workers=0)
    yield _fault("a deadline in this process", _evaluate, workers=0, episode_timeout=5.0)
    yield _fault("an executor and workers", _evaluate, executor=_Nobody(), workers=2)
    yield _fault("an executor and a deadline", _evaluate, executor=_Nobody(), episode_timeout=5.0)
    for words in (
        ["--workers=-1"],
        ["--workers=two"],
        ["--episode-timeout=0"],
        ["--workers=0", "--episode-timeout=9"],
        ["--ray=local"],
        ["--ray="],
        ["--ray=127.0.0.77:1"],
    ):
        yield Fault(AREA, f"evaluate {' '.join(words)}", functools.partial(_command, words))


def _wrong_addresses() -> Iterator[Fault]:
    for value in NO_ADDRESS:
        yield _fault(f"RayExecutor({value!r})", _ray_executor, address=value)
    for host in ("127.0.0.1", "127.0.0.77", "localhost", "[::1]"):
        yield Fault(AREA, f"{host}:1, which refuses", lambda folder, host=host: _join(f"{host}:1"))
    yield Fault(AREA, "a host that does not exist", lambda folder: _join("no-such.invalid:6379"))
    yield Fault(AREA, "RAY_ADDRESS names a port that refuses", _stale_environment)
    for what, answer in (
        ("is silent", b""),
        ("speaks HTTP", b"HTTP/1.1 400 Bad Request\r\n\r\n"),
        ("sends random bytes", bytes(range(256)) * 64),
    ):
        run = functools.partial(_port_that_is_no_head, answer)
        yield Fault(AREA, f"a port that accepts and {what}", run)
    yield Fault(AREA, "ray is not installed", _without_ray)


# -- policies ------------------------------------------------------------------------------------


def _wrong_policies() -> Iterator[Fault]:
    for what, policy in _POLICIES.items():
        yield _fault(f"a policy that {what}, workers=0", _evaluate, policy=policy, workers=0)
    for what in ("raises KeyError", "raises what cannot be pickled"):
        yield _fault(f"a policy that {what}, workers=1", _evaluate, policy=_POLICIES[what])
    yield _fault("a policy that leaves the process, workers=1", _evaluate, policy=_leave)
    for what, make in _UNSENDABLE.items():
        yield Fault(AREA, f"{what} as policy, workers=1", lambda _, make=make: _evaluate(make()))


class _Secretive(Exception):
    """Cannot be pickled, nor printed."""

    def __init__(self, secret: object) -> None:
        super().__init__(lambda: secret)

    def __str__(self) -> str:
        raise ValueError("no")


def _raise(error: BaseException, obs: Any) -> None:
    raise error


def _raise_secret(obs: Any) -> None:
    raise _Secretive(obs)


def _leave(obs: Any) -> None:
    sys.exit("enough")


def _recurse(obs: Any) -> Any:
    return _recurse(obs)


_POLICIES: dict[str, Any] = {
    "raises KeyError": functools.partial(_raise, KeyError("no such key")),
    "raises without words": functools.partial(_raise, AssertionError()),
    "raises what cannot be pickled": _raise_secret,
    "raises StopIteration": functools.partial(_raise, StopIteration()),
    "runs out of memory": functools.partial(_raise, MemoryError()),
    "calls itself for ever": _recurse,
    "returns nothing": lambda obs: None,
    "returns a word": lambda obs: "left",
    "returns too few numbers": lambda obs: [0.0] * 3,
    "returns a matrix": lambda obs: [[0.0] * 7] * 7,
    "returns NaN": lambda obs: [math.nan] * 7,
    "returns infinity": lambda obs: [math.inf] * 7,
    "returns 1e300": lambda obs: [1e300] * 7,
    "takes no argument": lambda: [0.0] * 7,
}


class _Refuses:
    def __call__(self, obs: Any) -> None: ...

    def __reduce__(self) -> str:
        raise ValueError("I am not to be pickled")


class _Elsewhere:
    def __call__(self, obs: Any) -> None: ...

    def __reduce__(self) -> Any:
        from importlib import import_module

        return import_module, ("no_such_module_of_mine",)


class _Holds:
    def __init__(self, thing: object) -> None:
        self.thing = thing

    def __call__(self, obs: Any) -> None: ...


_UNSENDABLE: dict[str, Callable[[], Any]] = {
    "a lambda": lambda: lambda obs: obs,
    "a local function": lambda: functools.partial(_local, 1)(),
    "a lock's holder": lambda: _Holds(threading.Lock()),
    "a generator's holder": lambda: _Holds(x for x in ()),
    "a socket's holder": lambda: _Holds(socket.socket()),
    "a module's holder": lambda: _Holds(os),
    "what refuses to be pickled": _Refuses,
    "what no worker can import": _Elsewhere,
}


def _local(number: int) -> Any:
    def policy(obs: Any) -> int:
        return number

    return policy


# -- deaths and hangs ----------------------------------------------------------------------------


def _deaths() -> Iterator[Fault]:
    for name in ("SIGKILL", "SIGTERM", "SIGSEGV", "SIGABRT", "SIGSTOP", "SIGTSTP"):
        run = functools.partial(_plays_again, f"signal {name}")
        yield Fault(AREA, f"an episode gets {name}", run, GOES_ON)
    for what in ("exit 0", "exit 3", "busy", "lock", "sleep", "fifo", "half an answer"):
        run = functools.partial(_plays_again, what)
        yield Fault(AREA, f"an episode's end: {what}", run, GOES_ON)
    for what in ("signal SIGKILL", "exit 5", "sleep", "signal SIGSTOP"):
        run = functools.partial(_gives_up, what, during="play")
        yield Fault(AREA, f"every worker at one seed: {what}", run)
    for what in ("signal SIGKILL", "exit 5"):
        run = functools.partial(_gives_up, what, during="begin")
        yield Fault(AREA, f"every worker before it is ready: {what}", run)
    run = functools.partial(_plays_again, "signal SIGKILL", during="begin")
    yield Fault(AREA, "a worker is killed before it is ready", run, GOES_ON)


@dataclass(frozen=True)
class Mischief:
    """Plays squares; does some mischief once, or again and again."""

    folder: Path
    what: str
    during: str
    again: bool = False

    def __call__(self) -> Callable[[int], int]:
        """Begin."""
        self._perhaps("begin")
        return self.play

    def play(self, seed: int) -> int:
        """Return the square of a seed."""
        if seed == 1:
            self._perhaps("play")
        return seed**2

    def _perhaps(self, when: str) -> None:
        mark = self.folder / "done"
        if when == self.during and (self.again or not mark.exists()):
            mark.touch()
            _do(self.what, self.folder)


def _do(what: str, folder: Path) -> None:
    kind, _, detail = what.partition(" ")
    if kind == "signal":
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.kill(os.getpid(), getattr(signal, detail))
    elif kind == "exit":
        os._exit(int(detail))
    elif kind == "busy":
        while True:
            pass
    elif kind == "lock":
        lock = threading.Lock()
        lock.acquire()
        lock.acquire()
    elif kind == "sleep":
        threading.Event().wait()
    elif kind == "fifo":
        os.mkfifo(folder / "fifo")
        (folder / "fifo").read_bytes()
    elif kind == "half":
        from tests.rollouts.plays import StopsHalfWay

        StopsHalfWay(folder).play(0)


def _plays_again(what: str, folder: Path, during: str = "play") -> str:
    from rollouts.playing.executor import ProcessExecutor

    executor = ProcessExecutor(1, episode_timeout=1.0)
    return _expect_squares(executor, Mischief(folder, what, during))


def _expect_squares(executor: Any, prepare: Any, deaths: int = 1) -> str:
    events = list(executor.run(prepare, range(4)))
    results = [(event.seed, event.result) for event in events if event.result is not None]
    assert sorted(results) == [(seed, seed**2) for seed in range(4)], results
    died = [event.died for event in events if event.died is not None]
    assert len(died) == deaths, died
    return f"{died[0]}; all four episodes are played, each once"


def _gives_up(what: str, folder: Path, during: str) -> None:
    from rollouts.playing.executor import ProcessExecutor

    executor = ProcessExecutor(1, attempts=2, episode_timeout=0.3)
    for event in executor.run(Mischief(folder, what, during, again=True), range(3)):
        if event.error is not None:
            assert "seed 1" in str(event.error)
            raise event.error


# -- programs ------------------------------------------------------------------------------------


def _programs() -> Iterator[Fault]:
    for what, (program, promise) in _PROGRAMS.items():
        run = functools.partial(_program, textwrap.dedent(program))
        yield Fault(AREA, what, run, promise)


def _program(text: str, folder: Path) -> str:
    """Run a program in a file of its own; its last line on stdout is what happened, as json."""
    (folder / "program.py").write_text(text)
    done = subprocess.run(
        [sys.executable, "program.py"],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=90,
    )
    assert done.stdout, done.stderr[-2000:]
    kind, words = json.loads(done.stdout.splitlines()[-1])
    if kind == "refused":
        raise RobotLayoutsError(words)
    return words


_OPENING = """
import json, multiprocessing, os, resource, signal, sys, time
from robots import RobotLayoutsError
from rollouts.playing.executor import ProcessExecutor
from tests.rollouts.plays import Play

def tell(*words):
    print(json.dumps(words), flush=True)

def play():
    try:
        tell("goes on", str(len(list(ProcessExecutor(2).run(Play(), range(4))))) + " are played")
    except RobotLayoutsError as error:
        tell("refused", str(error))
"""
_PROGRAMS = {
    "a program without `if __name__ == '__main__'` catches what its workers refuse": (
        _OPENING + "\nplay()\n",
        GOES_ON,
    ),
    "a daemonic process plays": (
        _OPENING
        + """
if __name__ == "__main__":
    process = multiprocessing.get_context("fork").Process(target=play, daemon=True)
    process.start()
    process.join()
""",
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
    "Python cannot be started any more once workers have played": (
        _OPENING
        + """
if __name__ == "__main__":
    list(ProcessExecutor(1).run(Play(), [0]))
    sys.executable = "/no/such/python"
    multiprocessing.set_executable("/no/such/python")
    play()
""",
        GOES_ON,
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
    text += "from rollouts.playing.executor import ProcessExecutor\\n"
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
    from rollouts import evaluate
    from tests.rollouts.policies import still
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


# -- executors -----------------------------------------------------------------------------------


def _executors() -> Iterator[Fault]:
    for what in ("forgets one", "plays nothing", "returns at once", "raises", "answers for others"):
        run = functools.partial(_with_executor, what)
        yield Fault(AREA, f"an executor that {what}: evaluate", run)
    yield Fault(AREA, "an executor that forgets one: record", _recording_with_forgetful_executor)


class _Nobody:
    what = "plays nothing"

    def run(self, prepare: Any, seeds: Any) -> Any:
        """Play, after a fashion."""
        from rollouts.playing.executor import Event, WorkerError
        from rollouts.playing.in_process import InProcessExecutor

        if self.what == "forgets one":
            yield from InProcessExecutor().run(prepare, seeds[1:])
        elif self.what == "raises":
            raise WorkerError("nobody is here to play")
        elif self.what == "answers for others":
            yield Event(77, result=3)
        elif self.what == "plays nothing":
            yield Event(None, said="I rest")


def _with_executor(what: str, folder: Path) -> None:
    executor = _Nobody()
    executor.what = what
    _evaluate(executor=executor, workers=None)


def _recording_with_forgetful_executor(folder: Path) -> None:
    from rollouts.reading.trajectory import TrajectoryFile

    executor = _Nobody()
    executor.what = "forgets one"
    try:
        _record(folder=folder, seeds=[4, 5], executor=executor, workers=None)
    finally:
        with TrajectoryFile(folder / "trajectory.h5") as file:
            assert file.seeds == (5,)


# -- Ray -----------------------------------------------------------------------------------------


def _clusters() -> Iterator[Fault]:
    for what in ("signal SIGKILL", "signal SIGSTOP", "exit 0", "busy"):
        run = functools.partial(_plays_again_on_ray, what)
        yield Fault(AREA, f"an actor's episode: {what}", run, GOES_ON)
    yield Fault(AREA, "every actor at one seed: exit 5", _gives_up_on_ray)
    yield Fault(AREA, "no actor can load what is to be played", _unloadable_on_ray)


@functools.cache
def _cluster() -> Any:
    """Return a cluster of one node with a CPU, which lives as long as this process."""
    from tests.rollouts.clusters import running_cluster

    manager = running_cluster()
    nodes = manager.__enter__()
    atexit.register(manager.__exit__, None, None, None)
    nodes.grow(1)
    return nodes


def _on_ray(**more: Any) -> Any:
    from rollouts.playing.ray_executor import RayExecutor

    modules = ["tests.faults.executors_faults"]
    return RayExecutor(_cluster().address, 1, modules=modules, episode_timeout=2.0, **more)


def _plays_again_on_ray(what: str, folder: Path) -> str:
    happened = _expect_squares(_on_ray(), Mischief(folder, what, "play"))
    _cluster().wait_for_no_player()
    return happened


def _gives_up_on_ray(folder: Path) -> None:
    prepare = Mischief(folder, "exit 5", "play", again=True)
    for event in _on_ray(attempts=2).run(prepare, range(3)):
        if event.error is not None:
            assert "seed 1" in str(event.error)
            raise event.error


def _unloadable_on_ray(folder: Path) -> None:
    list(_on_ray().run(_Elsewhere(), range(3)))


def _join(address: str) -> None:
    from rollouts.playing.ray_executor import RayExecutor

    next(RayExecutor(address).run(Mischief(Path(), "", ""), [0]))


def _stale_environment(folder: Path) -> None:
    with patch.dict(os.environ, {"RAY_ADDRESS": "127.0.0.77:1"}):
        _join("auto")


def _port_that_is_no_head(answer: bytes, folder: Path) -> None:
    with (
        patch("rollouts.playing.ray_cluster._JOIN_SECONDS", SILENT_SECONDS),
        _answering_port(answer) as port,
    ):
        _join(f"127.0.0.77:{port}")


@contextmanager
def _answering_port(answer: bytes) -> Iterator[int]:
    with socket.create_server(("127.0.0.77", 0)) as server:

        def serve() -> None:
            kept = []
            while True:
                try:
                    connection, _ = server.accept()
                except OSError:
                    return
                kept.append(connection)
                connection.sendall(answer)

        threading.Thread(target=serve, daemon=True).start()
        yield server.getsockname()[1]
        server.shutdown(socket.SHUT_RDWR)


def _without_ray(folder: Path) -> None:
    with patch.dict(sys.modules, {"ray": None}):
        _ray_executor()


# -- how all of them ask -------------------------------------------------------------------------


def _fault(what: str, run: Callable[..., None], **arguments: Any) -> Fault:
    return Fault(AREA, what, lambda folder: run(**arguments))


def _evaluate(policy: Any = len, seeds: Any = (0,), workers: Any = 1, **arguments: Any) -> None:
    from rollouts import evaluate

    if arguments.get("executor") is None or workers is not None:
        arguments["workers"] = workers
    evaluate(policy, TASK, seeds, **arguments)


def _record(
    seeds: Any = (0,), folder: Path = Path("/nowhere"), workers: Any = 1, **arguments: Any
) -> None:
    from rollouts.recording.record import record
    from tests.rollouts.plays import at_random

    with patch.dict("experts.registry._registered", {TASK: at_random}):
        record(TASK, seeds, folder, workers=workers, **arguments)


def _process_executor(**arguments: Any) -> None:
    from rollouts.playing.executor import ProcessExecutor

    ProcessExecutor(**arguments)


def _ray_executor(**arguments: Any) -> None:
    from rollouts.playing.ray_executor import RayExecutor

    RayExecutor(**arguments)


def _command(words: list[str], folder: Path) -> None:
    run_command("rollouts", "evaluate", f"--task={TASK}", "--episodes=1", *words)
