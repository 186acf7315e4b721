"""Meshes with fewer triangles look the same, and nothing else changes."""

import os
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

import tasks
from robot_layouts.data.receipts.provenance import describe_making
from robot_layouts.simulation.sapien3 import light_meshes
from robots import MissingPackageError, RobotRegistry, TaskError
from robots.urdf.paths import resolve
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf
from tasks.registry import scenario_of

pytest.importorskip("fast_simplification")
pytestmark = pytest.mark.usefixtures("renderer")


@pytest.fixture(autouse=True)
def forgets():
    """Let every test look for files again."""
    light_meshes._parts.cache_clear()
    yield
    light_meshes._parts.cache_clear()


@pytest.fixture
def made_here(monkeypatch, tmp_path) -> Path:
    monkeypatch.setattr(light_meshes, "default_root", lambda: tmp_path)
    return tmp_path


def mesh_of(robot: str, link: str) -> str:
    urdf = RobotRegistry.load(robot).urdf.locate(pictures=True)
    model = read_model(read_urdf(urdf), urdf.as_posix())
    return resolve(model.visuals[link][0].file, urdf.as_posix(), os.path.isfile)


def bumpy(tmp_path, name="bumpy.ply") -> Path:
    """Return a ball of 10 cm with 20,480 triangles, its surface a little wavy."""
    ball = trimesh.creation.icosphere(5, 0.05)
    ball.vertices *= 1 + 0.002 * np.sin(ball.vertices[:, :1] * 300)
    path = tmp_path / name
    ball.export(path)
    return path


def far(points_of, surface) -> np.ndarray:
    """Return points of one mesh that are 1 mm from another, by trimesh's own search."""
    sampled = trimesh.sample.sample_surface(points_of, 1500, seed=7)[0]
    points = np.concatenate([sampled, points_of.vertices[::3]])
    return points[trimesh.proximity.closest_point(surface, points)[1] > 1e-3]


def are_inside(points, surface) -> bool:
    """Tell whether a ray from any of the points, in whichever of 500 directions, hits a mesh."""
    ways = trimesh.sample.sample_surface(trimesh.creation.icosphere(4), 500, seed=7)[0]
    starts = np.repeat(points, len(ways), axis=0) + 1e-5 * np.tile(ways, (len(points), 1))
    return bool(surface.ray.intersects_any(starts, np.tile(ways, (len(points), 1))).all())


@pytest.mark.long
@pytest.mark.parametrize("link", ["panda_link1", "panda_hand"])
def test_no_point_is_1_mm_away(made_here, link):
    from sapien.render import RenderShapeTriangleMesh

    path = mesh_of("panda", link)
    whole = RenderShapeTriangleMesh(path, [1, 1, 1], None).parts
    parts = light_meshes.light_parts(path, (1.0, 1.0, 1.0))
    assert len(parts) == len(whole)
    everything = trimesh.util.concatenate(
        [trimesh.Trimesh(own.vertices, own.triangles, process=False) for own in whole]
    )
    for part, own in zip(parts, whole, strict=True):
        before = trimesh.Trimesh(own.vertices, own.triangles, process=False)
        now = trimesh.load_mesh(part.file, process=False)
        assert len(now.faces) < len(before.faces) / 1.5
        assert not len(far(now, before))
        assert are_inside(far(before, now), everything)
        for name in ("base_color", "metallic", "roughness", "specular"):
            assert getattr(part.material(), name) == getattr(own.material, name)


@pytest.mark.long
def test_what_is_inside_is_left_out(made_here, tmp_path):
    """Unless there is an opening through which it is seen."""
    shell = trimesh.creation.icosphere(4, 0.05)
    opened = shell.submesh([np.flatnonzero(shell.triangles_center[:, 2] < 0.045)], append=True)
    for outside, few in ((shell, True), (opened, False)):
        inside = trimesh.creation.icosphere(4, 0.03)
        path = tmp_path / f"{few}.ply"
        trimesh.util.concatenate([outside, inside]).export(path)
        (part,) = light_meshes.light_parts(str(path), (1.0, 1.0, 1.0))
        reach = np.linalg.norm(trimesh.load_mesh(part.file, process=False).vertices, axis=1)
        assert (reach.min() > 0.04) == few


@pytest.mark.long
def test_a_part_of_which_nothing_is_seen_is_left_out(made_here, tmp_path):
    path = tmp_path / "two.glb"
    scene = trimesh.Scene()
    for name, radius, colour in (("in", 0.03, (255, 0, 0, 255)), ("out", 0.05, (0, 255, 0, 255))):
        ball = trimesh.creation.icosphere(5, radius)
        paint = trimesh.visual.material.PBRMaterial(baseColorFactor=colour)
        ball.visual = trimesh.visual.TextureVisuals(material=paint)
        scene.add_geometry(ball, geom_name=name)
    scene.export(path)
    (part,) = light_meshes.light_parts(str(path), (1.0, 1.0, 1.0))
    assert part.finish["base_color"] == [0, 1, 0, 1]
    reach = np.linalg.norm(trimesh.load_mesh(part.file, process=False).vertices, axis=1)
    assert reach.min() > 0.04


@pytest.mark.parametrize("wrong", [np.nan, 0.0])
def test_a_mesh_without_a_surface_is_drawn_as_it_is(made_here, tmp_path, wrong):
    ball = trimesh.creation.icosphere(3, 0.05)
    ball.vertices[:, 0] *= wrong
    ball.vertices[:, 1] *= wrong
    ball.export(tmp_path / "none.ply")
    assert light_meshes.light_parts(str(tmp_path / "none.ply"), (1.0, 1.0, 1.0)) == ()


@pytest.mark.long
def test_it_is_smooth_and_faces_outwards(made_here, tmp_path):
    """Also if it is mirrored and stretched."""
    path = bumpy(tmp_path)
    for scale in ((1.0, 1.0, 1.0), (-2.0, 1.0, 0.5)):
        (part,) = light_meshes.light_parts(str(path), scale)
        mesh = trimesh.load_mesh(part.file, process=False)
        assert len(mesh.faces) < 5000
        assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.05**3, rel=0.05)
        outwards = mesh.vertices / np.array(scale) ** 2  # of an ellipsoid
        outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
        assert ((mesh.vertex_normals * outwards).sum(1) > 0.8).all()


def test_few_triangles_and_textures_stay(made_here, tmp_path):
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    box.export(tmp_path / "box.ply")
    assert light_meshes.light_parts(str(tmp_path / "box.ply"), (1.0, 1.0, 1.0)) == ()
    from PIL import Image

    ball = trimesh.creation.icosphere(5, 0.05)
    image = Image.new("RGB", (4, 4), (200, 10, 10))
    ball.visual = trimesh.visual.TextureVisuals(uv=ball.vertices[:, :2], image=image)
    ball.export(tmp_path / "ball.glb")
    assert light_meshes.light_parts(str(tmp_path / "ball.glb"), (1.0, 1.0, 1.0)) == ()


@pytest.mark.long
def test_it_is_made_once_and_again_if_the_file_changes(made_here, tmp_path, monkeypatch):
    path = bumpy(tmp_path)
    first = light_meshes.light_parts(str(path), (1.0, 1.0, 1.0))
    light_meshes._parts.cache_clear()
    monkeypatch.setattr(light_meshes, "find_spec", lambda name: None)
    assert light_meshes.light_parts(str(path), (1.0, 1.0, 1.0)) == first  # nothing is needed
    trimesh.creation.icosphere(5, 0.04).export(path)
    os.utime(path, ns=(1, 1))
    with pytest.raises(
        MissingPackageError,
        match=r"need fast_simplification and scipy: pip install 'robot-layouts\[light\]'",
    ):
        light_meshes.light_parts(str(path), (1.0, 1.0, 1.0))


@pytest.fixture(scope="module")
def pictures(renderer):
    """What the task's camera and the robot's see after three steps, and the states."""
    found = {}
    for visuals in ("full", "light"):
        env = tasks.make("PickCube-v1", obs_mode="rgb+segmentation", visuals=visuals)
        obs, _ = env.reset(seed=3)
        for _ in range(3):
            obs, *_ = env.step(torch.full((1, 8), 0.4))
        found[visuals] = obs["sensor_data"]["base_camera"], env.get_state_dict(), env
    return found


@pytest.mark.long
def test_pictures_are_nearly_the_same(pictures):
    (full, _, _), (light, _, _) = pictures["full"], pictures["light"]
    segments = (full["segmentation"] != light["segmentation"]).float().mean()
    assert 0 < segments < 0.005
    shades = (full["rgb"].int() - light["rgb"].int()).abs().amax(-1)
    assert (shades > 30).float().mean() < 0.02


@pytest.mark.long
def test_states_are_the_same(pictures):
    (_, full, _), (_, light, _) = pictures["full"], pictures["light"]
    for kind, entries in full.items():
        for name, rows in entries.items():
            assert torch.equal(rows, light[kind][name])


def test_what_visuals_there_are():
    with pytest.raises(TaskError, match="visuals 'lite' is not offered; choices: 'full', 'light'"):
        tasks.make("PickCube-v1", obs_mode="rgb", visuals="lite")


def test_a_receipt_says_so():
    cls, light = scenario_of("PickCube-v1", 1, obs_mode="rgb", visuals="light")
    assert describe_making(cls, light)["visuals"] == "light"
    cls, full = scenario_of("PickCube-v1", 1, obs_mode="rgb")
    assert "visuals" not in describe_making(cls, full)
