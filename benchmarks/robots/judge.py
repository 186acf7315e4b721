"""What is expected of robots, written by hand, and one answer to each question about them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import yaml

from benchmarks.records import RecordError

EXPECTED, EXPECTED_MJCFS = (Path(__file__).with_name(f"{kind}.yaml") for kind in ("urdfs", "mjcfs"))
KINDS = ("manipulator", "hand", "humanoid", "legged", "wheeled", "flying", "mechanism", "unknown")

# How far a reach may be from a data sheet's: that goes to the wrist or the flange, ours to the TCP.
REACH_SHARES = 0.9, 1.35
TCP_ERROR = 0.002  # m
WITH_TCP = ("manipulator", "humanoid", "unknown")  # kinds of robots that bring it somewhere
MISSED = 0.03  # of the overlaps that checks see; what physics may not see
EXACT = 1e-9  # m; how far MuJoCo and ours may be apart
TIPS = 0.005  # m; how far a TCP may be from where the fingers meet
HANDED_OVER = 8  # of ten episodes
NEAR = 0.02  # m; how far a TCP that no frame marks may be from where it is expected

STAGES = (
    "loads",
    "alone",
    "facing",
    "beside",
    "trial",
    "tcp_move",
    "agreement",
    "to_urdf",
    "to_drake",
    "grasps",
    "tcp_control",
    "hand_over",
)
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
    "fingers": "fingers known",
    "between": "TCP between the tips",
    "grasps": "grasps a cube",
    "square": "TCP's square",
    "hand_over": "hand-over by two",
    "two_hands": "hand-over by one body",
    "no_raw": "no raw exception",
    "no_crash": "no crash",
}
WORK = ("fingers", "between", "grasps", "square", "hand_over", "two_hands")
MJCF_QUESTIONS: Mapping[str, str] = {
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

Seen = Mapping[str, Any]


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
        """Refuse an unknown kind."""
        if self.kind not in KINDS:
            raise ValueError(f"kind is {self.kind!r}; it must be one of {', '.join(KINDS)}")


@dataclass(frozen=True)
class Answer:
    """An answer.

    Attributes:
        good: Whether it is as it should be; None if the question was not asked.
        text: In a word or two.
    """

    good: bool | None
    text: str


YES, NOT_ASKED = Answer(True, "yes"), Answer(None, "")


def read_expectations(path: Path) -> dict[str, Expected]:
    """Return what a file expects, by patterns of SOURCE/PATH.

    Raises:
        RecordError: If it cannot be read, or is invalid.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
        return {key: _expected(fields) for key, fields in content.items()}
    except (OSError, ValueError, TypeError, AttributeError, yaml.YAMLError) as error:
        raise RecordError(f"{path} holds no expectations: {error}") from error


def _expected(fields: Mapping[str, Any]) -> Expected:
    arms = {
        name: ExpectedArm(**{key: tuple(value) for key, value in arm.items()})
        for name, arm in fields.get("arms", {}).items()
    }
    rest: dict[str, Any] = {"arms": arms, "optional": tuple(fields.get("optional", ()))}
    return Expected(**{**fields, **rest})


def expected_of(key: str, expectations: Mapping[str, Expected]) -> Expected:
    """Return what is expected of a robot: the first pattern that matches counts."""
    found = (one for pattern, one in expectations.items() if fnmatchcase(key, pattern))
    return next(found, Expected())


def judge(seen: Seen, expected: Expected) -> dict[str, Answer]:
    """Return the answer to each of `QUESTIONS`.

    Args:
        seen: What `benchmarks.robots.probe` saw.
        expected: What is expected.
    """
    raw = [stage for stage in STAGES if "raw" in seen.get(stage, {})]
    answers = {
        "loads": _loads(seen),
        "refused": _yes("raw" not in seen.get("loads", {"raw": ""})),
        "no_raw": _yes(not raw, ", ".join(raw)),
        "no_crash": _yes("ended" not in seen, seen.get("ended", "")),
    }
    loaded = seen.get("loads", {}) if answers["loads"].good else {}
    answers |= _shape(loaded, expected)
    for stage in ("alone", "facing", "beside", "to_urdf", "to_drake"):
        answers[stage] = _yes(seen.get(stage, {}).get("ok", False))
    trial = seen.get("trial", {})
    answers["steps_50"], answers["steps_500"] = _steps(trial, 50), _steps(trial, 500)
    wrong = trial.get("wrong_numbers")
    right = "" if wrong is None else f"{trial['numbers'] - len(wrong)} of {trial['numbers']}"
    answers["numbers"] = _yes(wrong == [], right)
    error = seen.get("tcp_move", {}).get("error")
    length = "" if error is None else f"{error * 1e3:.1f} mm" if error < 1 else "far off"
    came = _yes(error is not None and error < TCP_ERROR, length)
    answers["tcp_move"] = came if expected.kind in WITH_TCP else NOT_ASKED
    answers["agreement"] = _agreement(seen.get("agreement", {}))
    answers |= _work(seen, expected)
    return {question: answers[question] for question in QUESTIONS}


def judge_mjcf(seen: Seen, expected: Expected) -> dict[str, Answer]:
    """Return the answer to each of `MJCF_QUESTIONS`; the arguments are those of `judge`."""
    found, loaded = judge(seen, expected), seen.get("loads", {})
    if found["tcp"].good and not loaded.get("tips"):
        wanted = [arm.offset or (0.0, 0.0, 0.0) for arm in expected.arms.values()]
        away = min(math.dist(loaded["tcp_offset"], offset) for offset in wanted)
        found["tcp"] = _yes(away <= NEAR, f"{away * 100:.0f} cm off")
    three = [found[question].good for question in ("arm", "gripper", "tcp")]
    asked = [good for good in three if good is not None]
    found["all"] = _yes(all(asked)) if asked else NOT_ASKED
    difference = seen.get("kinematics", {}).get("difference")
    text = "no" if difference is None else f"{difference:.0e}"
    found["kinematics"] = Answer(difference is not None and difference <= EXACT, text)
    return {question: found[question] for question in MJCF_QUESTIONS}


def _work(seen: Seen, expected: Expected) -> dict[str, Answer]:
    """Answer for fingers, grasps, control of the TCP and the hand-over, if they were tried."""
    if "made_with" not in seen:  # a record from before they were
        return dict.fromkeys(WORK, NOT_ASKED)
    hands = [arm for arm in expected.arms.values() if arm.gripper]
    grippers = seen.get("grasps", {}).get("grippers", ())
    known = [one for one in grippers if one["fingers"]]
    count = max(len(hands), len(grippers))
    off = max((one["tcp_off"] for one in known), default=0.0)
    length = f"{off * 1e3:.0f} mm off" if off < 1 else ""
    held = sum(one["grasps"] for one in known)
    handed = seen.get("hand_over", {})
    text = f"{handed['solved']} of {handed['of']}" if "of" in handed else ""
    passed = _yes(handed.get("solved", 0) >= HANDED_OVER, text)
    groups = seen.get("loads", {}).get("groups", ())
    arms = known if any("arm" in name.split("_") for name in groups) else ()  # not of hands alone
    return {
        "fingers": _yes(len(known) == count, f"{len(known)} of {count}") if count else NOT_ASKED,
        "between": _yes(off < TIPS, length) if known else NOT_ASKED,
        "grasps": _yes(held == count, f"{held} of {count}") if count else NOT_ASKED,
        "square": _square(seen.get("tcp_control", {}), expected),
        "hand_over": passed if len(arms) == 1 else NOT_ASKED,
        "two_hands": passed if len(arms) > 1 else NOT_ASKED,
    }


def _square(seen: Seen, expected: Expected) -> Answer:
    """Answer for the control modes that steer TCPs: what they missed, but for what they report."""
    trials = seen.get("trials", ())
    if not expected.arms or expected.kind not in WITH_TCP or ("trials" in seen and not trials):
        return NOT_ASKED
    missed = max((max(t["drift"], t["corner"] - t["reported"]) for t in trials), default=1.0)
    return _yes(missed < TCP_ERROR, f"{missed * 1e3:.1f} mm" if missed < 1 else "no")


def reason(seen: Seen) -> str:
    """Return why something is not as it should be: the first reason, or nothing."""
    if "ended" in seen:
        return str(seen["ended"])
    for stage in STAGES:
        for kind in ("raw", "refused"):
            if kind in seen.get(stage, {}):
                return f"{stage}: {seen[stage][kind]}"
    problems = [
        *(seen.get("trial", {}).get("problems") or seen.get("alone", {}).get("why") or ()),
        *(one["problem"] for one in seen.get("grasps", {}).get("grippers", ()) if one["problem"]),
        *(
            one["problem"]
            for one in seen.get("tcp_control", {}).get("trials", ())
            if one["problem"]
        ),
        *(f"hand-over: {why}" for why in seen.get("hand_over", {}).get("why", ())),
    ]
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
    arms = expected.arms.values()
    if not arms:
        return dict.fromkeys(("arm", "gripper", "tcp", "reach"), NOT_ASKED)
    if not loaded:
        return {
            "arm": _yes(False),
            "gripper": _yes(False) if any(arm.gripper for arm in arms) else NOT_ASKED,
            "tcp": _yes(False),
            "reach": _yes(False) if expected.reach else NOT_ASKED,
        }
    joints = [joint for group in loaded["groups"].values() for joint in group["joints"]]
    optional = _matching(joints, expected.optional)
    found = [limb - optional for limb in _limbs(loaded, "arm")]
    tcp = loaded["tips"] or [loaded["tcp"]]
    right = any(
        len(_matching(tcp, arm.tips if loaded["tips"] else arm.tcp)) == len(tcp) for arm in arms
    )
    grippers = [_matching(joints, arm.gripper) for arm in arms if arm.gripper]
    return {
        "arm": _same([_matching(joints, arm.joints) for arm in arms], filter(None, found)),
        "gripper": _same(grippers, _limbs(loaded, "gripper")),
        "tcp": _yes(right, "–".join(tcp)),
        "reach": _reach(loaded["reach"], expected.reach),
    }


def _matching(names: Iterable[str], patterns: Iterable[str]) -> frozenset[str]:
    patterns = tuple(patterns)
    return frozenset(name for name in names if any(fnmatchcase(name, p) for p in patterns))


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


def _reach(found: float, sheet: float | None) -> Answer:
    if sheet is None:
        return Answer(None, f"{found:.2f}")
    low, high = REACH_SHARES
    return Answer(low * sheet <= found <= high * sheet, f"{found:.2f} / {sheet:g}")


def _steps(trial: Seen, steps: int) -> Answer:
    if "stands" not in trial:
        return _yes(False)
    if not trial["stands"]:
        return Answer(False, "kicks")
    exploded = trial["exploded"]
    return _yes(exploded is None or exploded > steps, f"step {exploded}")


def _agreement(seen: Seen) -> Answer:
    if "both" not in seen:
        return _yes(False)
    if seen["physics"]:
        return Answer(False, f"{seen['physics']} unseen")
    alone, checked = seen["checks"], seen["both"] + seen["checks"]
    return _yes(alone <= MISSED * checked + 1, f"{alone} of {checked} missed")


def _yes(good: bool, otherwise: str = "") -> Answer:
    return YES if good else Answer(False, otherwise or "no")
