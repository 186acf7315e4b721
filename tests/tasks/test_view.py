"""What a page of a task shows, and ``robot-layouts tasks view``."""

import numpy as np
import pytest

import tasks
from benchmarks.teleop import served
from layouts import single
from layouts.viewer.page import NO_SLIDERS, save_html
from robot_layouts.__main__ import main
from robot_layouts.kinematics.rotations import pose_matrix
from robot_layouts.simulation import Box, Capsule, Cylinder, Sphere
from robot_layouts.simulation.sapien3.world import BuiltWorld
from robot_layouts.simulation.world import WorldBody
from tasks.registry import CATALOGUE
from tasks.view import body_parts, task_cell

TURNED = (0.5, 0.5, -0.5, 0.5)


@pytest.mark.parametrize(
    "shape",
    [
        Box(half_size=(0.1, 0.2, 0.3), position=(0.5, 0.0, 0.1), quaternion=TURNED),
        Sphere(radius=0.2, position=(0.0, 0.1, 0.0)),
        Cylinder(radius=0.1, half_length=0.4, position=(0.0, 0.0, 0.3), quaternion=TURNED),
        Capsule(radius=0.1, half_length=0.4),
    ],
)
def test_a_body_is_drawn_where_it_collides(shape):
    body = WorldBody("body", (shape,))
    built = BuiltWorld(single({"arm": "so100"})).add(body)
    (part,) = body_parts(body.shapes)
    corners = part.mesh.vertices
    low, high = built.component.compute_global_aabb_tight()
    np.testing.assert_allclose(corners.min(0), low, atol=2e-3)
    np.testing.assert_allclose(corners.max(0), high, atol=2e-3)
    assert part.rgba == shape.color


def test_what_is_not_drawn_is_left_out():
    assert body_parts((Sphere(radius=0.1, visible=False),)) == ()


@pytest.mark.parametrize("task_id", ["PickCube-v1", "TwoRobotPickCube-v1", "PegInsertionSide-v1"])
def test_everything_stands_where_the_task_put_it(task_id):
    env = tasks.make(task_id, obs_mode="none")
    env.reset(3)
    cell, state = task_cell(env, task_id), env.simulation.read()
    world = env.simulation.worlds[0]
    assert set(cell.things) == {
        name for name, body in world.bodies.items() if any(shape.visible for shape in body.shapes)
    }
    for name, thing in cell.things.items():
        np.testing.assert_array_equal(thing.pose, state.pose(name)[0])
    for name, placement in env.layout.items():
        links = cell.models[name].kinematics
        base = pose_matrix(placement.base_position, placement.base_quaternion)
        tcp = placement.robot.tcp_link
        found = base @ cell.link_poses(name, cell.start[name])[links.link(tcp)]
        expected = state.link_pose(name, tcp)[0][:3]
        np.testing.assert_allclose(found[:3, 3], expected, rtol=0, atol=1e-5)
    env.close()


@pytest.mark.long
def test_a_task_is_served_until_ctrl_c():
    with served("tasks", "view", "PickCube-v1", "--seed", "4", "--port", "0") as view:
        assert view.lines[-1].startswith("PickCube-v1, seed 4: http://127.0.0.1:")
        assert view.interrupt() == (0, "ended\n")


def test_a_task_is_saved(tmp_path, capsys):
    path = tmp_path / "task.html"
    assert main(["tasks", "view", "PushCube-v1", "--html", str(path)]) == 0
    assert capsys.readouterr().out == f"page: {path}\n{NO_SLIDERS}\n"
    assert "<title>PushCube-v1, seed 0</title>" in path.read_text()


def test_an_unknown_task_is_told(capsys):
    assert main(["tasks", "view", "PickCub-v1"]) == 2
    assert "Did you mean 'PickCube-v1'?" in capsys.readouterr().err


@pytest.mark.long
def test_every_task_can_be_shown(tmp_path):
    for task_id in CATALOGUE:
        env = tasks.make(task_id, obs_mode="none")
        env.reset(0)
        cell = task_cell(env, task_id)
        assert cell.things, task_id
        env.close()
    assert save_html(cell, tmp_path / "last.html").is_file()
