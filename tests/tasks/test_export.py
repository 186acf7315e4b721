"""A task's world, opened by MuJoCo, usd-core and readers of what ROS 2 takes."""

import re
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
import yaml
import yourdfpy

import tasks
from layouts import single
from objects.shapes import Mesh, Plane
from objects.solids import mass_of, surface
from robot_layouts.__main__ import main
from robot_layouts.kinematics.rotations import pose_matrix, transform
from robots import LayoutError, MissingPackageError
from tasks import Area, MultiRobotTask, Object, register_task
from tests.clients.environments import new_environment, play

HERE = Path(__file__).parent
DIGITS = 1e-5  # MuJoCo writes six


def opened(path):
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("now").id)
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.parametrize("simulator", ["sapien3", "mujoco"])
@pytest.mark.parametrize("task", ["PegInsertionSide-v1", "CellCloseDrawers-v1"])
def test_everything_is_where_it_is_in_the_task(task, simulator, tmp_path):
    env = tasks.make(task, simulator=simulator)
    env.reset(seed=3)
    for _ in range(5):
        env.step(np.full((1, env.layout.action_dim), 0.3, np.float32))
    model, data = opened(env.to_mjcf(tmp_path / "cell.xml"))
    bodies = [*env.simulation.worlds[0].bodies]
    for name in bodies:
        pose = env.state.pose(name)[0]
        np.testing.assert_allclose(data.body(name).xpos, pose[:3], atol=DIGITS)
        assert abs(data.body(name).xquat @ pose[3:]) > 1 - 1e-6
    for place, placement in env.layout.items():
        joints = [data.joint(f"{place}/{joint}").qpos[0] for joint in placement.robot.joints]
        np.testing.assert_allclose(joints, env.state.qpos(place)[0], atol=DIGITS)
        assert all(model.actuator(f"{place}/{joint}") for joint in placement.robot.joints)


class ShutLaptop(MultiRobotTask):
    """A laptop with a screen that rubs."""

    layout = single({"arm": "panda"})
    max_episode_steps = 20
    laptop = Object("laptop", spawn=Area(x=0.1, y=0.1), joints={"screen": 1.0})

    def evaluate(self, state):
        """Success: it is shut."""
        return {"success": state.joint("laptop", "screen") < 0.1}


@pytest.fixture(scope="module", autouse=True)
def laptop():
    register_task("TestShutLaptop-v1")(ShutLaptop)


def test_it_weighs_and_rubs_as_it_does_here_and_stands_still(tmp_path):
    env = tasks.make("TestShutLaptop-v1")
    env.reset(seed=0)
    model, data = opened(env.to_mjcf(tmp_path / "cell.xml"))
    body = env.simulation.worlds[0].bodies["laptop"]
    (joint,) = body.joints
    screen = model.body("laptop.screen")
    assert model.body("laptop").mass[0] == pytest.approx(mass_of(body.shapes).mass, rel=0.01)
    assert screen.mass[0] == pytest.approx(mass_of(joint.parts).mass, rel=0.01)
    rubs = joint.friction * screen.subtreemass[0] * 9.81
    assert model.dof_frictionloss[screen.dofadr[0]] == pytest.approx(rubs, rel=1e-3) != 0
    before = data.body("laptop").xpos.copy()
    mujoco.mj_step(model, data, nstep=round(1 / model.opt.timestep))
    assert np.abs(data.body("laptop").xpos - before).max() < 1e-3


def test_the_command(tmp_path, capsys):
    path = tmp_path / "bar.xml"
    assert main(["tasks", "export", "TwoRobotLiftBar-v1", "--seed", "1", "--out", str(path)]) == 0
    assert f"mjcf: {path}" in capsys.readouterr().out
    model, data = opened(path)
    assert data.body("bar").xpos[2] < 0.1
    assert "panda" in (tmp_path / "bar_assets" / "LICENCES.md").read_text()


def test_another_ending_is_refused_and_nothing_is_left(tmp_path):
    env = tasks.make("PushCube-v1")
    env.reset(seed=0)
    with pytest.raises(LayoutError, match="must end in .xml"):
        env.to_mjcf(tmp_path / "cell.usd")
    assert not list(tmp_path.iterdir())


# -- ROS 2 ----------------------------------------------------------------------------------------

PACKAGE = "world"
SLAB = 100.0  # m; what stands for a plane is as wide


@pytest.fixture(
    scope="module",
    params=[
        *("CellCloseDrawers-v1", "RotateValveLevel2-v1", "PegInsertionSide-v1"),
        *("CellHoldAndPush-v1", "TestShutLaptop-v1"),
    ],
)
def exported(request, laptop, tmp_path_factory):
    """A task's environment after some steps, and its package."""
    env = tasks.make(request.param)
    env.reset(seed=3)
    for _ in range(5):
        env.step(np.full((1, env.layout.action_dim), 0.3, np.float32))
    return env, env.to_ros2(tmp_path_factory.mktemp("ros2") / PACKAGE)


def read_urdf(path, package):
    def file(fname):
        return str(package.parent / fname.removeprefix("package://"))

    return yourdfpy.URDF.load(str(path), filename_handler=file, load_collision_meshes=True)


def box_of(points):
    return np.array([points.min(axis=0), points.max(axis=0)])


def box_here(env, name):
    """Return the box around what collides of a body, in the world."""
    pose = env.state.pose(name)[0].astype(float)
    shapes = [s for s in env.simulation.worlds[0].bodies[name].shapes if s.collides]
    points = [transform(pose_matrix(pose[:3], pose[3:]), surface(s).corners) for s in shapes]
    return box_of(np.vstack(points))


def solid_boxes(urdf, base):
    """Return the box around what collides of each link, in the world."""
    found = {}
    for name in urdf.link_map:
        pose, points = base @ urdf.get_transform(name), []
        for shape in urdf.link_map[name].collisions:
            own = np.eye(4) if shape.origin is None else shape.origin
            points.append(transform(pose @ own, geometry_points(shape.geometry, urdf)))
        if points:
            found[name] = box_of(np.vstack(points))
    return found


def geometry_points(geometry, urdf):
    if geometry.box is not None:
        return np.asarray(trimesh.creation.box(geometry.box.size).vertices)
    if geometry.sphere is not None:
        return np.asarray(trimesh.creation.icosphere(3, geometry.sphere.radius).vertices)
    if geometry.cylinder is not None:
        size = geometry.cylinder.radius, geometry.cylinder.length
        return np.asarray(trimesh.creation.cylinder(*size).vertices)
    mesh = trimesh.load(urdf._filename_handler(fname=geometry.mesh.filename), force="mesh")
    return np.asarray(mesh.vertices)


def test_bodies_have_urdfs_of_their_own_which_put_them_where_they_are(exported):
    env, package = exported
    bodies = env.simulation.worlds[0].bodies
    where = yaml.safe_load((package / "config" / "bodies.yaml").read_text())
    moved = [
        n for n, b in bodies.items() if not b.part_of and not b.anchored and b.kind != "static"
    ]
    solid = [n for n in moved if any(shape.collides for shape in bodies[n].shapes)]
    assert [*where] == solid
    for name, about in where.items():
        urdf = read_urdf(package / "urdf" / "bodies" / f"{name}.urdf", package)
        body, (x, y, z, w) = bodies[name], about["orientation"]
        base = np.eye(4) if about["held"] else pose_matrix(about["position"], [w, x, y, z])
        assert about["held"] == (body.kind != "dynamic")
        urdf.update_cfg({n: joint["position"] for n, joint in about.get("joints", {}).items()})
        found = solid_boxes(urdf, base)
        assert found.keys() == {plain(part) for part in bodies if whole(part) == name}
        for part in [n for n in bodies if whole(n) == name]:
            here = box_here(env, part)
            np.testing.assert_allclose(found[plain(part)], here, atol=2e-4)
        for joint in body.joints:
            made = urdf.joint_map[f"{name}_{joint.name}_joint"]
            limits = None if joint.is_endless else (made.limit.lower, made.limit.upper)
            assert limits == (None if joint.is_endless else joint.limits)
            assert float(made.dynamics.damping) == joint.damping


def plain(name):
    return re.sub(r"\W", "_", name)


def whole(part):
    return part.partition(".")[0]


def test_bodies_weigh_what_they_do_in_sapien(exported):
    env, package = exported
    world = env.simulation.backend.worlds[0]
    for path in (package / "urdf" / "bodies").iterdir():
        urdf = read_urdf(path, package)
        for name, body in env.simulation.worlds[0].bodies.items():
            if body.kind != "dynamic" or body.joints or name != path.stem:
                continue
            entity = world.bodies[name].component
            weight = urdf.link_map[name].inertial
            assert weight.mass == pytest.approx(entity.mass, rel=1e-3)
            moments = np.linalg.eigvalsh(weight.inertia)
            np.testing.assert_allclose(moments, np.sort(entity.inertia), rtol=1e-2)


def read_scene(text):
    """Return the objects of a scene file as MoveIt reads it: pose, and the points of shapes."""
    lines = iter(text.splitlines())
    next(lines)
    found = {}
    while (line := next(lines)) != ".":
        assert line.startswith("* ")
        pose, points = read_pose(lines), []
        for _ in range(int(next(lines))):
            corners = read_shape(lines)
            points.append(transform(pose @ read_pose(lines), corners))
            assert len(next(lines).split()) == 4
        found[line[2:]] = box_of(np.vstack(points))
        assert next(lines) == "0"
    return found


def read_pose(lines):
    x, y, z, w = map(float, (place := next(lines), next(lines))[1].split())
    return pose_matrix([float(number) for number in place.split()], [w, x, y, z])


def read_shape(lines):
    kind = next(lines)
    sizes = [float(number) for number in next(lines).split()]
    if kind == "mesh":
        corners = np.array([next(lines).split() for _ in range(int(sizes[0]))], float)
        faces = np.array([next(lines).split() for _ in range(int(sizes[1]))], int)
        assert faces.max() < len(corners)
        return corners
    made = {
        "box": lambda: trimesh.creation.box(sizes),
        "sphere": lambda: trimesh.creation.icosphere(3, *sizes),
        "cylinder": lambda: trimesh.creation.cylinder(*sizes),
    }[kind]()
    return np.asarray(made.vertices)


def test_moveit_is_told_where_they_are_and_started_with_them(exported):
    env, package = exported
    found = read_scene((package / "config" / "bodies.scene").read_text())
    bodies = env.simulation.worlds[0].bodies
    names = {plain(name): name for name in bodies}
    assert found.keys() <= names.keys()
    for name, box in found.items():
        np.testing.assert_allclose(box, box_here(env, names[name]), atol=2e-4)
    launch = (package / "launch" / "demo.launch.py").read_text()
    assert 'executable="moveit_publish_scene_from_text"' in launch
    compile(launch, "demo.launch.py", "exec")
    assert "moveit_ros_planning<" in (package / "package.xml").read_text()


def test_what_stands_is_in_the_cell_and_robots_are_where_they_were(exported):
    env, package = exported
    cell = read_urdf(package / "urdf" / f"{PACKAGE}.urdf", package)
    boxes = solid_boxes(cell, np.eye(4))
    for name, body in env.simulation.worlds[0].bodies.items():
        stands = body.kind == "static" or body.anchored
        plane = any(isinstance(shape, Plane) for shape in body.shapes)
        if not stands or body.joints or body.part_of:
            assert plain(name) not in cell.link_map
        elif plane:
            low, high = boxes[plain(name)]
            assert (high - low)[:2] == pytest.approx([SLAB, SLAB], abs=1e-3)
            assert high[2] == pytest.approx(plane_height(body, env.state.pose(name)[0]), abs=1e-5)
        elif any(shape.collides for shape in body.shapes):
            np.testing.assert_allclose(boxes[plain(name)], box_here(env, name), atol=2e-4)
    (srdf,) = (package / "config").glob("*.srdf")
    text = srdf.read_text()
    for place, placement in env.layout.items():
        for joint, position in zip(placement.robot.joints, env.state.qpos(place)[0], strict=True):
            if f'"{place}_{joint}" value' in text:
                value = float(text.split(f'"{place}_{joint}" value="')[1].split('"')[0])
                assert value == pytest.approx(position, abs=1e-6)


def plane_height(body, pose):
    (plane,) = (shape for shape in body.shapes if isinstance(shape, Plane))
    return plane.position[2] + pose[2]


def test_what_is_held_needs_no_mass_and_may_be_a_bare_surface(tmp_path):
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    sheet = trimesh.Trimesh(corners, [(0, 1, 2), (0, 2, 3)])
    sheet.export(tmp_path / "sheet.stl")

    @register_task("TestSheet-v1")
    class _Sheet(ShutLaptop):
        def build(self, world):
            """Add a sheet that the task moves."""
            super().build(world)
            mesh = Mesh(tmp_path / "sheet.stl", collision="surface")
            world.add("sheet", mesh, kind="kinematic", position=(0.0, 2.0, 0.0))

    env = tasks.make("TestSheet-v1")
    env.reset(seed=0)
    package = env.to_ros2(tmp_path / PACKAGE)
    urdf = read_urdf(package / "urdf" / "bodies" / "sheet.urdf", package)
    assert urdf.link_map["sheet"].inertial is None
    assert solid_boxes(urdf, np.eye(4))["sheet"].tolist() == [[0, 2, 0], [1, 3, 1]]


def test_the_command_writes_packages(tmp_path, capsys):
    folder = tmp_path / "peg"
    command = ["tasks", "export", "PegInsertionSide-v1", "--format", "ros2", "--out", str(folder)]
    assert main(command) == 0
    assert f"ros2: {folder}" in capsys.readouterr().out
    assert (folder / "urdf" / "bodies" / "peg.urdf").is_file()


# -- USD ------------------------------------------------------------------------------------------


def test_without_usd_core_it_says_what_brings_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    env = tasks.make("PushCube-v1")
    env.reset(seed=0)
    with pytest.raises(MissingPackageError, match=r"pip install 'robot-layouts\[usd\]'"):
        env.to_usd(tmp_path / "cell.usd")
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_usd_core_finds_everything_where_it_is(tmp_path):
    if sys.version_info < (3, 11):
        pytest.skip("the newest usd-core needs Python 3.11")
    python = new_environment(tmp_path / "environment", HERE / "programs" / "requirements.txt")
    play(python, HERE / "programs" / "usd_program.py", tmp_path / "out")
