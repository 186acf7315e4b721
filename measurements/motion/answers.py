"""The page and the table of what the planner answered to random questions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from measurements.robots.record import versions_of
from motion.planning.infeasibility import CUT_OFF

CLEARANCE = 0.02  # m; how far robots are asked to stay apart
PATIENCE = {2: 5.0, 3: 5.0, 4: 5.0}  # s of processor time within which a plan counts as solved
LONGEST = 30.0  # s, the same for more arms
ALONE = "even if the other robots that move were not there"  # in the planner's message
REASONS = ("goal in collision", "start in collision", "unreachable")  # that a check can tell
OUT_OF_REACH, IN_COLLISION = "out of reach", "in collision"  # kinds of goals that have no answer
INFEASIBLE = {OUT_OF_REACH: "unreachable", IN_COLLISION: "goal in collision"}
CATALOGUE = "catalogue"  # the source of robots that this library knows

COLUMNS = (
    "arms",
    "queries",
    "solved",
    "solved, of those with a way alone",
    "in time",
    "median s",
    "90 % s",
    "99 % s",
    "slowest s",
    "certified",
    "collisions",
    "least clearance mm",
    "carried out",
    "robots touched",
    "farthest from the plan mm",
    "an arm finds no way even alone",
    "cut off, recognised",
    "wrongly said to be infeasible",
    "infeasible, recognised",
)

Seen = dict[str, Any]


def summary(record: Sequence[Seen]) -> dict[str, Any]:
    """Return what a page shows of a record: with what it was made, and the rows of its table."""
    cells = {seen["cell"]: seen["sources"] for seen in record}
    sources = [source for own in cells.values() for source in own]
    packages = sorted({source.split("/")[0] for source in sources} - {CATALOGUE})
    return {
        "versions": versions_of("ompl", "toppra", "python-fcl", "sapien", "numpy"),
        "packages": dict.fromkeys(packages, "") | versions_of(*packages),
        "cells": len(cells),
        "arms": len(sources),
        "urdfs": sum(source != CATALOGUE for source in sources),
        "queries": sum(seen["goal"] not in INFEASIBLE for seen in record),
        "table": list(markdown(record)),
    }


def page(shown: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of the page."""
    yield "# Planning, measured"
    yield ""
    yield f"{shown['queries']} queries to `motion.plan` in {shown['cells']} random valid cells of"
    yield "mixed arms over a floor: from one random posture of all arms, free of collisions, to"
    yield "another, every fourth as TCP poses. This page was written by"
    yield "`python -m measurements.motion queries --page docs/planning.md`."
    yield f"Of the {shown['arms']} arms, {_origin(shown)}."
    yield ""
    yield f"Robots were asked to stay {CLEARANCE * 100:g} cm apart. With 1 cm, six plans in ten"
    yield "thousand touched something between the moments that the search looks at, and in one"
    yield "robots touched when it was carried out. *Least clearance* is to anything; arms whose"
    yield "shoulders turn a centimetre above the floor may come nearer to it."
    yield ""
    yield "Times are processor time of one core, of whole plans. *In time* is within 5 s for up to"
    yield "four arms and 30 s for more; *certified* by `Motion.certify`, every millimetre and half"
    yield "degree. *Carried out*: in SAPIEN by `experts.follow` in `pd_joint_pos`; *robots touched*"
    yield "counts motions in which links of two robots touched in any step of physics, and the"
    yield "column beside it says how far any link was from where the plan had it."
    yield ""
    yield "*An arm finds no way even alone*: the planner says so; some random postures lie in"
    yield "pockets. *Cut off, recognised*: the planner proves that there is no way, as where a goal"
    yield "lies beyond the floor for an upper arm that turns half way round at most; these queries"
    yield "count in no other column."
    yield "*Wrongly said to be infeasible*: a goal that stands for a free posture is said to be out"
    yield "of reach or in collision. *Infeasible, recognised*: two more queries per cell, in which"
    yield "one arm's goal is out of its reach or inside something, and how many of them were"
    yield "refused for that reason."
    yield ""
    yield f"Made with {_listed(shown['versions'])}."
    yield ""
    yield from shown["table"]


def _origin(shown: Mapping[str, Any]) -> str:
    if not shown["urdfs"]:
        return "all are of the catalogue"
    return (
        f"{shown['urdfs']} were made by\n`RobotDescriptor.from_urdf` from URDFs of"
        f" {_listed(shown['packages'])}; the others are of the catalogue"
    )


def _listed(versions: Mapping[str, str]) -> str:
    return ", ".join(f"{name} {version}".strip() for name, version in versions.items())


def markdown(record: Sequence[Seen]) -> Iterator[str]:
    """Yield the lines of the table: a row per number of arms."""
    yield f"| {' | '.join(COLUMNS)} |"
    yield "|" + " ---: |" * len(COLUMNS)
    for arms in sorted({seen["arms"] for seen in record}):
        yield _row(arms, [seen for seen in record if seen["arms"] == arms])


def _row(arms: int, every: Sequence[Seen]) -> str:
    hopeless = [s for s in every if s["goal"] in INFEASIBLE]
    asked = [s for s in every if s["goal"] not in INFEASIBLE]
    seen = [s for s in asked if s.get("reason") != CUT_OFF]
    solved = [s for s in seen if s["solved"]]
    seconds = np.array([s["seconds"] for s in seen])
    in_time = sum(s["seconds"] <= PATIENCE.get(arms, LONGEST) for s in solved)
    checked = [s for s in solved if "certified" in s]
    clearances = [s["clearance"] for s in checked if s["clearance"] is not None]
    tried = [s for s in solved if "executed" in s]
    strays = [s["stray"] for s in tried if s["executed"]]
    alone = sum(ALONE in s.get("message", "") for s in seen)
    numbers = [
        arms,
        len(seen),
        _share(len(solved), len(seen)),
        _share(len(solved), len(seen) - alone),
        _share(in_time, len(seen)),
        *(f"{np.quantile(seconds, q):.2f}" if seen else "" for q in (0.5, 0.9, 0.99, 1.0)),
        _share(sum(s["certified"] for s in checked), len(checked)),
        sum(s["collisions"] for s in checked),
        f"{1e3 * min(clearances):.1f}" if clearances else "",
        f"{sum(s['executed'] for s in tried)} of {len(tried)}",
        sum(bool(s["touching"]) for s in tried),
        f"{1e3 * max(strays):.1f}" if strays else "",
        alone,
        len(asked) - len(seen),
        sum(s.get("reason") in REASONS for s in seen),
        f"{sum(s.get('reason') == INFEASIBLE[s['goal']] for s in hopeless)} of {len(hopeless)}",
    ]
    return "| " + " | ".join(map(str, numbers)) + " |"


def _share(part: int, whole: int) -> str:
    return f"{part / whole:.1%}" if whole else ""
