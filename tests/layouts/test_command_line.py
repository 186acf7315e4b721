"""``python -m layouts``: the table, the picture, and errors in one line."""

import subprocess
import sys

import pytest

from layouts import face_to_face, single
from layouts.__main__ import main


def run(*words, capsys):
    status = main(words)
    output = capsys.readouterr()
    return status, output.out, output.err


def test_show_prints_the_layout(capsys):
    words = ["show", "face_to_face", "left=panda", "right=panda_stick", "--spacing", "1.5"]
    status, out, err = run(*words, capsys=capsys)
    expected = face_to_face({"left": "panda", "right": "panda_stick"}, spacing=1.5)
    assert (status, out, err) == (0, f"{expected}\n", "")


def test_show_takes_a_keyframe(capsys):
    words = ["show", "single", "arm=panda_stick", "--keyframe", "push_start"]
    status, out, _ = run(*words, capsys=capsys)
    assert (status, out) == (0, f"{single({'arm': 'panda_stick'}, keyframe='push_start')}\n")


def test_show_saves_a_picture_and_says_where(tmp_path, capsys):
    path = tmp_path / "cell.png"
    status, out, _ = run("show", "single", "arm=panda", "--preview", str(path), capsys=capsys)
    assert status == 0
    assert out.endswith(f"picture: {path}\n")
    assert path.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("face_to_fase a=panda b=panda", "unknown layout preset 'face_to_fase'. Did you mean"),
        ("single arm=panda --spacing 1", "single takes no --spacing; it takes --keyframe"),
        ("face_to_face a=panda b=panda", "face_to_face needs --spacing"),
        ("side_by_side a=panda --spacing nan", "spacing is nan m"),
        ("single arm=pandas", "unknown robot 'pandas'. Did you mean 'panda'?"),
        ("single panda", "'panda' should be name=robot, for example left=panda"),
        ("face_to_face a=panda a=panda --spacing 1", "name 'a' is given twice"),
        ("single arm=panda --keyframe ret", "Did you mean 'rest'?"),
        ("single arm=panda --preview cell.gif", "must end in .png, .pdf or .svg"),
    ],
)
def test_an_error_is_one_line(words, message, capsys):
    status, _, err = run("show", *words.split(), capsys=capsys)
    assert status == 1
    assert err.startswith("error: ")
    assert message in err
    assert err.count("\n") == 1


def test_it_runs_as_a_module():
    command = [sys.executable, "-m", "layouts", "show", "single", "arm=panda"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.startswith("1 robot, 8 action numbers\n")
