"""``robot-layouts motion``."""

from __future__ import annotations

import pytest

from layouts import face_to_face
from robot_layouts.__main__ import main as console
from robot_layouts.motion import Motion
from tests.experts.free_motions import swing

WORDS = ["plan", "face_to_face", "left=so100", "right=so100", "--spacing", "0.6"]
LAYOUT = face_to_face({"left": "so100", "right": "so100"}, spacing=0.6)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return swing(LAYOUT).save(tmp_path_factory.mktemp("motion") / "swing.json")


def test_a_motion_is_planned_saved_drawn_and_certified(tmp_path, capsys):
    out, picture = tmp_path / "motion.json", tmp_path / "motion.png"
    joints = ",".join(map(str, LAYOUT["left"].start_qpos[:5]))
    goal = ["--goal", f"left=joints:0.4{joints[joints.index(',') :]}"]
    extras = ["--box", "wall=0.1,0.1,0.1,0.5,0.5,0.05", "--velocity", "0.5", "--seed", "3"]
    assert (
        console(["motion", *WORDS, *goal, *extras, "--out", str(out), "--picture", str(picture)])
        == 0
    )
    printed = capsys.readouterr().out
    assert "s: left moved\n" in printed
    assert f"motion: {out}\npicture: {picture}\n" in printed
    motion = Motion.load(out)
    assert motion.end["left"][0] == pytest.approx(0.4)
    assert [obstacle.name for obstacle in motion.obstacles] == ["wall"]
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert console(["motion", "certify", str(out)]) == 0
    assert capsys.readouterr().out.startswith("certified: ")
    later = tmp_path / "later.json"
    back = ["--goal", f"left=joints:{joints}", "--after", str(out), "--out", str(later)]
    assert console(["motion", *WORDS, *back]) == 0
    assert Motion.load(later).start["left"][0] == pytest.approx(0.4)


def test_a_motion_that_is_too_fast_is_not_certified(tmp_path, capsys):
    fast = swing(LAYOUT, seconds=0.04, far=0.1)
    assert console(["motion", "certify", str(fast.save(tmp_path / "fast.json"))]) == 1
    assert capsys.readouterr().out.startswith("NOT CERTIFIED")


def test_a_motion_is_exported(file, tmp_path, capsys):
    words = ["--csv", str(tmp_path / "csv"), "--ros2", str(tmp_path / "ros"), "--frequency", "10"]
    assert console(["motion", "export", str(file), *words]) == 0
    printed = capsys.readouterr().out
    assert f"table: {tmp_path / 'csv/left.csv'}\n" in printed
    assert f"trajectory: {tmp_path / 'ros/left_arm_controller.yaml'}\n" in printed


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--goal", "left"], "'left' should be PLACE=X,Y,Z, for example left=0.4,0,0.3"),
        (["--goal", "left=1,2"], "--goal 'left=1,2' has 2 numbers; x, y, z (m), or these and"),
        (["--goal", "left=1,2,x"], "'left=1,2,x' should be numbers with commas between them"),
        (["--goal", "lefd=0,0,0"], "'lefd'. Did you mean 'left'"),
        (["--goal", "left=0,0,0", "--goal", "left=0,0,1"], "--goal 'left' is given twice"),
        (["--goal", "left=3,0,0"], "left does not get to its goal"),
        (["--box", "wall=1,1"], "--box 'wall' has 2 numbers; it takes NAME=WIDTH,DEPTH"),
        (["--control-mode", "pd_joint_pso"], "Did you mean 'pd_joint_pos'"),
        (["--after", "none.json"], "none.json"),
    ],
)
def test_what_makes_no_sense_is_refused_in_a_line(capsys, words, message):
    assert console(["motion", *WORDS, *words]) == (2 if "Did you mean" in message else 1)
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.err.startswith("error: ")
    assert printed.out == ""


def test_an_export_of_nothing(file, capsys):
    assert console(["motion", "export", str(file)]) == 1
    assert "give --csv DIR, --ros2 DIR or both" in capsys.readouterr().err
