"""``python -m benchmarks robots`` and ``mjcfs``: tries robots of other packages.

Each is tried in a process of its own: a crash is a result like any other.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from typing import Any

from tqdm import tqdm

from benchmarks.records import (
    DOCS,
    Record,
    RecordError,
    read_record,
    table,
    versions_of,
    write_page,
    write_record,
)
from benchmarks.robots.judge import (
    EXACT,
    EXPECTED,
    EXPECTED_MJCFS,
    KINDS,
    MJCF_QUESTIONS,
    NEAR,
    QUESTIONS,
    Answer,
    Expected,
    expected_of,
    judge,
    judge_mjcf,
    read_expectations,
    reason,
)
from robots import AssetError, MissingPackageError, UnknownNameError

# Package on the index -> folder of its wheel, behind which its robots lie.
PACKAGES: Mapping[str, str] = {
    "example-robot-data": "share/example-robot-data/robots",
    "mani_skill": "mani_skill/assets/robots",
    "pybullet": "pybullet_data",
}
# What manipulators with usable files are to reach (%).
TARGETS: Mapping[str, float] = {
    "refused": 100,
    "arm": 95,
    "gripper": 92,
    "tcp": 92,
    "alone": 97,
    "facing": 97,
    "beside": 97,
    "steps_50": 97,
    "numbers": 97,
    "fingers": 97,
    "grasps": 92,
    "square": 100,
    "hand_over": 75,
    "two_hands": 60,
    "no_raw": 100,
    "no_crash": 100,
}
COLUMNS = tuple(q for q in QUESTIONS if q not in ("refused", "no_raw", "no_crash"))
LONGEST_REASON = 160  # characters
PROBE = "benchmarks.robots.probe"

_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_COLLISION = re.compile(rb"<collision.*?</collision>", re.DOTALL)
_MESH = re.compile(rb"""<mesh\s[^>]*filename\s*=\s*["']([^"']+)["']""")
_MOVING = re.compile(rb"""<joint\s[^>]*type\s*=\s*["'](?!fixed["'])""")
_PASSING = re.compile(re.escape(tempfile.gettempdir()) + r"/tmp\w+/")
_CUT_SHORT = re.compile(r"(/[^\s'\"…]*)…")

Judged = tuple[str, Record, Expected, dict[str, Answer]]


@dataclass(frozen=True)
class Robot:
    """A URDF or MJCF of a source.

    Attributes:
        source: Name of the source.
        path: Of the file, relative to the source's folder, with forward slashes.
        folder: The source's folder on this machine.
    """

    source: str
    path: str
    folder: Path

    @property
    def key(self) -> str:
        """What it is called in the record."""
        return f"{self.source}/{self.path}"

    @property
    def file(self) -> Path:
        """The file on this machine."""
        return self.folder / self.path

    def missing_meshes(self) -> list[str]:
        """Return the meshes that physics needs and that the source has nowhere.

        Whatever a reference starts with, a file is looked for by its name and that of its folder.
        """
        there = _tails(self.folder)
        meshes = [
            mesh.decode(errors="replace")
            for collision in _COLLISION.findall(_COMMENT.sub(b"", self.file.read_bytes()))
            for mesh in _MESH.findall(collision)
        ]
        return [mesh for mesh in dict.fromkeys(meshes) if _tail(mesh) not in there]


def robots(
    folders: Sequence[str] = (),
    *,
    sources: tuple[str, ...] = (),
    only: tuple[str, ...] = ("*",),
    out: Path = DOCS / "robots.json",
    workers: int = 1,
    seconds: float = 1200.0,
    resume: bool = False,
    render: bool = False,
) -> int:
    """Guess the robots in other packages' URDFs, and record which of them work.

    Args:
        folders: Folders with URDFs, as [NAME=]FOLDER.
        sources: Installed packages: example-robot-data, mani_skill, pybullet (all).
        only: Robots whose SOURCE/PATH matches a pattern of the shell.
        out: The record; the page is beside it.
        workers: Processes at a time.
        seconds: Time limit for a robot (s).
        resume: Keep what the record holds, and try the others.
        render: Try nothing; write the page of the record anew.

    Raises:
        RobotLayoutsError: If a source does not exist, or something cannot be read or written.
    """
    if workers < 1:
        raise RecordError(f"--workers is {workers}; it must be 1 or more")
    record: Record = {"versions": {}, "robots": {}}
    if resume or render:
        record = read_record(out, **record)
    if not render:
        found = [*map(named_folder, folders), *((name, package_folder(name)) for name in sources)]
        urdfs = find_robots(found or _installed())
        wanted = [r for r in urdfs if any(fnmatch(r.key, pattern) for pattern in only)]
        record["versions"] |= versions_of("robot-layouts", "sapien", *PACKAGES)
        survey(record, out, wanted, workers, seconds)
    judged = _judged(record, read_expectations(EXPECTED), judge)
    kinds = {kind: [one for one in judged if one[2].kind == kind] for kind in KINDS}
    write_page(
        out,
        "robots",
        versions=record["versions"],
        judged=judged,
        before=[key for key, seen, *_ in judged if "made_with" not in seen],
        shares=_shares(judged),
        tables={kind: (len(rows), _rows(rows)) for kind, rows in kinds.items() if rows},
        reasons=_reasons(judged, LONGEST_REASON, "…"),
    )
    return 0


def mjcfs(
    folders: Sequence[str] = (),
    *,
    out: Path = DOCS / "mjcf.json",
    seconds: float = 1200.0,
    resume: bool = False,
    render: bool = False,
) -> int:
    """Try the MJCFs of benchmarks/robots/mjcfs.yaml, and record which of them work.

    Args:
        folders: Packages by name and the folder into which their wheel was unpacked, NAME=FOLDER.
        out: The record; the page is beside it.
        seconds: Time limit for a robot (s).
        resume: Keep what the record holds, and try the others.
        render: Try nothing; write the page of the record anew.

    Raises:
        RobotLayoutsError: If a folder does not exist, or something cannot be read or written.
    """
    expectations, record = read_expectations(EXPECTED_MJCFS), {"versions": {}, "robots": {}}
    if resume or render:
        record = read_record(out, **record)
    if not render:
        known, robots = dict(map(named_folder, folders)), list[Robot]()
        for key in expectations:
            source, _, path = key.partition("/")
            if source in known and (known[source] / path).is_file():
                robots.append(Robot(source, path, known[source]))
        record["versions"] |= versions_of("robot-layouts", "sapien", "mujoco")
        record["versions"] |= dict(_unpacked_versions(known))
        survey(record, out, robots, 1, seconds)
    judged = _judged(record, expectations, judge_mjcf)
    write_page(
        out,
        "mjcf",
        versions=record["versions"],
        judged=judged,
        questions=MJCF_QUESTIONS,
        rows=table(
            ("file", *MJCF_QUESTIONS.values()),
            (
                [f"`{key}`", *(answer.text for answer in found.values())]
                for key, _, _, found in judged
            ),
            (),
        ),
        share=lambda rows, question: _share(rows, question)[0],
        arms=[one for one in judged if one[2].kind == "manipulator"],
        reasons=_reasons(judged, 220, " …"),
        near=f"{NEAR * 100:g}",
        exact=f"{EXACT:g}",
    )
    return 0


def _unpacked_versions(folders: Mapping[str, Path]) -> Iterator[tuple[str, str]]:
    """Yield the versions that unpacked packages give, by their folders of metadata."""
    for name, folder in folders.items():
        for about in (*folder.glob("*.dist-info"), *folder.glob("*-*/PKG-INFO")):
            part = about.parent.name if about.name == "PKG-INFO" else about.stem
            yield name, part.rpartition("-")[2]


def survey(
    record: Record, out: Path, robots: Sequence[Robot], workers: int, seconds: float
) -> None:
    """Try robots that are not in a record, and keep what was seen of each in its file at once.

    Raises:
        UnwritableFileError: If the file cannot be written.
    """
    waiting = [robot for robot in robots if robot.key not in record["robots"]]
    with ThreadPoolExecutor(workers) as pool:
        seen = pool.map(lambda robot: probe(robot, seconds), waiting)
        for robot, found in zip(waiting, tqdm(seen, total=len(waiting), disable=None), strict=True):
            record["robots"] = dict(sorted({**record["robots"], robot.key: found}.items()))
            write_record(out, record)


def probe(robot: Robot, seconds: float) -> Record:
    """Return what one process sees of a robot; ``ended`` says how, where it did not end well."""
    command = [sys.executable, "-m", PROBE, str(robot.file)]
    environment, ended = {**os.environ, "OMP_NUM_THREADS": "1"}, ""
    with tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as errors:
        try:
            done = subprocess.run(
                command, stdout=output, stderr=errors, env=environment, timeout=seconds, check=False
            )
        except subprocess.TimeoutExpired:
            ended = f"took longer than {seconds:g} s"
        else:
            errors.seek(0)
            *_, last = ["no word", *errors.read().decode(errors="replace").strip().splitlines()]
            if done.returncode < 0:
                ended = f"crashed: {signal.Signals(-done.returncode).name}"
            elif done.returncode:
                ended = f"ended with {done.returncode}: {last}"
        output.seek(0)
        lines = output.read().decode(errors="replace").splitlines()
    seen: Record = {"made_with": version("robot-layouts"), "missing": robot.missing_meshes()}
    for line in lines:
        if line.startswith("{"):  # libraries print, too
            seen.update(json.loads(line))
    if ended:
        seen["ended"] = ended
    return without_folders(seen, robot.folder.as_posix())


def without_folders(seen: Record, folder: str) -> Record:
    """Return a result in which no path names a folder of this machine.

    Args:
        seen: The result; messages may cut paths short.
        folder: The source's folder, to which paths become relative.
    """

    def cut(found: re.Match[str]) -> str:
        return "…" if folder.startswith(found[1]) else found[0]

    text = _PASSING.sub("", json.dumps(seen, ensure_ascii=False))
    text = text.replace(f"{folder}/", "").replace(folder, ".")
    return json.loads(_CUT_SHORT.sub(cut, text))


def find_robots(folders: Iterable[tuple[str, Path]]) -> Iterator[Robot]:
    """Yield every URDF in folders, by name, that has a joint that moves, sorted by path."""
    for source, folder in folders:
        for urdf in sorted(folder.rglob("*.urdf")):
            if _MOVING.search(_COMMENT.sub(b"", urdf.read_bytes())):
                yield Robot(source, urdf.relative_to(folder).as_posix(), folder)


def package_folder(name: str) -> Path:
    """Return the folder of an installed package in which its robots lie.

    Raises:
        UnknownNameError: If it is none of `PACKAGES`.
        MissingPackageError: If it is not installed.
    """
    if name not in PACKAGES:
        raise UnknownNameError("package of robots", name, PACKAGES)
    try:
        files = distribution(name).files or ()
    except PackageNotFoundError as error:
        raise MissingPackageError(f"{name} is not installed: pip install {name}") from error
    part = f"{PACKAGES[name]}/"
    for file in files:
        if part in file.as_posix():
            return Path(str(file.locate()).split(part)[0]) / PACKAGES[name]
    raise MissingPackageError(f"{name} holds no robots in {PACKAGES[name]}: pip install {name}")


def named_folder(text: str) -> tuple[str, Path]:
    """Return name and path of a folder given as ``NAME=PATH``, or as ``PATH`` alone.

    Raises:
        AssetError: If there is no such folder.
    """
    name, equals, path = text.partition("=")
    folder = Path(path if equals else text).absolute()
    if not folder.is_dir():
        raise AssetError(f"there is no folder {folder}")
    return (name if equals else folder.name), folder


def _installed() -> Iterator[tuple[str, Path]]:
    for name in PACKAGES:
        try:
            yield name, package_folder(name)
        except MissingPackageError as error:
            print(f"{name} is left out: {error}", file=sys.stderr)


@lru_cache(maxsize=16)
def _tails(folder: Path) -> frozenset[str]:
    """Return name and folder's name of every file, and the name alone."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return frozenset(
        tail for file in files for tail in (f"{file.parent.name}/{file.name}", file.name)
    )


def _tail(mesh: str) -> str:
    names = [name for name in mesh.split("://")[-1].split("/") if name not in ("", ".", "..")]
    return "/".join(names[-2:])


def _judged(
    record: Record,
    expectations: Mapping[str, Expected],
    judge_one: Callable[[Any, Expected], dict[str, Answer]],
) -> list[Judged]:
    judged: list[Judged] = []
    for key, seen in sorted(record["robots"].items()):
        expected = expected_of(key, expectations)
        judged.append((key, seen, expected, judge_one(seen, expected)))
    return judged


def _share(judged: Iterable[Judged], question: str) -> tuple[str, str]:
    """Return how many answers are good, of those that were asked for, and in percent."""
    answers = [answers[question].good for _, _, _, answers in judged]
    asked = [good for good in answers if good is not None]
    if not asked:
        return "", ""
    return f"{sum(asked)} of {len(asked)}", f": {sum(asked) / len(asked):.0%}"


def _shares(judged: Sequence[Judged]) -> str:
    usable = [one for one in judged if not one[1].get("missing")]
    groups = {
        f"{kind}s": [one for one in usable if one[2].kind == kind]
        for kind in ("manipulator", "hand", "humanoid")
    }
    groups["all"] = list(judged)
    rows = (
        (
            words,
            f"{TARGETS[question]:g} %" if question in TARGETS else "",
            *("".join(_share(rows, question)) for rows in groups.values()),
        )
        for question, words in QUESTIONS.items()
    )
    return table(("", "target", *(f"{name} ({len(g)})" for name, g in groups.items())), rows)


def _rows(judged: Iterable[Judged]) -> str:
    rows = (
        (
            f"`{key}`{' (meshes missing)' if seen.get('missing') else ''}",
            *(
                f"**{answer.text}**" if answer.good is False else answer.text
                for answer in (answers[question] for question in COLUMNS)
            ),
        )
        for key, seen, _, answers in judged
    )
    escaped = ([cell.replace("|", "/") for cell in row] for row in rows)
    return table(("robot", *(QUESTIONS[question] for question in COLUMNS)), escaped, ())


def _reasons(judged: Iterable[Judged], longest: int, cut: str) -> dict[str, str]:
    """Return why robots are not as they should be, shortened to so many characters."""
    found = {key: " ".join(reason(seen).split()) for key, seen, _, _ in judged}
    return {
        key: why if len(why) <= longest else why[: longest - (cut == "…")] + cut
        for key, why in found.items()
        if why
    }
