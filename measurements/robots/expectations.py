"""What is expected of robots that the survey knows, written by hand in ``expected.yaml``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import yaml

from measurements.robots.record import SurveyError

EXPECTED = Path(__file__).with_name("expected.yaml")

KINDS = ("manipulator", "hand", "humanoid", "legged", "wheeled", "flying", "mechanism", "unknown")


@dataclass(frozen=True)
class ExpectedArm:
    """An arm; every text is a pattern as shells have it.

    Attributes:
        joints: Its joints.
        gripper: Its gripper's joints; none if it has no gripper.
        tcp: Links that are its TCP.
        tips: Links whose mean is, any of them.
        offset: Where it is in the frame of one of ``tcp`` (m); its origin if empty.
    """

    joints: tuple[str, ...]
    gripper: tuple[str, ...] = ()
    tcp: tuple[str, ...] = ()
    tips: tuple[str, ...] = ()
    offset: tuple[float, ...] = ()


@dataclass(frozen=True)
class Expected:
    """A robot.

    Attributes:
        kind: One of `KINDS`.
        arms: By name; none where nothing is known of them.
        optional: Patterns of joints that may count to an arm, or not.
        reach: By its maker's data sheet (m), or None.
    """

    kind: str = "unknown"
    arms: Mapping[str, ExpectedArm] = field(default_factory=dict)
    optional: tuple[str, ...] = ()
    reach: float | None = None

    def __post_init__(self) -> None:
        """Refuse a kind that there is not."""
        if self.kind not in KINDS:
            raise ValueError(f"kind is {self.kind!r}; it must be one of {', '.join(KINDS)}")


class Expectations:
    """Expectations by patterns of SOURCE/PATH; the first that matches counts."""

    def __init__(self, expected: Mapping[str, Expected]) -> None:
        """Take them in order."""
        self._expected = expected

    @property
    def keys(self) -> tuple[str, ...]:
        """The patterns, in order."""
        return tuple(self._expected)

    def of(self, key: str) -> Expected:
        """Return what is expected of a robot; if nothing is, its kind is unknown."""
        matching = (found for pattern, found in self._expected.items() if fnmatchcase(key, pattern))
        return next(matching, Expected())


def read_expectations(path: Path) -> Expectations:
    """Return the expectations in a file.

    Raises:
        SurveyError: If it cannot be read, or makes no sense.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
        return Expectations({key: _expected(fields) for key, fields in content.items()})
    except (OSError, ValueError, TypeError, AttributeError, yaml.YAMLError) as error:
        raise SurveyError(f"{path} holds no expectations: {error}") from error


def matching(names: Iterable[str], patterns: Iterable[str]) -> frozenset[str]:
    """Return the names that match a pattern."""
    patterns = tuple(patterns)
    return frozenset(name for name in names if any(fnmatchcase(name, p) for p in patterns))


def _expected(fields: Mapping[str, Any]) -> Expected:
    arms = {
        name: ExpectedArm(**{key: tuple(value) for key, value in arm.items()})
        for name, arm in fields.get("arms", {}).items()
    }
    rest: dict[str, Any] = {"arms": arms, "optional": tuple(fields.get("optional", ()))}
    return Expected(**{**fields, **rest})
