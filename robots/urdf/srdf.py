"""The SRDF beside a URDF: which pairs of links are left out of collision checks."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from robots.common.errors import AssetError
from robots.urdf.summary import parse_urdf, read_urdf


@dataclass(frozen=True)
class ExcludedPair:
    """A pair of links that an SRDF leaves out of collision checks.

    Attributes:
        links: Their names.
        reason: Why, such as ``"Adjacent"``; empty if it does not say.
    """

    links: tuple[str, str]
    reason: str


def srdf_beside(urdf: Path) -> Path | None:
    """Return the SRDF of a URDF's name, or None if there is none.

    It lies beside the URDF, or in a folder ``srdf`` beside the URDF's, as in ROS packages.
    """
    beside = urdf.with_suffix(".srdf")
    for srdf in (beside, urdf.parent.parent / "srdf" / beside.name):
        if os.path.lexists(srdf):
            return srdf
    return None


def read_excluded_pairs(urdf: Path) -> tuple[ExcludedPair, ...]:
    """Return the pairs that the SRDF beside a URDF excludes, in its order; none without an SRDF.

    Raises:
        AssetError: If the SRDF cannot be read or is none, or a pair lacks a link.
    """
    srdf = srdf_beside(urdf)
    if srdf is None:
        return ()
    pairs: list[ExcludedPair] = []
    for pair in parse_urdf(read_urdf(srdf), str(srdf)).iterfind("disable_collisions"):
        links = (pair.get("link1", ""), pair.get("link2", ""))
        if not all(links):
            raise AssetError(
                f"{srdf}: a <disable_collisions> needs link1 and link2; it has {links}"
            )
        pairs.append(ExcludedPair(links, pair.get("reason", "")))
    return tuple(pairs)
