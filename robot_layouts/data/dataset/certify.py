"""Plays every episode of a recording again, in other processes, and certifies what comes of it."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from robot_layouts.data.dataset.certificate import FILE, Certificate, CheckedEpisode
from robot_layouts.data.playing.executor import Event, Executor, modules_of, play_all
from robot_layouts.data.playing.replay import open_recording, replay
from robot_layouts.data.playing.seeds import checked_seeds
from robot_layouts.data.reading.manifest import sized_file
from robot_layouts.data.reading.recorded_task import task_class, task_for
from robot_layouts.data.reading.recording import Recording, TrajectoryError, all_files, first_file
from robot_layouts.experts.touching import ArmWatch
from tasks import MultiRobotTask

INTERVAL = 10.0  # s between writings of a certificate that is not complete

OnEvent = Callable[[Certificate, Event | None], None]


@dataclass(frozen=True)
class CertifyJob:
    """What workers need to play episodes of a recording again; can be pickled.

    Attributes:
        path: The recording; workers read it at the same place.
        task_id: Its task, ``module:Id`` for one of a module that no package lists, or None.
        cell: Where robots stood and which, where the file cannot say it; see `task_for`.
        task: Class of the task, which other machines may need.
    """

    path: Path
    task_id: str | None
    cell: Mapping[str, Any]
    task: type[MultiRobotTask]

    @property
    def modules(self) -> tuple[str, ...]:
        """What other machines may need to play it."""
        return modules_of(self.task)

    def __call__(self) -> Callable[[int], CheckedEpisode]:
        """Open the recording and make its task in a worker.

        Raises:
            MissingPackageError: If it takes python-fcl to see which arms touch.
            TrajectoryError: If that is impossible here.
        """
        torch.set_num_threads(1)
        return _Certifier(self)


class _Certifier:
    """Plays the episodes of seeds again."""

    def __init__(self, job: CertifyJob) -> None:
        self._file = open_recording(job.path, job.task_id)
        self._task = task_for(self._file, **job.cell)
        self._arms = ArmWatch(self._task)
        self._places = {seed: place for place, seed in enumerate(self._file.seeds)}

    def __call__(self, seed: int) -> CheckedEpisode:
        trajectory = self._file[self._places[seed]]
        if not trajectory.rebuilt or trajectory.states is None:
            raise TrajectoryError(
                f"episode {trajectory.episode_id} cannot be played exactly: it needs the seed of"
                " its reset, which must have built the world anew, and states to compare with"
            )
        pairs: list[set[str]] = []

        def watch() -> None:
            pairs.append({", ".join(sorted(map(str, pair))) for pair in self._arms.touching()})

        replayed = replay(self._task, trajectory, everything=True, watch=watch)
        steps = pairs[1:]  # the first is that after the reset
        touching = Counter(pair for touched in steps for pair in touched)
        return CheckedEpisode(replayed, dict(touching), sum(map(bool, steps)))

    def close(self) -> None:
        self._task.close()
        self._file.close()


def certify(
    path: Path,
    executor: Executor,
    out: Path | None = None,
    *,
    task_id: str | None = None,
    cell: Mapping[str, Any] | None = None,
    on_event: OnEvent = lambda certificate, event: None,
) -> Certificate:
    """Play all episodes of a recording again, and write a certificate.

    It is written every ten seconds, and at the end whatever ends it. If it is there already, for
    these files and versions, and not complete, its episodes are not played again.

    Args:
        path: The recording: an h5 file, a folder or a manifest.
        executor: Who plays.
        out: The certificate; by default ``certificate.json`` beside the recording.
        task_id: The recording's task; ``module:Id`` for one of a module that no package lists.
        cell: Where robots stood and which, where the file cannot say it; see `task_for`.
        on_event: Called once at the start without an event, and after every event.

    Raises:
        TrajectoryError: If the recording cannot be read, is not as its manifest says, or does not
            say the seeds of its episodes.
        RecordingError: If the certificate cannot be written, or something else is in its place.
        WorkerError: If workers cannot be started, or die again and again.
        KeyboardInterrupt: If interrupted.
    """
    out = out or certificate_path(path)
    with open_recording(path, task_id) as file:
        cls = task_class(file, task_id)
        seeds = _seeds(file)
        certificate = _begun(out, Certificate(file.task_id, _files(path, file), len(seeds)))
    on_event(certificate, None)
    job = CertifyJob(path.absolute(), task_id, dict(cell or {}), cls)
    missing, written = [s for s in seeds if s not in certificate.checked], time.monotonic()
    try:
        with closing(play_all(executor, job, missing)) as events:
            for event in events:
                if event.seed is not None and event.error is not None:
                    certificate.note_failure(event.seed, str(event.error))
                elif event.seed is not None and isinstance(event.result, CheckedEpisode):
                    certificate.note(event.seed, event.result)
                on_event(certificate, event)
                if time.monotonic() - written > INTERVAL:
                    certificate.write(out)
                    written = time.monotonic()
    finally:
        certificate.write(out)
    return certificate


def certificate_path(path: Path) -> Path:
    """Return where the certificate of a recording is: in its folder, or beside its one file."""
    first = first_file(path)
    return first.with_name(FILE) if first != path else path.with_suffix(f".{FILE}")


def _seeds(file: Recording) -> list[int]:
    if not len(file):
        raise TrajectoryError(f"{file.path} holds no episodes")
    if lacking := [i for i, seed in enumerate(file.seeds) if seed is None]:
        raise TrajectoryError(f"{file.path} does not say the seed of its episode {lacking[0]}")
    return checked_seeds(seed for seed in file.seeds if seed is not None)


def _files(path: Path, file: Recording) -> list[dict[str, Any]]:
    """Return names, sizes and checksums of all files.

    Raises:
        TrajectoryError: If one is not as the manifest says.
    """
    found: list[dict[str, Any]] = []
    for number, h5 in enumerate(all_files(path)):
        beside = h5.with_suffix(".json")
        sized = {"h5": sized_file(h5), "json": sized_file(beside)}
        if file.manifest is not None:
            entry = file.manifest.files[number]
            if (entry.h5, entry.json) != (sized["h5"], sized["json"]):
                raise TrajectoryError(
                    f"{h5} or its json was changed after it was recorded: its checksum is not that"
                    " of the manifest; resume the recording once, which records damaged episodes"
                    " again"
                )
        found += [
            {"file": p.name, **vars(s)} for p, s in ((h5, sized["h5"]), (beside, sized["json"]))
        ]
    return found


def _begun(out: Path, fresh: Certificate) -> Certificate:
    """Return the certificate that is there already, if it can be gone on with."""
    if not out.exists():
        return fresh
    there = Certificate.read(out)
    same = all(getattr(there, n) == getattr(fresh, n) for n in ("task_id", "files", "versions"))
    return there if same and not there.complete else fresh
