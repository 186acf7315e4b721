"""Who acts: what a recording keeps of experts, policies and people."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_layouts.data.reading.json_files import sized_file
from robots import RecordingError, UnreadableFileError

EXPERT = "expert"
POLICY, PERSON = "policy", "person"
MIXED, CORRECTION = "mixed", "correction"

TYPE, DESCRIPTION = "source_type", "source_desc"  # ManiSkill's fields of a recording's header
_BETWEEN = "; "  # sources in the latter


Turns = NDArray[np.uint8]
Source = tuple[str | None, str | None]
"""What a recording says of its source as a whole: ``source_type`` and ``source_desc``."""


@dataclass(frozen=True)
class Actor:
    """Somebody who gives actions.

    Attributes:
        kind: ``"expert"``, ``"policy"`` or ``"person"``.
        name: ``module:function`` or ``module:Class``; of a person, how they steered, such as
            ``"browser"``.
        sha256: SHA-256 of the file that a policy was loaded from, or of the source file that
            defines it; None if there is neither.
    """

    kind: str
    name: str
    sha256: str | None = None

    def to_json(self) -> dict[str, Any]:
        """Return it as json has it."""
        return {name: value for name, value in asdict(self).items() if value is not None}


def actor_of(policy: Any, name: str | None = None) -> Actor:
    """Return who a policy is, or a person who takes over.

    Args:
        policy: What gives actions. It may say by its attribute ``actor`` who it is, an `Actor`, or
            by its attribute ``file`` from which file it was loaded, its weights, say.
        name: Where it was imported from, ``module:name``; None: where it is defined.

    Raises:
        RecordingError: If its file cannot be read.
    """
    own = getattr(policy, "actor", None)
    if isinstance(own, Actor):
        return own
    return Actor(POLICY, name or name_of(policy), _checksum(policy))


def is_person(policy: Any) -> bool:
    """Return whether what gives actions says that it is a person."""
    own = getattr(policy, "actor", None)
    return isinstance(own, Actor) and own.kind == PERSON


def name_of(policy: Any) -> str:
    """Return ``module:function`` of a function, ``module:Class`` of other things."""
    defined = definition(policy)
    return f"{defined.__module__}:{defined.__qualname__}"


def episode_source(
    actors: Sequence[Actor], turns: Turns, corrector: Actor | None = None
) -> tuple[dict[str, Any], Turns | None]:
    """Return the source of an episode, and who of them acted at each step if several did.

    Args:
        actors: Who could act, the policy first.
        turns: The number of who acted at each step, (T,).
        corrector: Who corrected each step, if anyone did.
    """
    numbers, places = np.unique(turns, return_inverse=True)
    acted = [actors[number].to_json() for number in numbers]
    names = ", ".join(dict.fromkeys(actor["name"] for actor in acted))
    several = {"actors": acted} if len(acted) > 1 else {}
    if corrector is not None:
        about = {**corrector.to_json(), "kind": CORRECTION, "corrects": actors[0].to_json()}
    else:
        about = {"kind": MIXED, "name": names} if several else acted[0]
    return {**about, **several}, places.astype(np.uint8) if several else None


def source_of(header: Mapping[str, Any]) -> Source:
    """Return what a header says of its source."""
    return header.get(TYPE), header.get(DESCRIPTION)


def combined(sources: Iterable[Source]) -> dict[str, str | None]:
    """Return what the header of a recording says whose episodes are of these sources.

    It does not depend on their order.
    """
    found = set(sources)
    kinds = {kind for kind, _ in found}
    texts = {part for _, text in found for part in (text or "").split(_BETWEEN) if part}
    alone = len(kinds - {None}) <= 1 and len(texts) <= 1
    if alone:
        kind, text = next(iter(kinds - {None}), None), next(iter(texts), None)
        return {TYPE: kind, DESCRIPTION: text}
    return {TYPE: MIXED, DESCRIPTION: _BETWEEN.join(sorted(texts))}


def definition(policy: Any) -> Any:
    """Return the function or the class of a policy that stands in a source file."""
    while isinstance(policy, partial):
        policy = policy.func
    return policy if hasattr(policy, "__qualname__") else type(policy)


def _checksum(policy: Any) -> str | None:
    file = getattr(policy, "file", None)
    if file is None:
        try:
            file = inspect.getsourcefile(definition(policy))
        except TypeError:  # a notebook's class, or a built-in one
            file = None
        if file is None or not Path(file).is_file():
            return None
    try:
        return sized_file(file)["sha256"]
    except (TypeError, ValueError, OSError, UnreadableFileError) as error:
        raise RecordingError(
            f"the file {file!r} of the policy {name_of(policy)} cannot be read: {error}"
        ) from error
