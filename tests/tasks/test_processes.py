"""Worker processes: how they start, what forks and threads may do, what copies and ends leave."""

import gc
import multiprocessing
import os
import pickle
import signal
import sys
import weakref
from contextlib import closing, contextmanager
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import tasks
from benchmarks.soak import read_level
from robot_layouts.core.processes.transport import packed
from robot_layouts.core.processes.worker import Status, Worker
from robot_layouts.simulation.sapien3.backend import worlds_below
from robots import SimulationError, TaskError
from tasks.interfaces.vector import VectorTask
from tasks.interfaces.workers import VectorWorkerError
from tests.fresh_process import in_fresh_process
from tests.tasks import breaking

TASK = "PushCube-v1"
ACTION = np.full((2, 8), 0.2, np.float32)
PATIENCE = 20.0  # s, for processes to be gone on a busy machine


@pytest.fixture(scope="module", autouse=True)
def tasks_that_break():
    with breaking.offered():
        yield


def vector(workers, task_id=TASK, **fields):
    return closing(VectorTask(task_id, 2, num_workers=workers, **fields))


FRONTS = {
    "task": lambda: tasks.make(TASK, num_envs=2),
    "gymnasium": lambda: gymnasium.make(f"RobotLayouts/{TASK}"),
    "pettingzoo": lambda: tasks.parallel_env(TASK),
    "sb3": lambda: tasks.sb3_vec_env(TASK, 2, num_workers=0),
    "vector": lambda: VectorTask(TASK, 2, num_workers=0),
}


def task_of(env):
    """Return the task behind a front."""
    env = getattr(env, "unwrapped", env)
    env = getattr(env, "vector", env)
    return env._backend.batches[0]._task if hasattr(env, "_backend") else getattr(env, "task", env)


# -- what is left ---------------------------------------------------------------------------------


@contextmanager
def no_collector():
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("front", FRONTS)
def test_worlds_are_freed_at_once_when_they_are_closed_or_nobody_holds_them(front, closed):
    with no_collector():
        env = FRONTS[front]()
        world = weakref.ref(worlds_below(task_of(env).simulation)[0])
        if closed:
            env.reset()
            env.close()
        else:
            del env
        assert world() is None


def levels(workers, first, last):
    """Return what this process holds after some cycles of make, step and close, and after more."""
    found = []
    for cycle in range(1, last + 1):
        with vector(workers) as env:
            env.step(ACTION)
        if cycle in (first, last):
            found.append(read_level())
    return found


@pytest.mark.long
@pytest.mark.parametrize("cycles", [(0, 100, 600), (2, 10, 40)], ids=["here", "with workers"])
def test_nothing_grows_over_hundreds_of_vectors(cycles):
    first, last = in_fresh_process(levels, *cycles)
    assert last.memory - first.memory < 2.0  # MB
    for quantity in ("descriptors", "threads", "processes", "shared"):
        assert getattr(last, quantity) == getattr(first, quantity)


# -- how they start -------------------------------------------------------------------------------


def look_around():
    loaded = {"torch", "sapien", "tasks.interfaces.workers"} <= {*sys.modules}
    status = Path("/proc/self/status").read_text()
    return lambda: (
        (loaded, f"SigBlk:\t{1 << signal.SIGINT - 1:016x}" in status, os.sched_getaffinity(0)),
        (os.environ.get("ROBOT_LAYOUTS_SEEN"), os.getcwd(), np.random.random()),
    )


def asked(make):
    """Return the reply to a request without arguments, and end the worker."""
    worker = Worker(packed(make))
    worker.request()
    while (reply := worker.receive()) is None or reply.request < worker.last:
        assert reply is None or reply.status is Status.DONE
    worker.shutdown(PATIENCE)
    return reply.value


def test_a_worker_finds_the_libraries_loaded_and_everything_else_as_it_is_now(
    monkeypatch, tmp_path
):
    _, (_, _, first) = asked(look_around)
    monkeypatch.setenv("ROBOT_LAYOUTS_SEEN", "now")
    monkeypatch.chdir(tmp_path)
    (loaded, blocks_interrupts, cores), (seen, folder, drawn) = asked(look_around)
    assert loaded
    assert blocks_interrupts
    assert (seen, folder) == ("now", str(tmp_path))
    assert cores == os.sched_getaffinity(0)
    assert drawn != first  # forks of one process draw different numbers all the same


@pytest.mark.long
def test_a_program_that_is_read_from_standard_input_may_have_workers(monkeypatch):
    main = sys.modules["__main__"]
    monkeypatch.setattr(main, "__spec__", None)
    monkeypatch.setattr(main, "__file__", "<stdin>", raising=False)
    asked(look_around)
    assert main.__file__ == "<stdin>"


@pytest.mark.long
def test_a_daemonic_process_may_have_a_vector():
    this = multiprocessing.current_process()
    this.daemon = True
    try:
        with vector(2) as env:
            assert env.step(ACTION)[0].shape == (2, env.single_observation_space.shape[0])
        assert this.daemon
    finally:
        this.daemon = False


# -- errors ---------------------------------------------------------------------------------------


def test_an_error_of_a_task_arrives_with_its_traceback_and_no_hint_that_leads_nowhere():
    with vector(2, "Breaks_evaluate_late-v1") as env:
        env.reset(seed=30)
        with pytest.raises(VectorWorkerError) as caught:
            env.step(ACTION)
    message, cause = str(caught.value), str(caught.value.__cause__)
    assert "worker 0 with environments [0] of seeds [30]: process " in message
    assert "failed in step() with ValueError: on purpose" in message
    assert "__main__" not in message
    assert "Traceback (most recent call last)" in cause
    assert "breaking.py" in cause
    assert "in step" in cause


@pytest.mark.long
def test_a_task_that_cannot_be_built_says_where_and_that_there_is_no_vector():
    with pytest.raises(VectorWorkerError) as caught:
        VectorTask("Breaks_build_soon-v1", 2, num_workers=2)
    message, cause = str(caught.value), str(caught.value.__cause__)
    assert "failed in making its task with ValueError: on purpose" in message
    assert message.endswith("no vector was made")
    assert "breaking.py" in cause


@pytest.mark.long
def test_an_error_of_ours_keeps_its_type_and_says_where_it_came_from():
    with pytest.raises(TaskError, match="no such goal") as caught:
        VectorTask("Refuses-v1", 2, num_workers=1)
    assert "in build" in str(caught.value.__cause__)


# -- forks ----------------------------------------------------------------------------------------


def in_fork(call):
    """Return what a fork says of a call: its result, or its error."""
    read, write = os.pipe()
    pid = os.fork()
    if pid == 0:
        try:
            answer = call()
        except Exception as error:
            answer = error
        os.write(write, pickle.dumps(answer))
        os._exit(0)
    os.close(write)
    with open(read, "rb") as pipe:
        answer = pickle.loads(pipe.read())
    os.waitpid(pid, 0)
    return answer


@pytest.mark.long
def test_pictures_in_a_fork_are_refused_in_the_place_of_a_hang(drawn):
    with closing(tasks.make(TASK, render_mode="rgb_array")) as env:
        picture = env.render()
        rebuild = {"reconfigure": True}
        for call in (
            env.render,
            lambda: env.reset(options=rebuild),
            lambda: tasks.make(TASK, render_mode="rgb_array"),
        ):
            error = in_fork(call)
            assert isinstance(error, SimulationError)
            assert "use spawn in the place of fork" in str(error)
        assert in_fork(lambda: env.close()) is None  # freeing what draws would hang as well
        np.testing.assert_array_equal(env.render(), picture)
