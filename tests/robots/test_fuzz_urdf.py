"""Damaged URDFs, SRDFs and meshes end in an error of this library, or in a robot that is whole."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, example, given, settings
from hypothesis import strategies as st

from robots import RobotLayoutsError
from tests.faults.mesh_files_faults import KINDS, good
from tests.faults.toy_robots import BOX, LIMIT, check, guess, mesh, toy
from tests.mutations import damaged_bytes, damaged_text

pytestmark = pytest.mark.long

CHECKOUT = Path(__file__).parents[2]
VISUAL = f'<visual><geometry>{BOX}</geometry><material name="m"/></visual>'
URDF = toy(more=VISUAL).replace(LIMIT, f'{LIMIT}<mimic joint="shoulder" multiplier="2"/>')
SRDF = '<robot name="toy"><disable_collisions link1="base" link2="hand" reason="Default"/></robot>'
MESH_KINDS = st.sampled_from(KINDS).flatmap(
    lambda kind: st.tuples(st.just(kind), damaged_bytes(good(kind)))
)
FUZZ = settings(max_examples=1000, deadline=None, suppress_health_check=list(HealthCheck))
BUILT = settings(FUZZ, max_examples=600, phases=[Phase.explicit, Phase.generate])


def read(files: dict[str, bytes]) -> str:
    """Write files, have them read, and return why they were refused."""
    with tempfile.TemporaryDirectory() as folder:
        for name, data in files.items():
            Path(folder, name).write_bytes(data)
        urdf = Path(folder, "toy.urdf")
        with contextlib.suppress(RobotLayoutsError):
            guess(urdf)
        try:
            check(urdf)
        except RobotLayoutsError as error:
            return str(error)
        return "accepted"


def encoded(text: str) -> bytes:
    return text.encode(errors="replace")


@FUZZ
@given(damaged_text(URDF))
@example("")
@example("<robot/>")
@example(URDF.replace('upper="1"', 'upper="1e300"'))
@example(URDF.replace('name="hand"', 'name="ha&#10;nd"'))
@example(URDF.replace('multiplier="2"', 'multiplier="0"'))
@example(URDF.replace('ixx="0.1"', 'ixx="1e-300"'))
@example(URDF.replace(BOX, "<box/>"))
@example(
    URDF.replace('xyz="0 0 0" rpy="0 0 0"/><mass', 'xyz="0 0" rpy="0 0 0"/><mass').replace(
        "<box", "<ox"
    )
)
def test_damaged_urdfs(text):
    assert read({"toy.urdf": encoded(text)})


@FUZZ
@given(damaged_bytes(toy().encode("utf-16")))
@example(b"\xff\xfe")
def test_damaged_urdfs_in_other_encodings(data):
    assert read({"toy.urdf": data})


@settings(FUZZ, max_examples=400)
@given(damaged_text(SRDF))
@example('<robot><disable_collisions reason="Default"/></robot>')
def test_damaged_srdfs(text):
    assert read({"toy.urdf": toy().encode(), "toy.srdf": encoded(text)})


@FUZZ
@given(MESH_KINDS)
@example(("stl", b""))
@example(("glb", good("glb")[:20]))
@example(("obj", b"v 0 0 0\nf 1 2 99\n"))
@example(("dae", b"<COLLADA/>"))
@example(("ply", good("ply")[:330] + b"\xff" + good("ply")[331:]))
@example(("ply", good("ply").replace(b"element face", b"element vertex 8\nelement face")))
@example(("obj", good("obj").replace(b"f 2 4 1", b"f 241")))
def test_damaged_meshes(damaged):
    kind, data = damaged
    assert read({f"arm.{kind}": data, "toy.urdf": toy(mesh(f"arm.{kind}")).encode()})


BUILD_ALL = """
import sys
from pathlib import Path
from robots import RobotLayoutsError
from tests.faults.toy_robots import build
for urdf in sorted(Path(sys.argv[1]).glob("*/toy.urdf")):
    print(urdf, flush=True)
    try:
        build(urdf)
    except RobotLayoutsError:
        pass
print("all built")
"""


def build_all(folder: Path) -> None:
    """Build what checks accept in a process of its own, which may crash."""
    done = subprocess.run(
        [sys.executable, "-c", BUILD_ALL, str(folder)],
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
        capture_output=True,
        text=True,
        check=False,
        errors="replace",
    )
    lines = done.stdout.strip().splitlines()
    assert lines[-1:] == ["all built"], (
        f"{lines[-1:]} ends with {done.returncode}: {done.stderr[-2000:]}"
    )


def test_what_is_accepted_can_be_built(tmp_path):
    accepted: list[dict[str, bytes]] = []

    @BUILT
    @given(damaged_text(URDF))
    def urdfs(text):
        accepted.append({"toy.urdf": encoded(text)})

    twice = good("ply").partition(b"oat y")[0] + good("ply")[3:]
    uneven = good("ply")[:-13] + b"\x80" + good("ply")[-12:]

    @settings(BUILT, max_examples=2000)
    @given(MESH_KINDS)
    @example(("ply", twice))
    @example(("ply", uneven))
    def meshes(damaged):
        kind, data = damaged
        accepted.append({f"arm.{kind}": data, "toy.urdf": toy(mesh(f"arm.{kind}")).encode()})

    urdfs()
    meshes()
    for number, files in enumerate(accepted):
        folder = tmp_path / f"{number:05}"
        folder.mkdir()
        for name, data in files.items():
            (folder / name).write_bytes(data)
    build_all(tmp_path)
