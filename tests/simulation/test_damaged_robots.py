"""Robots whose URDF had to be repaired stand, step and are checked like any other."""

from __future__ import annotations

import numpy as np
import pytest

from layouts import single
from robot_layouts.simulation import PhysicsSettings, Simulation
from robot_layouts.simulation.sapien3.backend import worlds_below
from robots import RobotDescriptor
from tests.robots.damaged_robots import FINE, REPAIRS, with_tip, write_damaged

TEXTS = {**{kind: text for kind, (text, _) in REPAIRS.items()}, **FINE}


def simulate(urdf, **better) -> Simulation:
    robot = RobotDescriptor.from_urdf(urdf, quiet=True, **better)
    return Simulation(single({"arm": robot}), lambda world, _: None, 1, PhysicsSettings())


@pytest.mark.parametrize("kind", TEXTS)
def test_it_is_checked_and_steps(kind, tmp_path):
    simulation = simulate(write_damaged(tmp_path, TEXTS[kind]))
    assert simulation.layout.validate(samples=1, workspaces=False).ok
    simulation.clear([0])
    simulation.worlds[0].stand("arm", simulation.layout["arm"].start_qpos)
    action = np.ones((1, simulation.layout["arm"].robot.action_dim), np.float32)
    for _ in range(5):
        simulation.step(action, simulation.read().joint_positions)
    assert np.isfinite(simulation.read().joint_positions).all()


def test_mass_and_inertia_are_those_that_were_told(tmp_path):
    simulation = simulate(write_damaged(tmp_path, REPAIRS["no inertia"][0]))
    tip = worlds_below(simulation)[0].robots["arm"].links["tip"]
    assert tip.mass == 2
    assert tip.inertia == pytest.approx([2 / 12 * 0.13, 2 / 12 * 0.1, 2 / 12 * 0.05], rel=1e-5)


MIRRORED = '<mesh filename="lever.stl" scale="1 -1 1"/>'


def test_mirrored_meshes_that_touch_do_not_end_the_process(tmp_path):
    import trimesh

    shape = f"<collision><geometry>{MIRRORED}</geometry></collision>"
    urdf = write_damaged(tmp_path, with_tip("").replace('<box size="0.1 0.2 0.3"/>', MIRRORED))
    urdf.write_text(urdf.read_text().replace('<link name="tip">', f'<link name="tip">{shape}'))
    lever = trimesh.creation.box((0.1, 0.2, 1.5))
    lever.apply_translation((0, 0.3, 0))
    lever.export(urdf.parent / "lever.stl")
    simulation = simulate(urdf, allowed_collisions=())
    world = worlds_below(simulation)[0]
    simulation.step(np.zeros((1, 2), np.float32), simulation.read().joint_positions)
    assert world.system.get_contacts() or world.scene.get_contacts()
    (made,) = world.robots["arm"].links["tip"].collision_shapes
    assert made.vertices[:, 1].max() < 0  # on the other side
