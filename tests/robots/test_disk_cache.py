"""What files of the local copy come to is read once, and is the same the next time."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import fcl
import numpy as np
import pytest

from robot_layouts.core.errors import AssetError
from robot_layouts.core.paths import FOLDER, cached
from robot_layouts.kinematics.rotations import Floats
from robots.bodies.hulls import Hull, read_hulls
from robots.urdf.mesh_files import binary_stl, has_body
from robots.urdf.model import UrdfModel, UrdfShape
from robots.urdf.reading import read_model
from tests.fresh_process import in_fresh_process
from tests.three_links import arm, save


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ROBOT_LAYOUTS_ASSETS", str(tmp_path))
    return tmp_path


def entries(root: Path) -> list[Path]:
    return sorted((root / FOLDER).glob("*"))


class Reads:
    """Counts how often something is read."""

    def __init__(self, found: object) -> None:
        self.times, self._found = 0, found

    def __call__(self) -> object:
        self.times += 1
        return self._found


def test_a_file_is_read_once(root: Path):
    read = Reads({"a": (1.5, np.array([[0.1, -0.0], [float("inf"), 3.0]]))})
    file, about = str(root / "robot.urdf"), (b"reader", b"contents")
    first, second = (cached(file, about, read) for _ in range(2))
    assert repr(first) == repr(second) == "{'a': [1.5, [[0.1, -0.0], [inf, 3.0]]]}"
    assert read.times == 1


def test_other_contents_or_another_reader_are_read_again(root: Path):
    read = Reads(1)
    for about in ((b"a", b"b"), (b"ab", b""), (b"a", b"c"), (b"a", b"b", b"")):
        cached(str(root / "robot.urdf"), about, read)
    assert read.times == 4


def test_files_of_others_are_read_each_time(root: Path, tmp_path_factory: pytest.TempPathFactory):
    read = Reads(1)
    for _ in range(2):
        assert cached(str(tmp_path_factory.mktemp("own") / "robot.urdf"), (b"a",), read) == 1
    assert (read.times, entries(root)) == (2, [])


def test_an_error_is_not_cached(root: Path):
    def fail() -> None:
        raise AssetError("broken")

    for _ in range(2):
        with pytest.raises(AssetError, match="broken"):
            cached(str(root / "robot.urdf"), (b"a",), fail)
    assert entries(root) == []


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: b"",
        lambda text: text[:-1],
        lambda text: text.replace(b"0.25", b"0.75"),
        lambda text: b"\xff" + text,
    ],
)
def test_a_damaged_entry_is_read_again(root: Path, damage: Callable[[bytes], bytes]):
    read = Reads(0.25)
    cached(str(root / "robot.urdf"), (b"a",), read)
    (entry,) = entries(root)
    whole = entry.read_bytes()
    entry.write_bytes(damage(whole))
    assert cached(str(root / "robot.urdf"), (b"a",), read) == 0.25
    assert (read.times, entry.read_bytes()) == (2, whole)


def test_a_disk_that_takes_nothing_costs_only_time(root: Path):
    (root / FOLDER).write_text("a file where the folder would be")
    read = Reads(1)
    assert [cached(str(root / "robot.urdf"), (b"a",), read) for _ in range(2)] == [1, 1]
    assert read.times == 2


def test_a_model_comes_back_as_it_was(root: Path):
    (root / "kit").mkdir()
    urdf = save(root / "kit", arm(mimics="j1"))
    first = read_model(urdf.read_bytes(), urdf.as_posix())
    read_model.cache_clear()
    assert len(entries(root)) == 1
    again = read_model(urdf.read_bytes(), urdf.as_posix())
    assert again is not first
    assert repr(again) == repr(first)
    assert again.joints[0].origin.tobytes() == first.joints[0].origin.tobytes()


def test_whether_a_mesh_has_a_body_goes_with_its_contents(root: Path):
    corners = np.random.default_rng(0).normal(size=(8, 3, 3))
    thick, flat = binary_stl(corners), binary_stl(corners * [1, 1, 0])
    mesh = root / "part.stl"
    for contents in (thick, flat, thick):
        mesh.write_bytes(contents)
        os.utime(mesh, ns=(0, len(entries(root))))
        assert has_body(str(mesh), (1, 1, 1), "a link", "kit.urdf") is (contents is thick)
    assert len(entries(root)) == 2


def of_shapes(root: Path, *shapes: UrdfShape) -> UrdfModel:
    (root / "kit.urdf").touch()
    return UrdfModel("kit", ("base",), (), {"base": shapes}, {}, {})


def read_again(model: UrdfModel, root: Path, number: int) -> tuple[Hull, ...]:
    os.utime(root / "kit.urdf", ns=(0, number))  # what a process remembers is out of date then
    return read_hulls(model, root / "kit.urdf")


def test_hulls_come_back_as_they_were(root: Path, monkeypatch: pytest.MonkeyPatch):
    corners = np.random.default_rng(0).normal(size=(8, 3, 3))
    (root / "part.stl").write_bytes(binary_stl(corners))
    mesh = UrdfShape("mesh", (1.0, 2.0, 1.0), "part.stl", np.eye(4), "a link")
    capsule = UrdfShape("capsule", (0.1, 0.3), "", np.eye(4), "a link")
    model = of_shapes(root, mesh, capsule)
    first = read_again(model, root, 0)
    assert len(entries(root)) == 2
    monkeypatch.setattr("robots.bodies.hulls.shape_corners", None)  # nothing is read again
    for hull, again in zip(first, read_again(model, root, 1), strict=True):
        assert hull.corners.tobytes() == again.corners.tobytes()
        assert fcl.distance(*map(fcl.CollisionObject, (hull.geometry, again.geometry))) <= 0


def test_a_mesh_that_changed_has_another_hull(root: Path):
    corners = np.random.default_rng(0).normal(size=(8, 3, 3))
    model = of_shapes(root, UrdfShape("mesh", (1.0, 1.0, 1.0), "part.stl", np.eye(4), "a link"))
    found: list[Floats] = []
    for number, scale in enumerate((1.0, 2.0)):
        (root / "part.stl").write_bytes(binary_stl(scale * corners))
        (hull,) = read_again(model, root, number)
        found.append(np.ptp(hull.corners, axis=0))
    assert found[1] == pytest.approx(2 * found[0])


def packages_of_a_task() -> list[str]:
    import tasks

    tasks.make("TwoRobotPickCube-v1")
    return [name for name in ("trimesh", "yourdfpy") if name in sys.modules]


def test_the_second_process_that_makes_a_task_loads_no_reader():
    in_fresh_process(packages_of_a_task)
    assert in_fresh_process(packages_of_a_task) == []
