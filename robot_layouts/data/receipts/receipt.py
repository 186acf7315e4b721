"""A receipt: who played which task, made how, on what machine, and a digest of every state."""

from __future__ import annotations

import json
from base64 import b64decode
from binascii import Error as NotBase64
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from hashlib import sha256
from os import PathLike
from statistics import mean
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray
from typing_extensions import NotRequired, TypedDict

from robot_layouts.core.files import read_json
from robot_layouts.core.schema import (
    AnyText,
    Digest,
    FieldError,
    Finite,
    Name,
    Object,
    check,
    exactly,
    whole,
    within,
)
from robot_layouts.core.writing import write_whole
from robot_layouts.data.playing.evaluation_job import BYTES, PictureTrace
from robot_layouts.data.reading.json_files import MAX_SEED, MAX_STEPS
from robots import RobotLayoutsError, UnreadableFileError

FORMAT = "robot-layouts receipt 1"
FORMAT_WITH_PICTURES = "robot-layouts receipt 2"
MAX_BYTES = 2**27  # of a file; 100,000 episodes of 200 steps take a half

# A module before a task's id would be imported.
_Id = Annotated[str, Meta(pattern="^[^:]{1,200}\\Z", description="a task's id, without a module")]
_Task = TypedDict("_Task", {"id": _Id, "class": Name, "sha256": Digest | None})


class _Policy(TypedDict):
    kind: Name
    name: Name
    sha256: Digest | None
    files: NotRequired[Object]


class _Making(TypedDict):
    layout: Object


class _Environment(TypedDict):
    versions: Object
    processor: Object
    variables: NotRequired[AnyText]
    graphics: NotRequired[Object]


class _Pictures(TypedDict):
    interval: Annotated[int, whole(1, MAX_STEPS)]


class _PictureTrace(TypedDict):
    pictures: Digest
    trace: AnyText


class _ReceiptEpisode(TypedDict):
    seed: Annotated[int, whole(0, MAX_SEED)]
    success: bool
    steps: Annotated[int, whole(0, MAX_STEPS)]
    total: Finite
    states: Digest
    trace: AnyText
    reason: NotRequired[AnyText]
    stage_score: NotRequired[Annotated[float, within(0, 1)] | None]
    pictures: NotRequired[dict[Name, _PictureTrace]]


class _Receipt(TypedDict):
    format: Annotated[str, exactly(FORMAT, FORMAT_WITH_PICTURES)]
    hash: Digest
    task: _Task
    policy: _Policy
    making: _Making
    environment: _Environment
    pictures: NotRequired[_Pictures]
    episodes: list[_ReceiptEpisode]


class ReceiptError(RobotLayoutsError, ValueError):
    """A receipt that cannot be read, or whose episodes cannot be played again here."""


@dataclass(frozen=True)
class EpisodeReceipt:
    """How one episode went.

    Attributes:
        seed: Its seed.
        success: Whether its last step was a success.
        steps: Its control steps.
        total: The sum of its rewards, its return.
        states: SHA-256, in hex, over all states: after the reset and after each step.
        trace: The first two bytes of that digest as it stood at each of these moments, in base64.
        reason: Why it failed, in words, if that is known; of an expert, it is.
        pictures: Of the pictures that were observed, by camera and texture, such as
            ``base_camera/rgb``: ``pictures``, a SHA-256 in hex over the SHA-256 of each, and
            ``trace``, the first two bytes of each, in base64.
        stage_score: That of the last stage it passed; None of a task without stages, or if it took
            no step.
    """

    seed: int
    success: bool
    steps: int
    total: float
    states: str
    trace: str
    reason: str = ""
    pictures: Mapping[str, Mapping[str, str]] = field(
        default_factory=dict[str, Mapping[str, str]], hash=False
    )
    stage_score: float | None = None

    def __post_init__(self) -> None:
        """Refuse values that no episode has.

        Raises:
            ReceiptError: If a value is of another kind, or the trace has another length.
        """
        about = f"the episode of seed {self.seed!r}"
        vars(self).update(check(asdict(self), _ReceiptEpisode, about, ReceiptError))
        if _length(self.trace) != BYTES * (self.steps + 1):
            raise ReceiptError(
                f"the episode of seed {self.seed}: its trace must be {BYTES * (self.steps + 1)}"
                f" bytes in base64, {BYTES} for the reset and for each of {self.steps} steps"
            )

    def digests(self) -> NDArray[np.uint8]:
        """Return the first bytes of the digest after the reset and each step, (steps + 1, 2)."""
        return _rows(self.trace)

    def picture_digests(self) -> dict[str, NDArray[np.uint8]]:
        """Return the first bytes of the digest of each picture, (M, 2), by camera and texture."""
        return {name: _rows(about["trace"]) for name, about in self.pictures.items()}

    def picture_trace(self, name: str) -> PictureTrace:
        """Return what identifies the pictures of one camera and texture."""
        return PictureTrace(**self.pictures[name])


@dataclass(frozen=True)
class Receipt:
    """What was evaluated, and the results.

    Attributes:
        task: ``id``, ``class`` (``module:Class``) and ``sha256`` of the module's source.
            See `robot_layouts.data.receipts.provenance.describe_task`.
        policy: ``kind`` (``expert`` or ``policy``), ``name`` (``module:name``), ``sha256`` of its
            module's source, and more; see `robot_layouts.data.receipts.provenance.describe_policy`.
        making: What the task was made with: its ``layout`` with the checksums of robot files, and
            more; see `robot_layouts.data.receipts.provenance.describe_making`.
        environment: ``versions`` and ``processor`` of where it was played; see
            `environment`. ``others``, if workers differed; ``guessed``, where the
            files of robots were that no registry knows; ``variables``, names of environment
            variables that the policy's source reads and that were set; ``graphics``, on what
            pictures were drawn, see
            `robot_layouts.simulation.backend.Backend.describe_graphics`.
        episodes: One for each seed, in the order in which these were given.
        pictures: ``interval``: pictures after the reset and each so many-th control step have a
            digest. Empty if none have.
        claimed: The hash that a file says it has; empty if it comes from no file.
    """

    task: Mapping[str, Any]
    policy: Mapping[str, Any]
    making: Mapping[str, Any]
    environment: Mapping[str, Any]
    episodes: tuple[EpisodeReceipt, ...]
    pictures: Mapping[str, Any] = field(default_factory=dict[str, Any])
    claimed: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        """Refuse parts that no receipt has.

        Raises:
            ReceiptError: If a part is of another kind, or there are no episodes, or one twice.
        """
        kinds = {"task": _Task, "policy": _Policy, "making": _Making, "environment": _Environment}
        for name, kind in kinds.items():
            check(getattr(self, name), kind, name, ReceiptError)
        seeds = Counter(episode.seed for episode in self.episodes)
        if not seeds:
            raise ReceiptError("a receipt has one episode or more; this has none")
        if twice := [seed for seed, count in seeds.items() if count > 1]:
            raise ReceiptError(f"a receipt has each seed once; this has seed {twice[0]} twice")
        if self.pictures:
            check(self.pictures, _Pictures, "pictures", ReceiptError)
        for episode in self.episodes:
            self._check_pictures(episode)

    def _check_pictures(self, episode: EpisodeReceipt) -> None:
        if episode.pictures and not self.pictures:
            raise ReceiptError(
                f"the episode of seed {episode.seed} has digests of pictures, and the receipt does"
                ' not say of which; "pictures" must say their "interval"'
            )
        for name, about in episode.pictures.items():
            moments = episode.steps // self.pictures["interval"] + 1
            if _length(about["trace"]) != BYTES * moments:
                raise ReceiptError(
                    f"the episode of seed {episode.seed}: the trace of its pictures {name} must be"
                    f" {BYTES * moments} bytes in base64, {BYTES} for each of {moments}"
                )

    @property
    def hash(self) -> str:
        """SHA-256, in hex, of everything but the environment."""
        return _hash(self._content())

    @property
    def success_rate(self) -> float:
        """The share of episodes that ended in success."""
        return mean(episode.success for episode in self.episodes)

    @property
    def untouched(self) -> bool:
        """Whether the content is what its file's hash says; True if it comes from no file."""
        return self.claimed in ("", self.hash)

    def write(self, path: str | PathLike[str]) -> None:
        """Write it as json, whole or not at all.

        Raises:
            UnwritableFileError: If it cannot be written (also an ``OSError``).
        """
        form = FORMAT_WITH_PICTURES if self.pictures else FORMAT
        head = {"format": form, "hash": self.hash, **self._content()}
        head["environment"] = self.environment
        episodes = ",\n".join(f"  {json.dumps(episode)}" for episode in head.pop("episodes"))
        text = json.dumps(head, indent=1).removesuffix("\n}")
        write_whole(path, f'{text},\n "episodes": [\n{episodes}\n ]\n}}\n')

    @classmethod
    def read(cls, path: str | PathLike[str]) -> Receipt:
        """Read one.

        Raises:
            ReceiptError: If the file cannot be read, or is no receipt.
        """
        try:
            found = read_json(path, MAX_BYTES)
            check(found, _Receipt, "")
            episodes = tuple(_episode(about) for about in found["episodes"])
            parts = {name: found[name] for name in ("task", "policy", "making", "environment")}
            return cls(
                **parts,
                episodes=episodes,
                pictures=found.get("pictures", {}),
                claimed=found["hash"],
            )
        except UnreadableFileError as error:
            raise ReceiptError(str(error)) from error
        except (FieldError, ReceiptError) as error:
            raise ReceiptError(f"{path} is no receipt: {error}") from error

    def _content(self) -> dict[str, Any]:
        """Return everything but the environment, as plain data."""
        return {
            "task": self.task,
            "policy": self.policy,
            "making": self.making,
            **({"pictures": self.pictures} if self.pictures else {}),
            "episodes": [_brief(episode) for episode in self.episodes],
        }


def _brief(episode: EpisodeReceipt) -> dict[str, Any]:
    """Return an episode as plain data, without a reason, pictures or stages if there are none."""
    return {name: value for name, value in asdict(episode).items() if value not in ("", {}, None)}


def _episode(about: Mapping[str, Any]) -> EpisodeReceipt:
    names = EpisodeReceipt.__dataclass_fields__
    return EpisodeReceipt(**{name: about[name] for name in names if name in about})


def _length(trace: str) -> int:
    """Return how many bytes a trace has; -1 if it is not base64."""
    try:
        return len(b64decode(trace, validate=True))
    except (NotBase64, ValueError):
        return -1


def _rows(trace: str) -> NDArray[np.uint8]:
    return np.frombuffer(b64decode(trace), np.uint8).reshape(-1, BYTES)


def _hash(content: Mapping[str, Any]) -> str:
    return sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
