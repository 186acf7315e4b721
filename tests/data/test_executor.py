"""Episodes are played in processes, and one that dies takes nothing with it."""

import multiprocessing
import os
import random
import re
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import torch

import robot_layouts.data.playing.scheduler
from robot_layouts.data.playing.executor import (
    InProcessExecutor,
    ProcessExecutor,
    WorkerError,
    choose_executor,
)
from robot_layouts.data.playing.scheduler import Event
from robots import TaskError
from tests.data.plays import EveryOtherDies, Play, SaysAndRests, makes_what_cannot_be_pickled

ROOT = Path(__file__).parents[2]


def run(prepare, seeds, workers=2):
    return list(ProcessExecutor(workers).run(prepare, seeds))


def squares(events):
    return {event.seed: event.result[1] for event in events if event.result is not None}


@pytest.fixture(autouse=True)
def _no_process_is_left():
    yield
    assert multiprocessing.active_children() == []


@pytest.mark.parametrize("workers", [pytest.param(1, marks=pytest.mark.long), 3])
def test_every_seed_is_played_once(workers):
    events = run(Play(lasts=0.02), range(5, 15), workers)
    assert sorted(event.seed for event in events) == list(range(5, 15))
    assert squares(events) == {seed: seed**2 for seed in range(5, 15)}
    players = {event.result[0] for event in events}
    assert len(players) <= workers  # not all need be ready in time
    assert os.getpid() not in players


def test_a_worker_that_dies_is_told_and_its_episode_played_again(tmp_path):
    events = run(Play(tmp_path, dies_at=3), range(6))
    (death,) = [event for event in events if event.died is not None]
    assert death.seed == 3
    assert death.died.endswith("died by SIGKILL")
    assert squares(events) == {seed: seed**2 for seed in range(6)}


@pytest.mark.long
def test_a_fresh_process_for_every_episode():
    events = list(ProcessExecutor(2, fresh=True).run(Play(), range(4)))
    assert len({event.result[0] for event in events}) == 4


@pytest.mark.long
def test_what_an_episode_says_of_itself():
    events = list(ProcessExecutor(1).run(Play(says="halfway"), range(2)))
    said = [(event.seed, event.note or event.result[1]) for event in events]
    assert said == [(0, "halfway"), (0, 0), (1, "halfway"), (1, 1)]


def test_episodes_that_cannot_be_played():
    events = {e.seed: e for e in run(Play(fails_at=1, breaks_at=2, leaves_at=3), range(5), 1)}
    assert squares(events.values()) == {0: 0, 4: 16}
    assert events[1] == Event(1, error=events[1].error, worker=events[1].worker)
    assert isinstance(events[1].error, TaskError)
    assert str(events[1].error) == "no plan for 1"
    place = r"\(.*plays\.py:\d+, in play\)"
    assert isinstance(events[2].error, WorkerError)
    assert re.fullmatch(rf"ZeroDivisionError: division by zero {place}", str(events[2].error))
    assert "in play\n    return 1 / 0" in str(events[2].error.__cause__)
    assert re.fullmatch(rf"SystemExit: enough {place}", str(events[3].error))


@pytest.mark.long
def test_deaths_are_counted_from_the_last_worker_that_was_ready(tmp_path):
    events = list(ProcessExecutor(1, fresh=True).run(EveryOtherDies(tmp_path), range(4)))
    assert len([event for event in events if event.died is not None]) == 4
    assert len(squares(events)) == 4


def test_stopping_early_leaves_no_process():
    events = ProcessExecutor(2).run(Play(lasts=0.05), range(100))
    next(events)
    assert len(multiprocessing.active_children()) == 2
    events.close()


# -- deadlines -----------------------------------------------------------------------------------


@pytest.mark.long
def test_a_word_shows_that_an_episode_goes_on():
    executor = ProcessExecutor(1, episode_timeout=3.0)
    events = list(executor.run(SaysAndRests(words=5, pause=1.0), [2]))
    assert [event.died for event in events] == [None] * 6
    assert squares(events) == {2: 4}


@pytest.mark.long
def test_long_silence_is_said(monkeypatch):
    monkeypatch.setattr(robot_layouts.data.playing.scheduler, "QUIET_SECONDS", 1.0)
    said = [event.note for event in run(Play(lasts=2.5), [3]) if event.note]
    patterns = [
        r"no message for \d s: process \d+ has been getting ready for \d s",
        r"no message for \d s: process \d+ has been playing seed 3 for \d s",
    ]
    assert re.fullmatch(patterns[1], said[-1])
    assert all(re.fullmatch("|".join(patterns), line) for line in said)


# -- what cannot be sent, loaded or understood ---------------------------------------------------


@pytest.mark.long
def test_results_that_cannot_be_sent():
    (event,) = run(makes_what_cannot_be_pickled, [0])
    assert "pickle" in str(event.error)
    assert isinstance(event.error, WorkerError)


# -- who plays -----------------------------------------------------------------------------------


def test_this_process_keeps_its_own_settings():
    def prepare():
        torch.set_num_threads(1)
        torch.manual_seed(1)
        return play

    def play(seed):
        return torch.get_num_threads(), random.random(), np.random.rand(), float(torch.rand(1))

    def draws():
        random.seed(2)
        np.random.seed(2)
        torch.manual_seed(2)
        numbers = [(random.random(), np.random.rand(), float(torch.rand(1)))]
        for event in InProcessExecutor().run(prepare, [0, 1]) if playing else [None, None]:
            assert event is None or event.result[0] == 1
            numbers.append((random.random(), np.random.rand(), float(torch.rand(1))))
        return numbers

    threads = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        playing = False
        undisturbed = draws()
        playing = True
        assert draws() == undisturbed
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(threads)


def test_threads_that_play_in_this_process_take_turns():
    def play(seed):
        random.seed(seed)
        first = random.random()
        time.sleep(0.001)
        return first, random.random()

    def draws(_):
        return [event.result for event in InProcessExecutor().run(lambda: play, range(20))]

    before = random.getstate()
    with ThreadPoolExecutor(3) as pool:
        alone, *others = pool.map(draws, range(3))
    assert others == [alone] * 2
    assert random.getstate() == before


def test_who_is_chosen():
    assert isinstance(choose_executor(0), InProcessExecutor)
    assert choose_executor().workers == len(os.sched_getaffinity(0))
    assert choose_executor(3).workers == 3
    own = ProcessExecutor(2)
    assert choose_executor(executor=own) is own
    for contradiction in ({"workers": 1}, {"episode_timeout": 5.0}):
        with pytest.raises(TaskError, match="an executor knows its own workers and episode"):
            choose_executor(executor=own, **contradiction)
    with pytest.raises(TaskError, match="with workers=0 this process plays, and nothing could end"):
        choose_executor(0, episode_timeout=5.0)
