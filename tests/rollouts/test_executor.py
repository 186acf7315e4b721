"""Episodes are played in processes, and one that dies takes nothing with it."""

import multiprocessing
import os
import pickle

import pytest

from robots import TaskError
from rollouts.executor import Event, ProcessExecutor, WorkerError
from tests.rollouts.plays import DiesOnce, Play, cannot_prepare, dies_before_it_is_ready


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
    events = []
    with pytest.raises(WorkerError, match="seed 1 ended 3 worker processes; .*SIGKILL"):  # noqa: PT012
        for event in ProcessExecutor(2).run(Play(tmp_path, dies_at=1, always=True), range(9)):
            events.append(event)
    assert [event.seed for event in events if event.died] == [1, 1, 1]


def test_an_episode_that_cannot_be_played(tmp_path):
    events = {event.seed: event for event in run(Play(fails_at=1, breaks_at=2), range(4))}
    assert sorted(squares(events.values())) == [0, 3]
    assert events[1] == Event(1, error=events[1].error)
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
    events = run(DiesOnce(tmp_path), range(4))
    (death,) = [event for event in events if event.died is not None]
    assert death.seed is None
    assert squares(events) == {seed: seed**2 for seed in range(4)}


def test_what_cannot_be_sent_is_said():
    with pytest.raises(WorkerError, match="cannot be sent to them: .*lambda.*; a task or an exp"):
        run(lambda: None, range(2))


def test_stopping_early_leaves_no_process():
    events = ProcessExecutor(2).run(Play(lasts=0.05), range(100))
    next(events)
    assert len(multiprocessing.active_children()) == 2
    events.close()


def test_errors_come_home_whole():
    error = WorkerError("words")
    assert str(pickle.loads(pickle.dumps(error))) == "words"
