"""Reasons that one should read before the others."""

from __future__ import annotations


class Doubt(str):
    """A reason that weakens what the robot can do, or was decided on little."""

    __slots__ = ()
