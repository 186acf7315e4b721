"""Commands end by their exit code and at most one line, whatever becomes of their output."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from robot_layouts.core.commands import exit_code, is_watched, notice, printable
from robots import AssetError, RobotLayoutsError, UnknownNameError

REPOSITORY = Path(__file__).parents[2]
BEGIN = "import os, sys; from robot_layouts.core.commands import exit_code, notice, start; "
ROOMS = {
    "robots": "robots.fetch_assets --help",
    "layouts": "layouts --help",
    "tasks": "tasks --help",
    "robot_layouts": "robot_layouts record --help",
}


def shell(line: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a line of bash in which ``python`` is this one."""
    return subprocess.run(
        ["bash", "-c", line.replace("python", sys.executable, 1)],
        capture_output=True,
        text=True,
        check=False,
        cwd=REPOSITORY,
        env={**os.environ, **environment},
        timeout=120,
    )


def script(body: str, redirection: str = "", **environment: str):
    return shell(f'python -c "{BEGIN}{body}" {redirection}', **environment)


def refuse(error):
    def run():
        raise error

    return run


@pytest.mark.parametrize(
    ("run", "code"),
    [
        (lambda: None, 0),
        (lambda: 3, 3),
        (refuse(AssetError("no file")), 1),
        (refuse(UnknownNameError("robot", "padna", ["panda"])), 2),
    ],
    ids=["none", "own code", "refused", "unknown name"],
)
def test_the_exit_code_says_what_happened(capsys, run, code):
    assert exit_code(run) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("error: ") == (0 if code in (0, 3) else 1)


def test_other_errors_are_not_hidden():
    with pytest.raises(ZeroDivisionError):
        exit_code(lambda: 1 // 0)


def test_names_from_files_do_not_steer_the_terminal(capsys):
    exit_code(refuse(RobotLayoutsError("robot '\x1b]0;owned\x07\x1b[31m' – é")))
    assert capsys.readouterr().err == "error: robot '\\x1b]0;owned\\x07\\x1b[31m' – é\n"
    assert printable("a\u202eb\u2028c\nd") == "a\\u202eb\\u2028c\nd"


@pytest.mark.parametrize("stream", [None, "closed", "broken"])
def test_a_notice_is_no_reason_to_fail(monkeypatch, tmp_path, stream):
    if stream == "closed":
        stream = (tmp_path / "log").open("w")
        stream.close()
    elif stream == "broken":
        reading, writing = os.pipe()
        os.close(reading)
        stream = os.fdopen(writing, "w", closefd=True, buffering=1)
    monkeypatch.setattr(sys, "stderr", stream)
    notice("7 of 8 episodes")
    assert not is_watched()


@pytest.mark.long
@pytest.mark.parametrize("words", ROOMS.values(), ids=ROOMS)
def test_every_command_ends_quietly_when_nobody_reads_it(words):
    done = shell(f"set -o pipefail; python -m {words} | true")
    assert (done.returncode, done.stderr) == (0, "")


def test_a_command_whose_output_is_not_read_ends_with_its_own_code():
    body = "start(lambda: [print('x' * 99) for _ in range(9999)] and 7)"
    done = script(body, "| head -c 1; exit ${PIPESTATUS[0]}")
    assert (done.returncode, done.stdout, done.stderr) == (7, "x", "")


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_streams_are_dropped_and_never_become_another_file(tmp_path, closed):
    path = tmp_path / "recording"
    body = (
        f"start(lambda: open('{path}', 'w').write('whole') and print('out')"
        " or print('err', file=sys.stderr) or os.system('echo child; echo child >&2')"
        " or sys.stdin and 5)"
    )
    done = script(body, closed)
    assert (done.returncode, path.read_text()) == (5, "whole")
    assert done.stdout in ("", "out\nchild\n", "child\nout\n")
    assert done.stderr in ("", "err\nchild\n")


def test_output_that_does_not_fit_the_disk_is_one_error():
    done = script("start(lambda: exit_code(lambda: print('x' * 99)))", "> /dev/full")
    assert done.returncode == 1
    assert done.stderr == "error: cannot write the output: No space left on device\n"


def test_progress_that_does_not_fit_the_disk_is_dropped():
    done = script("start(lambda: notice('x') or print('done'))", "2> /dev/full")
    assert (done.returncode, done.stdout) == (0, "done\n")


def test_a_terminal_that_is_not_utf_8_gets_what_it_can_show():
    done = script("start(lambda: print('1 \u2013 2'))", PYTHONIOENCODING="ascii")
    assert (done.returncode, done.stdout, done.stderr) == (0, "1 \\u2013 2\n", "")


def test_ctrl_c_prints_no_traceback():
    body = "import time; start(lambda: print('ready', flush=True) or time.sleep(60))"
    with subprocess.Popen(
        [sys.executable, "-c", BEGIN + body],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=REPOSITORY,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (130, "interrupted\n")
