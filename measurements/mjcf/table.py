"""The record of MJCFs as a page: shares first, then file by file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from measurements.robots.expectations import Expectations, Expected
from measurements.robots.judge import NOT_ASKED, YES, Answer, judge, reason
from measurements.robots.record import Record, Seen

EXACT = 1e-9  # m; how far MuJoCo and ours may be apart
NEAR = 0.02  # m; how far a TCP that no frame marks may be from where it is expected
LONGEST_REASON = 220  # characters

QUESTIONS: Mapping[str, str] = {
    "loads": "loads",
    "arm": "arms",
    "gripper": "grippers",
    "tcp": "TCP",
    "all": "all three",
    "alone": "valid alone",
    "steps_50": "50 steps",
    "steps_500": "500 steps",
    "numbers": "its own joints",
    "tcp_move": "TCP move",
    "kinematics": "as MuJoCo",
}

Judged = tuple[str, Seen, Expected, dict[str, Answer]]


def markdown(record: Record, expectations: Expectations) -> Iterator[str]:
    """Yield the lines of the page."""
    judged = [
        (key, seen, expectations.of(key), answers(seen, expectations.of(key)))
        for key, seen in sorted(record.robots.items())
    ]
    arms = [one for one in judged if one[2].kind == "manipulator"]
    yield "# MJCFs that this library had not seen"
    yield ""
    yield from _about(record, judged)
    yield "| | arms and robots with arms | all |"
    yield "| --- | ---: | ---: |"
    for question, title in QUESTIONS.items():
        yield f"| {title} | {_share(arms, question)} | {_share(judged, question)} |"
    yield ""
    yield f"| file | {' | '.join(QUESTIONS.values())} |"
    yield "| --- " * (len(QUESTIONS) + 1) + "|"
    for key, _, _, found in judged:
        yield f"| `{key}` | {' | '.join(found[question].text for question in QUESTIONS)} |"
    yield ""
    yield "## Why not"
    yield ""
    for key, seen, _, _ in judged:
        if why := reason(seen):
            short = why if len(why) <= LONGEST_REASON else f"{why[:LONGEST_REASON]} …"
            yield f"- `{key}`: {short}"


def answers(seen: Seen, expected: Expected) -> dict[str, Answer]:
    """Return the answer to each of `QUESTIONS`."""
    found = judge(seen, expected)
    found["tcp"] = _tcp(seen, expected, found["tcp"])
    three = [found[question] for question in ("arm", "gripper", "tcp")]
    asked = [answer for answer in three if answer.good is not None]
    right = all(answer.good for answer in asked)
    found["all"] = NOT_ASKED if not asked else YES if right else Answer(False, "no")
    found["kinematics"] = _kinematics(seen)
    return {question: found[question] for question in QUESTIONS}


def _tcp(seen: Seen, expected: Expected, named: Answer) -> Answer:
    """Return whether the TCP is on the right link, and at the right place in its frame."""
    loaded = seen.get("loads", {})
    if not named.good or loaded.get("tips"):
        return named
    wanted = [arm.offset or (0.0, 0.0, 0.0) for arm in expected.arms.values()]
    away = min(math.dist(loaded["tcp_offset"], offset) for offset in wanted)
    return YES if away <= NEAR else Answer(False, f"{away * 100:.0f} cm off")


def _kinematics(seen: Seen) -> Answer:
    difference = seen.get("kinematics", {}).get("difference")
    if difference is None:
        return Answer(False, "no")
    return Answer(difference <= EXACT, f"{difference:.0e}")


def _share(judged: Sequence[Judged], question: str) -> str:
    asked = [found[question] for _, _, _, found in judged if found[question].good is not None]
    return f"{sum(bool(answer.good) for answer in asked)} of {len(asked)}" if asked else ""


def _about(record: Record, judged: Sequence[Judged]) -> Iterator[str]:
    versions = ", ".join(f"{name} {version}" for name, version in record.versions.items())
    yield f"{len(judged)} MJCFs of other packages, each tried in a process of its own by"
    yield "`python -m measurements.mjcf`, which writes this page. Nothing is known of a robot but"
    yield "its MJCF; what is expected of it stands in `measurements/mjcf/expected.yaml`, read off"
    yield f"the files' own names, actuators and sites by eye. Made with {versions}."
    yield ""
    yield "- arms, grippers: every arm and gripper has its own joints and no others; TCP: on the"
    yield f"  site or body that the file has for it, or within {NEAR * 100:g} cm of where fingers"
    yield "  meet; all three: of those that the file has"
    yield "- valid alone: `validate()`; 50 and 500 steps: holds still when it is to, then random"
    yield "  actions, no joint at ten times its largest speed; its own joints: each action number"
    yield "  moves them; TCP move: 5 cm by inverse kinematics, less than 2 mm off"
    yield "- as MuJoCo: the largest difference of any body's pose (m) in 100 random postures,"
    yield f"  which must be below {EXACT:g}"
    yield ""
