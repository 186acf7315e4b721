"""A layout as a plain SAPIEN scene, and its merged URDF in SAPIEN."""

import numpy as np
import pytest
import sapien
import sapien.physx as physx
from sapien.wrapper.urdf_loader import URDFLoader

from robot_layouts.simulation.sapien3.world import BuiltWorld, build_scene
from tests.layouts.cells import link_poses, mixed_cell, random_positions

DRAWS = 5


@pytest.fixture(scope="module")
def cell():
    return mixed_cell()


def set_positions(articulation, positions: dict[str, float]) -> None:
    articulation.set_qpos([positions[joint.name] for joint in articulation.active_joints])


def test_links_are_where_the_urdfs_and_the_simulation_put_them(cell):
    scene, world = build_scene(cell), BuiltWorld(cell)
    robots = {robot.name: robot for robot in scene.get_all_articulations()}
    assert list(robots) == list(cell)
    random = np.random.default_rng(0)
    for _ in range(DRAWS):
        for name, placement in cell.items():
            positions = random_positions(placement, random)
            set_positions(robots[name], positions)
            set_positions(world.robots[name].articulation, positions)
            expected = link_poses(placement, positions)
            assert len(expected) == len(robots[name].links)
            for link in robots[name].links:
                pose, simulated = link.entity_pose, world.robots[name].link(link.name).entity_pose
                assert np.array_equal(pose.p, simulated.p)
                assert np.array_equal(pose.q, simulated.q)
                np.testing.assert_allclose(pose.p, expected[link.name][:3, 3], rtol=0, atol=1e-6)


def test_robots_hold_their_keyframes(cell):
    scene = build_scene(cell)
    for _ in range(50):
        scene.step()
    for robot in scene.get_all_articulations():
        placement = cell[robot.name]
        start = dict(zip(placement.robot.joints, placement.start_qpos, strict=True))
        positions = dict(zip([j.name for j in robot.active_joints], robot.qpos, strict=True))
        for joint, value in start.items():
            assert positions[joint] == pytest.approx(value, abs=0.02)


def test_the_merged_urdf_is_the_same_robots_in_sapien(cell, tmp_path):
    scene = sapien.Scene([physx.PhysxCpuSystem()])
    loader = URDFLoader()
    loader.set_scene(scene)
    loader.fix_root_link = True
    merged = loader.load(str(cell.to_urdf(tmp_path / "cell.urdf", visuals=False)))
    random = np.random.default_rng(1)
    for _ in range(DRAWS):
        positions = {name: random_positions(p, random) for name, p in cell.items()}
        set_positions(
            merged,
            {f"{name}/{j}": x for name, found in positions.items() for j, x in found.items()},
        )
        poses = {link.name: link.entity_pose for link in merged.links}
        for name, placement in cell.items():
            for link, pose in link_poses(placement, positions[name]).items():
                found = poses[f"{name}/{link}"]
                np.testing.assert_allclose(found.p, pose[:3, 3], rtol=0, atol=1e-6)
