"""The record of a survey: one JSON file, from which the table is made."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from robots import RobotLayoutsError
from robots.common.writing import write_whole

Seen = dict[str, Any]


class SurveyError(RobotLayoutsError, ValueError):
    """A record, or a file of expectations, that makes no sense."""


@dataclass
class Record:
    """What was seen of robots.

    Attributes:
        robots: By source and path, as `measurements.robots.sources.Robot.key`.
        versions: Of what it was made with.
    """

    robots: dict[str, Seen] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls, path: Path) -> Record:
        """Return the record in a file.

        Raises:
            SurveyError: If it cannot be read, or holds none.
        """
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            return cls(dict(content["robots"]), dict(content["versions"]))
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise SurveyError(f"{path} holds no record of a survey: {error!r}") from error

    def write(self, path: Path) -> None:
        """Write it to a file, robots sorted.

        Raises:
            UnwritableFileError: If it cannot be written.
        """
        content = {"versions": self.versions, "robots": dict(sorted(self.robots.items()))}
        write_whole(path, json.dumps(content, indent=1, ensure_ascii=False) + "\n")


def versions_of(*packages: str) -> dict[str, str]:
    """Return the versions of packages that are installed."""
    found: dict[str, str] = {}
    for package in packages:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found
