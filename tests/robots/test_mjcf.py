"""Robots from MJCFs: what is taken over, what is refused, and that they move as in MuJoCo."""

from __future__ import annotations

import sys
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

from benchmarks.robots.probe import kinematic_difference
from layouts import single
from robot_layouts.__main__ import main
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.provenance import describe_guessed, guess_again
from robots import AssetError, DescriptorError, LocalMjcf, MissingPackageError, RobotDescriptor
from robots.from_urdf import guess_descriptor
from robots.mjcf import conversion
from robots.named import named_robot
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf

from .mjcf_parts import JAWS, arm, mjcf, motors, write

DRAWN = 'contype="0" conaffinity="0"'
CRUMB = trimesh.creation.box((1e-6, 1e-6, 1e-6))
SHEET = trimesh.creation.box((0.1, 0.1, 0.0))
TRIANGLE = trimesh.Trimesh(np.eye(3), [[0, 1, 2]])


@pytest.fixture(autouse=True)
def _local_copy(tmp_path_factory, monkeypatch):
    monkeypatch.setenv("ROBOT_LAYOUTS_ASSETS", str(tmp_path_factory.mktemp("local_copy")))


def urdf_of(path):
    urdf = LocalMjcf(path).locate()
    return read_model(read_urdf(urdf), urdf.as_posix())


def reasons(path):
    return "\n".join(guess_descriptor(path).reasons)


class TestWhatIsGuessed:
    def test_arm_gripper_tool_and_posture(self, tmp_path):
        hand = JAWS.format(site='<site name="pinch" pos="0.09 0 0"/>')
        rest = (
            "<actuator>"
            + motors(kind="position", kp=3000, kv=60, forcerange="-70 70")
            + "</actuator>"
            '<equality><joint joint1="slide_two" joint2="slide_one"/></equality>'
            '<keyframe><key name="other" qpos="0 0 0 0 0 0 0 0"/>'
            '<key name="home" qpos="0.1 -0.9 1.4 0 0.6 0 0.02 0.02"/></keyframe>'
            '<contact><exclude body1="base" body2="link4"/></contact>'
        )
        path = write(tmp_path, mjcf(arm(end=hand), rest))
        robot = RobotDescriptor.from_mjcf(path, quiet=True)
        assert robot.name == "small"
        assert robot.urdf == LocalMjcf(str(path))
        assert robot.arm_joints == tuple(f"joint{i}" for i in range(1, 7))
        assert set(robot.action_split.groups["gripper"].joints) == {"slide_one", "slide_two"}
        assert robot.action_split.groups["gripper"].size == 1
        assert robot.tcp_link == "pinch"
        assert robot.keyframe("rest")[:6] == pytest.approx((0.1, -0.9, 1.4, 0, 0.6, 0))
        assert robot.keyframe("rest")[6:] == pytest.approx((0.04, 0.04))
        assert robot.keyframe("home")[6:] == pytest.approx((0.02, 0.02))
        assert ("base", "link4") in robot.allowed_collisions
        arms = robot.action_split.groups["arm"]
        assert arms.drives[:5] == ((3000, 60, 70),) * 5
        assert arms.drives[5][0] < 3000  # stiffer, what it carries would shake

    def test_a_drive_that_is_too_weak_is_not_taken(self, tmp_path):
        weak = write(tmp_path, mjcf(arm(), f"<actuator>{motors(kind='position', kp=1)}</actuator>"))
        (about,) = [line for line in reasons(weak).splitlines() if "not those of the MJCF" in line]
        assert about.startswith("drives of joint1, joint2, joint3")
        assert guess_descriptor(weak).descriptor.action_split.groups["arm"].drives[0][0] > 50

    def test_armature_is_taken(self, tmp_path):
        path = write(tmp_path, "<mujoco><default><joint armature='0.25'/></default>"
                     + mjcf(arm()).removeprefix('<mujoco model="small">'))  # fmt: skip
        assert guess_descriptor(path).descriptor.action_split.groups["arm"].armature == 0.25

    def test_what_is_no_robot_is_left_out(self, tmp_path):
        scene = (
            '<geom type="plane" size="1 1 0.1"/><body name="table"><geom size="0.1"/></body>'
            '<body name="cube" pos="1 0 0"><freejoint/><geom size="0.02"/></body>'
            '<body name="door"><joint name="hinge"/><geom size="0.1"/></body>'
        )
        path = write(tmp_path, mjcf(scene + arm(), f"<actuator>{motors()}</actuator>"))
        about = reasons(path)
        assert "left out: table, cube, in which no joint turns or slides" in about
        assert "left out: door, of which no actuator drives a joint" in about
        assert "left out: what stands on the ground without a body, 1 shapes" in about
        assert {joint.name for joint in urdf_of(path).moving} == {f"joint{i}" for i in range(1, 7)}

    def test_a_base_that_flies_is_fixed(self, tmp_path):
        path = write(tmp_path, mjcf(arm(inside='<freejoint name="fly"/>')))
        assert "'fly', by which the whole robot flies freely, is fixed" in reasons(path)

    def test_ranges_of_radians_are_taken_for_that_unless_the_file_says_degrees(self, tmp_path):
        small = mjcf(arm().replace('range="-100 100"', 'range="-1.7 1.7"'))
        path = write(tmp_path, small)
        assert "taken for radians, as no hinge would turn by more than 3.4° otherwise" in reasons(
            path
        )
        assert {(joint.lower, joint.upper) for joint in urdf_of(path).moving} == {(-1.7, 1.7)}
        said = write(
            tmp_path, small.replace("<worldbody>", '<compiler angle="degree"/><worldbody>')
        )
        for file in (said, write(tmp_path, mjcf(arm()))):
            assert "radians" not in reasons(file)

    @pytest.mark.parametrize(
        ("lid", "use", "what"),
        [
            (CRUMB, "", "the mesh 'lid' has no volume, so it is a shell"),
            (SHEET, DRAWN, "the mesh 'lid' has no volume, so it is a shell"),
            (TRIANGLE, DRAWN, "left out: the mesh 'lid', which is only drawn"),
            (SHEET, "", None),
            (TRIANGLE, "", None),
        ],
    )
    def test_a_mesh_that_is_too_thin(self, lid, use, what, tmp_path):
        lid.export(tmp_path / "lid.obj")
        geom = f'<geom type="mesh" mesh="lid" {use}/>'
        path = write(tmp_path, mjcf(arm(inside=geom), '<asset><mesh file="lid.obj"/></asset>'))
        if what is None:
            with pytest.raises(AssetError, match="MuJoCo cannot compile"):
                guess_descriptor(path)
        else:
            assert what in reasons(path)
            kept = [] if what.startswith("left out") else ["mesh"]
            assert [shape.kind for shape in urdf_of(path).visuals["base"]] == [*kept, "box"]

    def test_what_lies_elsewhere_is_read_from_a_folder_that_is_named(self, tmp_path, capsys):
        far, own = tmp_path / "far", tmp_path / "own"
        far.mkdir(), own.mkdir()
        trimesh.creation.box((0.2, 0.1, 0.06)).export(far / "box.stl")
        assets = '<asset><mesh file="../far/box.stl"/></asset>'
        path = write(own, mjcf(arm(inside='<geom type="mesh" mesh="box"/>'), assets))
        with pytest.raises(AssetError, match=r"leads out of .* folder=… \(--folder DIR\)"):
            guess_descriptor(path)
        assert main(["robots", "guess", str(path), "--folder", str(far)]) == 0
        robot = RobotDescriptor.from_mjcf(path, quiet=True, folder=far)
        assert robot.urdf == LocalMjcf(str(path), str(far))

    def test_two_arms_are_limbs(self, tmp_path):
        both = arm("left_", at="0 0.4 0") + arm("right_", at="0 -0.4 0")
        robot = guess_descriptor(write(tmp_path, mjcf(both))).descriptor
        assert list(robot.limbs) == ["left", "right"]
        assert robot.limbs["left"].base[1] == pytest.approx(0.4)

    def test_fingers_on_one_tendon_move_alike(self, tmp_path):
        rest = (
            '<tendon><fixed name="both"><joint joint="slide_one" coef="0.5"/>'
            '<joint joint="slide_two" coef="0.5"/></fixed></tendon>'
            f'<actuator>{motors()}<general tendon="both" forcerange="-20 20"/></actuator>'
        )
        path = write(tmp_path, mjcf(arm(end=JAWS.format(site="")), rest))
        (follower,) = [joint for joint in urdf_of(path).moving if joint.mimics]
        assert (follower.name, follower.mimics) == ("slide_two", "slide_one")
        assert (follower.multiplier, follower.effort) == (1, 10)
        uneven = path.read_text("utf-8").replace('"slide_two" coef="0.5"', '"slide_two" coef="0.2"')
        about = reasons(write(tmp_path, uneven))
        assert "the tendon both pulls slide_one, slide_two by different amounts" in about

    def test_a_loop_moves_as_mujoco_moves_it(self, tmp_path):
        """A parallelogram: what the crank turns by, the rod turns back."""
        loop = (
            '<body name="crank"><joint name="crank" axis="0 1 0" range="-40 40"/>'
            '<geom type="capsule" size="0.01" fromto="0 0 0 0 0 0.1"/>'
            '<body name="rod" pos="0 0 0.1"><joint name="rod" axis="0 1 0"/>'
            '<geom type="capsule" size="0.01" fromto="0 0 0 0.1 0 0"/></body></body>'
            '<body name="rocker" pos="0.1 0 0"><joint name="rocker" axis="0 1 0"/>'
            '<geom type="capsule" size="0.01" fromto="0 0 0 0 0 0.1"/></body>'
        )
        rest = (
            '<equality><connect body1="rod" body2="rocker" anchor="0.1 0 0"/></equality>'
            f'<actuator>{motors()}<motor joint="crank"/></actuator>'
        )
        model = urdf_of(write(tmp_path, mjcf(arm(end=loop), rest)))
        follows = {joint.name: joint for joint in model.moving if joint.mimics}
        assert set(follows) == {"rod", "rocker"}
        assert follows["rod"].multiplier == pytest.approx(-1, abs=0.01)
        assert follows["rocker"].multiplier == pytest.approx(1, abs=0.01)

    def test_what_collides_and_what_is_drawn(self, tmp_path):
        shapes = (
            '<geom type="sphere" size="0.01" contype="0" conaffinity="0" rgba="1 0 0 1"/>'
            '<geom type="sphere" size="0.02" group="3"/>'
            '<geom type="ellipsoid" size="0.01 0.02 0.03"/>'
        )
        model = urdf_of(write(tmp_path, mjcf(arm(end=f'<body name="end">{shapes}</body>'))))
        assert [shape.kind for shape in model.visuals["end"]] == ["sphere", "mesh"]
        assert [shape.kind for shape in model.collisions["end"]] == ["sphere", "mesh"]
        assert model.visuals["end"][0].sizes == (0.01,)
        assert model.collisions["end"][0].sizes == (0.02,)


class TestKinematics:
    def test_odd_joints_move_as_in_mujoco(self, tmp_path):
        odd = """
        <mujoco><compiler angle="degree" eulerseq="zyx" autolimits="true"/>
        <default><default class="odd"><joint axis="1 2 3"/></default></default>
        <worldbody><body name="root" pos="1 2 3" euler="30 40 50"><geom size="0.1"/>
          <body name="a" pos="0.1 0.2 0.3" quat="1 2 3 4" childclass="odd">
            <joint name="j1" range="-90 90" pos="0.05 0.02 -0.03" ref="20"/>
            <joint name="j2" axis="0 1 0" range="-50 60" pos="-0.01 0.02 0.07"/>
            <joint name="s" type="slide" axis="0 0 2" range="-0.1 0.3" ref="0.1"/>
            <geom size="0.05"/>
            <body name="b" pos="0.2 0 0" axisangle="0 1 1 75">
              <joint name="j3" pos="0 0.1 0"/>
              <geom type="capsule" size="0.02" fromto="0 0 0 0 0 0.2"/>
              <body name="c" pos="0 0 0.2"><geom size="0.05"/>
                <body name="d" euler="0 90 0"><joint name="j4" axis="0 0 1"/><geom size="0.05"/>
          </body></body></body></body></body></worldbody></mujoco>"""
        assert kinematic_difference(write(tmp_path, odd)) < 1e-9

    def test_two_trees_and_a_scene(self, tmp_path):
        both = arm("left_", at="0 0.4 1") + arm("right_", at="0.3 -0.4 0")
        assert kinematic_difference(write(tmp_path, mjcf(both))) < 1e-9

    def test_meshes_are_where_mujoco_has_them(self, tmp_path):
        """Whatever an MJCF scales, shifts and turns, the corners in the link's frame are right."""
        box = trimesh.creation.box((0.2, 0.1, 0.06))
        box.apply_translation((0.3, 0, 0))
        (tmp_path / "parts").mkdir()
        box.export(tmp_path / "parts" / "Box.STL")
        assets = (
            '<compiler meshdir="parts"/><asset><mesh file="Box.STL" scale="0.5 1 2"'
            ' refpos="0.1 0 0" refquat="1 0 0 1"/></asset>'
        )
        end = '<geom type="mesh" mesh="Box" pos="0 0 0.1"/>'
        path = write(tmp_path, mjcf(arm(end=f'<body name="end">{end}</body>'), assets))
        model = urdf_of(path)
        (shape,) = model.collisions["end"]
        mesh = trimesh.load_mesh(LocalMjcf(path).locate().parent / shape.file)
        corners = np.asarray(mesh.vertices) @ shape.origin[:3, :3].T + shape.origin[:3, 3]
        import mujoco

        there = mujoco.MjModel.from_xml_path(str(path))
        geom = there.ngeom - 1
        data = mujoco.MjData(there)
        mujoco.mj_kinematics(there, data)
        body = there.geom_bodyid[geom]
        placed = there.mesh_vert @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        theirs = (placed - data.xpos[body]) @ data.xmat[body].reshape(3, 3)
        assert np.allclose(np.sort(np.ptp(corners, axis=0)), np.sort(np.ptp(theirs, axis=0)))
        assert np.allclose(corners.min(axis=0), theirs.min(axis=0), atol=1e-6)
        assert np.allclose(corners.max(axis=0), theirs.max(axis=0), atol=1e-6)

    def test_mass_and_inertia_are_mujocos(self, tmp_path):
        path = write(tmp_path, mjcf(arm()))
        root = ElementTree.parse(LocalMjcf(path).locate()).getroot()
        masses = [float(mass.get("value", "")) for mass in root.iterfind("link/inertial/mass")]
        assert masses == pytest.approx([0.8, *[0.0576] * 6])  # kg: volumes by densities


class TestFiles:
    def test_includes_are_read_wherever_they_stand(self, tmp_path):
        (tmp_path / "sub").mkdir()
        write(tmp_path, f"<mujocoinclude>{arm()}</mujocoinclude>", "sub/body.xml")
        write(tmp_path, '<mujoco><include file="body.xml"/></mujoco>', "sub/again.xml")
        path = write(tmp_path, mjcf('<include file="sub/again.xml"/>'))
        assert len(urdf_of(path).moving) == 6

    def test_nothing_is_written_twice_and_mujoco_is_asked_once(self, tmp_path, monkeypatch):
        path = write(tmp_path, mjcf(arm()))
        first = LocalMjcf(path).locate()
        conversion._convert.cache_clear()
        monkeypatch.setitem(sys.modules, "mujoco", None)
        assert LocalMjcf(path).locate() == first
        write(tmp_path, mjcf(arm(at="0 0 1")))
        with pytest.raises(MissingPackageError, match=r"pip install 'robot-layouts\[mjcf\]'"):
            LocalMjcf(path).locate()

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ('<!DOCTYPE x [<!ENTITY a "b">]><mujoco/>', "declares XML entities"),
            ("<robot/>", "holds <robot>, not <mujoco>"),
            ("<mujoco", "is not an MJCF"),
            ("<mujoco>" + "<body>" * 200 + "</body>" * 200 + "</mujoco>", "deeper than"),
            (mjcf('<include file="../../etc/passwd"/>'), "leads out of its folder"),
            (mjcf('<include file="/etc/passwd"/>'), "leads out of its folder"),
            (mjcf('<include file="arm.xml"/>'), "in itself"),
            (mjcf('<include file=""/>'), "which is no file"),
            (mjcf('<include file="no.xml"/>'), "cannot read the file"),
            (mjcf(arm(), '<asset><mesh file="../x.stl"/></asset>'), "leads out of its folder"),
            (mjcf(arm(), '<asset><mesh file="no.stl"/></asset>'), "cannot read the mesh"),
            (mjcf(arm(), '<asset><mesh file="arm.xml"/></asset>'), "MuJoCo reads .stl"),
            (mjcf(f'<replicate count="9" offset="1 0 0">{arm()}</replicate>'), "copies bodies"),
            (mjcf('<body><joint type="round"/></body>'), "MuJoCo cannot compile"),
            (mjcf(arm(end='<body><joint name="b" type="ball"/><geom size="1"/></body>')), "ball"),
        ],
    )
    def test_what_is_refused(self, tmp_path, text, message):
        path = write(tmp_path, text)
        with pytest.raises(AssetError, match=message):
            guess_descriptor(path)

    def test_nothing_is_left_where_it_was_started(self, tmp_path, monkeypatch):
        """MuJoCo would write a log there, of a model that it warns of."""
        path = write(tmp_path, mjcf(arm(end='<body><geom size="nan"/></body>')))
        (tmp_path / "here").mkdir()
        monkeypatch.chdir(tmp_path / "here")
        with pytest.raises(AssetError, match="MuJoCo cannot compile"):
            guess_descriptor(path)
        assert not list((tmp_path / "here").iterdir())

    def test_what_holds_no_robot(self, tmp_path):
        with pytest.raises(DescriptorError, match="no joint that turns or slides"):
            guess_descriptor(write(tmp_path, mjcf('<body><freejoint/><geom size="1"/></body>')))

    def test_joints_that_follow_no_line_are_refused(self, tmp_path):
        curve = '<equality><joint joint1="joint1" joint2="joint2" polycoef="0 1 2 0 0"/></equality>'
        with pytest.raises(AssetError, match="joint joint1 follows joint2 by an equality, but by"):
            guess_descriptor(write(tmp_path, mjcf(arm(), curve)))

    def test_an_mjcf_takes_no_srdf(self, tmp_path):
        path = write(tmp_path, mjcf(arm()))
        with pytest.raises(DescriptorError, match="is an MJCF, which takes no SRDF"):
            guess_descriptor(path, srdf="arm.srdf")


class TestEverywhere:
    def test_commands_take_an_mjcf_for_a_robot(self, tmp_path, capsys):
        path = write(tmp_path, mjcf(arm(end='<site name="tcp"/>')))
        assert named_robot(str(path)).tcp_link == "tcp"
        assert single({"arm": str(path)})["arm"].robot.name == "small"
        assert main(["robots", "guess", str(path), "--module"]) == 0
        scope: dict[str, object] = {}
        exec(capsys.readouterr().out, scope)
        assert scope["SMALL"] == RobotDescriptor.from_mjcf(path, quiet=True)

    def test_a_recording_knows_the_file_and_refuses_another(self, tmp_path):
        path = write(tmp_path, mjcf(arm()))
        robot = RobotDescriptor.from_mjcf(path, quiet=True)
        recorded = describe_guessed(single({"arm": robot}))["arm"]
        assert guess_again("arm", recorded, robot.name) == robot
        write(tmp_path, mjcf(arm(at="0 0 0.1")))
        with pytest.raises(TrajectoryError, match="which has changed since"):
            guess_again("arm", recorded, robot.name)
