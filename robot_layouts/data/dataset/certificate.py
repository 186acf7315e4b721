"""Plays every episode of a recording again, and certifies whether every bit is the same."""

from __future__ import annotations

import json
import platform
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any

from typing_extensions import NotRequired, TypedDict

from robot_layouts.core.files import read_json
from robot_layouts.core.pages import plural
from robot_layouts.core.schema import FieldError, Name, Object, check, exactly, length, whole
from robot_layouts.core.writing import write_whole
from robot_layouts.data.playing.environment import versions as installed
from robot_layouts.data.playing.executor import Executor, checked_seeds, play_all
from robot_layouts.data.playing.replay import (
    RecordedJob,
    Replayed,
    open_recording,
    replay,
)
from robot_layouts.data.playing.scheduler import Event
from robot_layouts.data.reading.hub import on_hub
from robot_layouts.data.reading.json_files import (
    MAX_JSON,
    MAX_SEED,
    MOST_EPISODES,
    TrajectoryError,
    sized_file,
    spans_of,
)
from robot_layouts.data.reading.recording import Recording, Trajectory, all_files, first_file
from robot_layouts.experts.touching import ArmWatch
from robots import RecordingError, UnreadableFileError
from tasks import TaskEnv

FORMAT = "robot-layouts certificate 1"
FILE = "certificate.json"
PACKAGES = ("robot-layouts", "sapien", "numpy", "torch")
SHOWN = 100  # episodes that differ, could not be played, or in which arms touch, that are listed

_Count = Annotated[int, whole(0, 2**53)]
_Seed = Annotated[int, whole(0, MAX_SEED)]
INTERVAL = 10.0  # s between writings of a certificate that is not complete


class _Contacts(TypedDict):
    episodes: _Count
    steps: _Count
    pairs: Object
    touching: NotRequired[list[Object]]


class _Certificate(TypedDict):
    format: Annotated[str, exactly(FORMAT)]
    complete: bool
    task: Name
    versions: Object
    files: list[Object]
    episodes: Annotated[int, whole(0, MOST_EPISODES)]
    checked: list[Annotated[list[_Seed], length(2)]]
    equal: _Count
    steps: _Count
    successes: _Count
    differing: list[Object]
    not_played: list[Object]
    arm_contacts: _Contacts


@dataclass(frozen=True)
class CheckedEpisode:
    """An episode that was played again, and in how many of its steps arms touched.

    Attributes:
        replayed: Whether it is the same.
        touching: Control steps in which links of different arms touched, by pair of links.
        touching_steps: Control steps in which any did.
    """

    replayed: Replayed
    touching: dict[str, int]
    touching_steps: int


@dataclass
class TouchingArms:
    """The episodes of a recording in which arms touched each other.

    Attributes:
        episodes: How many there are.
        steps: Control steps in which they did.
        pairs: The same by pair of links.
        touching: Seed, success and number of such steps of these episodes, the first hundred.
    """

    episodes: int = 0
    steps: int = 0
    pairs: dict[str, int] = field(default_factory=dict[str, int])
    touching: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])


@dataclass
class RecordingCertificate:
    """What was found when a recording was played again; it does not depend on who played.

    Attributes:
        task: Id of the task.
        versions: Of what played them.
        files: Name, size and SHA-256 of each h5 file and json.
        episodes: How many episodes these hold.
        checked: Seeds of the episodes that were played.
        equal: How many of these were the same to the last bit.
        steps: Their control steps.
        successes: How many ended in success.
        differing: Seed, step and array of those that were not the same, the first hundred.
        not_played: Seed and reason of those that could not be played, likewise.
        arm_contacts: Those in which arms touched each other.
    """

    task: str
    versions: dict[str, str]
    files: list[dict[str, Any]]
    episodes: int
    checked: set[int] = field(default_factory=set[int])
    equal: int = 0
    steps: int = 0
    successes: int = 0
    differing: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    not_played: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    arm_contacts: TouchingArms = field(default_factory=TouchingArms)

    @property
    def complete(self) -> bool:
        """Whether every episode was played."""
        return len(self.checked) == self.episodes

    @property
    def holds(self) -> bool:
        """Whether every episode was played, and was the same to the last bit."""
        return self.complete and self.equal == self.episodes

    def note(self, seed: int, checked: CheckedEpisode) -> None:
        """Count an episode."""
        replayed = checked.replayed
        self.checked.add(seed)
        self.steps += replayed.steps
        self.successes += replayed.success
        if (differs := replayed.difference) is None:
            self.equal += 1
        else:
            _keep(self.differing, {"seed": seed, "step": differs.step, "array": differs.array})
        if checked.touching:
            arms, steps = self.arm_contacts, checked.touching_steps
            arms.episodes += 1
            arms.steps += steps
            for pair, touched in checked.touching.items():
                arms.pairs[pair] = arms.pairs.get(pair, 0) + touched
            _keep(arms.touching, {"seed": seed, "success": replayed.success, "steps": steps})

    def note_failure(self, seed: int, reason: str) -> None:
        """Count an episode that could not be played."""
        self.checked.add(seed)
        _keep(self.not_played, {"seed": seed, "reason": reason})

    def to_json(self) -> dict[str, Any]:
        """Return it as plain data."""
        arms = self.arm_contacts
        return {
            "format": FORMAT,
            "complete": self.complete,
            "holds": self.holds,
            **vars(self),
            "checked": spans_of(sorted(self.checked)),
            "arm_contacts": {**vars(arms), "pairs": dict(sorted(arms.pairs.items()))},
        }

    def write(self, path: Path) -> None:
        """Write it.

        Raises:
            RecordingError: If it cannot be written.
        """
        write_whole(path, json.dumps(self.to_json(), indent=1) + "\n", RecordingError)

    @staticmethod
    def read(path: Path) -> RecordingCertificate:
        """Read one.

        Raises:
            RecordingError: If it cannot be read, or is no certificate.
        """
        try:
            found = check(read_json(path, MAX_JSON), _Certificate, "")
        except UnreadableFileError as error:
            raise RecordingError(str(error)) from error
        except FieldError as error:
            raise RecordingError(f"{path} is no certificate: {error}") from error
        if sum(last - first + 1 for first, last in found["checked"]) > found["episodes"]:
            raise RecordingError(f"{path} is no certificate: it checked more than there is")
        spans = found["checked"]
        found["checked"] = {seed for first, last in spans for seed in range(first, last + 1)}
        found["arm_contacts"] = TouchingArms(**found["arm_contacts"])
        own = fields(RecordingCertificate)
        return RecordingCertificate(**{one.name: found[one.name] for one in own})


def versions() -> dict[str, str]:
    """Return the versions that bits depend on, and the kind of machine."""
    machine = {"python": platform.python_version(), "machine": platform.machine()}
    return {**machine, **installed(PACKAGES)}


def sentences(certificate: RecordingCertificate) -> Sequence[str]:
    """Return a certificate as sentences."""
    c, arms = certificate, certificate.arm_contacts
    lines = [
        f"{c.equal} of {c.episodes} episodes equal to the last bit, {c.steps} steps, {c.successes}"
        " successes",
        f"arms touched in {plural(arms.episodes, 'episode')}"
        + f", {plural(arms.steps, 'step')}: {', '.join(arms.pairs)}{_seeds(arms)}"
        * bool(arms.pairs),
    ]
    if c.differing:
        first = c.differing[0]
        lines.append(
            f"first difference: seed {first['seed']}, step {first['step']} in {first['array']}"
        )
    if c.not_played:
        first = c.not_played[0]
        lines.append(f"not played: seed {first['seed']}: {first['reason']}")
    if not c.complete:
        lines.append(f"not complete: {len(c.checked)} of {c.episodes} were played")
    return lines


def _seeds(arms: TouchingArms) -> str:
    """Return the first three episodes in which arms touched, as the end of a sentence."""
    named = [f"{one['seed']}{'' if one['success'] else ' (no success)'}" for one in arms.touching][
        :3
    ]
    more = "" if arms.episodes <= len(named) else " and others"
    return f"; seeds {', '.join(named)}{more}" if named else ""


def _keep(listed: list[dict[str, Any]], entry: dict[str, Any]) -> None:
    """Keep the first hundred in the order of seeds."""
    listed.append(entry)
    listed.sort(key=lambda one: one["seed"])
    del listed[SHOWN:]


OnEvent = Callable[[RecordingCertificate, Event | None], None]


@dataclass(frozen=True)
class CertifyJob(RecordedJob):
    """Episodes that are played again and certified."""

    def tools(self, task: TaskEnv) -> ArmWatch:
        """Return what sees which arms touch.

        Raises:
            MissingPackageError: If it takes python-fcl to see it.
        """
        return ArmWatch(task)

    def play(self, task: TaskEnv, episode: Trajectory, tools: ArmWatch) -> CheckedEpisode:
        """Play an episode again.

        Raises:
            TrajectoryError: If it cannot be played exactly.
        """
        if not episode.rebuilt or episode.states is None:
            raise TrajectoryError(
                f"episode {episode.episode_id} cannot be played exactly: it needs the seed of"
                " its reset, which must have built the world anew, and states to compare with"
            )
        pairs: list[set[str]] = []

        def watch() -> None:
            pairs.append({", ".join(sorted(map(str, pair))) for pair in tools.touching()})

        replayed = replay(task, episode, everything=True, watch=watch)
        steps = pairs[1:]  # the first is that after the reset
        touching = Counter(pair for touched in steps for pair in touched)
        return CheckedEpisode(replayed, dict(touching), sum(map(bool, steps)))


def certify(
    path: Path,
    executor: Executor,
    out: Path | None = None,
    *,
    task_id: str | None = None,
    cell: Mapping[str, Any] | None = None,
    on_event: OnEvent = lambda certificate, event: None,
) -> RecordingCertificate:
    """Play all episodes of a recording again, and write a certificate.

    It is written every ten seconds, and at the end whatever ends it. If it is there already, for
    these files and versions, and not complete, its episodes are not played again.

    Args:
        path: The recording: an h5 file, a folder or a manifest.
        executor: Who plays.
        out: The certificate; by default ``certificate.json`` beside the recording, if that is on
            this machine.
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
    if out is None and on_hub(path):
        raise RecordingError(f"{path} has no room for its certificate; say where (--out)")
    out = out or certificate_path(path)
    with open_recording(path, task_id) as file:
        seeds = _seeds_of(file)
        places = {seed: place for place, seed in enumerate(seeds)}
        job = CertifyJob.of(file, places, cell)
        certificate = _begun(
            out, RecordingCertificate(file.task_id, versions(), _files(path, file), len(seeds))
        )
    on_event(certificate, None)
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


def _seeds_of(file: Recording) -> list[int]:
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
            if (entry["h5"], entry["json"]) != (sized["h5"], sized["json"]):
                raise TrajectoryError(
                    f"{h5} or its json was changed after it was recorded: its checksum is not that"
                    " of the manifest; resume the recording once, which records damaged episodes"
                    " again"
                )
        found += [{"file": p.name, **s} for p, s in ((h5, sized["h5"]), (beside, sized["json"]))]
    return found


def _begun(out: Path, fresh: RecordingCertificate) -> RecordingCertificate:
    """Return the certificate that is there already, if it can be gone on with."""
    if not out.exists():
        return fresh
    there = RecordingCertificate.read(out)
    same = all(getattr(there, n) == getattr(fresh, n) for n in ("task", "files", "versions"))
    return there if same and not there.complete else fresh
