"""Xacro templates are expanded by the package xacro where it is installed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import trimesh

from robot_layouts.__main__ import main
from robots import AssetError, LocalUrdf, RobotDescriptor
from robots.from_urdf import guess_descriptor
from robots.urdf.cleaning.xacro_files import template_of, with_arguments
from robots.urdf.summary import asset_fingerprint, read_cleaned

CHECKOUT = Path(__file__).parents[2]

PARTS = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:macro name="part" params="name">
  <link name="${name}"><inertial><mass value="1"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><mesh filename="file://$(find toy_package)/box.stl"/></geometry>
    </collision>
  </link>
</xacro:macro></robot>"""

ARM = """<robot name="toy" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="prefix" default=""/><xacro:arg name="limit" default="1"/>
<xacro:include filename="$(find toy_package)/urdf/parts.xacro"/>
<xacro:property name="p" value="$(arg prefix)"/>
<link name="base"/><xacro:part name="${p}upper"/><xacro:part name="${p}lower"/>
<joint name="${p}shoulder" type="revolute"><parent link="base"/><child link="${p}upper"/>
  <origin xyz="0 0 ${0.1 * 2}"/><axis xyz="0 1 0"/><limit lower="-1" upper="$(arg limit)"/></joint>
<joint name="${p}elbow" type="revolute"><parent link="${p}upper"/><child link="${p}lower"/>
  <origin xyz="0 0 0.4"/><axis xyz="0 1 0"/><limit lower="-1" upper="1"/></joint>
</robot>"""


@pytest.fixture
def template(tmp_path):
    package = tmp_path / "toy_folder"
    (package / "urdf").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>toy_package</name></package>")
    trimesh.creation.box((0.1, 0.1, 0.3)).export(package / "box.stl")
    (package / "urdf" / "parts.xacro").write_text(PARTS)
    path = package / "urdf" / "arm.urdf.xacro"
    path.write_text(ARM)
    return path


def test_arguments_travel_in_the_path(tmp_path):
    arguments = {"prefix": "left_/x", "limit": "1.5", "empty": ""}
    path = with_arguments(tmp_path / "arm.urdf.xacro", arguments)
    assert template_of(path) == (tmp_path / "arm.urdf.xacro", arguments)
    assert with_arguments(tmp_path, {}) == tmp_path
    odd = tmp_path / "arm?.urdf"
    odd.touch()
    assert template_of(odd) == (odd, {})


def test_a_template_is_expanded_with_its_arguments(template):
    pytest.importorskip("xacro")
    plain = RobotDescriptor.from_urdf(template, quiet=True)
    left = RobotDescriptor.from_urdf(template, xacro={"prefix": "left_", "limit": 0.5}, quiet=True)
    assert plain.joints == ("shoulder", "elbow")
    assert left.joints == ("left_shoulder", "left_elbow")
    assert left.action_split.groups["arm"].limits == ((-1.0, 0.5), (-1.0, 1.0))
    assert left.urdf == LocalUrdf(f"{template}?prefix=left_&limit=0.5")
    assert asset_fingerprint(left.urdf) != asset_fingerprint(plain.urdf)


def test_it_is_expanded_again_if_what_it_includes_changes(template):
    pytest.importorskip("xacro")
    before = read_cleaned(template).xml
    parts = template.with_name("parts.xacro")
    parts.write_text(parts.read_text().replace('mass value="1"', 'mass value="7"'))
    assert before.replace(b'mass value="1"', b'mass value="7"') == read_cleaned(template).xml


def test_what_cannot_be_expanded_is_an_error(template):
    pytest.importorskip("xacro")
    template.write_text(ARM.replace("0.1 * 2", "0.1 * nothing"))
    with pytest.raises(AssetError, match=r"xacro cannot expand .*arm\.urdf\.xacro: .*nothing"):
        read_cleaned(template)
    template.write_text(ARM.replace("find toy_package", "find lost_package"))
    with pytest.raises(
        AssetError, match=r"xacro cannot expand .*arm\.urdf\.xacro: .*part"
    ) as caught:
        read_cleaned(template)
    assert "'lost_package' is not there: put it beside" in str(caught.value)
    assert "ament" not in str(caught.value)


@pytest.mark.parametrize("place", ["toy_folder/urdf", "toy_folder", ""])
def test_a_package_is_found_beside_the_file_and_above_it(template, place):
    pytest.importorskip("xacro")
    other = template.parents[2] / place / "lost_package_of_another_folder"
    other.mkdir(parents=True)
    (other / "package.xml").write_text("<package><name>lost_package</name></package>")
    template.with_name("parts.xacro").rename(other / "parts.xacro")
    template.write_text(ARM.replace("toy_package)/urdf", "lost_package)"))
    assert RobotDescriptor.from_urdf(template, quiet=True).dof == 2


def test_an_include_that_is_not_needed_may_be_of_a_package_that_is_not_there(template):
    pytest.importorskip("xacro")
    colours = '<xacro:include filename="$(find lost_package)/colours.xacro"/>'
    template.write_text(ARM.replace("<link", f"{colours}<link", 1))
    guess = guess_descriptor(template)
    assert guess.descriptor.dof == 2
    assert any("lost_package" in reason and "colours.xacro" in reason for reason in guess.reasons)
    package = template.parents[1] / "lost_package"
    package.mkdir()
    (package / "colours.xacro").write_text('<robot><material name="red"/></robot>')
    assert b"red" in read_cleaned(template).xml


def test_a_mesh_of_a_package_that_is_not_there_names_it(template):
    pytest.importorskip("xacro")
    parts = template.with_name("parts.xacro")
    parts.write_text(PARTS.replace("find toy_package", "find lost_package"))
    with pytest.raises(AssetError, match="'lost_package' is not there: put it beside"):
        read_cleaned(template)


def test_the_guess_lists_the_arguments(template):
    pytest.importorskip("xacro")
    reasons = guess_descriptor(template, xacro={"prefix": "left_"}).reasons
    assert (
        "xacro: arguments prefix='left_', limit='1'; xacro={…} or --xacro KEY=VALUE" in reasons[0]
    )


def test_the_command_takes_arguments(template, capsys):
    with pytest.raises(SystemExit):
        main(["robots", "guess", str(template), "--xacro", "prefix"])
    assert "'prefix' is not KEY=VALUE, such as prefix=left_" in capsys.readouterr().err
    pytest.importorskip("xacro")
    words = ["--xacro", "prefix=left_", "--xacro", "limit=2", "--all"]
    assert main(["robots", "guess", str(template), *words]) == 0
    assert "arm: left_shoulder, left_elbow" in capsys.readouterr().out


@pytest.mark.long
def test_without_the_package_the_message_says_what_to_install(template):
    code = """
import sys
sys.modules["xacro"] = None
from robot_layouts.__main__ import main
sys.exit(main(["robots", "guess", *sys.argv[1:]]))
"""
    done = subprocess.run(
        [sys.executable, "-c", code, str(template)],
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert f"{template} is a xacro template; expanding it needs xacro: pip install" in done.stderr
    assert "Traceback" not in done.stderr
