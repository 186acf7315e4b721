"""Commands of the room robots: wrong words, Ctrl-C, odd places."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from robot_layouts.__main__ import main as program
from robots import RobotRegistry
from robots.assets.store import AssetStore
from robots.fetch_assets import main as fetch_assets
from robots.fetch_assets import robot_files
from tests.faults.fault import GOES_ON, Fault
from tests.faults.tiny_files import run_main, settings
from tests.robots.conftest import contents
from tests.robots.hub_server import HubServer, stall

AREA = "robot commands"
CHECKOUT = Path(__file__).parents[2]
SECONDS = 60

WRONG_WORDS: dict[str, tuple[Callable[..., int], tuple[str, ...]]] = {
    "fetch_assets padna": (fetch_assets, ("padna", "--check")),
    "fetch_assets --no-such-option": (fetch_assets, ("--no-such-option",)),
    "fetch_assets --source ftp": (fetch_assets, ("--source", "ftp")),
    "fetch_assets --offline --source hf": (fetch_assets, ("--offline", "--source", "hf")),
    "fetch_assets --dest ''": (fetch_assets, ("--dest", "")),
    "fetch_assets --dest ~nobody": (fetch_assets, ("--dest", "~nobody_here")),
    "fetch_assets --dest /dev/null": (
        fetch_assets,
        ("koch", "--physics-only", "--source", "mani_skill", "--dest", "/dev/null"),
    ),
    "fetch_assets --source local of nothing": (fetch_assets, ("koch", "--source", "local")),
    "inspect padna": (
        program,
        (
            "robots",
            "inspect",
            "padna",
        ),
    ),
    "inspect a path": (
        program,
        (
            "robots",
            "inspect",
            "/etc/passwd",
        ),
    ),
    "from_urdf of nothing there": (
        program,
        (
            "robots",
            "guess",
            "nothing/there.urdf",
        ),
    ),
    "from_urdf of /etc/passwd": (
        program,
        (
            "robots",
            "guess",
            "/etc/passwd",
        ),
    ),
    "from_urdf of a name of 5000 letters": (
        program,
        (
            "robots",
            "guess",
            "x" * 5000 + ".urdf",
        ),
    ),
    "from_urdf of an unknown description": (
        program,
        (
            "robots",
            "guess",
            "pandaa_description",
        ),
    ),
}
FETCH = (sys.executable, "-m", "robots.fetch_assets", "koch", "--physics-only")
ODD_NAMES = {"no UTF-8": "caf\udce9", "an escape": "a\x1b[31mb", "a line break": "a\nb"}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for what, (main, words) in WRONG_WORDS.items():
        yield Fault(AREA, what, lambda folder, m=main, w=words: _refuse(folder, m, w))
    for what, name in ODD_NAMES.items():
        into = f"fetch_assets into a folder with {what}"
        yield Fault(AREA, into, partial(_odd_folder, name), GOES_ON)
    for signal_ in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        yield Fault(AREA, f"fetch_assets: {signal_.name}", partial(_interrupted, signal_), GOES_ON)


def _refuse(folder: Path, main: Callable[..., int], words: tuple[str, ...]) -> None:
    with settings(folder):
        run_main(main, *words)


def _environment(folder: Path, **given: str) -> dict[str, str]:
    with settings(folder, **given):
        return dict(os.environ)


def _complete(root: Path) -> bool:
    return not AssetStore(root).unusable(robot_files(RobotRegistry.load("koch"), pictures=False))


def _odd_folder(name: str, folder: Path) -> None:
    done = subprocess.run(
        [*FETCH, "--source", "mani_skill", "--dest", folder / name],
        cwd=CHECKOUT,
        env=_environment(folder),
        capture_output=True,
        timeout=SECONDS,
    )
    assert done.returncode == 0, done.stderr
    assert b"\x1b" not in done.stdout + done.stderr, "steers the terminal"
    assert _complete(folder / name)


def _interrupted(number: signal.Signals, folder: Path) -> str:
    files = robot_files(RobotRegistry.load("koch"), pictures=False)
    served = {f"{file.origin.hub_folder}/{file.path}": contents(file) for file in files}
    reached = threading.Event()
    with HubServer(served) as hub:
        hub.fail("GET", ".stl", stall(reached), times=1)
        process = subprocess.Popen(
            FETCH,
            cwd=CHECKOUT,
            env=_environment(folder, HF_ENDPOINT=hub.endpoint),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        with process:
            assert reached.wait(SECONDS)
            process.send_signal(number)
            printed = "".join(process.communicate(timeout=SECONDS))
        assert "Traceback" not in printed, printed
    if number is signal.SIGINT:
        assert process.returncode == 130
        assert not (folder / "assets" / ".partial").exists()
    with settings(folder):
        run_main(fetch_assets, "koch", "--physics-only", "--source", "mani_skill")
    assert _complete(folder / "assets")
    assert not (folder / "assets" / ".partial").exists()
    return f"ends with {process.returncode}, and the next fetch is complete"
