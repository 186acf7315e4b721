"""What a page of a layout shows, where it is served, and how it ends; no browser needed."""

import socket
import sys
import urllib.request
from urllib.parse import urlsplit

import numpy as np
import pytest
import trimesh

from benchmarks.teleop import served
from layouts import side_by_side, single
from layouts.__main__ import main
from layouts.viewer import ShownCell, ShownMotion, Thing, ViewerError
from layouts.viewer.page import NO_SLIDERS, CellPage, contacts_text, save_html
from layouts.viewer.server import serving
from layouts.visuals import MOST_TRIANGLES, coloured, simplified
from robots import LayoutError, MissingPackageError
from tests.layouts.cells import link_poses, mixed_cell, random_positions

ARM = ("single", "arm=so100")


def make_cell(moments: int = 0) -> ShownCell:
    layout = single({"arm": "so100"})
    if not moments:
        return ShownCell("arm", layout)
    start = np.array(layout["arm"].start_qpos)
    ball = Thing((coloured(trimesh.creation.icosphere(), (1, 0, 0, 1)),), np.eye(7)[3])
    poses = np.tile(np.eye(7)[3], (moments, 1))
    poses[:, 0] = np.arange(moments)
    motion = ShownMotion(0.05, {"arm": start + np.arange(moments)[:, None] * 0.01}, {"ball": poses})
    return ShownCell("arm", layout, {"ball": ball}, motion)


@pytest.mark.long
def test_the_page_is_served_to_this_machine_alone_until_ctrl_c():
    with served("layouts", "view", *ARM, "--port", "0") as view:
        assert "Ctrl-C ends it" in view.lines[-1]
        assert view.url.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(view.url) as answer:
            assert b"<title>" in answer.read()
        port = urlsplit(view.url).port
        assert listening_at(view.process.pid, port) == {"0100007F"}  # 127.0.0.1
        assert view.interrupt() == (0, "ended\n")


@pytest.mark.long
def test_the_network_sees_it_only_if_asked():
    with served("layouts", "view", *ARM, "--port", "0", "--host", "0.0.0.0") as view:
        port = urlsplit(view.url).port
        assert listening_at(view.process.pid, port) == {"00000000"}
        assert view.url.startswith("http://localhost:")
        assert view.lines[-2].startswith("listening at 0.0.0.0: others on this network")
        assert view.interrupt() == (0, "ended\n")


def listening_at(process: int, port: int) -> set[str]:
    """Return the addresses at which someone listens on a port, as Linux writes them."""
    found = set()
    for name in ("tcp", "tcp6"):
        with open(f"/proc/{process}/net/{name}") as table:
            rows = [line.split() for line in table.readlines()[1:]]
        found |= {
            r[1].split(":")[0] for r in rows if r[3] == "0A" and r[1].endswith(f":{port:04X}")
        }
    return found


def test_a_port_in_use_is_refused_with_a_way_out(capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert main(["view", *ARM, "--port", str(port)]) == 1
    error = capsys.readouterr().err.splitlines()[-1]  # after what fetches the robot's files says
    assert error.startswith(f"error: port {port} of 127.0.0.1 is in use")
    assert f"--port {port + 1}" in error
    assert "--port 0" in error


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--host", "nowhere.invalid"], "there is no address 'nowhere.invalid'"),
        (["--host", "192.0.2.1"], "cannot listen at '192.0.2.1', port 8080"),
        (["--port", "70000"], "port 70000 does not exist; ports are 0 … 65535"),
        (["--html", "cell.pdf"], "cannot save a page as 'cell.pdf'; the name must end in .html"),
    ],
)
def test_what_cannot_be_served_is_refused(words, message, capsys):
    assert main(["view", *ARM, *words]) == 1
    assert message in capsys.readouterr().err


def test_a_missing_package_is_told_with_the_command_that_installs_it(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(MissingPackageError, match=r"pip install 'robot-layouts\[view\]'"):
        save_html(make_cell(), tmp_path / "cell.html")


def test_links_stand_where_yourdfpy_puts_them():
    layout = mixed_cell()
    cell, random = ShownCell("mixed", layout), np.random.default_rng(0)
    for name, placement in layout.items():
        positions = random_positions(placement, random)
        qpos = np.array([positions[joint] for joint in placement.robot.joints])
        expected = link_poses(placement, positions)
        base = expected[cell.models[name].kinematics.links[0]]
        for link, pose in zip(
            cell.models[name].kinematics.links, cell.link_poses(name, qpos), strict=True
        ):
            np.testing.assert_allclose(base @ pose, expected[link], rtol=0, atol=1e-9)


def test_the_page_shows_every_robot_and_overlay_at_the_posed_joints():
    layout = side_by_side({"a": "so100", "b": "so100"}, spacing=0.6)
    with serving("127.0.0.1", 0, "cell") as (server, _):
        cell = ShownCell("cell", layout)
        page = CellPage(server, cell)
        page.tick(0.0)
        nodes = server.scene._handle_from_node_name
        for overlay in ("meshes", "frames", "collision", "touching"):
            assert f"/b/{overlay}/Lower_Arm" in nodes
        assert {"/a/reach/level/circle", "/a/reach sphere/ball", "/(floor)"} <= set(nodes)
        qpos = np.array(layout["b"].start_qpos) + 0.1
        page.scene.pose("b", qpos)
        kinematics = cell.models["b"].kinematics
        expected = cell.link_poses("b", qpos)[kinematics.link("Lower_Arm")][:3, 3]
        for overlay in ("meshes", "frames", "collision"):
            np.testing.assert_allclose(nodes[f"/b/{overlay}/Lower_Arm"].position, expected)
        page.scene.show("meshes", False, ["a"])
        assert not nodes["/a/meshes"].visible
        assert nodes["/b/meshes"].visible


def test_overlaps_are_named_and_marked():
    close = side_by_side({"a": "so100", "b": "so100"}, spacing=0.03)
    cell = ShownCell("close", close)
    contacts = cell.contacts(cell.start)
    assert contacts
    assert {contact.robots for contact in contacts} == {("a", "b")}
    assert contacts == sorted(contacts, key=lambda contact: -contact.depth)
    text = contacts_text(contacts)
    assert text.splitlines()[0] == (
        f"- a.{contacts[0].links[0]} in b.{contacts[0].links[1]}, {contacts[0].depth * 100:.1f} cm"
    )
    with serving("127.0.0.1", 0, "close") as (server, _):
        page = CellPage(server, cell)
        page.tick(0.0)
        nodes = server.scene._handle_from_node_name
        red = {n for n, handle in nodes.items() if "/touching/" in n and handle.visible}
    assert red == {
        f"/{robot}/touching/{link}"
        for contact in contacts
        for robot, link in zip(contact.robots, contact.links, strict=True)
    }


def test_the_timeline_moves_robots_and_things():
    cell = make_cell(moments=5)
    with serving("127.0.0.1", 0, "arm") as (server, _):
        page = CellPage(server, cell)
        nodes = server.scene._handle_from_node_name
        page.go_to(3)
        assert nodes["/(things)/ball"].position[0] == pytest.approx(3)
        expected = cell.link_poses("arm", cell.motion.qpos["arm"][3])
        link = cell.models["arm"].kinematics.link("Lower_Arm")
        np.testing.assert_allclose(nodes["/arm/meshes/Lower_Arm"].position, expected[link][:3, 3])
        assert page._clock.text == "step 3 of 4, 0.15 s"
        page._playing.value = True
        page.tick(0.07)  # more than one step of 0.05 s
        assert page._timeline.value == 1


@pytest.mark.parametrize(
    ("motion", "message"),
    [
        (
            ShownMotion(0.05, {"leg": np.zeros((2, 6))}),
            "the motion is of the robots leg; the layout has",
        ),
        (ShownMotion(0.05, {"arm": np.zeros((0, 6))}), "1 or more"),
        (
            ShownMotion(0.05, {"arm": np.zeros((2, 6))}, {"ball": np.zeros((2, 7))}),
            "the motion moves ball, which are not in the cell",
        ),
    ],
)
def test_motions_of_something_else_are_refused(motion, message):
    with pytest.raises(LayoutError, match=message):
        ShownCell("arm", single({"arm": "so100"}), motion=motion)


def test_a_saved_page_is_whole_or_not_there(tmp_path):
    cell = make_cell(moments=3)
    path = save_html(cell, tmp_path / "deep" / "arm.html")
    text = path.read_text()
    assert "<title>arm</title>" in text
    assert "__VISER_EMBED_DATA__" in text
    with pytest.raises(ViewerError, match="must end in .html"):
        save_html(cell, tmp_path / "arm.txt")
    assert [p.name for p in tmp_path.iterdir()] == ["deep"]


def test_no_mesh_is_drawn_of_more_triangles_than_other_programs_read():
    side = 200  # corners of a sheet, of which there are three
    grid = np.stack(np.meshgrid(*[np.arange(side) / side] * 2, np.arange(3) / 3), -1).reshape(-1, 3)
    corner = np.arange(len(grid)).reshape(side, side, 3)
    one, two, three, four = (
        part.ravel()
        for part in (corner[1:, 1:], corner[1:, :-1], corner[:-1, 1:], corner[:-1, :-1])
    )
    faces = np.concatenate([np.stack([one, two, three], 1), np.stack([two, three, four], 1)])
    fine = coloured(trimesh.Trimesh(grid, faces, process=False), (1.0, 0.0, 0.0, 1.0))
    assert len(faces) > MOST_TRIANGLES
    assert 10_000 < len(simplified(fine).mesh.faces) <= MOST_TRIANGLES


def test_a_robot_without_visual_meshes_is_shown_by_its_collision_shapes(capsys, tmp_path):
    cell = ShownCell("pinch", single({"arm": "panda_pinch"}))
    assert len(cell.notes) == 1
    assert cell.notes[0].startswith("arm is shown by its collision shapes: ")
    with serving("127.0.0.1", 0, "pinch") as (server, _):
        CellPage(server, cell)
        nodes = server.scene._handle_from_node_name
        assert nodes["/arm/collision"].visible
        assert "/arm/meshes/panda_link0" not in nodes
    path = tmp_path / "pinch.html"
    assert main(["view", "single", "arm=panda_pinch", "--html", str(path)]) == 0
    assert capsys.readouterr().out == f"{cell.notes[0]}\npage: {path}\n{NO_SLIDERS}\n"
