"""A certificate: which files were played again, on what, and whether every bit was the same."""

from __future__ import annotations

import json
import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from typing_extensions import NotRequired, TypedDict

from robot_layouts.core.files import read_json
from robot_layouts.core.pages import plural
from robot_layouts.core.schema import FieldError, Name, Object, check, exactly, length, whole
from robot_layouts.core.writing import write_whole
from robot_layouts.data.playing.environment import versions as installed
from robot_layouts.data.playing.replay import Replayed
from robot_layouts.data.reading.manifest import MOST_EPISODES, spans_of
from robot_layouts.data.reading.summary import MAX_JSON, MAX_SEED
from robots import RecordingError, UnreadableFileError

FORMAT = "robot-layouts certificate 1"
FILE = "certificate.json"
PACKAGES = ("robot-layouts", "sapien", "numpy", "torch")
SHOWN = 100  # episodes that differ, could not be played, or in which arms touch, that are listed

_Count = Annotated[int, whole(0, 2**53)]
_Seed = Annotated[int, whole(0, MAX_SEED)]


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
class Certificate:
    """What was found when a recording was played again; it does not depend on who played.

    Attributes:
        task_id: Id of the task.
        files: Name, size and SHA-256 of each h5 file and json.
        episodes: How many episodes these hold.
        versions: Of what played them.
        checked: Seeds of the episodes that were played.
        equal: How many of these were the same to the last bit.
        steps: Their control steps.
        successes: How many ended in success.
        differing: Seed, step and array of those that were not the same, the first hundred.
        not_played: Seed and reason of those that could not be played, likewise.
        contact_episodes: Episodes in which arms touched each other.
        contact_steps: Control steps in which they did.
        pairs: The same by pair of links.
        touching: Seed, success and number of such steps of these episodes, likewise.
    """

    task_id: str
    files: list[dict[str, Any]]
    episodes: int
    versions: dict[str, str] = field(default_factory=lambda: versions())
    checked: set[int] = field(default_factory=set[int])
    equal: int = 0
    steps: int = 0
    successes: int = 0
    differing: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    not_played: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    contact_episodes: int = 0
    contact_steps: int = 0
    pairs: Counter[str] = field(default_factory=Counter[str])
    touching: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])

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
            self.contact_episodes += 1
            self.contact_steps += checked.touching_steps
            self.pairs.update(checked.touching)
            about = {"success": replayed.success, "steps": checked.touching_steps}
            _keep(self.touching, {"seed": seed, **about})

    def note_failure(self, seed: int, reason: str) -> None:
        """Count an episode that could not be played."""
        self.checked.add(seed)
        _keep(self.not_played, {"seed": seed, "reason": reason})

    def to_json(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            "format": FORMAT,
            "complete": self.complete,
            "holds": self.holds,
            "task": self.task_id,
            "versions": self.versions,
            "files": self.files,
            "episodes": self.episodes,
            "checked": [list(span) for span in spans_of(sorted(self.checked))],
            "equal": self.equal,
            "steps": self.steps,
            "successes": self.successes,
            "differing": self.differing,
            "not_played": self.not_played,
            "arm_contacts": {
                "episodes": self.contact_episodes,
                "steps": self.contact_steps,
                "pairs": dict(sorted(self.pairs.items())),
                "touching": self.touching,
            },
        }

    def write(self, path: Path) -> None:
        """Write it.

        Raises:
            RecordingError: If it cannot be written.
        """
        write_whole(path, json.dumps(self.to_json(), indent=1) + "\n", RecordingError)

    @staticmethod
    def read(path: Path) -> Certificate:
        """Read one.

        Raises:
            RecordingError: If it cannot be read, or is no certificate.
        """
        try:
            found = read_json(path, MAX_JSON)
            check(found, _Certificate, "")
        except UnreadableFileError as error:
            raise RecordingError(str(error)) from error
        except FieldError as error:
            raise RecordingError(f"{path} is no certificate: {error}") from error
        if sum(last - first + 1 for first, last in found["checked"]) > found["episodes"]:
            raise RecordingError(f"{path} is no certificate: it checked more than there is")
        return _from_json(found)


def versions() -> dict[str, str]:
    """Return the versions that bits depend on, and the kind of machine."""
    machine = {"python": platform.python_version(), "machine": platform.machine()}
    return {**machine, **installed(PACKAGES)}


def sentences(certificate: Certificate) -> Sequence[str]:
    """Return a certificate as sentences."""
    c = certificate
    lines = [
        f"{c.equal} of {c.episodes} episodes equal to the last bit, {c.steps} steps, {c.successes}"
        " successes",
        f"arms touched in {plural(c.contact_episodes, 'episode')}"
        + (f", {plural(c.contact_steps, 'step')}: {', '.join(c.pairs)}{_seeds(c)}" * bool(c.pairs)),
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


def _seeds(certificate: Certificate) -> str:
    """Return the first three episodes in which arms touched, as the end of a sentence."""
    named = [
        f"{one['seed']}{'' if one['success'] else ' (no success)'}" for one in certificate.touching
    ][:3]
    more = "" if certificate.contact_episodes <= len(named) else " and others"
    return f"; seeds {', '.join(named)}{more}" if named else ""


def _keep(listed: list[dict[str, Any]], entry: dict[str, Any]) -> None:
    """Keep the first hundred in the order of seeds."""
    listed.append(entry)
    listed.sort(key=lambda one: one["seed"])
    del listed[SHOWN:]


def _from_json(found: Mapping[str, Any]) -> Certificate:
    contacts = found["arm_contacts"]
    as_they_are = ("files", "episodes", "versions", "equal", "steps", "successes")
    return Certificate(
        task_id=found["task"],
        **{name: found[name] for name in (*as_they_are, "differing", "not_played")},
        checked={seed for first, last in found["checked"] for seed in range(first, last + 1)},
        contact_episodes=contacts["episodes"],
        contact_steps=contacts["steps"],
        pairs=Counter(contacts["pairs"]),
        touching=contacts.get("touching", []),
    )
