"""The record of a survey as a page: shares beside targets, then robot by robot."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from measurements.robots.expectations import KINDS, Expectations, Expected
from measurements.robots.judge import QUESTIONS, Answer, judge, reason, usable
from measurements.robots.record import Record, Seen

# What manipulators with usable files are to reach (%).
TARGETS: Mapping[str, float] = {
    "refused": 100,
    "arm": 95,
    "gripper": 92,
    "tcp": 92,
    "facing": 92,
    "beside": 95,
    "steps_50": 97,
    "numbers": 95,
    "no_raw": 100,
    "no_crash": 100,
}
COLUMNS = tuple(q for q in QUESTIONS if q not in ("refused", "no_raw", "no_crash"))
LONGEST_REASON = 160  # characters

Judged = tuple[str, Seen, Expected, dict[str, Answer]]


def markdown(record: Record, expectations: Expectations) -> Iterator[str]:
    """Yield the lines of the page."""
    judged = [
        (key, seen, expectations.of(key), judge(seen, expectations.of(key)))
        for key, seen in sorted(record.robots.items())
    ]
    yield "# Robots that this library had not seen"
    yield ""
    yield from _about(record, judged)
    yield "## Shares"
    yield ""
    yield from _shares(judged)
    for kind in KINDS:
        rows = [one for one in judged if one[2].kind == kind]
        if rows:
            yield ""
            yield f"## {kind.capitalize()} ({len(rows)})"
            yield ""
            yield from _rows(rows)
    yield ""
    yield "## Why not"
    yield ""
    for key, seen, _, _ in judged:
        if why := reason(seen):
            yield f"- `{key}`: {_shortened(why)}"


def _about(record: Record, judged: Sequence[Judged]) -> Iterator[str]:
    versions = ", ".join(f"{name} {version}" for name, version in record.versions.items())
    yield f"{len(judged)} URDFs with joints that move, each tried in a process of its own by"
    yield "`python -m measurements.robots`, which writes this page. Nothing is known of a robot but"
    yield "its URDF; what is expected of it stands in `measurements/robots/expected.yaml`."
    yield f"Made with {versions}."
    yield ""
    yield "- arms, grippers: every arm and gripper has its own joints and no others;"
    yield "  reach: ours, to the TCP / the maker's, to the wrist or the flange (m)"
    yield "- valid alone, face to face, beside a Panda: `validate()`, at the presets' distances"
    yield "- 50 steps, 500 steps: holds still when it is to (less than 0.1 rad in the first step,"
    yield "  at rest after 20), then random actions; no joint at ten times its largest speed"
    yield "- its own joints: each number moves them by more than half a step within one or two, and"
    yield "  others by less than a tenth of what was asked for until then"
    yield "- TCP move: 5 cm by inverse kinematics, less than 2 mm off; URDF, Drake: saved, and read"
    yield "  again"
    yield "- checks as physics: in 200 random postures, links that are inside each other by 1 mm in"
    yield "  physics are so in checks (else: how many are unseen), and the reverse but for 3 %"
    yield ""


def _shares(judged: Sequence[Judged]) -> Iterator[str]:
    groups = {
        "manipulators": [one for one in judged if one[2].kind == "manipulator" and usable(one[1])],
        "hands": [one for one in judged if one[2].kind == "hand" and usable(one[1])],
        "humanoids": [one for one in judged if one[2].kind == "humanoid" and usable(one[1])],
        "all": list(judged),
    }
    yield _row("", "target", *(f"{name} ({len(rows)})" for name, rows in groups.items()))
    yield _row("---", "---:", *["---:"] * len(groups))
    for question, words in QUESTIONS.items():
        target = f"{TARGETS[question]:g} %" if question in TARGETS else ""
        yield _row(words, target, *(_share(rows, question) for rows in groups.values()))
    yield ""
    yield "Of robots whose meshes are all there, but in the last column."


def _share(judged: Iterable[Judged], question: str) -> str:
    answers = [answers[question].good for _, _, _, answers in judged]
    asked = [good for good in answers if good is not None]
    if not asked:
        return ""
    return f"{sum(asked)} of {len(asked)}: {sum(asked) / len(asked):.0%}"


def _rows(judged: Iterable[Judged]) -> Iterator[str]:
    yield _row("robot", *(QUESTIONS[question] for question in COLUMNS))
    yield _row("---", *["---"] * len(COLUMNS))
    for key, seen, _, answers in judged:
        name = f"`{key}`" if usable(seen) else f"`{key}` (meshes missing)"
        yield _row(name, *(_cell(answers[question]) for question in COLUMNS))


def _cell(answer: Answer) -> str:
    return f"**{answer.text}**" if answer.good is False else answer.text


def _row(*cells: str) -> str:
    return f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"


def _shortened(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= LONGEST_REASON else f"{line[: LONGEST_REASON - 1]}…"
