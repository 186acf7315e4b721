"""Suites of somebody else, and runs that are damaged."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from robot_layouts.data.suite.run import run_suite, verify_run
from robot_layouts.data.suite.suite import load_suite
from robots import RobotLayoutsError
from tests.faults.fault import GOES_ON, Fault, each, run_command
from tests.faults.strangers import lay_bait, runs_nothing

AREA = "suites"
TASK, POLICY = "PushT-v1", "tests.data.policies:LEANS"
HEAD = "name: x\nseeds: 0\ntasks:\n"
SUITE = f"{HEAD}  - {{task: {TASK}, name: First}}\n  - {{task: {TASK}, name: Later, seeds: 1-2}}\n"


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    yield from each(AREA, "{}", _load, {**_FIELDS, **_NAMES, **_SEEDS, **_BOMBS})
    for what, value in _ELSEWHERE.items():
        for key in ("layout", "randomization"):
            run = functools.partial(_reads_nothing, key=key, value=value)
            yield Fault(AREA, f"its {key} is {what}", run)
    for what, text in _GADGETS.items():
        run = functools.partial(_runs_nothing, words=("show", "suite.yaml"), text=text)
        yield Fault(AREA, f"show: {what}", run)
    for words in (("report", "."), ("verify", ".", "--workers=0")):
        run = functools.partial(_runs_nothing, words=words, text=_GADGETS["a task in a module"])
        yield Fault(AREA, f"{words[0]}: a task in a module", run)
    yield from each(AREA, "goes on: {}", _goes_on, _DAMAGE)
    yield from each(AREA, "goes on: {}", _same, _HARMLESS, GOES_ON)
    for what, run in _RUNS.items():
        yield Fault(AREA, what, run)


# -- files ----------------------------------------------------------------------------------------


def _load(folder: Path, text: str) -> None:
    (folder / "suite.yaml").write_text(text)
    load_suite(folder / "suite.yaml")


def _of(entry: str) -> str:
    return f"{HEAD}  - {{task: {TASK}, {entry}}}\n"


_FIELDS = {
    "name is a list": "name: [x]\nseeds: 0\ntasks: [PushT-v1]",
    "seeds is a mapping": "name: x\nseeds: {a: 1}\ntasks: [PushT-v1]",
    "tasks is a text": "name: x\nseeds: 0\ntasks: PushT-v1",
    "a task is a list": f"{HEAD}  - [PushT-v1]\n",
    "a task is nobody's": f"{HEAD}  - PushX-v1\n",
    "policies is a list": f"policies: [expert]\n{SUITE}",
    "a policy is a number": f"policies: {{PushT-v1: 5}}\n{SUITE}",
    "a policy of nobody's task": f"policies: {{PushX-v1: expert}}\n{SUITE}",
    "control_mode is unknown": f"control_mode: pd_ee_dance\n{SUITE}",
    "control_mode of a robot that is not there": f"control_mode: {{left: pd_joint_pos}}\n{SUITE}",
    "obs_mode is a mapping": f"obs_mode: {{a: 1}}\n{SUITE}",
    "obs_mode is unknown": f"obs_mode: smell\n{SUITE}",
    "randomization is a number": f"randomization: 5\n{SUITE}",
    "randomization of nothing there is": f"randomization: {{mas: 1}}\n{SUITE}",
    "layout is a number": _of("layout: 5"),
    "layout lacks the task's place": _of("layout: {robots: {left: {robot: panda_stick}}}"),
    "layout of an unknown robot": _of("layout: {robots: {arm: {robot: pandy}}}"),
    "layout far away": _of(
        "layout: {robots: {arm: {robot: panda_stick, position: [1e300, 0, 0]}}}"
    ),
    "a preset that is none": _of("layout: {preset: sqare, robots: {arm: panda_stick}}"),
    "a preset without robots": _of("layout: {preset: single}"),
    "a preset of no distance": _of(
        "layout: {preset: ring, robots: {arm: panda_stick}, radius: -1}"
    ),
    "layout and layouts": _of("layout: own, layouts: {own: own}"),
    "layouts is empty": _of("layouts: {}"),
    "an unknown key": f"seed: 1\n{SUITE}",
    "an unknown key of a task": _of("sedes: 1"),
}

_NAMES = {
    "a name of a suite is a path": SUITE.replace("name: x", "name: ../x"),
    "a name is a path": _of("name: ../../First"),
    "a name is of 101 letters": _of(f"name: {'x' * 101}"),
    "a name in Cyrillic letters": _of("name: Аrm"),
    "a name twice": SUITE.replace("Later", "First"),
    "a name of a layout is a path": _of("layouts: {/etc: own}"),
}

_SEEDS = {
    f"seeds are {seeds}": _of(f"seeds: {seeds}")
    for seeds in (
        "-1", "0.5", "1e12", "[]", "9-0", "0-4294967295", "[0-2, 1]", "{0: 1}",
    )
}  # fmt: skip

_BOMBS = {
    "empty": "",
    "a number": "5",
    "two suites": f"{SUITE}---\n{SUITE}",
    "a key twice": f"name: y\n{SUITE}",
    "half": SUITE[: len(SUITE) // 2],
    "an alias": f"a: &a 1\nb: *a\n{SUITE}",
    "billion laughs": "a0: &a0 [ha, ha]\n"
    + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 12)),
    "a Python object": "!!python/object/apply:os.system ['touch ran']",
    "100,000 brackets": "[" * 100_000,
    "a megabyte of remarks": "#" * 2**20,
    "a suite of 100,000 cases of 100,000 seeds": "name: x\nseeds: 0-99999\ntasks:\n"
    + "".join(f"  - {{task: x, name: a{i}}}\n" for i in range(100_000)),
}


# -- what lies elsewhere --------------------------------------------------------------------------

SECRET = "password of somebody else"

_ELSEWHERE = {
    "/etc/passwd": "/etc/passwd",
    "a file above it": "../secret.yaml",
    "a link that leads out": "link.yaml",
    "below a link that leads out": "link/secret.yaml",
    "a link to itself": "itself.yaml",
    "a name with a null character": '"a\\0b"',
    "in a home": "~/secret.yaml",
}


def _reads_nothing(folder: Path, key: str, value: str) -> None:
    """Read a suite in a folder below that of a secret; no message tells the secret."""
    (folder / "secret.yaml").write_text(SECRET)
    own = folder / "theirs"
    (own / "inside").mkdir(parents=True)
    (own / "link.yaml").symlink_to(folder / "secret.yaml")
    (own / "link").symlink_to(folder)
    (own / "itself.yaml").symlink_to("itself.yaml")
    (own / "suite.yaml").write_text(_of(f"{key}: {value}"))
    with pytest.raises(RobotLayoutsError) as caught:
        load_suite(own / "suite.yaml")
    assert SECRET not in str(caught.value)
    assert "root:" not in str(caught.value)
    raise caught.value


_GADGETS = {
    "a task in a module": f"{HEAD}  - strange:Task-v1\n",
    "a task in a module of Python's": f"{HEAD}  - antigravity:Task-v1\n",
    "a policy of a task in a module": f"policies: {{'strange:Task-v1': expert}}\n{SUITE}",
    "a robot in a module": _of("layout: {robots: {arm: {robot: 'strange:ROBOT'}}}"),
    "a robot of a preset in a module": _of("layout: {preset: single, robots: {arm: 'strange:R'}}"),
    "a robot of a preset is a program": _of("layout: {preset: single, robots: {arm: ./arm.xacro}}"),
    "a layout file with a robot in a module": _of("layout: cell.yaml"),
}


def _runs_nothing(folder: Path, words: tuple[str, ...], text: str) -> None:
    """Look at a suite in a folder of a stranger's."""
    lay_bait(folder)
    (folder / "suite.yaml").write_text(text)
    runs_nothing(folder, "suite", *words)


# -- runs -----------------------------------------------------------------------------------------


def _suite(folder: Path, text: str = SUITE) -> Any:
    (folder / "mine.yaml").write_text(text)
    return load_suite(folder / "mine.yaml")


def _play(folder: Path, policy: Any = POLICY, text: str = SUITE, **how: Any) -> Mapping[str, Any]:
    """Play a suite into the folder's ``run``, and return the hashes of its receipts."""
    run = run_suite(_suite(folder, text), folder / "run", policy, **{"workers": 0, **how})
    return {name: receipt.hash for name, receipt in run.receipts.items()}


def _receipt(folder: Path, case: str = "First") -> Path:
    return folder / "run" / "receipts" / f"{case}.json"


def _replaced(old: str, new: str, folder: Path) -> None:
    text = _receipt(folder).read_text()
    assert old in text
    _receipt(folder).write_text(text.replace(old, new, 1))


def _link(folder: Path) -> None:
    _receipt(folder).unlink()
    _receipt(folder).symlink_to("/dev/zero")


_DAMAGE: dict[str, Callable[[Path], object]] = {
    "a receipt is half": lambda folder: os.truncate(_receipt(folder), 500),
    "a receipt is a folder": lambda folder: (_receipt(folder).unlink(), _receipt(folder).mkdir()),
    "a receipt is a FIFO": lambda f: (_receipt(f).unlink(), os.mkfifo(_receipt(f))),
    "a receipt is /dev/zero": _link,
    "a receipt was changed": partial(_replaced, '"success": false', '"success": true'),
    "a receipt of another task": partial(_replaced, '"id": "PushT-v1"', '"id": "PickCube-v1"'),
    "a receipt of another case": lambda f: _receipt(f, "Later").rename(_receipt(f)),
    "its suite is another": lambda f: (f / "run" / "suite.yaml").write_text(_of("seeds: 5")),
    "its suite names a module": lambda f: (f / "run" / "suite.yaml").write_text(
        f"{HEAD}  - strange:Task-v1\n"
    ),
    "its suite is gone": lambda folder: (folder / "run" / "suite.yaml").unlink(),
}

_HARMLESS: dict[str, Callable[[Path], object]] = {
    "a receipt is gone": lambda folder: _receipt(folder).unlink(),
    "a file that was half written": lambda folder: (
        _receipt(folder).with_name(".First.json.123.partial").write_text("{")
    ),
    "a report lies in it": lambda folder: (folder / "run" / "report.html").write_text("x"),
    "its suite was reformatted": lambda folder: (folder / "run" / "suite.yaml").write_text(SUITE),
}


def _goes_on(folder: Path, edit: Callable[[Path], object]) -> None:
    _play(folder)
    edit(folder)
    _play(folder)


def _same(folder: Path, edit: Callable[[Path], object]) -> str:
    before = _play(folder)
    edit(folder)
    assert _play(folder) == before
    return "all receipts are as they were"


def _another(folder: Path) -> None:
    _play(folder, only=["First"])
    before = _receipt(folder).read_bytes()
    try:
        _play(folder, "tests.data.policies:still")
    finally:
        assert _receipt(folder).read_bytes() == before
        assert not _receipt(folder, "Later").exists()


def _verify(folder: Path, **how: Any) -> None:
    _play(folder)
    verify_run(folder / "run", workers=0, **how)


def _into(make: Callable[[Path], object], folder: Path) -> None:
    make(folder / "run")
    _play(folder)


_RUNS: dict[str, Callable[[Path], None]] = {
    "a body that is not there varies": lambda folder: (
        _play(folder, text=f"randomization: {{mass: {{x: 1}}}}\n{SUITE}") and None
    ),
    "another policy into its folder": _another,
    "a policy that is not there": lambda folder: _play(folder, "no.such:policy") and None,
    "a policy that is none": lambda folder: _play(folder, 5) and None,
    "a policy that raises": lambda f: _play(f, "tests.data.policies:fails") and None,
    "a policy of no task of it": lambda f: _play(f, {"PickCube-v1": POLICY}) and None,
    "cases that it has not": lambda folder: _play(folder, only=["Frist"]) and None,
    "fewer than no workers": lambda folder: _play(folder, workers=-1) and None,
    "into a file": partial(_into, Path.touch),
    "into a FIFO": partial(_into, os.mkfifo),
    "into /dev/full": partial(_into, lambda path: path.symlink_to("/dev/full")),
    "into a folder of something else": partial(
        _into, lambda path: (path.mkdir(), (path / "thesis.tex").touch())
    ),
    "verify: nobody is named to play": _verify,
    "verify: a policy that is not there": lambda folder: _verify(folder, policy="no.such:policy"),
    "verify: a folder of nothing": lambda f: (
        run_command("robot_layouts", "suite", "verify", str(f)) and None
    ),
}
