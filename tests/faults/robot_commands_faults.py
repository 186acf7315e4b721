"""Commands of the room robots: wrong words, streams that are closed, Ctrl-C, odd places."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from unittest import mock

from robots import RobotRegistry
from robots.assets.store import AssetStore
from robots.fetch_assets import main as fetch_assets
from robots.fetch_assets import robot_files
from robots.from_urdf import main as from_urdf
from robots.inspect import main as inspect
from tests.faults.fault import GOES_ON, Fault, run_command
from tests.faults.tiny_files import run_main, settings
from tests.robots.conftest import contents
from tests.robots.hub_server import HubServer, stall

AREA = "robot commands"
CHECKOUT = Path(__file__).parents[2]
SECONDS = 60

WRONG_WORDS: dict[str, tuple[Callable[..., int], tuple[str, ...]]] = {
    "fetch_assets padna": (fetch_assets, ("padna", "--check")),
    "fetch_assets ''": (fetch_assets, ("", "--check")),
    "fetch_assets '../panda'": (fetch_assets, ("../panda", "--check")),
    "fetch_assets panda padna": (fetch_assets, ("panda", "padna", "--check")),
    "fetch_assets --no-such-option": (fetch_assets, ("--no-such-option",)),
    "fetch_assets --source ftp": (fetch_assets, ("--source", "ftp")),
    "fetch_assets --offline --source hf": (fetch_assets, ("--offline", "--source", "hf")),
    "fetch_assets --offline --source wheel": (fetch_assets, ("--offline", "--source", "wheel")),
    "fetch_assets --dest without a folder": (fetch_assets, ("--dest",)),
    "fetch_assets --dest ''": (fetch_assets, ("--dest", "")),
    "fetch_assets --dest ~nobody": (fetch_assets, ("--dest", "~nobody_here")),
    "fetch_assets --dest /dev/null": (
        fetch_assets,
        ("koch", "--physics-only", "--source", "mani_skill", "--dest", "/dev/null"),
    ),
    "fetch_assets --dest /proc/x": (
        fetch_assets,
        ("koch", "--physics-only", "--source", "mani_skill", "--dest", "/proc/x"),
    ),
    "fetch_assets --source local of nothing": (fetch_assets, ("koch", "--source", "local")),
    "inspect padna": (inspect, ("padna",)),
    "inspect ''": (inspect, ("",)),
    "inspect a path": (inspect, ("/etc/passwd",)),
    "inspect a line break": (inspect, ("panda\n",)),
    "inspect --all": (inspect, ("--all",)),
    "from_urdf without a path": (from_urdf, ()),
    "from_urdf of nothing there": (from_urdf, ("nothing/there.urdf",)),
    "from_urdf ''": (from_urdf, ("",)),
    "from_urdf of a folder": (from_urdf, ("/tmp",)),
    "from_urdf of /dev/null": (from_urdf, ("/dev/null",)),
    "from_urdf of /etc/passwd": (from_urdf, ("/etc/passwd",)),
    "from_urdf of ~nobody": (from_urdf, ("~nobody_here/x.urdf",)),
    "from_urdf of a name of 5000 letters": (from_urdf, ("x" * 5000 + ".urdf",)),
    "from_urdf of an unknown description": (from_urdf, ("pandaa_description",)),
}
COMMANDS = {
    "fetch_assets": "robots.fetch_assets koch --physics-only --source mani_skill",
    "fetch_assets --check": "robots.fetch_assets koch --check",
    "inspect": "robots.inspect panda",
    "from_urdf": f"robots.from_urdf {CHECKOUT}/nothing.urdf",
}
# How a shell runs a command, and whether its exit code is still that of the command.
STREAMS = {
    "nobody reads": "{command} | true",
    "nobody reads errors": "{command} 2> >(true)",
    "stdout is closed": "{command} >&-",
    "stderr is closed": "{command} 2>&-",
    "all streams are closed": "{command} <&- >&- 2>&-",
    "stdout is ASCII": "LC_ALL=C PYTHONIOENCODING=ascii {command}",
}
ODD_NAMES = {"no UTF-8": "caf\udce9", "an escape": "a\x1b[31mb", "a line break": "a\nb"}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for what, (main, words) in WRONG_WORDS.items():
        yield Fault(AREA, what, lambda folder, m=main, w=words: _refuse(folder, m, w))
    for what, command in COMMANDS.items():
        for how, line in STREAMS.items():
            yield Fault(AREA, f"{what}: {how}", _in_shell(line, command), GOES_ON)
    yield Fault(AREA, "fetch_assets: stdout is full", _full_output)
    for what, name in ODD_NAMES.items():
        yield Fault(AREA, f"fetch_assets into a folder with {what}", _odd_folder(name), GOES_ON)
    for signal_ in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        yield Fault(AREA, f"fetch_assets: {signal_.name}", _interrupted(signal_), GOES_ON)
    yield Fault(AREA, "fetch_assets: 5 processes at once", _at_once, GOES_ON)


def _refuse(folder: Path, main: Callable[..., int], words: tuple[str, ...]) -> None:
    with settings(folder):
        run_main(main, *words)


def _environment(folder: Path, **given: str) -> dict[str, str]:
    with settings(folder, **given):
        return dict(os.environ)


def _in_shell(line: str, command: str) -> Callable[[Path], str]:
    def run(folder: Path) -> str:
        python = f"{shlex.quote(sys.executable)} -m {command}"
        text = line.format(command=python) + "; echo ${PIPESTATUS[0]} >&9"
        read, write = os.pipe()
        with os.fdopen(read) as codes:
            done = subprocess.run(
                ["bash", "-c", f"exec 9>&{write}; {text}"],
                cwd=CHECKOUT,
                env=_environment(folder),
                capture_output=True,
                pass_fds=(write,),
                timeout=SECONDS,
            )
            os.close(write)
            code = int(codes.read())
        printed = (done.stdout + done.stderr).decode()
        assert "Traceback" not in printed, printed[-2000:]
        assert "Exception ignored" not in printed, printed[-2000:]
        expected = 1 if "nothing.urdf" in command or "--check" in command else 0
        assert code == expected, (code, printed[-2000:])
        if "--source" in command:
            assert _complete(folder / "assets")
        return f"ends with {code}"

    return run


def _complete(root: Path) -> bool:
    return not AssetStore(root).unusable(robot_files(RobotRegistry.load("koch"), pictures=False))


def _full_output(folder: Path) -> None:
    line = f"{shlex.quote(sys.executable)} -m robots.inspect panda > /dev/full"
    done = subprocess.run(
        ["bash", "-c", line],
        cwd=CHECKOUT,
        env=_environment(folder),
        capture_output=True,
        text=True,
        timeout=SECONDS,
    )
    assert "Traceback" not in done.stderr, done.stderr
    with mock.patch("subprocess.run", return_value=done):
        run_command("robots.inspect", "panda")


def _odd_folder(name: str) -> Callable[[Path], None]:
    def run(folder: Path) -> None:
        done = subprocess.run(
            [sys.executable, "-m", *COMMANDS["fetch_assets"].split(), "--dest", folder / name],
            cwd=CHECKOUT,
            env=_environment(folder),
            capture_output=True,
            timeout=SECONDS,
        )
        assert done.returncode == 0, done.stderr
        assert b"\x1b" not in done.stdout + done.stderr, "steers the terminal"
        assert _complete(folder / name)

    return run


def _interrupted(number: signal.Signals) -> Callable[[Path], str]:
    def run(folder: Path) -> str:
        files = robot_files(RobotRegistry.load("koch"), pictures=False)
        served = {f"{file.origin.hub_folder}/{file.path}": contents(file) for file in files}
        reached = threading.Event()
        with HubServer(served) as hub:
            hub.fail("GET", ".stl", stall(reached), times=1)
            process = subprocess.Popen(
                [sys.executable, "-m", *"robots.fetch_assets koch --physics-only".split()],
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

    return run


def _at_once(folder: Path) -> None:
    command = [sys.executable, "-m", *COMMANDS["fetch_assets"].split()]
    environment = _environment(folder)
    processes = [
        subprocess.Popen(
            command, cwd=CHECKOUT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        for _ in range(5)
    ]
    printed = [process.communicate(timeout=SECONDS)[0] for process in processes]
    assert [process.returncode for process in processes] == [0] * 5, printed
    assert _complete(folder / "assets")
