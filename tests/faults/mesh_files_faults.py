"""Meshes that are empty, broken, out of all measure, or that refer to other files."""

from __future__ import annotations

import base64
import functools
import json
import os
import re
import struct
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from tests.faults.fault import GOES_ON, Fault
from tests.faults.toy_robots import build, check, guess, mesh, read_by_all, read_repaired, toy

AREA = "robot files"

_NO_MESHES = ("pkl", "usd", "zip", "sh", "3mf", "STEP", "")
KINDS = ("stl", "obj", "dae", "glb", "gltf", "ply")
Data = Callable[[], bytes]


def faults() -> Iterator[Fault]:
    """Go through this area's faults of meshes."""
    for kind in KINDS:
        for what, change in _DAMAGES.items():
            yield _fault(f"{kind}: {what}", kind, lambda k=kind, c=change: c(good(k)))
        yield _fault(f"{kind}: of another kind", kind, lambda k=kind: good(_other(k)))
        yield _right(f"{kind}: good", kind, lambda k=kind: good(k))
        yield _right(f"{kind.upper()}: good", kind.upper(), lambda k=kind: good(k))
    for ending in _NO_MESHES:
        yield _fault(f"a mesh that ends in {ending or 'nothing'}", ending, lambda: good("stl"))
    for value in ("nan", "inf", "1e30", "-1e5"):
        for kind, change in _VERTICES.items():
            yield _fault(f"{kind}: a corner at {value} m", kind, lambda c=change, v=value: c(v))
    for what, (kind, data) in _BROKEN.items():
        yield _fault(what, kind, data)
    for what, change in _gltf_changes():
        yield _fault(f"glb: {what}", "glb", lambda c=change: _changed_glb(c))
    for target in _ELSEWHERE:
        for kind, text in _NAMING.items():
            yield _fault(
                f"{kind}: it names {target}", kind, lambda t=text, n=target: t(n), ("toy.fifo",)
            )
    yield _right("obj: its materials are missing", "obj", lambda: _named_in_obj("no.mtl"))
    yield _right("stl: 100 m high, scaled to 10 cm", "stl", _large, ' scale="0.001 0.001 0.001"')


# What is as flat as a picture, and is left out.
_FLAT = {"glb: flat", "glb: a node of size 0"}
# What trimesh makes sense of, and SAPIEN refuses.
_READ_BY_TRIMESH = {"glb: a node below itself"}


def _fault(what: str, ending: str, data: Data, fifos: tuple[str, ...] = ()) -> Fault:
    if what in _FLAT:

        def repair(folder: Path) -> str:
            return read_repaired(_robot_with(folder, f"arm.{ending}", data()))

        return Fault(AREA, f"mesh {what}", repair, GOES_ON)

    def run(folder: Path) -> None:
        for fifo in fifos:
            os.mkfifo(folder / fifo)
        readers = ("build",) if what in _READ_BY_TRIMESH else ("check", "build")
        read_by_all(_robot_with(folder, f"arm.{ending}", data()), readers)

    return Fault(AREA, f"mesh {what}", run)


def _right(what: str, ending: str, data: Data, more: str = "") -> Fault:
    def run(folder: Path) -> str:
        urdf = _robot_with(folder, f"arm.{ending}", data(), more)
        for reader in (guess, check, build):
            reader(urdf)
        return "every link has its shape"

    return Fault(AREA, f"mesh {what}", run, GOES_ON)


def _robot_with(folder: Path, file: str, data: bytes, more: str = "") -> Path:
    (folder / file).write_bytes(data)
    urdf = folder / "toy.urdf"
    urdf.write_text(toy(mesh(file, more)))
    return urdf


@functools.cache
def good(kind: str) -> bytes:
    """Return a box as a file of a kind."""
    import trimesh

    made: Any = trimesh.creation.box((0.1, 0.2, 0.3)).export(file_type=kind)
    if kind == "gltf":
        files = dict(made)
        tree = json.loads(files.pop("model.gltf"))
        for buffer in tree["buffers"]:
            data = base64.b64encode(files[buffer["uri"]]).decode()
            buffer["uri"] = f"data:application/octet-stream;base64,{data}"
        return json.dumps(tree).encode()
    return made if isinstance(made, bytes) else made.encode()


def _other(kind: str) -> str:
    return KINDS[(KINDS.index(kind) + 1) % len(KINDS)]


_DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda data: b"",
    "zeros": lambda data: bytes(len(data)),
    "random bytes": lambda data: bytes(i * i * 31 % 251 for i in range(5000)),
    "a list of users": lambda data: b"root:x:0:0:root:/root:/bin/bash\n" * 30,
}


def _stl_corner(value: str) -> bytes:
    data = bytearray(good("stl"))
    struct.pack_into("<f", data, 84 + 12, float(value))
    return bytes(data)


_VERTICES: dict[str, Callable[[str], bytes]] = {
    "stl": _stl_corner,
    "obj": lambda value: re.sub(rb"(?m)^v \S+", f"v {value}".encode(), good("obj"), count=1),
}


def _large() -> bytes:
    import trimesh

    return trimesh.creation.box((100, 100, 100)).export(file_type="stl")


def _flat() -> bytes:
    import trimesh

    corners = [[0, 0, 0], [1, 0, 0.5], [0, 1, 0], [1, 1, 0.5]]
    made: Any = trimesh.Trimesh(corners, [[0, 1, 2], [1, 3, 2]], process=False)
    return made.export(file_type="glb")


_BROKEN: dict[str, tuple[str, Data]] = {
    "stl: it announces 4 billion faces": (
        "stl",
        lambda: good("stl")[:80] + b"\xff" * 4 + good("stl")[84:],
    ),
    "glb: flat": ("glb", _flat),
    "obj: corners that are words": ("obj", lambda: b"v a b c\nf 1 1 1"),
    "ply: it announces 2 billion corners": (
        "ply",
        lambda: good("ply").replace(b"element vertex 8", b"element vertex 2147483647"),
    ),
    "dae: an entity in UTF-16": (
        "dae",
        lambda: (
            '<?xml version="1.0" encoding="utf-16"?><!DOCTYPE x [<!ENTITY a "ha">]>'
            + _collada().decode()
        ).encode("utf-16"),
    ),
    "gltf: its buffer is missing": (
        "gltf",
        lambda: re.sub(rb'"uri": ?"[^"]*"', b'"uri": "gone.bin"', good("gltf")),
    ),
    "gltf: nested 10,000 deep": ("gltf", lambda: b'{"extras": ' + b"[" * 10_000),
}


def _collada() -> bytes:
    return good("dae")[good("dae").index(b"<COLLADA") :]


# --- glTF -----------------------------------------------------------------------------------------


def _changed_glb(change: Callable[[dict[str, Any]], object]) -> bytes:
    data = good("glb")
    length = struct.unpack_from("<I", data, 12)[0]
    tree, rest = json.loads(data[20 : 20 + length]), data[20 + length :]
    change(tree)
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunk = struct.pack("<I4s", len(text), b"JSON") + text + rest
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunk)) + chunk


def _gltf_changes() -> Iterator[tuple[str, Callable[[dict[str, Any]], object]]]:
    values: Mapping[str, tuple[object, ...]] = {
        "count": (2**31, -1, 0, "many", None),
        "byteOffset": (10**6, -4),
        "bufferView": (99, None),
    }
    for key, wrong in values.items():
        for value in wrong:
            yield f"accessor with {key}={value!r}", lambda t, k=key, v=value: _set(t, k, v)
    for key, value in (("byteLength", 2**31), ("byteLength", -5), ("byteOffset", 10**5)):
        yield (
            f"buffer view with {key}={value}",
            lambda t, k=key, v=value: t["bufferViews"][0].__setitem__(k, v),
        )
    yield "no corners", lambda t: t["meshes"][0]["primitives"][0]["attributes"].clear()
    yield "a mesh that does not exist", lambda t: t["nodes"][0].update(mesh=99)
    yield "a node below itself", lambda t: t["nodes"][0].update(children=[0])
    yield "a scene that does not exist", lambda t: t.update(scene=9)
    yield "a node of size 0", lambda t: t["nodes"][0].update(matrix=[0] * 16)
    yield "a node that is not a number", lambda t: t["nodes"][0].update(matrix=[float("nan")] * 16)


def _set(tree: dict[str, Any], key: str, value: object) -> None:
    for accessor in tree["accessors"]:
        accessor[key] = value


# --- files beside a mesh --------------------------------------------------------------------------

_ELSEWHERE = (
    "../../../../../../../../etc/passwd",
    "/etc/passwd",
    "/dev/zero",
    "toy.fifo",
    "%2e%2e/%2e%2e/%2e%2e/%2e%2e/%2e%2e/etc/passwd",
    "..\\..\\..\\..\\..\\..\\etc\\passwd",
    "file:///etc/passwd",
)


def _named_in_obj(name: str) -> bytes:
    return f"mtllib {name}\n".encode() + good("obj")


def _named_in_dae(name: str) -> bytes:
    image = f'<library_images><image id="i"><init_from>{name}</init_from></image></library_images>'
    return good("dae").replace(b"<library_geometries>", image.encode() + b"<library_geometries>")


def _named_in_gltf(name: str) -> bytes:
    uri = json.dumps(name)
    return re.sub(rb'"uri": ?"[^"]*"', lambda _: f'"uri": {uri}'.encode(), good("gltf"))


def _named_in_ply(name: str) -> bytes:
    return good("ply").replace(
        b"element vertex", f"comment TextureFile {name}\nelement vertex".encode()
    )


_NAMING: dict[str, Callable[[str], bytes]] = {
    "obj": _named_in_obj,
    "dae": _named_in_dae,
    "gltf": _named_in_gltf,
    "glb": lambda name: _changed_glb(lambda tree: tree.update(images=[{"uri": name}])),
    "ply": _named_in_ply,
}
