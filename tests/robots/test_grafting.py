"""Robots made of others: other grippers, tools, cameras, arms on one body."""

import math
import pickle
import subprocess
import sys

import numpy as np
import pytest

from layouts import face_to_face, single
from robot_layouts.core.errors import UnwritableFileError
from robot_layouts.kinematics.rotations import pose_matrix
from robot_layouts.simulation import Simulation
from robots import DescriptorError, RobotRegistry, UnknownNameError
from robots.assets.assembled import AssembledUrdf, UrdfPart
from robots.assets.locator import LocalUrdf
from robots.grafting import Mount, on_body, with_gripper, with_tool
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf
from robots.urdf.tree import kinematic_tree

LINK = """<link name="{name}"><inertial><mass value="0.2"/><inertia ixx="1e-3" iyy="1e-3"
 izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial><collision><origin xyz="0 0 {z}"/><geometry>
 <box size="{size}"/></geometry></collision></link>"""
PEN = (
    '<robot name="pen">'
    + LINK.format(name="shaft", z=0.05, size="0.01 0.01 0.1")
    + '<link name="nib"/><joint name="nib_joint" type="fixed"><parent link="shaft"/>'
    '<child link="nib"/><origin xyz="0 0 0.1"/></joint></robot>'
)
BENCH = f'<robot name="bench">{LINK.format(name="top", z=0.25, size="0.3 1.2 0.5")}</robot>'
PANDA = RobotRegistry.load("panda")


@pytest.fixture(autouse=True)
def _own_folder(tmp_path, monkeypatch):
    """Let nothing of what is put together stay behind."""
    monkeypatch.setattr("robots.assets.assembled.default_root", lambda: tmp_path / "cache")


@pytest.fixture
def pen(tmp_path):
    path = tmp_path / "pen.urdf"
    path.write_text(PEN)
    return path


@pytest.fixture
def bench(tmp_path):
    path = tmp_path / "bench.urdf"
    path.write_text(BENCH)
    return path


def model_of(robot):
    path = robot.urdf.locate()
    return read_model(read_urdf(path), path.as_posix())


def pose_of(robot, link):
    tree = kinematic_tree(model_of(robot), robot.joints)
    start = np.array([robot.keyframe(robot.home.keyframe)], float)
    return tree.forward(start)[0, tree.link(link)]


def stepped(robot, action, steps=1):
    """Return the joint positions before and after some steps of a robot that stands alone."""
    layout = single({"arm": robot})

    simulation = Simulation(layout, lambda world, index: None, 1)
    simulation.clear([0])
    simulation.worlds[0].stand("arm", layout["arm"].start_qpos)
    before = simulation.read().qpos("arm")[0].copy()
    for _ in range(steps):
        state = simulation.read()
        simulation.step(np.array([action], np.float32), state.joint_positions)
    return before, simulation.read().qpos("arm")[0]


class TestGrippers:
    def test_an_arm_takes_the_gripper_of_another(self):
        arm = RobotRegistry.load("panda_stick").with_gripper("panda")
        assert (arm.dof, arm.action_dim) == (9, 8)
        assert arm.joints[-2:] == ("tool_panda_finger_joint1", "tool_panda_finger_joint2")
        assert arm.tcp_link.endswith("panda_hand_tcp")
        assert arm.fingers.links == ("tool_panda_leftfinger", "tool_panda_rightfinger")
        assert set(arm.gripper_material.links) <= set(model_of(arm).links)
        assert arm.keyframe("rest")[-2:] == (0.04, 0.04)

    def test_a_gripper_of_its_own_is_taken_off(self):
        other = with_gripper(PANDA, "panda", position=(0, 0, 0.1), name="longer")
        assert other.name == "longer"
        assert sorted(model_of(other).links) == sorted(model_of(PANDA).links)
        np.testing.assert_allclose(
            pose_of(other, "panda_hand_tcp"),
            pose_of(PANDA, "panda_link8")
            @ pose_matrix((0, 0, 0.1), (math.cos(math.pi / 8), 0, 0, -math.sin(math.pi / 8)))
            @ np.linalg.inv(pose_of(PANDA, "panda_hand"))
            @ pose_of(PANDA, "panda_hand_tcp"),
            atol=1e-6,
        )
        assert other.reach > PANDA.reach

    def test_it_stands_and_obeys(self):
        arm = with_gripper(RobotRegistry.load("panda_stick"), PANDA)
        assert single({"arm": arm}).validate(workspaces=False).ok
        assert face_to_face({"left": arm, "right": "panda"}, spacing=1.5).validate().ok
        still = np.zeros(8)
        still[-1] = 1.0  # an open gripper
        before, after = stepped(arm, still, 20)
        np.testing.assert_allclose(after, before, atol=1e-3)
        closing = np.zeros(8)
        closing[-1] = -1.0
        _, after = stepped(arm, closing, 20)
        assert (after[-2:] < 0.005).all()

    def test_fingers_that_hang_on_the_last_link_of_the_arm_are_cut_off(self):
        own = RobotRegistry.load("so100")
        arm = with_gripper(own, "panda")
        gone = set(model_of(own).links) - set(model_of(arm).links)
        assert gone == {"Moving_Jaw", "Moving_Jaw_tip"}
        assert model_of(arm).parent_joint["panda_hand"].parent == "Fixed_Jaw"
        assert arm.joints == (*own.arm_joints, "panda_finger_joint1", "panda_finger_joint2")
        assert arm.fingers.links == ("panda_leftfinger", "panda_rightfinger")

    def test_fingers_that_hang_on_an_arm_are_not_lent(self):
        with pytest.raises(DescriptorError, match="so100 cannot lend its gripper: no fixed joint"):
            with_gripper(PANDA, "so100")

    def test_an_arm_that_has_none_lends_none(self):
        with pytest.raises(DescriptorError, match="panda_stick is an arm, and none of its"):
            with_gripper(PANDA, "panda_stick")

    def test_poses_that_are_none(self):
        with pytest.raises(DescriptorError, match="quaternion .* has length 2; a rotation has"):
            with_gripper(PANDA, "panda", quaternion=(2, 0, 0, 0))
        with pytest.raises(DescriptorError, match="'panda_link8': position"):
            with_gripper(PANDA, "panda", position=(0, math.nan, 0))

    def test_links_that_do_not_exist(self):
        with pytest.raises(UnknownNameError, match="panda_link8"):
            with_gripper(RobotRegistry.load("panda_stick"), "panda", link="panda_link88")
        with pytest.raises(UnknownNameError, match="panda"):
            with_gripper(PANDA, "pandda")


class TestTools:
    def test_the_tip_of_a_pen_is_the_tool_centre_point(self, pen):
        arm = with_tool(PANDA, pen, tcp_link="nib")
        hand = pose_of(PANDA, "panda_hand_tcp")
        np.testing.assert_allclose(
            pose_of(arm, "nib"), hand @ pose_matrix((0, 0, 0.1), (1, 0, 0, 0)), atol=1e-9
        )
        assert arm.reach == pytest.approx(PANDA.reach + 0.1, abs=1e-3)
        assert arm.action_dim == PANDA.action_dim
        before, after = stepped(arm, [*[0.0] * 7, 1.0], 10)
        np.testing.assert_allclose(after, before, atol=1e-3)

    def test_what_is_refused(self, pen):
        with pytest.raises(UnknownNameError, match="nib"):
            with_tool(PANDA, pen, tcp_link="nip")
        with pytest.raises(DescriptorError, match=r"tool moves \(panda_joint1\)"):
            with_tool(PANDA, PANDA.urdf, tcp_link="panda_hand")

    def test_names_that_are_taken_get_a_prefix(self, tmp_path):
        path = tmp_path / "tool.urdf"
        path.write_text(PEN.replace('"shaft"', '"panda_hand"'))
        arm = with_tool(PANDA, path, tcp_link="nib")
        assert (arm.tcp_link, "tool_panda_hand" in model_of(arm).links) == ("tool_nib", True)

    def test_two_of_a_kind(self, pen):
        arm = with_tool(with_tool(PANDA, pen, tcp_link="nib"), pen, tcp_link="nib", link="nib")
        assert arm.tcp_link == "tool_nib"
        third = with_tool(arm, pen, tcp_link="nib")
        assert third.tcp_link == "tool_2_nib"
        assert third.reach > arm.reach > PANDA.reach


def test_a_gripper_leaves_the_control_modes_of_its_arm_behind():
    lent = PANDA.with_gripper("fetch")
    assert set(lent.in_control_mode("pd_joint_pos").action_split) == {"arm", "gripper"}
    kept = RobotRegistry.load("fetch").with_gripper("panda")
    assert kept.in_control_mode("pd_joint_pos").action_split.groups["torso"].delta


class TestArmsOnABody:
    def test_two_arms_on_a_bench(self, bench):
        both = on_body(
            "bimanual",
            bench,
            {
                "left": Mount("panda", position=(0.0, 0.4, 0.5)),
                "right": Mount("panda_stick", position=(0.0, -0.4, 0.5)),
            },
        )
        assert (both.dof, both.action_dim) == (16, 15)
        assert list(both.action_split.groups) == ["left_arm", "left_gripper", "right_arm"]
        assert single({"robot": both}).validate(workspaces=False).ok
        left = pose_of(both, "left_panda_link0")
        np.testing.assert_allclose(left[:3, 3], (0, 0.4, 0.5))
        for number in (0, 8):
            action = np.zeros(15)
            action[7], action[number] = 1.0, 1.0
            before, after = stepped(both, action, 10)
            moved = np.flatnonzero(abs(after - before) > 0.3)
            assert moved.tolist() == [both.joints.index(both.describe_action()[number].joints[0])]

    def test_robots_keep_control_modes_of_their_own(self, bench):
        mounts = {"one": Mount("koch"), "other": Mount("fetch", position=(0.0, 1.0, 0.0))}
        both = on_body("pair", bench, mounts).in_control_mode("pd_joint_pos")
        assert both.no_floor_contact == ("other_l_wheel_link", "other_r_wheel_link")
        for key, mount in mounts.items():
            alone = RobotRegistry.load(str(mount.robot)).in_control_mode("pd_joint_pos")
            for name, group in alone.action_split.groups.items():
                joined = both.action_split.groups[f"{key}_{name}"]
                assert joined.joints == tuple(f"{key}_{joint}" for joint in group.joints)
                assert (joined.drives, joined.bounds) == (group.drives, group.bounds)

    def test_robots_of_several_arms_are_not_joined(self, bench):
        both = on_body("pair", bench, {"one": Mount("panda"), "other": Mount("panda")})
        with pytest.raises(DescriptorError, match="has the limbs one, other, and cannot take anot"):
            both.with_gripper("panda")
        with pytest.raises(DescriptorError, match="has the limbs one, other, and cannot lend a gr"):
            PANDA.with_gripper(both)
        with pytest.raises(DescriptorError, match="and cannot stand on a body as 'here'"):
            on_body("more", bench, {"here": Mount(both)})

    def test_an_empty_or_moving_body(self, bench):
        with pytest.raises(DescriptorError, match="nothing stands on the body"):
            on_body("nothing", bench, {})
        with pytest.raises(DescriptorError, match="body moves"):
            on_body("moving", PANDA.urdf, {"left": Mount("panda")})


class TestFiles:
    def test_the_same_parts_make_the_same_file(self, pen, tmp_path):
        urdf = AssembledUrdf(PANDA.urdf, (UrdfPart(LocalUrdf(pen), "panda_hand"),))
        first = urdf.locate()
        assert pickle.loads(pickle.dumps(urdf)).locate() == first
        pen.write_text(PEN.replace("0.2", "0.3"))
        second = urdf.locate()
        assert second != first
        assert sorted(p.name for p in first.parent.parent.iterdir()) == sorted(
            [first.parent.name, second.parent.name]
        )

    @pytest.mark.long
    def test_many_processes_at_once(self, pen, tmp_path):
        code = (
            "import sys; from robots import RobotRegistry, LocalUrdf;"
            "from robots.assets import assembled; from pathlib import Path;"
            "assembled.default_root = lambda: Path(sys.argv[2]);"
            "panda = RobotRegistry.load('panda');"
            "part = assembled.UrdfPart(LocalUrdf(sys.argv[1]), 'panda_hand');"
            "print(assembled.AssembledUrdf(panda.urdf, (part,)).locate())"
        )
        words = [sys.executable, "-c", code, str(pen), str(tmp_path / "shared")]
        running = [subprocess.Popen(words, stdout=subprocess.PIPE, text=True) for _ in range(4)]
        places = {process.communicate()[0] for process in running}
        assert {process.returncode for process in running} == {0}
        assert len(places) == 1
        assert len(list((tmp_path / "shared" / "assembled").iterdir())) == 1

    def test_a_folder_that_cannot_be_written(self, pen, tmp_path):
        (tmp_path / "cache").write_text("a file")
        with pytest.raises(UnwritableFileError, match="cannot write .*cache/assembled"):
            AssembledUrdf(PANDA.urdf, (UrdfPart(LocalUrdf(pen), "panda_hand"),)).locate()

    def test_names_that_are_there_twice(self, pen):
        part = UrdfPart(LocalUrdf(pen), "panda_hand")
        with pytest.raises(DescriptorError, match="has a link 'shaft', and so has"):
            AssembledUrdf(PANDA.urdf, (part, part)).locate()
        with pytest.raises(DescriptorError, match="nothing is left without 'panda_link0'"):
            AssembledUrdf(PANDA.urdf, without=("panda_link0",)).locate()
