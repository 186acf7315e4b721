"""MJCF of a layout: read and stepped by MuJoCo, and what only its XML says."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from layouts import Layout, Placement, ceiling, single, table
from layouts.export.cell import ExportedCell
from layouts.export.mjcf import TIMESTEPS
from robots import AssetError, CameraMount, LayoutError
from tests.layouts.programs.mujoco_program import check
from tests.layouts.travelling import outside


def small_cell(folder):
    robot = replace(
        outside(folder),
        cameras=(CameraMount("eye", "tip", (0.1, 0.0, 0.0), fov=1.0, width=64, height=32),),
    )
    return Layout(
        {
            "hung": Placement(robot, on="ceiling", rpy=(0.3, 0.2, 1.0)),
            "up": Placement("so100", on="table.north"),
        },
        {"ceiling": ceiling(1.5, position=(0.4, -0.3)), **table(1.0, 0.8, yaw=0.3)},
    )


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    return small_cell(tmp_path_factory.mktemp("outside"))


@pytest.fixture(scope="module")
def path(cell, tmp_path_factory):
    return cell.to_mjcf(tmp_path_factory.mktemp("mjcf") / "cell.xml")


@pytest.fixture(scope="module")
def model(path):
    return ElementTree.parse(path).getroot()


def numbers(text):
    return [float(word) for word in text.split()]


def test_links_pairs_and_tools_are_there_and_hold_their_keyframe(cell, tmp_path):
    """In MuJoCo, of one cell; `test_export_programs` looks at every cell."""
    check("cell", cell, tmp_path)


def test_meshes_are_there(path, model):
    folder = path.parent / model.find("compiler").get("meshdir")
    files = {mesh.get("file") for mesh in model.findall("asset/mesh")}
    assert files == {f.relative_to(folder).as_posix() for f in folder.rglob("*.stl")}
    assert "Apache-2.0" in (folder / "LICENCES.md").read_text()


def test_drives_limits_and_home_are_the_descriptors(cell, model):
    actuators = {element.get("name"): element for element in model.find("actuator")}
    home = model.find("keyframe/key")
    standing = ExportedCell.read(cell, visuals=False).robots
    driven = [f"{n}/{joint}" for n, placement in cell.items() for joint in placement.robot.joints]
    assert list(actuators) == driven
    assert "hung/close_2" in actuators  # though it follows another joint
    group = cell["up"].robot.action_split.groups["arm"]
    for joint, (stiffness, damping, force) in zip(group.joints, group.drives, strict=True):
        own = actuators[f"up/{joint}"]
        assert [float(own.get(key)) for key in ("kp", "kv")] == [stiffness, damping]
        assert numbers(own.get("forcerange")) == [-force, force]
    order = [joint.get("name") for joint in model.find("worldbody").iter("joint")]
    qpos = dict(zip(order, numbers(home.get("qpos")), strict=True))
    standing = ExportedCell.read(cell, visuals=False).robots
    expected = {f"{n}/{joint}": x for n, r in standing.items() for joint, x in r.home.items()}
    assert qpos == expected
    assert numbers(home.get("ctrl")) == [expected[joint] for joint in driven]


def test_followers_are_tied_to_what_they_follow(model):
    ties = {tie.get("joint1"): tie for tie in model.find("equality")}
    assert ties.keys() == {"hung/close_2", "hung/close_3"}
    assert ties["hung/close_2"].get("joint2") == "hung/close_3"
    assert numbers(ties["hung/close_2"].get("polycoef")) == [0.1, 2.0, 0.0, 0.0, 0.0]


def test_contacts_and_ties_are_as_stiff_as_the_timestep_allows(model):
    stiff = [2 * float(model.find("option").get("timestep")), 1.0]
    assert numbers(model.find("default/geom").get("solref")) == stiff
    assert all(numbers(tie.get("solref")) == stiff for tie in model.find("equality"))


def test_joints_weigh_enough_for_their_dampers(cell, model):
    """The damper of a drive at its force limit acts once a step, so that it must not overshoot."""
    timestep = float(model.find("option").get("timestep"))
    joints = {joint.get("name"): joint for joint in model.find("worldbody").iter("joint")}
    group = cell["up"].robot.action_split.groups["arm"]
    for joint, (_, damping, _) in zip(group.joints, group.drives, strict=True):
        armature = float(joints[f"up/{joint}"].get("armature"))
        assert 0.9 * damping * timestep < armature <= damping * timestep  # light links add the rest


def test_what_a_urdf_says_of_joints_is_kept(model):
    joints = {joint.get("name"): joint for joint in model.find("worldbody").iter("joint")}
    close, lean = joints["hung/close"], joints["hung/lean"]
    assert numbers(close.get("range")) == [0.0, 0.8]
    assert (close.get("damping"), close.get("frictionloss")) == ("0.1", "0.2")
    assert lean.get("range") is None
    np.testing.assert_allclose(numbers(lean.get("axis")), np.array([1, 2, -2]) / 3)
    assert joints["hung/reach"].get("type") == "slide"


def test_tables_frames_tools_and_cameras_are_there(model):
    (top,) = model.findall("worldbody/geom")
    np.testing.assert_allclose(numbers(top.get("size")), [0.5, 0.4, 0.45])
    np.testing.assert_allclose(numbers(top.get("pos")), [0.0, 0.0, -0.45])
    sites = [site.get("name") for site in model.iter("site")]
    assert {"table.north", "ceiling", "hung/tcp", "up/tcp"} <= set(sites)
    (camera,) = model.iter("camera")
    assert camera.get("resolution") == "64 32"
    assert float(camera.get("fovy")) == pytest.approx(np.degrees(1.0))


def test_masses_are_those_of_the_urdf(model):
    bodies = {body.get("name"): body for body in model.iter("body")}
    inertial = bodies["hung/arm/0.5"].find("inertial")
    assert float(inertial.get("mass")) == 0.4
    xx, yy, zz, xy, xz, yz = numbers(inertial.get("fullinertia"))
    found = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    given = np.array([[0.003, 0.0002, 0], [0.0002, 0.002, 0.0001], [0, 0.0001, 0.004]])
    np.testing.assert_allclose(np.linalg.eigvalsh(found), np.linalg.eigvalsh(given))
    assert bodies["hung/tip"].find("inertial") is None  # its shapes give it


def test_the_timestep_is_one_at_which_drives_are_stable(tmp_path):
    soft = outside(tmp_path)
    name, group = next(iter(soft.action_split.groups.items()))
    hard = replace(group, stiffness=1e7, damping=1.0, armature=0.0)
    stiff = soft.action_split.replace(**{name: hard})
    for robot, step in ((soft, TIMESTEPS[0]), (replace(soft, action_split=stiff), 0.0002)):
        path = single({"arm": robot}).to_mjcf(tmp_path / "arm.xml")
        option = ElementTree.parse(path).getroot().find("option")
        assert float(option.get("timestep")) == step


def test_nothing_is_half_done(tmp_path, monkeypatch):
    def refuse(*_):
        raise AssetError("no mesh")

    layout = single({"arm": outside(tmp_path)})
    path = layout.to_mjcf(tmp_path / "arm.xml")
    before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    monkeypatch.setattr("layouts.export.mjcf.solid_shapes", refuse)
    with pytest.raises(AssetError, match="no mesh"):
        layout.to_mjcf(path)
    assert {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()} == before


def test_what_others_left_is_not_replaced(tmp_path):
    (tmp_path / "arm_assets").mkdir()
    (tmp_path / "arm_assets" / "thesis.txt").touch()
    with pytest.raises(LayoutError, match=r"would be replaced, but holds thesis.txt"):
        single({"arm": "so100"}).to_mjcf(tmp_path / "arm.xml")


def test_a_robot_whose_pictures_nobody_has_is_drawn_by_its_shapes(tmp_path, capsys):
    path = single({"arm": "mobile_panda"}).to_mjcf(tmp_path / "arm.xml")
    classes = {
        g.get("class") for g in ElementTree.parse(path).getroot().find("worldbody").iter("geom")
    }
    assert classes == {"drawn", "solid"}
    assert "mobile_panda is drawn by its collision shapes" in capsys.readouterr().err
