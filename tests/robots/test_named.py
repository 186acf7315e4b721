"""A robot goes by a listed name, the path of its URDF or MJCF, or MODULE:NAME."""

from __future__ import annotations

import sys

import pytest

from layouts import Layout, Placement
from robots import AssetError, DescriptorError, LayoutError, RobotDescriptor, UnknownNameError
from robots.named import FORMS, named_robot, robot_in_file, written_robot
from tests.robots.urdf_parts import Parts


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a URDF and a module that declares a robot, in which the user works."""
    parts = Parts()
    parts.arm(parts.link("base"), "arm", "0 0 0.1")
    parts.write(tmp_path)
    (tmp_path / "toy_robots.py").write_text(
        "from pathlib import Path\n"
        "from robots import RobotDescriptor\n"
        "print('imported')\n"
        "URDF = Path(__file__).parent / 'robot.urdf'\n"
        "TINY = RobotDescriptor.from_urdf(URDF, 'tiny', quiet=True, reach=0.5)\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    sys.modules.pop("toy_robots", None)


def test_every_form_gives_a_robot(folder):
    tiny = named_robot("toy_robots:TINY")
    assert (tiny.name, tiny.reach) == ("tiny", 0.5)
    assert Placement("toy_robots:TINY").robot == tiny
    assert named_robot("robot.urdf") == named_robot(folder / "robot.urdf")
    assert named_robot("panda") is named_robot("robots.catalogue.panda:PANDA")


def test_errors_name_the_forms_and_the_closest_match(folder):
    with pytest.raises(
        UnknownNameError, match="unknown robot 'pandda'. Did you mean 'panda'"
    ) as it:
        named_robot("pandda")
    assert str(it.value).endswith(f"A robot goes by {FORMS}.")
    with pytest.raises(DescriptorError, match="No module named 'toy_robot'") as it:
        named_robot("toy_robot:TINY")
    assert str(it.value).endswith(f"A robot goes by {FORMS}.")
    with pytest.raises(DescriptorError, match="has no attribute 'tiny'. Did you mean 'TINY'"):
        named_robot("toy_robots:tiny")
    with pytest.raises(DescriptorError, match="toy_robots:URDF gave .*; a RobotDescriptor is need"):
        named_robot("toy_robots:URDF")
    with pytest.raises(AssetError, match=r"no file .*robt\.urdf'. Did you mean 'robot.urdf'"):
        named_robot("robt.urdf")
    with pytest.raises(AssetError, match=r"there is no file '/none/x\.xml'. A robot goes by a n"):
        named_robot("/none/x.xml")


def test_a_file_runs_no_code(folder, capsys):
    text = 'version: 1\nrobots:\n  left: {robot: "toy_robots:TINY"}\n'
    with pytest.raises(LayoutError, match="line 3: 'toy_robots:TINY' is code of the module") as it:
        Layout.from_yaml(text)
    assert "--robots left=toy_robots:TINY" in str(it.value)
    assert "import toy_robots before" in str(it.value)
    assert "imported" not in capsys.readouterr().out
    tiny = named_robot("toy_robots:TINY")  # the user says so
    assert Layout.from_yaml(text)["left"].robot == tiny


def test_a_file_expands_no_template(folder):
    pytest.importorskip("xacro")
    urdf = (folder / "robot.urdf").read_text()
    spelt = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
    (folder / "arm.urdf").write_text(
        urdf.replace("<robot", f"<robot {spelt}", 1)
        .replace("0 0 0.1", "0 0 ${0.05 * 2}", 1)
        .replace("</robot>", '<xacro:property name="x" value="1"/></robot>')
    )
    for word in ("arm.urdf", "arm.urdf?prefix=x"):
        with pytest.raises(DescriptorError, match="is a xacro template, and a file chooses no cod"):
            robot_in_file(word, "left", folder)
    robot = named_robot("arm.urdf")
    assert robot_in_file("arm.urdf", "left", folder) == robot


@pytest.mark.parametrize("where", ["cell.yaml", "cells/cell.yaml"])
def test_a_saved_layout_loads_again_from_wherever_it_lies(folder, where, monkeypatch):
    (folder / "cells").mkdir()
    layout = Layout(
        {
            "left": Placement("toy_robots:TINY"),
            "right": Placement("cells/../robot.urdf", position=(1, 0, 0)),
            "there": Placement("panda", position=(2, 0, 0)),
        }
    )
    text = layout.save(where).read_text()
    assert str(folder) not in text
    monkeypatch.chdir("/")
    assert Layout.load(folder / where) == layout


def test_what_no_word_brings_back_is_not_written(folder):
    own = RobotDescriptor.from_urdf("robot.urdf", quiet=True, reach=0.4)
    assert written_robot(own, folder) is None
    assert (
        written_robot(RobotDescriptor.from_urdf("robot.urdf", quiet=True), folder) == "robot.urdf"
    )
    with pytest.raises(
        LayoutError, match=r"the robot 'made' of 'a' is not registered, nor what is"
    ):
        Layout({"a": Placement(own)}).to_yaml()


def test_a_path_without_an_ending_stays_a_path(folder):
    (folder / "robot.urdf").rename(folder / "panda")
    robot = named_robot("./panda")
    assert written_robot(robot, folder) == "./panda"
    assert robot_in_file("./panda", "left", folder) == robot


def test_layout_commands_save_and_load_every_form(folder, capsys):
    from layouts.__main__ import main

    words = "face_to_face left=toy_robots:TINY right=robot.urdf --spacing 2 --save cell.yaml"
    assert main(["show", *words.split()]) == 0
    saved = (folder / "cell.yaml").read_text()
    assert '    robot: "toy_robots:TINY"\n' in saved
    assert "    robot: robot.urdf\n" in saved
    sys.modules.pop("toy_robots")  # as in a process of its own
    capsys.readouterr()
    assert main(["show", "cell.yaml"]) == 1
    assert "name it with the command, as left=toy_robots:TINY" in capsys.readouterr().err
    assert main(["show", "cell.yaml", "left=toy_robots:TINY"]) == 0
    assert "tiny" in capsys.readouterr().out
