"""What SAPIEN builds is what the URDF says, or an error."""

from __future__ import annotations

import pytest
import sapien
import trimesh

from layouts import Layout, Placement
from robot_layouts.simulation.sapien3.blueprint import read_blueprint
from robot_layouts.simulation.sapien3.world import BuiltWorld
from robots import AssetError
from robots.urdf.checks import MAX_LINKS
from tests.faults.toy_robots import descriptor, joint, link, mesh, robot, toy, write_mesh


def world(urdf):
    return BuiltWorld(Layout({"toy": Placement(descriptor(urdf))}))


def shapes(urdf):
    return [len(part.collision_shapes) for part in world(urdf).robots["toy"].links.values()]


@pytest.fixture
def urdf(tmp_path):
    """A toy whose arm is a mesh."""
    write_mesh(tmp_path / "arm.stl")
    path = tmp_path / "toy.urdf"
    path.write_text(toy(mesh("arm.stl")))
    return path


def test_every_shape_of_the_urdf_is_built(urdf):
    assert shapes(urdf) == [1, 1, 1]


def test_a_mesh_that_sapien_cannot_read_is_an_error(urdf):
    (urdf.parent / "arm.stl").write_bytes(b"")
    with pytest.raises(AssetError, match=r"link 'arm': the mesh .*arm\.stl is empty"):
        world(urdf)


def test_a_shape_that_sapien_leaves_out_is_an_error(urdf):
    blueprint = read_blueprint(descriptor(urdf), visuals=False)
    (urdf.parent / "arm.stl").unlink()  # between reading and building
    with pytest.raises(AssetError, match=r"'arm': SAPIEN made 0 of its 1 .* body of 'arm\.stl'"):
        blueprint.build(sapien.Scene([sapien.physx.PhysxCpuSystem()]), sapien.Pose())
    assert not blueprint.checked


@pytest.mark.parametrize("reference", ["/etc/passwd", "../../../../../../etc/passwd"])
def test_files_of_the_system_are_refused(urdf, reference):
    urdf.write_text(toy(mesh(reference)))
    with pytest.raises(AssetError, match="leads out of its folder and its package"):
        world(urdf)


def test_checks_and_physics_refuse_the_same_files_in_the_same_words(urdf):
    trimesh.creation.box((3e4, 0.1, 0.1)).export(urdf.parent / "arm.stl")
    layout = Layout({"toy": Placement(descriptor(urdf))})
    with pytest.raises(AssetError) as of_physics:
        BuiltWorld(layout)
    with pytest.raises(AssetError) as of_checks:
        layout.validate()
    assert str(of_physics.value) == str(of_checks.value)
    assert "has corners 1.5e+04 m away" in str(of_checks.value)


def test_what_sapien_stumbles_over_and_nobody_needs_is_left_out(urdf):
    text = toy(mesh("arm.stl")).replace("</robot>", "<transmission/><gazebo/></robot>")
    urdf.write_text(text.replace("</joint>", '<dynamics friction="0.1"/></joint>', 1))
    assert shapes(urdf) == [1, 1, 1]


@pytest.mark.parametrize("links", [MAX_LINKS, MAX_LINKS + 1])
def test_as_many_links_as_physx_can_join(tmp_path, links):
    fixed = "".join(
        f'<link name="l{i}"/>{joint(f"j{i}", "hand", f"l{i}", kind="fixed")}'
        for i in range(links - 3)
    )
    urdf = tmp_path / "toy.urdf"
    urdf.write_text(toy().replace("</robot>", f"{fixed}</robot>"))
    if links > MAX_LINKS:
        with pytest.raises(AssetError, match=r"has 256 links; PhysX joins 255 at most"):
            world(urdf)
        return
    built = world(urdf)
    assert len(built.robots["toy"].links) == links
    assert len(built.robots["toy"].joints) == 2
    built.system.step()


def test_more_excluded_pairs_than_sapien_can_keep_apart_are_an_error(tmp_path):
    urdf = tmp_path / "toy.urdf"
    parts = [f"p{i}" for i in range(9)]
    fixed = [link(name) + joint(f"j{name}", "hand", name, kind="fixed") for name in parts]
    urdf.write_text(toy().replace("</robot>", f"{''.join(fixed)}</robot>"))
    pairs = [(one, other) for one in parts for other in parts if one < other]
    urdf.with_suffix(".srdf").write_text(
        robot(
            *(
                f'<disable_collisions link1="{one}" link2="{other}" reason="Default"/>'
                for one, other in pairs
            )
        )
    )
    with pytest.raises(AssetError, match=r"leaves 36 pairs .* SAPIEN can do so with 31 at most"):
        world(urdf)
