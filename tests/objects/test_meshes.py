"""Things from mesh files: what collides, how they rest, where they are held, what is refused."""

import sys
from dataclasses import replace

import numpy as np
import pytest
import trimesh

import tasks
from layouts import single
from objects import ObjectDescriptor
from objects.shapes import ConvexHull, Friction, Mesh
from objects.solids import bounds, surface
from robot_layouts.kinematics.rotations import rotate
from robot_layouts.simulation.checks.objects import holding, try_rests
from robots import AssetError, DescriptorError, MissingPackageError
from tasks import Area, MultiRobotTask, Object, register_task


@pytest.fixture(autouse=True)
def _own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("ROBOT_LAYOUTS_ASSETS", str(tmp_path / "assets"))


def saved(folder, name, *meshes):
    path = folder / name
    trimesh.util.concatenate(list(meshes)).export(path)
    return path


def mallet(folder, name="mallet.stl"):
    """A handle of 20 × 4 × 3 cm along x, and across its end a head of 3 × 10 × 3 cm."""
    handle, head = trimesh.creation.box((0.2, 0.04, 0.03)), trimesh.creation.box((0.03, 0.1, 0.03))
    return saved(folder, name, handle, head.apply_translation((0.115, 0, 0)))


@pytest.mark.parametrize("ending", ["stl", "obj", "ply", "glb"])
def test_bodies_that_are_convex_are_parts_as_they_are(tmp_path, ending):
    path = mallet(tmp_path, f"my mallet.{ending}")
    thing = ObjectDescriptor.from_mesh(path, up="z", density=500.0, friction=Friction(0.8, 0.8))
    drawn, *hulls = thing.parts
    assert thing.name == "my_mallet"
    assert thing.licence == "NOASSERTION"
    assert (type(drawn), drawn.file, drawn.collides) == (Mesh, path, False)
    assert [len(hull.corners) for hull in hulls] == [8, 8]
    assert all(type(hull) is ConvexHull and not hull.visible for hull in hulls)
    assert thing.mass == pytest.approx(500 * (0.2 * 0.04 * 0.03 + 0.03 * 0.1 * 0.03), rel=1e-4)
    assert np.allclose(thing.extent, (0.23, 0.1, 0.03), atol=1e-6)
    assert all(part.friction == Friction(0.8, 0.8) for part in thing.parts)


def test_a_mass_is_that_of_all_parts_together(tmp_path):
    thing = ObjectDescriptor.from_mesh(mallet(tmp_path), mass=0.4)
    assert thing.mass == pytest.approx(0.4)
    assert len({part.density for part in thing.parts if part.collides}) == 1


def test_a_second_process_reads_what_the_first_one_worked_out(tmp_path, monkeypatch):
    path = mallet(tmp_path)
    first = ObjectDescriptor.from_mesh(path)
    (kept,) = (tmp_path / "assets" / "objects").glob("*/object.json")
    monkeypatch.setattr(trimesh, "load_scene", None)  # a second reading of the mesh would fail
    assert ObjectDescriptor.from_mesh(path) == first
    moved = tmp_path / "elsewhere" / path.name
    moved.parent.mkdir()
    moved.write_bytes(path.read_bytes())
    again = ObjectDescriptor.from_mesh(moved)
    assert again.parts[0].file == moved
    assert again.parts[1:] == first.parts[1:]
    kept.write_text("{}")
    with pytest.raises(AssetError, match=r"object.json is damaged \('parts'\); delete the folder"):
        ObjectDescriptor.from_mesh(path)


def test_another_file_of_the_same_name_is_another_thing(tmp_path):
    path = mallet(tmp_path)
    one = ObjectDescriptor.from_mesh(path)
    saved(tmp_path, path.name, trimesh.creation.box((0.05, 0.05, 0.05)))
    assert len(ObjectDescriptor.from_mesh(path).parts) == 2 < len(one.parts)


def test_glb_has_y_up_and_others_z(tmp_path):
    long = trimesh.creation.box((0.04, 0.12, 0.06))
    upright = ObjectDescriptor.from_mesh(saved(tmp_path, "box.glb", long))
    lying = ObjectDescriptor.from_mesh(saved(tmp_path, "box.stl", long))
    assert np.allclose(upright.extent, (0.04, 0.06, 0.12), atol=1e-6)
    assert np.allclose(lying.extent, (0.04, 0.12, 0.06), atol=1e-6)
    for thing in (upright, lying):  # what is drawn is where it collides
        low, high = bounds(thing.parts)
        corners = surface(thing.parts[0]).corners
        assert np.allclose([corners.min(axis=0), corners.max(axis=0)], [low, high], atol=1e-6)


def test_it_rests_on_the_sides_that_are_steady(tmp_path):
    thing = ObjectDescriptor.from_mesh(
        saved(tmp_path, "slab.stl", trimesh.creation.box((0.1, 0.06, 0.02)))
    )
    assert next(iter(thing.rests)) == "upright"
    heights = sorted({round(thing.height(rest), 6) for rest in thing.rests})
    assert heights == [0.01, 0.03, 0.05][: len(heights)]
    assert [seen.problem for seen in try_rests([thing], time=2.0)] == [None] * len(thing.rests)
    needle = saved(tmp_path, "needle.stl", trimesh.creation.box((0.004, 0.004, 0.1)))
    assert "upright" not in ObjectDescriptor.from_mesh(needle).rests


def test_grasps_have_opposite_sides_between_the_fingers_and_hold(tmp_path):
    thing = ObjectDescriptor.from_mesh(mallet(tmp_path), density=400.0)
    assert len(thing.grasps) >= 20
    assert {round(grasp.opening, 6) for grasp in thing.grasps} <= {0.03, 0.04}
    for grasp in thing.grasps:
        x, y, z = grasp.position
        _, across, up = rotate(np.array(grasp.quaternion), np.array([0.0, 1.0, 0.0]))
        if abs(across) > 0.9:
            assert grasp.opening == pytest.approx(0.04, abs=1e-6)
            assert y == pytest.approx(0.0, abs=1e-6)
        if abs(up) > 0.9:
            assert z == pytest.approx(0.0, abs=1e-6)
    held = holding(thing, (0.07,))
    assert len(held.grasps) >= 0.9 * len(thing.grasps)
    beside = replace(thing.grasps[0], position=(0.0, 0.0, 0.5))
    assert holding(replace(thing, grasps=(beside, *held.grasps)), (0.07,)).grasps == held.grasps


def test_a_cone_is_held_across_its_axis_by_friction(tmp_path):
    cone = trimesh.creation.cone(0.025, 0.09)
    thing = ObjectDescriptor.from_mesh(saved(tmp_path, "cone.stl", cone), density=400.0)
    ways = [rotate(np.array(grasp.quaternion), np.array([0.0, 1.0, 0.0])) for grasp in thing.grasps]
    assert len(ways) >= 20
    assert np.abs(np.array(ways)[:, 2]).max() < 0.1
    assert len(holding(thing, (0.07,)).grasps) >= 0.5 * len(thing.grasps)


def test_what_is_hollow_needs_coacd_and_its_hull_does_not(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "coacd", None)  # as if it were not installed
    path = saved(tmp_path, "pipe.stl", trimesh.creation.annulus(0.03, 0.04, 0.08))
    with pytest.raises(MissingPackageError, match=r"pipe.stl is hollow; .* 'robot-layouts\[obj"):
        ObjectDescriptor.from_mesh(path)
    assert not (tmp_path / "assets").exists()
    filled = ObjectDescriptor.from_mesh(path, most_parts=1)
    assert len(filled.parts) == 2
    assert filled.extent[2] == pytest.approx(0.08)


@pytest.mark.long
def test_what_is_hollow_stays_hollow(tmp_path):
    pytest.importorskip("coacd")
    path = saved(tmp_path, "pipe.stl", trimesh.creation.annulus(0.03, 0.04, 0.08))
    pipe = ObjectDescriptor.from_mesh(path, density=1000.0)
    assert len(pipe.parts) > 4
    for part in pipe.parts[1:]:
        assert np.hypot(*np.mean(part.corners, axis=0)[:2]) > 0.02
    assert pipe.mass == pytest.approx(1000 * np.pi * (0.04**2 - 0.03**2) * 0.08, rel=0.02)
    assert len(holding(pipe, (0.07,)).grasps) >= 20


def test_a_large_hull_keeps_its_shape_with_few_corners(tmp_path):
    ball = saved(tmp_path, "ball.stl", trimesh.creation.icosphere(4, 0.04))
    thing = ObjectDescriptor.from_mesh(ball)
    (hull,) = thing.parts[1:]
    assert len(hull.corners) == 64
    assert np.linalg.norm(hull.corners, axis=1).min() == pytest.approx(0.04, rel=1e-3)
    assert thing.mass == pytest.approx(1000 * 4 / 3 * np.pi * 0.04**3, rel=0.01)


@pytest.mark.parametrize(
    ("details", "message"),
    [
        ({"scale": 0}, "scale is 0; it must be"),
        ({"scale": 1000.0}, r"is 230 m long; things are 5 m long at most .* scale=0.001"),
        ({"up": "w"}, "up 'w' is not offered; choices: 'x', 'y', 'z'"),
        ({"mass": -1.0}, "mass is -1"),
        ({"density": "heavy"}, "density is 'heavy'"),
        ({"most_parts": 0}, "most_parts is 0"),
        ({"most_grasps": 0}, "most_grasps is 0"),
        ({"name": "2 mallets"}, "object name '2 mallets' must be a letter"),
    ],
)
def test_what_is_out_of_bounds_is_refused(tmp_path, details, message):
    with pytest.raises(DescriptorError, match=message):
        ObjectDescriptor.from_mesh(mallet(tmp_path), **details)


def test_files_that_are_no_meshes_are_refused(tmp_path):
    with pytest.raises(AssetError, match="cannot read the mesh .*/none.stl: No such file"):
        ObjectDescriptor.from_mesh(tmp_path / "none.stl")
    (tmp_path / "text.stl").write_text("not a mesh")
    with pytest.raises(AssetError, match="the mesh .*text.stl"):
        ObjectDescriptor.from_mesh(tmp_path / "text.stl")
    (tmp_path / "mallet.step").write_text("x")
    with pytest.raises(AssetError, match=r"ends in .step; meshes end in .stl, .obj"):
        ObjectDescriptor.from_mesh(tmp_path / "mallet.step")
    flat = trimesh.Trimesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [[0, 1, 2]])
    with pytest.raises(DescriptorError, match="flat.stl: the mesh has no volume"):
        ObjectDescriptor.from_mesh(saved(tmp_path, "flat.stl", flat), most_parts=1)


def test_it_is_a_body_of_a_task_in_any_size(tmp_path, monkeypatch):
    thing = ObjectDescriptor.from_mesh(mallet(tmp_path), density=400.0)
    monkeypatch.delenv("ROBOT_LAYOUTS_ASSETS")  # which has the robot's files

    class Look(MultiRobotTask):
        """Leave a mallet where it is."""

        layout = single({"arm": "panda"})
        max_episode_steps = 5
        mallet = Object(thing, scale=0.5, spawn=Area(x=0.0, y=0.3, yaw="any"))

        def evaluate(self, state):
            return {"success": state.position("mallet")[:, 2] > 1.0}

    register_task("LookAtMallet-v1")(Look)
    env = tasks.make("LookAtMallet-v1", num_envs=2)
    env.reset(seed=0)
    before = env.state.position("mallet").copy()
    for _ in range(5):
        env.step(env.action_space.sample() * 0)
    assert np.abs(env.state.position("mallet") - before).max() < 1e-3
    assert before[:, 2].tolist() == pytest.approx([0.0075, 0.0075], abs=1e-6)
    env.close()
