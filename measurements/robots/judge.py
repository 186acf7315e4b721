"""Judges what was seen of a robot by what is expected of it: one answer to each question."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from measurements.robots.expectations import Expected, ExpectedArm, matching

Seen = Mapping[str, Any]

# How far a reach may be from a data sheet's: that goes to the wrist or the flange, ours to the TCP.
REACH_SHARES = 0.9, 1.35
TCP_ERROR = 0.002  # m
WITH_TCP = ("manipulator", "humanoid", "unknown")  # kinds of robots that bring it somewhere

MISSED = 0.03  # of the overlaps that checks see; what physics may not see

STAGES = (
    "loads", "alone", "facing", "beside", "trial", "tcp_move", "agreement", "to_urdf", "to_drake",
)  # fmt: skip

QUESTIONS: Mapping[str, str] = {
    "loads": "loads",
    "refused": "loads or is refused for a reason",
    "arm": "arms",
    "gripper": "grippers",
    "tcp": "TCP",
    "reach": "reach",
    "alone": "valid alone",
    "facing": "face to face",
    "beside": "beside a Panda",
    "steps_50": "50 steps",
    "steps_500": "500 steps",
    "numbers": "its own joints",
    "tcp_move": "TCP move",
    "agreement": "checks as physics",
    "to_urdf": "URDF",
    "to_drake": "Drake",
    "no_raw": "no raw exception",
    "no_crash": "no crash",
}


@dataclass(frozen=True)
class Answer:
    """An answer.

    Attributes:
        good: Whether it is as it is to be; None if the question makes no sense.
        text: In a word or two.
    """

    good: bool | None
    text: str


YES, NOT_ASKED = Answer(True, "yes"), Answer(None, "")


def judge(seen: Seen, expected: Expected) -> dict[str, Answer]:
    """Return the answer to each of `QUESTIONS`.

    Args:
        seen: What `measurements.robots.probe` saw.
        expected: What is expected.
    """
    answers = {
        "loads": _loads(seen),
        "refused": _yes("raw" not in seen.get("loads", {"raw": ""})),
        "no_raw": _no_raw(seen),
        "no_crash": _yes("ended" not in seen, seen.get("ended", "")),
    }
    loaded = seen.get("loads", {}) if answers["loads"].good else {}
    answers |= _shape(loaded, expected)
    for stage in ("alone", "facing", "beside", "to_urdf", "to_drake"):
        answers[stage] = _yes(seen.get(stage, {}).get("ok", False))
    trial = seen.get("trial", {})
    answers["steps_50"], answers["steps_500"] = _steps(trial, 50), _steps(trial, 500)
    wrong = trial.get("wrong_numbers")
    answers["numbers"] = _yes(wrong == [], _wrong_text(wrong, trial))
    error = seen.get("tcp_move", {}).get("error")
    came = _yes(error is not None and error < TCP_ERROR, _length(error))
    answers["tcp_move"] = came if expected.kind in WITH_TCP else NOT_ASKED
    answers["agreement"] = _agreement(seen.get("agreement", {}))
    return {question: answers[question] for question in QUESTIONS}


def usable(seen: Seen) -> bool:
    """Tell whether all meshes are there that physics needs."""
    return not seen.get("missing")


def reason(seen: Seen) -> str:
    """Return why something is not as it is to be: the first that tells, or nothing."""
    if "ended" in seen:
        return str(seen["ended"])
    for stage in STAGES:
        for kind in ("raw", "refused"):
            if kind in seen.get(stage, {}):
                return f"{stage}: {seen[stage][kind]}"
    problems = seen.get("trial", {}).get("problems") or seen.get("alone", {}).get("why")
    return str(problems[0]) if problems else ""


def _loads(seen: Seen) -> Answer:
    for stage in ("loads", "trial"):
        kinds = seen.get(stage, {"crashed": ""})
        for kind in ("raw", "refused", "crashed"):
            if kind in kinds:
                return Answer(False, kind)
    return YES


def _shape(loaded: Seen, expected: Expected) -> dict[str, Answer]:
    """Answer for arms, grippers, TCP and reach."""
    questions = ("arm", "gripper", "tcp", "reach")
    if not expected.arms:
        return dict.fromkeys(questions, NOT_ASKED)
    if not loaded:
        return {
            "arm": _yes(False),
            "gripper": _yes(False) if _has_gripper(expected) else NOT_ASKED,
            "tcp": _yes(False),
            "reach": _yes(False) if expected.reach else NOT_ASKED,
        }
    joints = [joint for group in loaded["groups"].values() for joint in group["joints"]]
    arms = expected.arms.values()
    wanted = [matching(joints, arm.joints) for arm in arms]
    optional = matching(joints, expected.optional)
    found = [limb - optional for limb in _limbs(loaded, "arm")]
    grippers = [matching(joints, arm.gripper) for arm in arms if arm.gripper]
    return {
        "arm": _same(wanted, [limb for limb in found if limb]),
        "gripper": _same(grippers, _limbs(loaded, "gripper")),
        "tcp": _yes(any(_is_tcp(loaded, arm) for arm in arms), "–".join(_tcp(loaded))),
        "reach": _reach(loaded["reach"], expected.reach),
    }


def _limbs(loaded: Seen, part: str) -> list[frozenset[str]]:
    """Return the driven joints of each arm, or of each gripper, by the names of their groups."""
    limbs: dict[str, set[str]] = {}
    for name, group in loaded["groups"].items():
        words = name.split("_")
        if part in words and group["numbers"]:
            here = words.index(part)
            numbers = [word for word in words[here + 1 :] if word.isdigit()]
            limb = "_".join([*words[:here], *numbers])
            limbs.setdefault(limb, set()).update(group["joints"])
    return [frozenset(limb) for limb in limbs.values()]


def _same(wanted: Iterable[frozenset[str]], found: Iterable[frozenset[str]]) -> Answer:
    wanted, found = set(wanted), set(found)
    if not wanted and not found:
        return NOT_ASKED
    if wanted == found:
        return YES
    if len(wanted) > 1 and wanted & found:
        return Answer(False, f"{len(wanted & found)} of {len(wanted)}")
    return Answer(False, "no" if wanted else "none to be")


def _tcp(loaded: Seen) -> list[str]:
    return loaded["tips"] or [loaded["tcp"]]


def _is_tcp(loaded: Seen, arm: ExpectedArm) -> bool:
    links = _tcp(loaded)
    return len(matching(links, arm.tips if loaded["tips"] else arm.tcp)) == len(links)


def _reach(found: float, sheet: float | None) -> Answer:
    text = f"{found:.2f}" if sheet is None else f"{found:.2f} / {sheet:g}"
    if sheet is None:
        return Answer(None, text)
    low, high = REACH_SHARES
    return Answer(low * sheet <= found <= high * sheet, text)


def _steps(trial: Seen, steps: int) -> Answer:
    if "stands" not in trial:
        return _yes(False)
    if not trial["stands"]:
        return Answer(False, "kicks")
    exploded = trial["exploded"]
    if exploded is not None and exploded <= steps:
        return Answer(False, f"step {exploded}")
    return YES


def _agreement(seen: Seen) -> Answer:
    if "both" not in seen:
        return _yes(False)
    if seen["physics"]:
        return Answer(False, f"{seen['physics']} unseen")
    alone, checked = seen["checks"], seen["both"] + seen["checks"]
    return _yes(alone <= MISSED * checked + 1, f"{alone} of {checked} missed")


def _no_raw(seen: Seen) -> Answer:
    raw = [stage for stage in STAGES if "raw" in seen.get(stage, {})]
    return _yes(not raw, ", ".join(raw))


def _has_gripper(expected: Expected) -> bool:
    return any(arm.gripper for arm in expected.arms.values())


def _wrong_text(wrong: list[str] | None, trial: Seen) -> str:
    return "" if wrong is None else f"{trial['numbers'] - len(wrong)} of {trial['numbers']}"


def _length(error: float | None) -> str:
    return "" if error is None else f"{error * 1e3:.1f} mm" if error < 1 else "far off"


def _yes(good: bool, otherwise: str = "") -> Answer:
    return YES if good else Answer(False, otherwise or "no")
