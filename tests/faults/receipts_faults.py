"""Receipts that are damaged, lie, or would have somebody else's code run."""

from __future__ import annotations

import functools
import json
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from robot_layouts.data import evaluate
from robot_layouts.data.receipts import Receipt, ReceiptError, verify
from tests.faults.fault import GOES_ON, NO_FILES, Fault, each
from tests.faults.strangers import lay_bait, runs_nothing

AREA = "receipts"
TASK, POLICY, SEEDS, STEPS = "PushT-v1", "tests.data.policies:LEANS", (0, 1), 3
HEX = "ab" * 32

Place = tuple[str | int, ...]
_ARM: Place = ("making", "layout", "arm")
_EPISODE: Place = ("episodes", 0)


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for place, value in _FIELDS.items():
        what = f"{'.'.join(map(str, place))} is {value!r:.40}"
        yield Fault(AREA, what, functools.partial(_verify, edit=_set(place, value)))
    for kind, (place, values) in _KINDS.items():
        for value in values:
            what = f"{kind}: {value!r:.40}"
            yield Fault(AREA, what, functools.partial(_verify, edit=_set(place, value)))
    for place in _NEEDED:
        what = f"no {'.'.join(map(str, place))}"
        yield Fault(AREA, what, functools.partial(_verify, edit=_remove(place)))
    yield from each(AREA, "{}", _verify, _NONSENSE)
    yield from each(AREA, "the file is {}", _read, _FILES)
    yield from each(AREA, "it lies: {}", _differs, _LIES, GOES_ON)
    for name in _GADGETS:
        yield Fault(AREA, f"its policy is {name}", functools.partial(_runs_nothing, policy=name))
    for module in ("antigravity", "strange", "os"):
        run = functools.partial(_runs_nothing, task=module)
        yield Fault(AREA, f"its task is in {module}", run)
    for what, edit in _STRANGE_ROBOTS.items():
        yield Fault(AREA, what, functools.partial(_runs_nothing, edit=edit))
    for what, run in _ARGUMENTS.items():
        yield Fault(AREA, what, run)


# -- a receipt, and what is done with it ----------------------------------------------------------


@functools.cache
def contents() -> str:
    """Return the text of a small receipt, as it was written."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "receipt.json"
        evaluate(POLICY, TASK, SEEDS, workers=0, receipt=path, max_episode_steps=STEPS)
        return path.read_text()


def edited(folder: Path, edit: Callable[[Any], object]) -> Path:
    """Write the receipt, changed and with the hash of what it has become, to a folder."""
    path, about = folder / "receipt.json", json.loads(contents())
    edit(about)
    path.write_text(json.dumps(about))
    try:
        Receipt.read(path).write(path)
    except (ReceiptError, KeyError):  # as somebody left it, then
        path.write_text(json.dumps(about))
    return path


def _verify(folder: Path, edit: Callable[[Any], object]) -> Any:
    return verify(edited(folder, edit), workers=0, policy=POLICY)


def _differs(folder: Path, edit: Callable[[Any], object]) -> str:
    found = _verify(folder, edit)
    assert not found.equal
    first = [*found.differences, *found.changed][0]
    return f"not equal: {first}"


def _read(folder: Path, make: Callable[[Path], object]) -> None:
    make(folder / "receipt.json")
    verify(folder / "receipt.json", workers=0, policy=POLICY)


def _runs_nothing(
    folder: Path, policy: str = "", task: str = "", edit: Callable[[Any], object] = lambda _: None
) -> None:
    """Verify by the command, in a folder of a stranger's."""
    lay_bait(folder)
    (folder / "arm.urdf").write_text(TEMPLATE)

    def change(found: Any) -> None:
        edit(found)
        if policy:
            own = {"sha256": _hash(folder, policy.partition(":")[0]), "importable": True}
            found["policy"] = {"kind": "policy", "name": policy, **own}
            found["making"]["obs_mode"] = "state_dict"
        if task:
            own = {"class": f"{task}:Task", "sha256": _hash(folder, task)}
            found["task"].update(id="Strange-v1", **own)

    edited(folder, change)
    words = ["receipt.json", "--workers=0", *([] if policy else ["--policy", POLICY])]
    runs_nothing(folder, "verify", *words)


def _hash(folder: Path, module: str) -> str:
    """Return the SHA-256 of a module's file, as whoever writes a receipt knows it."""
    path = folder / module.replace(".", "/")
    own = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    with suppress(ImportError, OSError):
        spec = None if own.exists() else find_spec(module)
        return sha256(
            own.read_bytes() if spec is None else Path(spec.origin).read_bytes()
        ).hexdigest()
    return HEX


# -- what is wrong with it ------------------------------------------------------------------------


def _set(place: Place, value: Any) -> Callable[[Any], None]:
    def edit(found: Any) -> None:
        for key in place[:-1]:
            found = found[key]
        found[place[-1]] = value

    return edit


def _remove(place: Place) -> Callable[[Any], None]:
    def edit(found: Any) -> None:
        for key in place[:-1]:
            found = found[key]
        del found[place[-1]]

    return edit


def _both(*edits: Callable[[Any], object]) -> Callable[[Any], None]:
    def edit(found: Any) -> None:
        for one in edits:
            one(found)

    return edit


# Every field, with one value of another kind.
_FIELDS: dict[Place, Any] = {
    ("format",): "robot-layouts receipt 3",
    ("task",): [],
    ("task", "id"): ["PushT-v1"],
    ("task", "sha256"): "x" * 64,
    ("policy",): "expert",
    ("policy", "sha256"): 7,
    ("making",): None,
    ("making", "layout"): [],
    _ARM: "panda_stick",
    (*_ARM, "position"): [0, 0],
    ("making", "obs_mode"): None,
    ("making", "control_frequency"): "20",
    ("making", "max_episode_steps"): 0,
    ("making", "randomization"): "mass",
    ("making", "camera_size"): [64],
    ("making", "touch"): "fingers",
    ("making", "num_envs"): 1.5,
    ("environment",): [],
    ("environment", "versions"): "3.11",
    ("episodes",): {},
    _EPISODE: None,
    (*_EPISODE, "seed"): "0",
    (*_EPISODE, "steps"): True,
    (*_EPISODE, "states"): None,
    (*_EPISODE, "stage_score"): 1.5,
}

# Every kind of value, in one field that has it, with what is nearly one.
_KINDS: dict[str, tuple[Place, tuple[Any, ...]]] = {
    "a SHA-256": ((*_EPISODE, "states"), ("", HEX.upper(), HEX[:-1], f"0{HEX}", f" {HEX[1:]}")),
    "a seed": ((*_EPISODE, "seed"), (-1, 2**32, 0.0, float("inf"))),
    "a trace": ((*_EPISODE, "trace"), ("", "AAAA", "äöüß", "A A A A A A=")),
}

_NEEDED: tuple[Place, ...] = (
    ("format",),
    ("hash",),
    ("task", "class"),
    ("policy", "name"),
    ("making", "layout"),
    ("making", "simulator"),
    ("environment", "versions"),
    (*_EPISODE, "states"),
)

_NONSENSE: dict[str, Callable[[Any], object]] = {
    "a seed twice": _set(("episodes", 1, "seed"), 0),
    "a trace of more steps than it has": _set((*_EPISODE, "steps"), STEPS - 1),
    "more steps than any episode has": _set((*_EPISODE, "steps"), 2**31),
    "another task with its places": _both(
        _set(("task", "id"), "TwoRobotPickCube-v1"), _set(("making", "reward_mode"), "dense")
    ),
    "a task's id with a module": _set(("task", "id"), "os:PushT-v1"),
    "a robot's name that is a path": _set((*_ARM, "robot"), "/etc/passwd"),
    "a thousand places": lambda found: found["making"]["layout"].update(
        {f"arm{i}": found["making"]["layout"]["arm"] for i in range(1000)}
    ),
    "no place": _set(("making", "layout"), {}),
    "an unknown simulator": _set(("making", "simulator"), "os:system"),
    "a million steps a second": _set(("making", "control_frequency"), 1e6),
    "more environments than fit": _set(("making", "num_envs"), 10**6),
    "an unknown axis of randomization": _set(("making", "randomization"), {"mas": 1}),
    "a link that is not there": _set(("making", "touch"), {"arm": ["palm"]}),
    "pictures of a terapixel": _both(
        _set(("making", "camera_size"), [10**6, 10**6]), _set(("making", "obs_mode"), "rgb")
    ),
}


def _text(change: Callable[[str], str]) -> Callable[[Path], object]:
    return lambda path: path.write_text(change(contents()))


_FILES: dict[str, Callable[[Path], object]] = {
    **NO_FILES,
    "empty": Path.touch,
    "half": _text(lambda text: text[: len(text) // 2]),
    "two receipts": _text(lambda text: text * 2),
    "a receipt with a key twice": _text(lambda text: text.replace("{", '{"hash": "",', 1)),
    "100,000 brackets": lambda path: path.write_text("[" * 100_000),
    "a number of a million digits": _text(
        lambda text: text.replace(": 0,", f": {'9' * 10**6},", 1)
    ),
    "UTF-16": lambda path: path.write_bytes(contents().encode("utf-16")),
    "not UTF-8": lambda path: path.write_bytes(contents().encode().replace(b"PushT", b"\xff", 1)),
    "a pickle": lambda path: path.write_bytes(b"\x80\x04cos\nsystem\n"),
}

_LIES: dict[str, Callable[[Any], object]] = {
    "one success more": _set((*_EPISODE, "success"), True),
    "stages that its task lacks": _set((*_EPISODE, "stage_score"), 1.0),
    "other states": _set((*_EPISODE, "states"), HEX),
    "a trace of other states": _set((*_EPISODE, "trace"), "AAAAAAAAAAA="),
    "a reason": _set((*_EPISODE, "reason"), "\x1b[2J bad luck"),
    "episodes without an end": _set(("making", "max_episode_steps"), 2**31 - 1),
    "another source of the policy": _set(("policy", "sha256"), HEX),
    "another name of the policy": _set(("policy", "name"), "mine:policy"),
    "a checkpoint that is not there": _set(("policy", "files"), {"policy.pt": HEX}),
    "another source of the task": _set(("task", "sha256"), HEX),
    "the robot elsewhere": _set((*_ARM, "position"), [0.0, 0.0, 0.01]),
    "another gravity": _set(("making", "randomization"), {"gravity": 1.0}),
}

_GADGETS = (
    "http.server:test",
    "antigravity:fly",
    "strange:policy",
    "strange.inside:policy",
    "tests.data.policies:dies",
    "os:system; touch ran",
    "../strange:policy",
)


TEMPLATE = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="arm">
<xacro:include filename="/etc/passwd"/></robot>"""


def _guessed(name: str) -> Callable[[Any], None]:
    """Return what says that the robot was guessed from a file, whose hash is right."""

    def edit(found: Any) -> None:
        text = TEMPLATE.encode() if name == "arm.urdf" else Path(name).read_bytes()
        about = {"urdf": name, "sha256": sha256(text).hexdigest(), "descriptor": HEX}
        found["environment"]["guessed"] = {"arm": about}

    return edit


_STRANGE_ROBOTS: dict[str, Callable[[Any], object]] = {
    "its robot is in a module": _set((*_ARM, "robot"), "strange:ROBOT"),
    "its robot is a program": _set((*_ARM, "robot"), "./bait/agent"),
    "its robot was guessed from /etc/passwd": _guessed("/etc/passwd"),
    "its robot was guessed from a xacro template": _guessed("arm.urdf"),
}


def _verified(folder: Path, **arguments: Any) -> None:
    verify(edited(folder, lambda _: None), **{"workers": 0, **arguments})


_ARGUMENTS: dict[str, Callable[[Path], None]] = {
    "nobody is named to play": lambda folder: _verified(folder),
    "a policy that is not there": lambda folder: _verified(folder, policy="no.such:policy"),
    "another task": lambda folder: _verified(folder, policy=POLICY, task="PushCube-v1"),
    "a robot of no place": lambda folder: _verified(folder, policy=POLICY, robots={"a": "pandy"}),
}
