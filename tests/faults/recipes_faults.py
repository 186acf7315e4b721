"""Recipes of somebody else: whatever they say, nothing of theirs runs, and nothing is half-made."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from pathlib import Path

from robot_layouts.data.playing.command_options import Players
from robot_layouts.data.recipe_commands import build_command, recipe_command
from robots import RobotLayoutsError
from tests.data.recordings import record
from tests.faults.fault import GOES_ON, NO_FILES, Fault, each
from tests.faults.strangers import lay_bait, runs_nothing

AREA = "recipes"
TASK, POLICY = "PushT-v1", "tests.data.policies:still"
STEPS = "max_episode_steps: 3"


def _of(more: str, task: str = TASK, seeds: str = "0") -> str:
    return f"recordings: {{it: {{task: {task}, seeds: {seeds}, {more}}}}}"


GOOD = _of(f"policy: '{POLICY}', {STEPS}")

_FIELDS = {
    "no recordings": "made_with: {numpy: 1.0}",
    "recordings are a list": "recordings: [PushT-v1]",
    "an unknown key": f"recording: {{}}\n{GOOD}",
    "made_with is a list": f"made_with: [numpy]\n{GOOD}",
    "a recording is a list": "recordings: {it: [PushT-v1]}",
    "a task is nobody's": _of("", task="PushTee-v1"),
    "a policy that is not there": _of("policy: 'tests.data.policies:stil'"),
    "layout is somewhere else": _of("layout: ../layout.yaml"),
    "layout is /etc/passwd": _of("layout: /etc/passwd"),
    "a robot that is not there": _of("robots: pandy"),
    "a robot of no place": _of("robots: {left: panda_stick}"),
    "bystanders are a number": _of("bystanders: 7"),
    "control_mode is unknown": _of("control_mode: pd_ee_dance"),
    "observations are a word": _of(f"observations: maybe, {STEPS}, policy: '{POLICY}'"),
    "no steps": _of("max_episode_steps: 0"),
    "endless steps": _of("max_episode_steps: .inf"),
    "randomization of nothing there is": _of("randomization: {mas: 1}"),
    "a camera without a place": _of("cameras: [{name: a}]"),
    "sensor_configs is a list": _of("sensor_configs: [64]"),
    "camera_size is a word": _of("camera_size: big"),
    "visuals is unknown": _of("visuals: pretty"),
    "file_size is negative": _of(f"file_size: -1, {STEPS}, policy: '{POLICY}'"),
    "exports are a list": _of("exports: [lerobot]"),
    "an export of an unknown format": _of("exports: {x: {format: csv}}"),
    "an export with an unknown option": _of("exports: {x: {format: lerobot, fsp: 1}}"),
    "an export whose flag is a word": _of("exports: {x: {format: robomimic, depth: 5}}"),
    "an export in the recording's folder": _of("exports: {it: {format: lerobot}}"),
    "files are a list": _of("files: [trajectory.h5]"),
    "an unknown key of a recording": _of("sedes: 1"),
}

_NAMES = {
    f"the name of a recording is {what}": GOOD.replace("it:", f"{name}:")
    for what, name in {
        "a path up": "../it",
        "hidden": ".it",
        "empty": "''",
        "of 101 letters": "x" * 101,
        "in Cyrillic letters": "Аrm",
    }.items()
} | {
    "the name of an export is a path up": _of("exports: {../x: {format: lerobot}}"),
    "the name of an export is a path": _of("exports: {/tmp/x: {format: lerobot}}"),
}

_SEEDS = {
    f"seeds are {seeds}": _of(STEPS, seeds=seeds) for seeds in ("-1", "[]", "9-0", "[0-2, 1]")
}

_BOMBS = {
    "empty": "",
    "two recipes": f"{GOOD}\n---\n{GOOD}",
    "a key twice": f"{GOOD}\n{GOOD}",
    "half": GOOD[: len(GOOD) // 2],
    "not UTF-8": "\udcff",
    "a tag of Python's": "recordings: !!python/object/apply:os.system [touch ran]",
    "billion laughs": "a0: &a0 [ha, ha]\n"
    + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 12)),
}

_GADGETS = {
    "a policy in a module": _of("policy: 'strange:policy'"),
    "a takeover in a module": _of("takeover: 'strange:policy'"),
    "a corrector in a module": _of("corrector: 'strange:policy'"),
    "a robot in a module": _of("robots: 'strange:ROBOT'"),
    "a robot of a template": _of("robots: {arm: arm.xacro}"),
    "a robot in a module, in a layout's file": _of("layout: cell.yaml"),
    "a robot in a module, in a preset": _of(
        "layout: {preset: single, robots: {arm: 'strange:ROBOT'}}"
    ),
    "a module of Python's": _of("policy: 'antigravity:fly'"),
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    yield from each(AREA, "{}", _build, {**_FIELDS, **_NAMES, **_SEEDS, **_BOMBS})
    yield from each(AREA, "{}", _runs_nothing, _GADGETS)
    yield from each(AREA, "the file is {}", _build_of, NO_FILES)
    for what, run in _BUILDS.items():
        yield Fault(AREA, what, run)
    for what, run in _RECIPES_OF.items():
        yield Fault(AREA, f"the recipe of {what}", run)
    yield Fault(AREA, "an export that is there, half of it", _half_an_export, GOES_ON)


# -- building -------------------------------------------------------------------------------------


def _make(folder: Path, *words: str) -> int:
    """Build the folder's recipe here; returns the exit code of the command."""
    only = {"only": words} if words else {}
    players = Players(workers=0)  # no module but ours is named, or the command is run
    return build_command(
        folder / "recipe.yaml", out=folder / "out", trust=True, players=players, **only
    )


def _build(folder: Path, text: str) -> None:
    """Build a recipe that is none; nothing may be made of it."""
    (folder / "recipe.yaml").write_text(text, errors="surrogateescape")
    try:
        _make(folder)
    finally:
        assert not [path for path in folder.rglob("*.h5")], "something of it was recorded"
        assert not (folder.parent / "it").exists()


def _build_of(folder: Path, make: Callable[[Path], object]) -> None:
    make(folder / "recipe.yaml")
    _make(folder)


def _runs_nothing(folder: Path, text: str) -> None:
    """Build by the command, in a folder of a stranger's."""
    lay_bait(folder)
    (folder / "recipe.yaml").write_text(text)
    runs_nothing(folder, "data", "build", "recipe.yaml", "--out", "out", "--workers", "0")


def _other_bytes(folder: Path) -> None:
    files = {"trajectory.h5": "0" * 64, "trajectory.json": "0" * 64}
    _write(folder, _of(f"policy: '{POLICY}', {STEPS}, files: {files}"))
    _make(folder)


def _write(folder: Path, text: str = GOOD) -> None:
    (folder / "recipe.yaml").write_text(text)


def _made_otherwise(folder: Path) -> None:
    _write(folder)
    assert _make(folder) == 0
    before = _bytes(folder / "out")
    _write(folder, GOOD.replace(STEPS, "max_episode_steps: 4"))
    try:
        _make(folder)
    finally:
        assert _bytes(folder / "out") == before


def _bytes(folder: Path) -> dict[str, bytes]:
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def _out_is_a_file(folder: Path) -> None:
    _write(folder)
    (folder / "out").write_text("precious")
    try:
        _make(folder)
    finally:
        assert (folder / "out").read_text() == "precious"


def _unknown_recording(folder: Path) -> None:
    _write(folder)
    try:
        _make(folder, "them")
    finally:
        assert not (folder / "out").exists()


def _policy_fails(folder: Path) -> None:
    _write(folder, _of(f"policy: 'tests.data.policies:fails', {STEPS}"))
    if _make(folder):
        raise RobotLayoutsError("an episode is not recorded")


_BUILDS: dict[str, Callable[[Path], None]] = {
    "its files have another SHA-256": _other_bytes,
    "a recording that was made otherwise is there": _made_otherwise,
    "a file is where its folder is to be": _out_is_a_file,
    "a recording that it lacks is asked for": _unknown_recording,
    "its policy fails": _policy_fails,
}


def _half_an_export(folder: Path) -> str:
    """An export that was being written when the process died is none, and is made."""
    text = GOOD.replace(STEPS, f"{STEPS}, exports: {{table: {{format: robomimic, {_KEEP}}}}}")
    _write(folder, text)
    (folder / "out" / "table.1.0.partial").mkdir(parents=True)
    assert _make(folder) == 0
    whole = _bytes(folder / "out" / "table")
    assert whole
    return "the export is whole"


_KEEP = "include_failures: true"


# -- the recipe of a recording --------------------------------------------------------------------


def _recipe_of(folder: Path, make: Callable[[Path], object]) -> None:
    make(folder / "recording")
    try:
        recipe_command(folder / "recording", out=folder / "recipe.yaml")
    finally:
        assert not (folder / "recipe.yaml").exists()


def _recorded(path: Path, file: str = "", text: str = "") -> None:
    path.mkdir()
    record(path / "trajectory.h5", TASK, [2])
    if file:
        (path / file).write_text(text)


_RECIPES_OF: dict[str, Callable[[Path], None]] = {
    what: functools.partial(_recipe_of, make=make)
    for what, make in {
        "nothing": lambda path: None,
        "an empty folder": Path.mkdir,
        "a text": lambda path: path.write_text("PushT-v1"),
        "a recording whose json is empty": lambda path: _recorded(path, "trajectory.json"),
        "a recording whose json is a list": lambda path: _recorded(path, "trajectory.json", "[]"),
        "a recording whose h5 file is a text": lambda path: _recorded(path, "trajectory.h5", "x"),
    }.items()
}
