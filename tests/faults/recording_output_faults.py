"""Commands about recordings whose output nobody reads, which are killed, and what they leave."""

from __future__ import annotations

import functools
import io
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

from robot_layouts.__main__ import main
from robot_layouts.core.commands import printable
from robot_layouts.data.export.dataset import Export, export
from robots import RobotLayoutsError
from tests.faults.fault import GOES_ON, Fault
from tests.faults.recording_files import AREA, edited, recording

REPOSITORY = Path(__file__).parents[2]
DEADLINE = 90.0  # s
PROGRESS = re.compile(r" of \d+ \w+ \(\d+%\)$")


def faults() -> Iterator[Fault]:
    """Go through them."""
    for redirection in ("<&- >&- 2>&-", "2>&1 | true", "2> /dev/full"):
        yield Fault(
            AREA,
            f"output: record {redirection}",
            lambda folder, r=redirection: _record(folder, r),
            GOES_ON,
        )
    for words in ("replay {h5}", "export {h5} --format robomimic --include-failures --out {out}"):
        for redirection in ("2>&-", "| true"):
            yield Fault(
                AREA,
                f"output: {words.split()[0]} {redirection}",
                lambda folder, w=words, r=redirection: _quiet(folder, w, r),
                GOES_ON,
            )
    yield Fault(AREA, "output: replay > /dev/full", _full)
    for name, stop in (("Ctrl-C", signal.SIGINT), ("SIGKILL", signal.SIGKILL)):
        yield Fault(
            AREA,
            f"output: {name} in an export, and again",
            lambda folder, s=stop: _stopped_export(folder, s),
            GOES_ON,
        )
    yield Fault(AREA, "output: another export writes to the same folder", _living_export, GOES_ON)
    for what, put in _BESIDE.items():
        yield Fault(
            AREA,
            f"output: beside an export lies {what}",
            lambda folder, p=put: _beside(folder, p),
            GOES_ON,
        )
    for what, put in _TAKEN.items():
        yield Fault(
            AREA,
            f"output: where an export goes lies {what}",
            lambda folder, p=put: _taken(folder, p),
        )
    for name in ("[red]", "[/a]", "[link=http://x]y", "\x1b]0;owned\x07", "a\nb", "ä ✓", "-x"):
        yield Fault(
            AREA,
            f"output: a recording in a folder called {name!r}",
            lambda folder, n=name: _named(folder, n),
            GOES_ON,
        )
    yield Fault(AREA, "output: a body is called by a sequence that steers terminals", _steering)


def _shell(line: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["bash", "-c", f"set -o pipefail; exec 3>&1; {line}"],
        capture_output=True,
        text=True,
        check=False,
        timeout=DEADLINE,
        cwd=REPOSITORY,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )


def _record(folder: Path, redirection: str) -> str:
    """Record for longer than the two seconds after which progress is shown."""
    done = _shell(
        f"{sys.executable} -m robot_layouts record --task PullCube-v1 --episodes 3 --out {folder}/r"
        f" {redirection}"
    )
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr
    from robot_layouts.data.reading.recording import Recording

    with Recording(folder / "r" / "trajectory.h5") as file:
        assert [episode.seed for episode in file] == [0, 1, 2]
    return "all episodes are recorded, and it ends with 0"


def _quiet(folder: Path, words: str, redirection: str) -> str:
    path = recording(folder)
    words = words.format(h5=path, out=folder / "out")
    done = _shell(f"{sys.executable} -m robot_layouts {words} {redirection}")
    assert (done.returncode, _said(done)) == (0, [])
    return "it ends with 0"


def _full(folder: Path) -> None:
    done = _shell(f"{sys.executable} -m robot_layouts replay {recording(folder)} > /dev/full")
    assert done.returncode == 1
    (line,) = _said(done)
    raise RobotLayoutsError(line)


def _said(done: subprocess.CompletedProcess[str]) -> list[str]:
    """Return the lines of standard error but those of progress, which long work shows."""
    return [line for line in done.stderr.splitlines() if not PROGRESS.search(line)]


# An export that stops in the middle until it is killed, as one of a large recording would be.
_SLOW = """
import sys, time
from robot_layouts.data.export.dataset import Export, export
from robot_layouts.core.commands import start
def main():
    def wait(done, total):
        print("writing", flush=True)
        time.sleep(600)
    export(Export(sys.argv[1], "robomimic", sys.argv[2], include_failures=True), wait)
start(main)
"""


def _slow_export(path: Path, out: Path) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-c", _SLOW, str(path), str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=REPOSITORY,
        preexec_fn=functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "writing\n"
    return process


def _export(path: Path, out: Path) -> None:
    assert export(Export(path, "robomimic", out, include_failures=True)).episodes == 3


def _stopped_export(folder: Path, stop: signal.Signals) -> str:
    path, out = recording(folder), folder / "out"
    with _slow_export(path, out) as process:
        process.send_signal(stop)
        _, said = process.communicate(timeout=DEADLINE)
    assert "Traceback" not in said, said
    assert process.returncode == (130 if stop == signal.SIGINT else -stop)
    _export(path, out)
    assert {p.name for p in folder.iterdir()} == {"out", path.name, "trajectory.json"}
    return f"it says {said.strip()!r}; the next export removes what is left"


def _living_export(folder: Path) -> str:
    path, out = recording(folder), folder / "out"
    with _slow_export(path, out) as process:
        _export(path, folder / "out")
        assert len([p for p in folder.iterdir() if p.name.endswith(".partial")]) == 1
        process.kill()
    return "it keeps the other's unfinished folder"


def _beside(folder: Path, put: Callable[[Path], None]) -> str:
    path = recording(folder)
    put(folder)
    before = {p.name for p in folder.iterdir()}
    _export(path, folder / "out")
    assert {p.name for p in folder.iterdir()} == before | {"out"}
    return "it stays"


def _folder_with_file(name: str) -> Callable[[Path], None]:
    def put(folder: Path) -> None:
        (folder / name).mkdir()
        (folder / name / "mine").touch()

    return put


def _link(path: Path) -> None:
    path.symlink_to("/tmp")


_BESIDE: dict[str, Callable[[Path], None]] = {
    "a file like an unfinished folder": lambda folder: (folder / ".out.12.partial").touch(),
    "a link like an unfinished folder": lambda folder: (folder / ".out.12.partial").symlink_to(
        "/tmp"
    ),
    "a FIFO like an unfinished folder": lambda folder: os.mkfifo(folder / ".out.12.partial"),
    "an unfinished folder of another export": _folder_with_file(".other.12.partial"),
    "a folder of nearly that name": _folder_with_file(".out.mine.partial"),
}


def _taken(folder: Path, put: Callable[[Path], None]) -> None:
    path = recording(folder)
    put(folder / "out")
    _export(path, folder / "out")


_TAKEN: dict[str, Callable[[Path], None]] = {
    "a file": lambda out: out.touch(),
    "a FIFO": os.mkfifo,
    "a full folder": lambda out: _folder_with_file(out.name)(out.parent),
    "a link that leads nowhere": lambda out: out.symlink_to("nowhere"),
    "a link to itself": lambda out: out.symlink_to(out),
}


def _named(folder: Path, name: str) -> str:
    place = folder / name
    place.mkdir(parents=True)
    with redirect_stdout(io.StringIO()) as printed:
        assert main(["replay", str(recording(place))]) == 0
    assert "3 of 3 episodes end as recorded" in printed.getvalue()
    assert "\x1b" not in printed.getvalue()
    assert f"{printable(str(place))}/trajectory.h5: PushT-v1" in printed.getvalue()
    return "it is printed as it is"


def _steering(folder: Path) -> None:
    """Refuse a file with such a name as the command does, which prints it."""
    path = recording(folder)
    with edited(path) as file:
        states = file["traj_0/env_states/actors"]
        states["\x1b]0;owned\x07"] = states["Tee"][()][:2]
    with redirect_stderr(io.StringIO()) as printed:
        assert main(["replay", str(path)]) == 1
    assert "\x1b" not in printed.getvalue()
    raise RobotLayoutsError(printed.getvalue().strip())
