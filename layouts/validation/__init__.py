"""Checks of a layout before anything moves, from the robots' real collision shapes."""

from layouts.validation.findings import Clearance, Finding, LinkPair, SharedWorkspace, TargetReach
from layouts.validation.report import Report

__all__ = [
    "Clearance",
    "Finding",
    "LinkPair",
    "Report",
    "SharedWorkspace",
    "TargetReach",
]
