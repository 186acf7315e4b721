"""Commands about recordings whose output nobody reads, or which find something in their way."""

from __future__ import annotations

import io
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from pathlib import Path

from robot_layouts.__main__ import main
from robot_layouts.core.commands import printable
from robot_layouts.data.export.dataset import Export, export
from robots import RobotLayoutsError
from tests.faults.fault import GOES_ON, Fault, each
from tests.faults.recording_files import AREA, edited, recording

REPOSITORY = Path(__file__).parents[2]
DEADLINE = 90.0  # s
PROGRESS = re.compile(r" of \d+ \w+ \(\d+%\)$")


def faults() -> Iterator[Fault]:
    """Go through them."""
    for redirection in ("<&- >&- 2>&-", "2>&1 | true", "2> /dev/full"):
        run = partial(_record, redirection)
        yield Fault(AREA, f"output: record {redirection}", run, GOES_ON)
    for words in ("replay {h5}", "export {h5} --format robomimic --include-failures --out {out}"):
        for redirection in ("2>&-", "| true"):
            run = partial(_quiet, words, redirection)
            yield Fault(AREA, f"output: {words.split()[0]} {redirection}", run, GOES_ON)
    yield Fault(AREA, "output: replay > /dev/full", _full)
    yield from each(AREA, "output: where an export goes lies {}", _taken, _TAKEN)
    for name in ("[red]", "[/a]", "\x1b]0;owned\x07", "a\nb"):
        what = f"output: a recording in a folder called {name!r}"
        yield Fault(AREA, what, partial(_named, name), GOES_ON)
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


def _record(redirection: str, folder: Path) -> str:
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


def _quiet(words: str, redirection: str, folder: Path) -> str:
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


def _taken(folder: Path, put: Callable[[Path], None]) -> None:
    path = recording(folder)
    put(folder / "out")
    export(Export(path, "robomimic", folder / "out", include_failures=True))


_TAKEN: dict[str, Callable[[Path], None]] = {
    "a file": lambda out: out.touch(),
    "a FIFO": os.mkfifo,
    "a full folder": lambda out: (out.mkdir(), (out / "mine").touch()),
    "a link that leads nowhere": lambda out: out.symlink_to("nowhere"),
    "a link to itself": lambda out: out.symlink_to(out),
}


def _named(name: str, folder: Path) -> str:
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
