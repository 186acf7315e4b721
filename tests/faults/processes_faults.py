"""Processes that are killed, stopped, forked or copied, threads that collide, too little room."""

from __future__ import annotations

import copy
import multiprocessing
import os
import pickle
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

from tests.faults.fault import GOES_ON, Fault

AREA = "processes"
ROOT = Path(__file__).parents[2]
PATIENCE = 30.0  # s, for processes to be gone on a busy machine
TASK = "PushCube-v1"


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    yield from _tasks_that_break()
    yield from _workers_that_end()
    yield from _parents_that_end()
    yield from _forks()
    yield from _threads()
    yield from _copies()
    yield from _too_little()
    yield from _main_modules()
    yield from _servers()


# -- tasks that break ---------------------------------------------------------------------------


def _tasks_that_break() -> Iterator[Fault]:
    from tests.tasks.breaking import HOOKS, WAYS

    for hook in HOOKS:
        what = f"a task's {hook}() fails when a worker makes it"
        if hook not in ("dense_reward", "respond"):
            yield Fault(AREA, what, lambda _, hook=hook: _breaks(f"Breaks_{hook}_soon-v1"))
        if hook != "begin_episodes":
            what = f"a task's {hook}() fails in a worker later"
            yield Fault(AREA, what, lambda _, hook=hook: _breaks(f"Breaks_{hook}_late-v1"))
    for number, way in enumerate(WAYS):
        what = f"evaluate() ends with {way} in a worker"
        yield Fault(AREA, what, lambda _, number=number: _breaks(f"BreaksBy_{number}-v1"))
        what = f"evaluate() ends with {way} in one of two workers, and the other goes on"
        yield Fault(AREA, what, lambda _, n=number: _goes_on(f"BreaksBy_{n}-v1"), GOES_ON)
    yield Fault(AREA, "evaluate() has more keys than at first", lambda _: _breaks("Grows-v1"))


def _breaks(task_id: str) -> None:
    """Play until it fails, and see that the error says where and that nothing is left."""
    before = _children()
    try:
        with _vector(task_id) as env:
            env.step(_actions(env))
            env.step(_actions(env))
            env.reset(options={"reconfigure": True})
    except RuntimeError as error:
        message, cause = str(error), str(error.__cause__)
        assert "environments [0, 1] of seeds [" in message, message
        assert "__main__" not in message, "a hint that leads nowhere"
        dead = "died by" in message or "ended with code" in message
        assert dead or ("failed in " in message and "Traceback" in cause), message
        raise
    finally:
        assert _children() == before


def _goes_on(task_id: str) -> str:
    """Break in one worker alone: the other has taken the step."""
    with _vector(task_id, num_workers=2) as env, _vector(TASK, num_workers=0) as same:
        env.reset(seed=7)
        same.reset(seed=7)
        error = _failure(lambda: env.step(_actions(env)))
        assert error.env_ids == [0], error
        assert error.seeds == [7], error
        _same_rows(error.results, same.step(_actions(same)), [1])
        env.restart()
        assert len(_workers(env)) == 2
    return str(error)


def _failure(call: Callable[[], Any]) -> Any:
    from tasks.fronts.workers import WorkerError

    try:
        call()
    except WorkerError as error:
        return error
    raise AssertionError("nothing failed")


def _same_rows(results: Any, expected: Any, rows: list[int]) -> None:
    import numpy as np

    for result, wanted in zip(results[:4], expected[:4], strict=True):
        np.testing.assert_array_equal(result[rows], wanted[rows])


# -- workers that end ---------------------------------------------------------------------------

SIGNALS = ("SIGKILL", "SIGTERM", "SIGSEGV", "SIGABRT", "SIGHUP", "SIGQUIT")
MOMENTS = (0.0, 0.05, 0.15, 0.3, 0.6)  # s after a call has begun that takes 0.2 s or more


def _workers_that_end() -> Iterator[Fault]:
    for name in SIGNALS:
        what = f"a worker ends by {name} between two steps"
        yield Fault(AREA, what, lambda _, name=name: _ends_between_steps(name), GOES_ON)
    for seconds in MOMENTS:
        what = f"a worker is killed {seconds:g} s after the first of slow steps has begun"
        yield Fault(AREA, what, lambda _, s=seconds: _killed_in_steps(s), GOES_ON)
        what = f"a worker is killed {seconds:g} s after vectors are made"
        yield Fault(AREA, what, lambda _, s=seconds: _killed_while_made(s))
        what = f"a worker is killed {seconds:g} s after worlds are rebuilt"
        yield Fault(AREA, what, lambda _, s=seconds: _killed_in_rebuild(s))
    yield Fault(AREA, "a worker is stopped for ever", lambda _: _hangs(TASK, stopped=True))
    yield Fault(AREA, "a worker hangs in C code", lambda _: _hangs("BusySteps-v1", stopped=False))
    yield Fault(AREA, "a worker is stopped for a while", lambda _: _stopped_for_a_while(), GOES_ON)
    yield Fault(AREA, "all workers are killed at once", lambda _: _all_killed())
    yield Fault(AREA, "a vector is closed while a worker is stopped", lambda _: _closes(), GOES_ON)
    yield Fault(AREA, "closed in C code that never ends", lambda _: _closes_busy(), GOES_ON)


def _ends_between_steps(name: str) -> str:
    with _vector(num_workers=2) as env, _vector(num_workers=0) as same:
        for each in (env, same):
            each.reset(seed=3)
            each.step(_actions(each))
        os.kill(_worker(env, 0), signal.Signals[name])
        error = _failure(lambda: env.step(_actions(env)))
        assert f"died by {name}" in str(error), error
        _same_rows(error.results, same.step(_actions(same)), [1])
        env.restart()
        obs, *_ = env.step(_actions(env))
        assert obs.shape[0] == 2
    return str(error)


def _killed_in_steps(seconds: float) -> str:
    with _vector("SlowSteps-v1", num_workers=2) as env, _vector(num_workers=0) as same:
        for each in (env, same):
            each.reset(seed=3)
        env.step(_actions(env))
        same.step(_actions(same))
        error = None
        with _later(seconds, lambda: os.kill(_worker(env, 0), signal.SIGKILL)):
            while error is None:
                wanted = same.step(_actions(same))
                try:
                    _same_rows(env.step(_actions(env)), wanted, [0, 1])
                except RuntimeError as raised:
                    error = raised
        assert getattr(error, "env_ids", None) == [0], error
        _same_rows(error.results, wanted, [1])  # type: ignore[attr-defined]
    return str(error)


def _killed_while_made(seconds: float) -> None:
    """Kill one as soon as there is one, and make vectors until one of them meets it."""
    before = _children()

    def kill() -> None:
        while not (new := _children() - before):
            pass
        os.kill(min(new), signal.SIGKILL)

    with _later(seconds, kill):
        while True:
            with _vector("SlowBuild-v1", num_workers=2) as env:
                for _ in range(5):
                    env.step(_actions(env))


def _killed_in_rebuild(seconds: float) -> None:
    with (
        _vector("SlowBuild-v1", num_workers=2) as env,
        _later(seconds, lambda: os.kill(_worker(env, 0), signal.SIGKILL)),
    ):
        while True:
            env.reset(options={"reconfigure": True})


def _hangs(task_id: str, *, stopped: bool) -> None:
    with _vector(task_id, num_workers=2, timeout=1.0) as env:
        env.reset()
        if stopped:
            os.kill(_worker(env, 1), signal.SIGSTOP)
        begun = time.monotonic()
        try:
            env.step(_actions(env))
        finally:
            assert time.monotonic() - begun < PATIENCE


def _stopped_for_a_while() -> None:
    with _vector(num_workers=2) as env, _vector(num_workers=0) as same:
        for each in (env, same):
            each.reset(seed=3)
        pid = _worker(env, 0)
        os.kill(pid, signal.SIGSTOP)
        with _later(0.5, lambda: os.kill(pid, signal.SIGCONT)):
            _same_rows(env.step(_actions(env)), same.step(_actions(same)), [0, 1])


def _all_killed() -> None:
    with _vector(num_workers=2) as env:
        for pid in _workers(env):
            os.kill(pid, signal.SIGKILL)
        error = _failure(lambda: env.step(_actions(env)))
        assert error.env_ids == [0, 1]
        env.restart()
        env.step(_actions(env))
        raise error


def _closes() -> None:
    before = _children()
    with _vector(num_workers=2) as env:
        os.kill(_worker(env, 0), signal.SIGSTOP)
    assert _children() == before


def _closes_busy() -> None:
    before = _children()
    with _vector("BusySteps-v1", num_workers=2, timeout=1.0) as env:
        _failure(lambda: env.step(_actions(env)))
    assert _children() == before


# -- parents that end ---------------------------------------------------------------------------


def _parents_that_end() -> Iterator[Fault]:
    for milliseconds in (0, 50, 100, 200, 400, 800, 1600, 3200):
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
    from tasks.processes import process as processes

    ours, theirs = processes.context.Pipe()
    parent = processes.context.Process(target=_hold, args=(theirs, hold, task_id))
    processes.start(parent)
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
        server = {other for other in others if "fork_server" in _command(other)}
        server &= {other for other in others if _parent_of(other) == pid}
        victims = {"worker": _session(pid) - server - {pid}, "server": server, "": set[int]()}
        for victim in victims[stopped]:
            if "resource_tracker" not in _command(victim):  # Python's own ends by itself
                os.kill(victim, signal.SIGSTOP)
        os.kill(pid, signal.Signals[name])
        parent.join(PATIENCE)
        _wait_until(lambda: not _session(pid), f"left: {_session(pid)}")
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
        from rollouts.playing.executor import ProcessExecutor
        from tests.rollouts.plays import Play

        connection.send("begins")
        for event in ProcessExecutor(2).run(Play(lasts=0.05), range(10**6)):
            if event.seed == 0:
                connection.send("has workers")
        return
    connection.send("begins")
    with _vector(task_id, 3, num_workers=3) as env:
        connection.send("has workers")
        while True:
            env.step(_actions(env))


def _command(pid: int) -> str:
    with suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_text()
    return ""


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


# -- forks --------------------------------------------------------------------------------------

USES: dict[str, Callable[[Any], Any]] = {
    "step()": lambda env: env.step(_actions(env)),
    "reset()": lambda env: env.reset(),
    "reset(seed=1)": lambda env: env.reset(seed=1),
    "reset(reconfigure)": lambda env: env.reset(options={"reconfigure": True}),
    "restart()": lambda env: env.restart(),
}
ENDS = {
    "sys.exit": "sys.exit(0)",
    "an error": "raise ValueError('on purpose')",
    "sys.exit, having closed the vector": "env.close(); one.close(); sys.exit(0)",
}
SUDDEN_ENDS: dict[str, Callable[[Any], Any]] = {
    "os._exit": lambda env: None,
    "os._exit, having closed the vector": lambda env: env.close(),
    "os._exit, having let it be collected": lambda env: vars(env).clear(),
    "SIGTERM": lambda env: os.kill(os.getpid(), signal.SIGTERM),
    "multiprocessing's own ending": lambda env: _end_of_multiprocessing(),
}
FORKING = """
import os, sys, time
import numpy as np
from tasks.fronts.vector import VectorTask
if __name__ == "__main__":
    env = VectorTask("PushCube-v1", 2, num_workers=2)
    one = VectorTask("PushCube-v1", 2, num_workers=0)
    if not os.fork():
        {end}
    os.wait()
    for each in (env, one):
        each.reset(seed=1)
    for _ in range(3):
        action = np.zeros((2, 8), np.float32)
        assert (env.step(action)[0] == one.step(action)[0]).all()
    env.close()
"""


def _forks() -> Iterator[Fault]:
    for name, use in USES.items():
        what = f"{name} of a vector with workers in a fork"
        yield Fault(AREA, what, lambda _, use=use: _used_in_fork(use))
        what = f"{name} of a vector without workers in a fork"
        yield Fault(AREA, what, lambda _, use=use: _used_in_fork(use, workers=0), GOES_ON)
    for name, end in ENDS.items():
        what = f"a fork ends by {name} while a vector is open"
        yield Fault(AREA, what, lambda folder, end=end: _fork_ends(folder, end), GOES_ON)
    for name, last in SUDDEN_ENDS.items():
        what = f"a fork ends by {name}, while a vector is open"
        yield Fault(AREA, what, lambda _, last=last: _fork_ends_suddenly(last), GOES_ON)
    yield Fault(AREA, "a vector of its own in a fork", lambda _: _own_in_fork(), GOES_ON)
    yield Fault(AREA, "a task is stepped in a fork", lambda _: _stepped_in_fork(), GOES_ON)
    yield Fault(AREA, "a vector in a process by fork", lambda _: _in_process_by("fork"), GOES_ON)
    yield Fault(AREA, "a vector in a process by spawn", lambda _: _in_process_by("spawn"), GOES_ON)
    yield Fault(AREA, "a vector in a multiprocessing.Pool", lambda _: _in_pool(), GOES_ON)


def _used_in_fork(use: Callable[[Any], Any], workers: int = 2) -> None:
    with _vector(num_workers=workers) as env:
        env.reset(seed=2)
        try:
            _in_fork(lambda: (use(env), None)[1])
        finally:
            if workers:
                assert len(_workers(env)) == workers
            env.step(_actions(env))


def _fork_ends(folder: Path, end: str) -> None:
    script = folder / "forking.py"
    script.write_text(FORKING.format(end=end))
    done = subprocess.run(
        [sys.executable, str(script)],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        timeout=60 + PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    expected = "ValueError: on purpose" if "raise" in end else ""
    last = (done.stderr.strip().splitlines() or [""])[-1]
    assert last == expected, done.stderr[-2000:]


def _fork_ends_suddenly(last: Callable[[Any], Any]) -> None:
    with _vector(num_workers=2) as env:
        env.reset(seed=4)
        pid = os.fork()
        if pid == 0:
            last(env)
            os._exit(0)
        os.waitpid(pid, 0)
        assert env.step(_actions(env))[0].tobytes() == _play_own()


def _end_of_multiprocessing() -> None:
    from multiprocessing import util

    util._exit_function()  # type: ignore[attr-defined]


def _own_in_fork() -> None:
    with _vector(num_workers=2) as env:
        env.reset(seed=4)
        wanted = env.step(_actions(env))[0].tobytes()
        assert _in_fork(_play_own) == wanted


def _play_own() -> bytes:
    with _vector(num_workers=2) as env:
        env.reset(seed=4)
        return env.step(_actions(env))[0].tobytes()


def _stepped_in_fork() -> None:
    import tasks

    env = tasks.make(TASK)
    env.reset(seed=5)
    state = _in_fork(lambda: _three_steps(env))
    assert state == _three_steps(env)
    env.close()


def _three_steps(env: Any) -> bytes:
    import numpy as np

    action = np.full((1, 8), 0.3, np.float32)
    return b"".join(env.step(action)[0].numpy().tobytes() for _ in range(3))


def _in_process_by(method: str) -> None:
    context: Any = multiprocessing.get_context(method)
    ours, theirs = context.Pipe()
    process = context.Process(target=_send_own, args=(theirs,), daemon=True)
    process.start()
    assert ours.poll(90)
    assert ours.recv() == _play_own()
    process.join(PATIENCE)
    assert process.exitcode == 0


def _send_own(connection: Any) -> None:
    connection.send(_play_own())


def _in_pool() -> None:
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.apply(_play_own) == _play_own()


def _in_fork(call: Callable[[], Any]) -> Any:
    """Call something in a fork, and return or raise here what it does there."""
    read, write = os.pipe()
    pid = os.fork()
    if pid == 0:
        signal.alarm(60)
        try:
            answer = call(), None
        except Exception as error:
            answer = None, error
        os.write(write, pickle.dumps(answer))
        os._exit(0)
    os.close(write)
    with open(read, "rb") as pipe:
        told = pipe.read()
    os.waitpid(pid, 0)
    assert told, "the fork hung, or died without a word"
    result, error = pickle.loads(told)
    if error is not None:
        raise error
    return result


# -- threads ------------------------------------------------------------------------------------


def _threads() -> Iterator[Fault]:
    for name, use in {**USES, "close()": lambda env: env.close()}.items():
        for workers in (0, 2):
            what = f"{name} while another thread steps a vector of {workers} workers"
            yield Fault(AREA, what, lambda _, use=use, workers=workers: _collide(use, workers))
    yield Fault(AREA, "four threads step one vector", lambda _: _four_threads(), GOES_ON)
    yield Fault(AREA, "four threads take turns", lambda _: _take_turns(), GOES_ON)
    yield Fault(AREA, "four threads make vectors", lambda _: _all_make(), GOES_ON)
    yield Fault(AREA, "Ctrl-C again and again", lambda _: _interrupted(), GOES_ON)


def _collide(use: Callable[[Any], Any], workers: int) -> None:
    with _vector("SlowSteps-v1", num_workers=workers) as env:
        env.step(_actions(env))
        results: list[Any] = []
        thread = threading.Thread(target=lambda: results.append(env.step(_actions(env))))
        thread.start()
        _wait_until(env.busy.locked, "the other thread does not step")
        try:
            use(env)
        finally:
            thread.join(PATIENCE)
            assert results, "the first call was disturbed"
            env.step(_actions(env))


def _four_threads() -> str:
    from robots import SimulationError

    steps, refused = [0] * 4, [0] * 4
    with _vector("SlowSteps-v1", num_workers=2) as env:
        env.reset(seed=1)

        def play(number: int) -> None:
            for _ in range(5):
                try:
                    env.step(_actions(env))
                    steps[number] += 1
                except SimulationError:
                    refused[number] += 1

        _run_threads(play)
        _, info = env.reset(seed=1)
        assert sum(steps) >= 1
        assert sum(refused) >= 1
        assert len(_workers(env)) == 2
        assert info["elapsed_steps"].tolist() == [0, 0]
    return f"{sum(steps)} steps taken, {sum(refused)} refused"


def _take_turns() -> None:
    lock = threading.Lock()
    with _vector(num_workers=2) as env:
        env.reset(seed=1)

        def play(_: int) -> None:
            for _ in range(5):
                with lock:
                    env.step(_actions(env))

        _run_threads(play)
        assert env.step(_actions(env))[4]["elapsed_steps"].tolist() == [21, 21]


def _all_make() -> None:
    results: list[bytes] = []
    _run_threads(lambda _: results.append(_play_own()))
    assert len(set(results)) == 1
    assert len(results) == 4


def _run_threads(target: Callable[[int], Any]) -> None:
    threads = [threading.Thread(target=target, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE)
        assert not thread.is_alive(), "a thread hangs"


def _interrupted() -> None:
    """Interrupt steps at many moments: the vector stays of use."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        with _vector(num_workers=2) as env:
            env.reset(seed=1)
            for i in range(40):
                signal.setitimer(signal.ITIMER_REAL, 1e-4 * (i + 1))
                with suppress(KeyboardInterrupt):
                    while True:
                        env.step(_actions(env))
            obs, _ = env.reset(seed=4)
            assert env.step(_actions(env))[0].tobytes() == _play_own()
            assert len(_workers(env)) == 2
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


# -- copies -------------------------------------------------------------------------------------

COPIES: dict[str, Callable[[Any], Any]] = {
    "copy.copy": copy.copy,
    "copy.deepcopy": copy.deepcopy,
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
}


def _fronts() -> dict[str, Callable[[], Any]]:
    import gymnasium

    import tasks
    from tasks.fronts.vector import VectorTask

    return {
        "a vector with workers": lambda: VectorTask(TASK, 2, num_workers=2),
        "a vector without workers": lambda: VectorTask(TASK, 2, num_workers=0),
        "a Gymnasium environment": lambda: gymnasium.make(f"RobotLayouts/{TASK}"),
        "a PettingZoo environment": lambda: tasks.parallel_env(TASK),
        "a Stable-Baselines3 environment": lambda: tasks.sb3_vec_env(TASK, 2, num_workers=0),
        "a task": lambda: tasks.make(TASK, num_envs=2),
    }


FRONTS = (
    "a vector with workers",
    "a vector without workers",
    "a Gymnasium environment",
    "a PettingZoo environment",
    "a Stable-Baselines3 environment",
    "a task",
)


def _copies() -> Iterator[Fault]:
    for front in FRONTS:
        for name, make_copy in COPIES.items():
            if "Gymnasium" in front and make_copy is copy.copy:
                continue  # a shallow copy of Gymnasium's wrappers shares what they wrap
            what = f"{name} of {front}"
            yield Fault(AREA, what, lambda _, f=front, c=make_copy: _copied(f, c), GOES_ON)
    yield Fault(AREA, "copy.deepcopy of a vector fails", lambda _: _copy_fails(), GOES_ON)
    yield Fault(AREA, "pickle of a closed vector", lambda _: _copied_closed(), GOES_ON)


def _copied(front: str, make_copy: Callable[[Any], Any]) -> None:
    """Copy, end the copy, and see that the original goes on and the copy was made alike."""
    original = _fronts()[front]()
    _seed(original)
    other = make_copy(original)
    assert other is not original
    assert type(other) is type(original)
    first = _seed(other)
    other.close()
    assert _seed(original) == first
    original.close()


def _seed(env: Any) -> bytes:
    """Begin an episode of one seed and return what is observed, as bytes."""
    if hasattr(env, "env_is_wrapped"):
        env.seed(11)
        return pickle.dumps(env.reset().tolist())
    obs, _ = env.reset(seed=11)
    if isinstance(obs, dict):
        return pickle.dumps({key: part.tolist() for key, part in obs.items()})
    return pickle.dumps(obs.tolist())


def _copy_fails() -> None:
    with _vector(num_workers=2) as env:
        env.reset(seed=4)
        room = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (_open_files() + 2, room[1]))
        try:
            copy.deepcopy(env)
        except RuntimeError:
            pass
        else:
            raise AssertionError("nothing failed")
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, room)
        assert env.step(_actions(env))[0].tobytes() == _play_own()


def _copied_closed() -> None:
    with _vector(num_workers=2) as env:
        env.close()
        other = pickle.loads(pickle.dumps(env))
        other.reset()
        other.close()


# -- too little ---------------------------------------------------------------------------------


def _too_little() -> Iterator[Fault]:
    for more in (0, 1, 2, 3, 4, 6, 9, 13, 18, 24):
        what = f"{more} more file descriptors for 8 workers"
        yield Fault(AREA, what, lambda _, more=more: _few_descriptors(more))
    for limit in (16, 20, 24):
        what = f"8 workers in a process with ulimit -n {limit}"
        yield Fault(AREA, what, lambda folder, n=limit: _limited(folder, f"ulimit -n {n}"))
    yield Fault(AREA, "no memory to share", lambda _: _no_shared_memory())
    for megabytes in (0, 1, 4, 16):
        what = f"workers that may take {megabytes} MB more"
        yield Fault(AREA, what, lambda _, more=megabytes: _little_memory(more))


def _few_descriptors(more: int) -> None:
    _server()  # is there already
    before, open_before = _children(), _open_files()
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (open_before + more, hard))
    try:
        with _vector(num_envs=8, num_workers=8):
            raise AssertionError("8 workers with so few descriptors")
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        assert _children() == before
        assert _open_files() == open_before


LIMITED = """
import os, sys, multiprocessing
from robots import RobotLayoutsError
from tasks.fronts.vector import VectorTask
if __name__ == "__main__":
    try:
        VectorTask("PushCube-v1", 8, num_workers=8)
    except RobotLayoutsError as error:
        assert not multiprocessing.active_children()
        sys.exit(str(error))
"""


def _limited(folder: Path, limit: str) -> None:
    from robots import RobotLayoutsError

    script = folder / "limited.py"
    script.write_text(LIMITED)
    words = ["bash", "-c", f'{limit}; exec "$0" "$1"', sys.executable, str(script)]
    done = subprocess.run(
        words,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        timeout=60 + PATIENCE,
        check=False,
    )
    assert "Traceback" not in done.stderr, done.stderr[-2000:]
    if done.returncode:
        raise RobotLayoutsError(done.stderr.strip())


def _no_shared_memory() -> None:
    """Let no file grow: memory that processes share is one."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before, open_before = _children(), _open_files()
    before_signal = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (16, hard))
    try:
        with _vector(num_workers=2):
            raise AssertionError("memory was shared")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before_signal)
        assert _children() == before
        assert _open_files() == open_before


@contextmanager
def _server_may_take(more: int) -> Generator[None]:
    """Let the server and its forks have so much address space more (bytes)."""
    server = _server()
    pages = int(Path(f"/proc/{server}/statm").read_text().split()[0])
    limit = max(1, pages * resource.getpagesize() + more)
    hard = resource.prlimit(server, resource.RLIMIT_AS)[1]
    resource.prlimit(server, resource.RLIMIT_AS, (limit, hard))
    try:
        yield
    finally:
        resource.prlimit(server, resource.RLIMIT_AS, (resource.RLIM_INFINITY, hard))


def _little_memory(megabytes: int) -> None:
    with _server_may_take(megabytes * 2**20), _vector(num_envs=64, num_workers=2) as env:
        for _ in range(5):
            env.reset(options={"reconfigure": True})
            env.step(_actions(env))


# -- main modules -------------------------------------------------------------------------------

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
    "ends when a worker imports it": (
        "import gymnasium, sys, tasks\n"
        "if __name__ != '__main__': sys.exit(5)\n"
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
        "define its class in a module that they can import",
    ),
    "defines a task in a function": (
        "import gymnasium, tasks\n"
        "from tasks.maniskill.push_cube import PushCube\n"
        "def mine():\n"
        "    class Mine(PushCube): pass\n"
        "    return Mine\n"
        "if __name__ == '__main__':\n"
        "    tasks.register_task('Mine-v1')(mine())\n"
        "    gymnasium.make_vec('RobotLayouts/Mine-v1', num_envs=2, num_workers=2)\n",
        "define its class in a module that they can import",
    ),
}


def _main_modules() -> Iterator[Fault]:
    for what, (text, hint) in MAINS.items():
        yield Fault(
            AREA, f"a script {what}", lambda folder, t=text, h=hint: _run_main(folder, t, h)
        )


def _run_main(folder: Path, text: str, hint: str) -> None:
    from robots import RobotLayoutsError

    script = folder / "script.py"
    script.write_text(text)
    done = subprocess.run(
        [sys.executable, str(script)],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        timeout=60 + PATIENCE,
        check=False,
    )
    assert done.returncode == 1, done.stderr[-2000:]
    last = done.stderr.strip().splitlines()[-1]
    assert hint in last, done.stderr[-2000:]
    raise RobotLayoutsError(last)


# -- the server ---------------------------------------------------------------------------------


def _servers() -> Iterator[Fault]:
    yield Fault(AREA, "the server is killed before a start", lambda _: _no_server(), GOES_ON)
    yield Fault(AREA, "the server is killed with a vector open", lambda _: _server_lost())
    yield Fault(AREA, "the server is stopped before a start", lambda _: _server_stops(), GOES_ON)
    yield Fault(AREA, "the server's libraries cannot be loaded", lambda _: _server_cannot_load())


def _server() -> int:
    """Return the number of the server that forks this process's workers."""
    from tasks.processes import forks

    if forks._server is None:
        with _vector(num_workers=1):
            pass
    assert forks._server is not None
    return forks._server._pid  # pyright: ignore[reportPrivateUsage]


def _no_server() -> None:
    server = _server()
    os.kill(server, signal.SIGKILL)
    _play_own()
    assert _server() != server


def _server_lost() -> None:
    server = _server()
    with _vector(num_workers=2) as env:
        env.reset(seed=4)
        pids = _workers(env)
        os.kill(server, signal.SIGKILL)
        _wait_until(lambda: not any(map(_session_of, pids)), "the workers outlive the server")
        error = _failure(lambda: env.step(_actions(env)))
        assert error.env_ids == [0, 1]
        env.restart()
        assert env.step(_actions(env))[0].tobytes() == _play_own()
        raise error


def _server_stops() -> None:
    from tasks.processes import forks

    patience, forks._FORK_SECONDS = forks._FORK_SECONDS, 1.0
    try:
        os.kill(_server(), signal.SIGSTOP)
        _play_own()
    finally:
        forks._FORK_SECONDS = patience


def _server_cannot_load() -> None:
    from tasks.processes import forks

    os.kill(_server(), signal.SIGKILL)
    command = forks._COMMAND
    forks._COMMAND = command.replace("serve(", "raise SystemExit(")
    try:
        _play_own()
    finally:
        forks._COMMAND = command


# -- what all use -------------------------------------------------------------------------------


@contextmanager
def _vector(task_id: str = TASK, num_envs: int = 2, **fields: Any) -> Generator[Any]:
    """Give a vector, and close it in the end."""
    from tasks.fronts.vector import VectorTask
    from tests.tasks.breaking import offered

    with offered(), closing(VectorTask(task_id, num_envs, **{"num_workers": 1, **fields})) as env:
        yield env


def _actions(env: Any) -> Any:
    import numpy as np

    return np.full((env.num_envs, 8), 0.2, np.float32)


def _worker(env: Any, number: int) -> int:
    return env._crew._crew[number].pid


def _workers(env: Any) -> list[int]:
    """Return the processes of a vector that live."""
    return [worker.pid for worker in env._crew._crew.values() if _session_of(worker.pid)]


def _session_of(pid: int) -> int:
    with suppress(OSError):
        state, *rest = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return 0 if state in "ZX" else int(rest[2])
    return 0


def _children() -> set[int]:
    return {child.pid for child in multiprocessing.active_children() if child.pid is not None}


def _open_files() -> int:
    return len(os.listdir("/proc/self/fd")) - 1


@contextmanager
def _later(seconds: float, call: Callable[[], Any]) -> Generator[None]:
    """Call something in a thread after some time (s)."""
    timer = threading.Timer(seconds, call)
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()


def _wait_until(met: Callable[[], Any], otherwise: str) -> None:
    deadline = time.monotonic() + PATIENCE
    while not met():
        assert time.monotonic() < deadline, otherwise
        time.sleep(0.01)
