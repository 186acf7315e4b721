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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots import RobotLayoutsError, UnreadableFileError
from robots.common.files import read_json
from robots.common.writing import write_whole
from rollouts.playing.state_trace import BYTES
from rollouts.reading.json_fields import (
    FLAG,
    NAME,
    NUMBER,
    OBJECT,
    TEXT,
    FieldError,
    Kind,
    fields,
    items,
    maybe,
    whole,
)
from rollouts.reading.summary import MAX_SEED, MAX_STEPS

FORMAT = "robot-layouts receipt 1"
MAX_BYTES = 2**27  # of a file; 100,000 episodes of 200 steps take a half

_HEX = frozenset("0123456789abcdef")


def _is_digest(value: Any) -> bool:
    return isinstance(value, str) and len(value) == 64 and _HEX.issuperset(value)


DIGEST = Kind("a SHA-256: 64 of the digits 0-9 and a-f", _is_digest)
# A module before a task's id would be imported.
ID = Kind("a task's id, without a module", lambda value: NAME.fits(value) and ":" not in value)
TASK = fields({"id": ID, "class": NAME, "sha256": maybe(DIGEST)})
POLICY = fields({"kind": NAME, "name": NAME, "sha256": maybe(DIGEST)}, {"files": OBJECT})
MAKING = fields({"layout": OBJECT})
ENVIRONMENT = fields({"versions": OBJECT, "processor": OBJECT}, {"variables": TEXT})
EPISODE = fields(
    {
        "seed": whole(0, MAX_SEED),
        "success": FLAG,
        "steps": whole(0, MAX_STEPS),
        "total": NUMBER,
        "states": DIGEST,
        "trace": TEXT,
    },
    {"reason": TEXT},
)
RECEIPT = fields(
    {
        "format": Kind(repr(FORMAT), lambda value: value == FORMAT),
        "hash": DIGEST,
        "task": TASK,
        "policy": POLICY,
        "making": MAKING,
        "environment": ENVIRONMENT,
        "episodes": items(EPISODE),
    }
)


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
    """

    seed: int
    success: bool
    steps: int
    total: float
    states: str
    trace: str
    reason: str = ""

    def __post_init__(self) -> None:
        """Refuse values that no episode has.

        Raises:
            ReceiptError: If a value is of another kind, or the trace has another length.
        """
        _expect(EPISODE, asdict(self), f"the episode of seed {self.seed!r}")
        try:
            length = len(b64decode(self.trace, validate=True))
        except (NotBase64, ValueError):
            length = -1
        if length != BYTES * (self.steps + 1):
            raise ReceiptError(
                f"the episode of seed {self.seed}: its trace must be {BYTES * (self.steps + 1)}"
                f" bytes in base64, {BYTES} for the reset and for each of {self.steps} steps"
            )

    def digests(self) -> NDArray[np.uint8]:
        """Return the first bytes of the digest after the reset and each step, (steps + 1, 2)."""
        return np.frombuffer(b64decode(self.trace), np.uint8).reshape(-1, BYTES)


@dataclass(frozen=True)
class Receipt:
    """What was evaluated, and the results.

    Attributes:
        task: ``id``, ``class`` (``module:Class``) and ``sha256`` of the module's source.
            See `rollouts.receipts.provenance.describe_task`.
        policy: ``kind`` (``expert`` or ``policy``), ``name`` (``module:name``), ``sha256`` of its
            module's source, and more; see `rollouts.receipts.provenance.describe_policy`.
        making: What the task was made with: its ``layout`` with the checksums of robot files, and
            more; see `rollouts.receipts.making.describe_making`.
        environment: ``versions`` and ``processor`` of where it was played; see
            `rollouts.playing.environment`. ``others``, if workers differed; ``guessed``, where the
            files of robots were that no registry knows; ``variables``, names of environment
            variables that the policy's source reads and that were set.
        episodes: One for each seed, in the order in which these were given.
        claimed: The hash that a file says it has; empty if it comes from no file.
    """

    task: Mapping[str, Any]
    policy: Mapping[str, Any]
    making: Mapping[str, Any]
    environment: Mapping[str, Any]
    episodes: tuple[EpisodeReceipt, ...]
    claimed: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        """Refuse parts that no receipt has.

        Raises:
            ReceiptError: If a part is of another kind, or there are no episodes, or one twice.
        """
        for kind, name in ((TASK, "task"), (POLICY, "policy"), (MAKING, "making")):
            _expect(kind, getattr(self, name), name)
        _expect(ENVIRONMENT, self.environment, "environment")
        seeds = Counter(episode.seed for episode in self.episodes)
        if not seeds:
            raise ReceiptError("a receipt has one episode or more; this has none")
        if twice := [seed for seed, count in seeds.items() if count > 1]:
            raise ReceiptError(f"a receipt has each seed once; this has seed {twice[0]} twice")

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
        head = {"format": FORMAT, "hash": self.hash, **self._content()}
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
            RECEIPT.expect(found, "")
            episodes = tuple(_episode(about) for about in found["episodes"])
            parts = {name: found[name] for name in ("task", "policy", "making", "environment")}
            return cls(**parts, episodes=episodes, claimed=found["hash"])
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
            "episodes": [_brief(episode) for episode in self.episodes],
        }


def _brief(episode: EpisodeReceipt) -> dict[str, Any]:
    """Return an episode as plain data, without a reason if there is none."""
    return {name: value for name, value in asdict(episode).items() if value != ""}


def _episode(about: Mapping[str, Any]) -> EpisodeReceipt:
    names = EpisodeReceipt.__dataclass_fields__
    return EpisodeReceipt(**{name: about[name] for name in names if name in about})


def _hash(content: Mapping[str, Any]) -> str:
    return sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _expect(kind: Kind, value: Any, where: str) -> None:
    try:
        kind.expect(value, where)
    except FieldError as error:
        raise ReceiptError(str(error)) from error
