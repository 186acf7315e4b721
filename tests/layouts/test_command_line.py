"""``python -m layouts``: the table, the picture, and errors in one line."""

import subprocess
import sys

import pytest

from layouts import Layout, around_table, face_to_face, from_maniskill, grid, ring, single
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
    ("words", "layout"),
    [
        ("ring a=panda b=so100", ring({"a": "panda", "b": "so100"})),
        ("ring a=panda --radius 0.5 --facing out", ring({"a": "panda"}, radius=0.5, facing="out")),
        ("grid a=panda b=panda --columns 1", grid({"a": "panda", "b": "panda"}, columns=1)),
        (
            "around_table a=panda b=panda --edges west,west --table 1 2 --inset 0.2",
            around_table(
                {"a": "panda", "b": "panda"}, edges=["west", "west"], table=(1.0, 2.0), inset=0.2
            ),
        ),
        (
            "face_to_face a=panda b=so100 --spacing auto",
            face_to_face({"a": "panda", "b": "so100"}, spacing="auto"),
        ),
        ("PushT-v1", from_maniskill("PushT-v1")),
    ],
)
def test_show_takes_what_presets_take_and_saves_it(words, layout, tmp_path, capsys):
    path = tmp_path / "cell.yaml"
    status, out, err = run("show", *words.split(), "--save", str(path), capsys=capsys)
    assert (status, out, err) == (0, f"{layout}\nlayout: {path}\n", "")
    assert Layout.load(path) == layout


def test_show_reads_a_file(tmp_path, capsys):
    layout = around_table({"a": "panda", "b": "so100"})
    path = layout.save(tmp_path / "cell.yaml")
    assert run("show", str(path), capsys=capsys) == (0, f"{layout}\n", "")


def test_show_names_file_and_line(tmp_path, capsys):
    path = tmp_path / "cell.yml"
    path.write_text("version: 1\nrobots:\n  a: {robot: pandas}\n")
    status, out, err = run("show", str(path), capsys=capsys)
    assert (status, out) == (1, "")
    assert err.startswith(f"error: {path}, line 3: unknown robot 'pandas'. Did you mean 'panda'?")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("face_to_fase a=panda b=panda", "unknown layout preset 'face_to_fase'. Did you mean"),
        ("single arm=panda --spacing 1", "single takes no --spacing; it takes --keyframe"),
        ("PushT-v1 left=panda", "unknown robot of this layout 'left'. Choices: arm."),
        ("PushT-v1 --radius 1", "PushT-v1 says where robots stand; it takes no --radius"),
        ("PushT-v2", "unknown layout preset 'PushT-v2'. Did you mean 'PushT-v1'?"),
        ("none.yaml", "cannot read the layout 'none.yaml': No such file"),
        ("ring a=panda --radius -1", "radius is -1.0 m; it must be finite and greater than 0"),
        ("single panda", "'panda' should be name=robot, for example left=panda"),
        ("face_to_face a=panda a=panda --spacing 1", "name 'a' is given twice"),
        ("single arm=panda --keyframe ret", "Did you mean 'rest'?"),
        ("single arm=panda --preview cell.gif", "must end in .png, .pdf or .svg"),
    ],
)
def test_an_error_is_one_line(words, message, capsys):
    status, _, err = run("show", *words.split(), capsys=capsys)
    assert status == (2 if "unknown" in err else 1)
    assert err.startswith("error: ")
    assert message in err
    assert err.count("\n") == 1


@pytest.mark.long
def test_it_runs_as_a_module():
    command = [sys.executable, "-m", "layouts", "show", "single", "arm=panda"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.startswith("1 robot, 8 action numbers\n")


@pytest.mark.parametrize(
    ("kind", "name", "written"),
    [
        ("mjcf", "cell.xml", "cell.xml"),
        ("ros2", "cell", "cell/config/cell.srdf"),
        ("urdf", "cell.urdf", "cell.urdf"),
        ("drake", "cell.dmd.yaml", "cell.dmd.yaml"),
    ],
)
def test_export_writes_a_layout(kind, name, written, tmp_path, capsys):
    layout = single({"arm": "floating_panda_gripper"}).save(tmp_path / "cell.yaml")
    out = tmp_path / "out" / name
    words = ["export", str(layout), "--format", kind, "--out", str(out), "--no-visuals"]
    assert run(*words, capsys=capsys)[:2] == (0, f"{kind}: {out}\n")
    assert (tmp_path / "out" / written).is_file()


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("mjcf", "MJCF as 'a.pdf'; the name must end in .xml"),
        ("urdf", "'a.pdf'; the name must end in .urdf"),
        ("drake", "'a.pdf'; the name must end in .dmd.yaml"),
        ("usd", "'a.pdf'; the name must end in .usd, .usda, .usdc"),
    ],
)
def test_export_says_what_a_format_takes(kind, words, tmp_path, capsys):
    out = str(tmp_path / "a.pdf")
    status, printed, err = run(
        *("export", "single", "arm=so100", "--format", kind, "--out", out), capsys=capsys
    )
    assert (status, printed, err.count("\n")) == (1, "", 1)
    assert words in err
    assert list(tmp_path.iterdir()) == []
