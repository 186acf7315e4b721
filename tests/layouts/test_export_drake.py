"""Drake's model directives of a layout, read back without Drake."""

from pathlib import Path
from urllib.parse import urlparse

import numpy as np
import pytest
import yaml
import yourdfpy
from scipy.spatial.transform import Rotation

from layouts import single
from robots import LayoutError, RobotDescriptor
from tests.catalogue import every_robot
from tests.layouts.cells import hung, link_poses, mixed_cell, random_positions, skeleton
from tests.robots.damaged_robots import BOX, REPAIRS, joint, shape, with_tip, write_damaged

pytestmark = pytest.mark.xdist_group("drake")  # they share one exported cell

DRAWS = 5
READABLE = (".obj", ".vtk", ".gltf")  # by Drake


class _Directives(yaml.SafeLoader):
    pass


_Directives.add_constructor("!Rpy", lambda loader, node: loader.construct_mapping(node, deep=True))


def read(path: Path) -> tuple[dict, dict]:
    """Return the models and the poses of their welded links, by name."""
    directives = yaml.load(path.read_text(), Loader=_Directives)["directives"]
    models = {d["add_model"]["name"]: d["add_model"] for d in directives if "add_model" in d}
    welds = {}
    for weld in (d["add_weld"] for d in directives if "add_weld" in d):
        assert weld["parent"] == "world"
        place, link = weld["child"].split("::")
        pose = np.eye(4)
        # Drake's Rpy: about fixed x, y and z.
        turn = Rotation.from_euler("xyz", weld["X_PC"]["rotation"]["deg"], degrees=True)
        pose[:3, :3] = turn.as_matrix()
        pose[:3, 3] = weld["X_PC"]["translation"]
        welds[place] = (link, pose)
    assert len(directives) == len(models) + len(welds)
    return models, welds


@pytest.fixture(scope="module")
def cell():
    return mixed_cell()


@pytest.fixture(scope="module")
def exported(cell, tmp_path_factory):
    return cell.to_drake(tmp_path_factory.mktemp("drake") / "cell.dmd.yaml")


def urdf_of(model: dict) -> Path:
    return Path(urlparse(model["file"]).path)


@pytest.mark.parametrize("robot", every_robot(quick=("fetch", "panda", "so100")))
def test_links_of_any_robot_that_hangs_are_there(robot, tmp_path):
    layout = hung(robot)
    models, welds = read(layout.to_drake(tmp_path / "cell.dmd.yaml", visuals=False))
    urdf = skeleton(urdf_of(models["arm"]), mimics=False)
    welded, base = welds["arm"]
    random = np.random.default_rng(1)
    for _ in range(DRAWS):
        positions = random_positions(layout["arm"], random)
        urdf.update_cfg({j.name: positions[j.name] for j in urdf.actuated_joints})
        for link, pose in link_poses(layout["arm"], positions).items():
            name = "world_link" if link == "world" else link  # that name is Drake's own
            found = base @ urdf.get_transform(name, welded)
            np.testing.assert_allclose(found, pose, rtol=0, atol=1e-9)


@pytest.mark.long
def test_robots_start_at_their_keyframes(cell, exported):
    models, _ = read(exported)
    for name, placement in cell.items():
        start = {j: [x] for j, x in zip(placement.robot.joints, placement.start_qpos, strict=True)}
        assert models[name]["default_joint_positions"] == start


def test_robots_of_one_kind_share_their_files(exported):
    models, _ = read(exported)
    assert models["left"]["file"] == models["left_2"]["file"] != models["up"]["file"]


def test_meshes_are_of_kinds_that_drake_reads_and_have_the_same_size(cell, exported):
    models, _ = read(exported)
    own = yourdfpy.URDF.load(
        str(cell["hung"].robot.urdf.locate(pictures=True)),
        load_collision_meshes=True,
        build_collision_scene_graph=True,
    )
    written = urdf_of(models["hung"])
    found = yourdfpy.URDF.load(
        str(written), load_collision_meshes=True, build_collision_scene_graph=True
    )
    for before, now in ((own.scene, found.scene), (own.collision_scene, found.collision_scene)):
        np.testing.assert_allclose(now.bounds, before.bounds, rtol=0, atol=1e-5)
    files = [path for path in written.parent.iterdir() if path.suffix != ".urdf"]
    assert len(files) > 20
    assert all(path.suffix in READABLE for path in files)


def test_only_a_folder_of_its_own_is_replaced(tmp_path):
    layout = single({"arm": "so100"})
    path = layout.to_drake(tmp_path / "arm.dmd.yaml")
    folder = tmp_path / "arm_robots"
    (folder / "so100" / "left_over.obj").touch()
    assert layout.to_drake(path) == path
    assert not (folder / "so100" / "left_over.obj").exists()
    (folder / "notes").mkdir()
    with pytest.raises(LayoutError, match="would be replaced, but holds notes"):
        layout.to_drake(path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["arm.dmd.yaml", "arm_robots"]


ODD = with_tip(shape('<mesh filename="box.stl"/>') + shape('<mesh filename="box.stl"/>', "visual"))


def written(text: str, folder: Path) -> tuple[Path, Path]:
    """Export a robot and return the directives and its URDF."""
    robot = RobotDescriptor.from_urdf(write_damaged(folder, text), quiet=True)
    path = single({"arm": robot}).to_drake(folder / "cell.dmd.yaml")
    models, _ = read(path)
    return path, urdf_of(models["arm"])


@pytest.mark.parametrize("taken", ["", '<link name="world_link"/>'])
def test_a_link_called_world_is_renamed(tmp_path, taken):
    more = taken and taken + joint("other", "base", "world_link", kind="fixed")
    path, urdf = written(
        ODD.replace('"base"', '"world"').replace("</robot>", "")
        + (more.replace('"base"', '"world"') + "</robot>"),
        tmp_path,
    )
    _, welds = read(path)
    new = "world_link2" if taken else "world_link"
    assert welds["arm"][0] == new
    links = yourdfpy.URDF.load(str(urdf), load_meshes=False).link_map
    assert new in links
    assert "world" not in links


def test_a_slash_in_a_name_leads_to_no_other_folder(tmp_path):
    text = ODD.replace(BOX, '<mesh filename="box.stl"/>')
    text = text.replace('"tip"', '"left/../tip"').replace('"upper"', '"left_.._tip"')
    _, urdf = written(text, tmp_path)
    meshes = [path.name for path in urdf.parent.iterdir() if path.suffix == ".obj"]
    assert sorted(meshes) == [
        "base_collision_0.obj",
        "left_.._tip_collision_0.obj",
        "left_.._tip_collision_0_2.obj",
        "left_.._tip_collision_1.obj",
        "left_.._tip_collision_2.obj",
        "left_.._tip_visual_0.obj",
    ]
    loaded = yourdfpy.URDF.load(str(urdf), load_collision_meshes=True)
    assert "left/../tip" in loaded.link_map


def test_what_is_repaired_is_exported_repaired(tmp_path):
    _, urdf = written(REPAIRS["a box without size"][0], tmp_path)
    assert 'size="0 0 0"' not in urdf.read_text()
