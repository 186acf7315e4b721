"""Episodes are played in processes, and one that dies takes nothing with it."""

import multiprocessing
import os
import pickle
import re
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from robots import TaskError
from rollouts.executor import Event, ProcessExecutor, WorkerError, WorkersDied
from tests.rollouts.plays import DiesOnce, Play, cannot_prepare, dies_before_it_is_ready

ROOT = Path(__file__).parents[2]


def run(prepare, seeds, workers=2):
    return list(ProcessExecutor(workers).run(prepare, seeds))


def squares(events):
    return {event.seed: event.result[1] for event in events if event.result is not None}


@pytest.fixture(autouse=True)
def _no_process_is_left():
    yield
    assert multiprocessing.active_children() == []


@pytest.mark.parametrize("workers", [1, 3])
def test_every_seed_is_played_once(workers):
    events = run(Play(lasts=0.02), range(5, 15), workers)
    assert sorted(event.seed for event in events) == list(range(5, 15))
    assert squares(events) == {seed: seed**2 for seed in range(5, 15)}
    players = {event.result[0] for event in events}
    assert len(players) <= workers  # not all need be ready in time
    assert os.getpid() not in players


def test_nothing_to_play():
    assert run(Play(), []) == []


def test_a_worker_that_dies_is_told_and_its_episode_played_again(tmp_path):
    events = run(Play(tmp_path, dies_at=3), range(6))
    (death,) = [event for event in events if event.died is not None]
    assert death.seed == 3
    assert death.died.endswith("died by SIGKILL")
    assert squares(events) == {seed: seed**2 for seed in range(6)}


def test_an_episode_that_kills_every_worker_is_given_up(tmp_path):
    events = run(Play(tmp_path, dies_at=1, always=True), range(9))
    assert [event.seed for event in events if event.died] == [1, 1, 1]
    (given_up,) = [event for event in events if event.error]
    assert given_up.seed == 1
    assert isinstance(given_up.error, WorkersDied)
    assert re.search("seed 1 ended 3 worker processes; .*SIGKILL", str(given_up.error))
    assert sorted(squares(events)) == [0, *range(2, 9)]


def test_one_attempt(tmp_path):
    executor = ProcessExecutor(1, attempts=1)
    events = list(executor.run(Play(tmp_path, dies_at=1, always=True), range(3)))
    assert [event.seed for event in events if event.died] == [1]
    assert "seed 1 ended 1 worker process; " in str(events[-2].error)
    assert sorted(squares(events)) == [0, 2]


def test_a_fresh_process_for_every_episode():
    events = list(ProcessExecutor(2, fresh=True).run(Play(), range(4)))
    assert len({event.result[0] for event in events}) == 4


def test_what_an_episode_says_of_itself():
    events = list(ProcessExecutor(1).run(Play(says="halfway"), range(2)))
    said = [(event.seed, event.said or event.result[1]) for event in events]
    assert said == [(0, "halfway"), (0, 0), (1, "halfway"), (1, 1)]


def test_ctrl_c_reaches_no_worker():
    """Not even the first one, whose start begins with that of a helper."""
    program = """
        from rollouts.executor import ProcessExecutor
        from tests.rollouts.plays import blocked_signals

        if __name__ == "__main__":
            print(*[event.result for event in ProcessExecutor().run(blocked_signals, [0])])
    """
    words = [sys.executable, "-c", textwrap.dedent(program)]
    said = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert int(said, 16) >> (signal.SIGINT - 1) & 1


def test_an_episode_that_cannot_be_played(tmp_path):
    events = {event.seed: event for event in run(Play(fails_at=1, breaks_at=2), range(4))}
    assert sorted(squares(events.values())) == [0, 3]
    assert events[1] == Event(1, error=events[1].error, worker=events[1].worker)
    assert isinstance(events[1].error, TaskError)
    assert str(events[1].error) == "no plan for 1"
    assert isinstance(events[2].error, WorkerError)
    assert "ZeroDivisionError: division by zero (" in str(events[2].error)
    assert "plays.py:" in str(events[2].error)


def test_workers_that_cannot_begin():
    with pytest.raises(TaskError, match="nothing can be made here"):
        run(cannot_prepare, range(3))
    with pytest.raises(WorkerError, match="3 worker processes died before .* with exit code 7"):
        run(dies_before_it_is_ready, range(3))


def test_a_worker_that_dies_before_it_is_ready_is_replaced(tmp_path):
    events = run(DiesOnce(tmp_path), range(4), workers=1)  # with 2, the other may play all
    (death,) = [event for event in events if event.died is not None]
    assert death.seed is None
    assert squares(events) == {seed: seed**2 for seed in range(4)}


def test_what_cannot_be_sent_is_said():
    with pytest.raises(WorkerError, match="cannot be sent to them: .*lambda.*; a task, an ex"):
        run(lambda: None, range(2))


def test_stopping_early_leaves_no_process():
    events = ProcessExecutor(2).run(Play(lasts=0.05), range(100))
    next(events)
    assert len(multiprocessing.active_children()) == 2
    events.close()


def test_errors_come_home_whole():
    error = WorkerError("words")
    assert str(pickle.loads(pickle.dumps(error))) == "words"
