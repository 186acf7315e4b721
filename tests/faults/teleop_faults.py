"""Teleoperation: what policies ask of a session that it cannot do, and what it keeps."""

from __future__ import annotations

import resource
import signal
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

import tasks
from robot_layouts.data.reading.recording import FILE, Recording
from robot_layouts.data.recording.recorder import Recorder
from robot_layouts.data.teleop.session import Session
from robots import RecordingError
from tests.faults.fault import GOES_ON, Fault

AREA = "teleoperation"
HOME = (0.0, 0.0, 0.3, 0.0, 1.0, 0.0, 0.0)


def _raises(error: BaseException) -> Callable[[Any], Any]:
    def policy(observation: Any) -> Any:
        raise error

    return policy


POLICIES: dict[str, Any] = {
    "raises": _raises(KeyError("layer9")),
    "ends the program": _raises(SystemExit("enough")),
    "returns nothing": lambda observation: None,
    "returns too few numbers": lambda observation: np.zeros(7),
    "is no function": 5,
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for what, policy in POLICIES.items():
        yield Fault(AREA, f"a policy {what}", partial(_advised, policy))
    yield Fault(AREA, "the disk is full when an episode is kept", _full_disk, GOES_ON)
    yield Fault(AREA, "an arm is to go a thousand kilometres away", _far, GOES_ON)


@cache
def _task() -> tasks.TaskEnv:
    return tasks.make("PickCube-v1")


def _advised(policy: Any, folder: Path) -> None:
    session = Session(_task(), policy=policy)
    try:
        session.step()
    finally:
        assert not session.actions


def _full_disk(folder: Path) -> str:
    with Recorder(folder / FILE, _task()) as recorder:
        session = Session(_task(), recorder)
        session.step()
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))
        try:
            session.keep()
        except RecordingError as error:
            said = str(error).rpartition(": ")[2]
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
            signal.signal(signal.SIGXFSZ, before)
        assert len(session.actions) == 1
        session.keep()
    with Recording(folder / FILE) as file:
        assert len(file) == 1
    return f"{said}; the episode is there, and kept once there is room"


def _far(folder: Path) -> None:
    session = Session(_task())
    session.aim("arm", (1e6, *HOME[1:]))
    for _ in range(3):
        session.step()
    assert np.isfinite(session.actions).all()
