"""Meshes are read before anybody draws or cooks them, and refused in clear words."""

from __future__ import annotations

import json
import os
import struct

import numpy as np
import pytest
import trimesh

from robots import AssetError
from robots.urdf.mesh_files import LARGEST, has_volume, load_scene, read_corners

BOX = trimesh.creation.box((0.1, 0.2, 0.3))
STL: bytes = BOX.export(file_type="stl")
PLY: bytes = BOX.export(file_type="ply")
OBJ: bytes = BOX.export(file_type="obj").encode()


def corners(folder, name, data, scale=(1.0, 1.0, 1.0)):
    path = folder / name
    path.write_bytes(data)
    return read_corners(path.as_posix(), scale, "link 'arm'", (folder / "arm.urdf").as_posix())


def with_corner(value):
    data = bytearray(STL)
    struct.pack_into("<f", data, 96, value)
    return bytes(data)


@pytest.mark.parametrize("ending", ["stl", "obj", "ply", "glb", "dae"])
def test_a_good_mesh_is_read_and_scaled(ending, tmp_path):
    data = BOX.export(file_type=ending)
    data = data if isinstance(data, bytes) else data.encode()
    found = corners(tmp_path, f"a.{ending}", data, (2.0, 1.0, -1.0))
    np.testing.assert_allclose(np.ptp(found, axis=0), (0.2, 0.2, 0.3), rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "data", "reason"),
    [
        ("a.stl", b"", "is empty, or damaged"),
        ("a.stl", STL[:300], "is empty, or damaged"),
        ("a.stl", STL[:80] + bytes(4), "is empty, or damaged"),
        ("a.stl", with_corner(np.nan), "has corners that are not finite"),
        ("a.stl", with_corner(1e30), r"has corners 1e\+30 m away; robots end at 10000 m"),
        ("a.stl", STL[:80] + b"\1\0\0\0" + STL[84:134], "without a volume"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99\n", "cannot read the mesh"),
        ("a.obj", b"root:x:0:0", "is empty"),
        ("a.glb", b"glTF", "cannot read the mesh"),
        ("a.glb", b"glTF" + bytes(100), "only GLTF 2 is supported"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 999999999\n", "cannot read the mesh"),
        (
            "a.ply",
            PLY.replace(b"\x03\x01\0\0\0", b"\x03\x63\0\0\0", 1),
            "more than its 8 corners",
        ),
        ("a.ply", PLY[:-20], "PLY is unexpected length"),
        ("a.dae", b'<!DOCTYPE x [<!ENTITY a "a">]><COLLADA/>', "declares XML entities"),
        ("a.pkl", b"\x80\x04K\x01.", r"ends in \.pkl; meshes end in \.stl"),
    ],
)
def test_a_bad_mesh_is_refused(name, data, reason, tmp_path):
    with pytest.raises(AssetError, match=reason) as error:
        corners(tmp_path, name, data)
    assert str(error.value).startswith("link 'arm': ")
    assert (tmp_path / name).as_posix() in str(error.value)


@pytest.mark.parametrize("line", ["mtllib {}", "mtllib no.mtl\nmtllib {}"])
@pytest.mark.parametrize("kind", ["outside", "FIFO"])
def test_files_beside_a_mesh_are_inside_and_regular(line, kind, tmp_path):
    (tmp_path / "robot").mkdir()
    os.mkfifo(tmp_path / "robot" / "fifo.mtl")
    (tmp_path / "secret.txt").write_text("password")
    name = {"outside": "../secret.txt", "FIFO": "fifo.mtl"}[kind]
    reason = {"outside": "leads out of the folders", "FIFO": "it is a FIFO, not a regular"}[kind]
    with pytest.raises(AssetError, match=reason):
        corners(tmp_path / "robot", "a.obj", f"{line.format(name)}\n".encode() + OBJ)


def test_a_texture_outside_is_not_opened(tmp_path):
    (tmp_path / "robot").mkdir()
    (tmp_path / "secret.png").write_text("password")
    (tmp_path / "robot" / "a.mtl").write_text("newmtl m\nmap_Kd ../secret.png\n")
    (tmp_path / "robot" / "a.obj").write_bytes(b"mtllib a.mtl\nusemtl m\n" + OBJ)
    with pytest.raises(AssetError, match=r"refers to '\.\./secret\.png', which leads out"):
        load_scene(str(tmp_path / "robot" / "a.obj"), "link 'arm'")


def test_missing_materials_are_left_out(tmp_path):
    assert len(corners(tmp_path, "a.obj", b"mtllib /opt/author/a.mtl\n" + OBJ)) == 8


def test_a_gltf_reads_its_buffers_and_nothing_else(tmp_path):
    files = BOX.export(file_type="gltf")
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    assert len(corners(tmp_path, "a.gltf", files["model.gltf"])) == 8
    tree = json.loads(files["model.gltf"])
    tree["buffers"][0]["uri"] = "/dev/zero"
    with pytest.raises(AssetError, match="refers to '/dev/zero', which leads out"):
        corners(tmp_path, "a.gltf", json.dumps(tree).encode())


def test_a_volume_is_measured_where_a_body_is_thinnest():
    flat = np.random.default_rng(0).uniform(-1, 1, (1000, 3)) * (1, 1, 0)
    turn = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3))[:3, :3]
    assert not has_volume(flat)
    assert not has_volume(flat @ turn)
    assert has_volume(
        (flat + (0, 0, 0.01) * np.random.default_rng(1).uniform(size=(1000, 1))) @ turn
    )
    assert not has_volume(flat[:3])
    assert LARGEST == 1e4
