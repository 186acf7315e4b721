"""``robot-layouts certify``: every episode of a recording is played again, to the last bit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from robot_layouts.core.cli import Word
from robot_layouts.core.commands import printable
from robot_layouts.data.playing.command_options import GOES_ON, Players, RecordingOption, stoppable
from robots import TaskError

if TYPE_CHECKING:
    from robot_layouts.core.progress import Progress
    from robot_layouts.data.dataset.certificate import Certificate
    from robot_layouts.data.playing.executor import Event


def certify(
    recording: RecordingOption,
    *,
    players: Players,
    out: Annotated[Path, Word("JSON")] | None = None,
) -> int:
    """Play every episode of a recording again, and certify that every bit is the same.

    Compares states, rewards and flags of every step, and counts contacts between arms in every step
    of physics. The same command goes on where it was stopped. With --ray, every machine must find
    the recording at the same place. Exit code: 0 if everything is equal, 1 if not, 2 for bad usage,
    130 if interrupted.

    Args:
        recording: The recording.
        players: Who plays.
        out: The certificate (certificate.json beside it).

    Raises:
        RobotLayoutsError: If it cannot be certified.
    """
    from robot_layouts.core.progress import Progress
    from robot_layouts.data.dataset import certify as certifying
    from robot_layouts.data.dataset.certificate import sentences
    from robot_layouts.data.playing.replay import find_official
    from tasks import get_task_class

    path = recording.file
    if path is None:
        if recording.task is None:
            raise TaskError("neither a recording nor a task is given to certify")
        path = find_official(get_task_class(recording.task).task_id)
    executor, line = players.executor(), Progress(unit="episodes")
    with stoppable(lambda: GOES_ON), line:
        certificate = certifying.certify(
            path,
            executor,
            out,
            task_id=recording.task,
            cell=recording.cell.making(),
            on_event=_Status(line).show,
        )
    print(printable(f"{out or certifying.certificate_path(path)}: {certificate.task_id}"))
    for sentence in sentences(certificate):
        print(printable(sentence))
    return 0 if certificate.holds else 1


class _Status:
    """How far it is, and what happens on the way."""

    def __init__(self, line: Progress) -> None:
        self._line = line

    def show(self, certificate: Certificate, event: Event | None) -> None:
        """Tell how far it is."""
        self._line.total = certificate.episodes
        if event is None and certificate.checked:
            self._line.say(f"{len(certificate.checked)} episodes were played before")
        if event is not None and event.news is not None:
            self._line.say(event.news)
        if event is not None and event.error is not None:
            self._line.say(f"seed {event.seed} cannot be played: {event.error}")
        done = len(certificate.checked)
        self._line.update(done, f"certifying, {certificate.equal} equal")
