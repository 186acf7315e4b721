"""What a process holds is read as it is, and only what keeps rising counts as growth."""

import os
import subprocess
import sys
import threading
import time
from contextlib import contextmanager

import pytest

from measurements.soak.process_resources import Level, grown, growth, read_level, worst
from tests.fresh_process import in_fresh_process


def level(memory: float = 0.0, descriptors: float = 0.0) -> Level:
    return Level(memory, descriptors, 1, 0, 0)


@contextmanager
def a_file():
    with open(os.devnull):
        yield


@contextmanager
def memory():
    kept = [b"x" * 20_000_000]
    yield
    kept.clear()


@contextmanager
def a_thread():
    over = threading.Event()
    thread = threading.Thread(target=over.wait)
    thread.start()
    yield
    over.set()
    thread.join()
    while os.path.exists(f"/proc/self/task/{thread.native_id}"):  # the system's end comes later
        time.sleep(0.001)


@contextmanager
def a_process_that_was_not_waited_for():
    process = subprocess.Popen([sys.executable, "-c", ""], stdin=subprocess.DEVNULL)
    yield
    process.wait()


@contextmanager
def shared_memory():
    descriptor = os.memfd_create("a-test")
    yield
    os.close(descriptor)


def levels_around(held) -> tuple[Level, Level, Level]:
    before = read_level()
    with held():
        during = read_level()
    return before, during, read_level()


@pytest.mark.parametrize(
    ("held", "expected"),
    [
        (a_file, {"descriptors": 1}),
        (memory, {"memory": pytest.approx(20e6 / 2**20, abs=1)}),
        (a_thread, {"threads": 1}),
        (a_process_that_was_not_waited_for, {"processes": 1}),
        (shared_memory, {"descriptors": 1, "shared": 1}),
    ],
)
def test_what_is_held_is_counted(held, expected):
    before, during, after = in_fresh_process(levels_around, held)
    for name in ("descriptors", "threads", "processes", "shared"):
        assert getattr(during, name) - getattr(before, name) == expected.get(name, 0)
        assert getattr(after, name) == getattr(before, name)
    added = during.memory - before.memory
    assert added == expected.get("memory", pytest.approx(0, abs=1))


def test_another_process_is_read_by_its_number():
    said = "import os, sys, time; kept = b'x' * 30_000_000; print(flush=True); sys.stdin.read()"
    with subprocess.Popen(
        [sys.executable, "-c", said], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        process.stdout.readline()
        there = read_level(process.pid)
        process.stdin.close()
    assert 28 < there.memory < 60
    assert (there.descriptors, there.threads, there.processes) == (3, 1, 0)
    with pytest.raises(OSError, match=str(process.pid)):
        read_level(process.pid)


def test_what_keeps_rising_grows():
    assert growth([[0, 1, 2, 3, 4, 5, 6, 7, 8]]) == pytest.approx(5)
    assert growth([[0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4]]) > 1  # piece by piece


@pytest.mark.parametrize(
    "values",
    [
        [5, 8, 9, 9, 9, 9, 9, 9, 9],  # warming up
        [3, 3, 3, 3, 3, 3, 9, 9, 9],  # one step up
        [3, 3, 3, 3, 9, 3, 9, 3, 3],
        [9, 9, 9, 9, 8, 7, 6, 5, 4],
        [1],
    ],
)
def test_nothing_else_grows(values):
    assert growth([values]) <= 0


def test_laps_start_where_they_like():
    assert growth([[0, 0, 1, 2, 3, 4], [70, 70, 71, 72, 73, 74]]) == 3


def test_growth_of_every_quantity_and_the_worst():
    one = grown([[level(k, 2 * k) for k in range(9)]])
    other = grown([[level(3 * k, k) for k in range(9)]])
    assert (one.memory, one.descriptors, one.threads) == (5, 10, 0)
    together = worst((one, other))
    assert (together.memory, together.descriptors, together.threads) == (15, 10, 0)
