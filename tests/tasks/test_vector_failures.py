"""Workers that die or hang, and what a vector leaves behind."""

import multiprocessing
import os
import signal
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from layouts import face_to_face
from robot_layouts.core.processes.worker import Worker
from robots import SimulationError, TaskError
from tasks.interfaces.vector import VectorTask
from tasks.interfaces.workers import VectorWorkerError

GONE, LEFT = [0, 1], [2, 3]  # environments of the first worker and of the second
ACTION = np.full((4, 8), 0.2, np.float32)


def workers():
    return sorted(p.pid for p in multiprocessing.active_children())


@pytest.fixture(scope="module")
def shared():
    env = VectorTask("PickCube-v1", num_envs=4, num_workers=2, timeout=30.0)
    yield env
    env.close()


def first_worker(env):
    return env._backend.workers[0].pid


@pytest.mark.long
@pytest.mark.parametrize("how", ["killed", "hung"])
def test_a_worker_that_fails_is_reported_and_replaced(shared, how):
    reference = VectorTask("PickCube-v1", num_envs=4, num_workers=0)
    for env in (shared, reference):
        env.reset(seed=40, options={"reconfigure": True})
        env.step(ACTION)
    victim = first_worker(shared)
    shared._backend.timeout = 30.0 if how == "killed" else 3.0
    os.kill(victim, signal.SIGKILL if how == "killed" else signal.SIGSTOP)
    with pytest.raises(VectorWorkerError) as caught:
        shared.step(ACTION)
    shared._backend.timeout = 30.0
    error = caught.value
    assert error.env_ids == GONE
    assert error.seeds == [40, 41]
    why = "died by SIGKILL" if how == "killed" else "did not reply within 3 s and was ended"
    assert f"worker 0 with environments [0, 1] of seeds [40, 41]: process {victim} {why}" in str(
        error
    )
    assert "restart()" in str(error)

    expected = reference.step(ACTION)
    for result, wanted in zip(error.results[:4], expected[:4], strict=True):
        np.testing.assert_array_equal(result[LEFT], wanted[LEFT])
    with pytest.raises(VectorWorkerError, match=r"environments \[0, 1\]"):
        shared.step(ACTION)
    with pytest.raises(TaskError, match=r"environments \[3\] are not gone"):
        shared.restart({3: 5})

    obs, info = shared.restart({1: 77})
    gone = np.array([True, True, False, False])
    wanted, _ = reference.reset(
        seed=[40, 77, None, None], options={"reset_mask": gone, "reconfigure": True}
    )
    np.testing.assert_array_equal(obs, wanted)
    assert info["elapsed_steps"].tolist() == [0, 0, 2, 2]
    for _ in range(50):  # beyond the end of the episodes
        for result, wanted in zip(shared.step(ACTION)[:4], reference.step(ACTION)[:4], strict=True):
            np.testing.assert_array_equal(result, wanted)
    assert victim not in workers()
    assert len(workers()) == 2


def interrupted(moment, event, matches, call):
    """Call something, and raise KeyboardInterrupt at the nth line or instruction of some code.

    Args:
        moment: n, from 1.
        event: ``line`` or ``opcode``.
        matches: Whether a code object counts.
        call: What is called.

    Returns:
        Whether it was interrupted, which it is not if the code has fewer of them.
    """
    left = moment

    def trace(frame, met, _):
        nonlocal left
        if not matches(frame.f_code):
            return None
        frame.f_trace_opcodes = True
        left -= met == event
        if left == 0:
            raise KeyboardInterrupt
        return trace

    sys.settrace(trace)
    try:
        call()
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(None)
    return False


@pytest.mark.long
def test_a_vector_is_of_use_after_an_interrupt_at_any_instruction_of_a_conversation():
    def talks(code):
        return code.co_filename.endswith(("interfaces/workers.py", "processes/worker.py"))

    with closing(VectorTask("PushCube-v1", num_envs=2, num_workers=2, timeout=5.0)) as env:
        action = np.full((2, 8), 0.2, np.float32)
        env.reset(seed=4)
        wanted = env.step(action)[0]
        moment = 1
        while interrupted(moment, "opcode", talks, lambda: env.step(action)):
            env.reset(seed=4)
            np.testing.assert_array_equal(env.step(action)[0], wanted)
            moment += 1
        assert moment > 200


def test_an_interrupt_as_a_call_begins_locks_nobody_out():
    def begins(code):
        return code.co_filename.endswith("interfaces/vector.py") and code.co_name == "call"

    with closing(VectorTask("PushCube-v1", num_envs=1, num_workers=0)) as env:
        for moment in (1, 2, 3):
            assert interrupted(moment, "line", begins, env.reset)
            env.reset()


@pytest.mark.long
def test_a_restart_that_fails_may_be_tried_again(shared, monkeypatch):
    shared.reset(seed=0)
    workers_of_it, living = shared._backend.workers, first_worker(shared)
    for worker in [*workers_of_it.values()]:
        os.kill(worker.pid, signal.SIGKILL)
    with pytest.raises(VectorWorkerError, match=r"environments \[0, 1\].*environments \[2, 3\]"):
        shared.step(ACTION)
    start, started = Worker.__init__, []

    def doomed(self, *args, **kwargs):
        start(self, *args, **kwargs)
        if not started:
            os.kill(self.pid, signal.SIGKILL)
        started.append(self)

    with monkeypatch.context() as patch:
        patch.setattr(Worker, "__init__", doomed)
        with pytest.raises(VectorWorkerError, match=r"environments \[0, 1\].*died by SIGKILL"):
            shared.restart()
    assert not workers_of_it
    assert not {living, *(worker.pid for worker in started)} & {*workers()}
    shared.restart()
    assert shared.step(ACTION)[4]["elapsed_steps"].tolist() == [1, 1, 1, 1]


def test_closing_leaves_nothing():
    VectorTask("PickCube-v1", num_envs=1, num_workers=1).close()  # what stays is there from now on
    before, open_before = workers(), len(os.listdir("/proc/self/fd"))
    env = VectorTask("PickCube-v1", num_envs=2, num_workers=1)
    assert len(workers()) == len(before) + 1
    assert "memfd:robot-layouts" in Path("/proc/self/maps").read_text()
    shared_maps = Path("/proc/self/maps").read_text().count("memfd:robot-layouts")
    env.close()
    env.close()
    assert workers() == before
    assert len(os.listdir("/proc/self/fd")) == open_before
    assert Path("/proc/self/maps").read_text().count("memfd:robot-layouts") < shared_maps
    with pytest.raises(SimulationError, match="closed"):
        env.step(ACTION[:2])


@pytest.mark.long
def test_what_cannot_be_built_raises_here_and_leaves_nothing():
    before = workers()
    two = face_to_face({"a": "panda", "b": "panda"}, spacing=1.0)
    with pytest.raises(TaskError, match="has the places"):
        VectorTask("PickCube-v1", num_envs=2, num_workers=1, layout=two)
    assert workers() == before
