"""Checks of a layout before anything moves, from the robots' real collision shapes."""

from layouts.validation.check import validate
from layouts.validation.report import (
    Clearance,
    Finding,
    LinkPair,
    Report,
    SharedWorkspace,
    TargetReach,
)

__all__ = [
    "Clearance",
    "Finding",
    "LinkPair",
    "Report",
    "SharedWorkspace",
    "TargetReach",
    "validate",
]
