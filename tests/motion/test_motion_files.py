"""Motions saved, read back, and exported."""

from __future__ import annotations

import csv
import json
from dataclasses import fields

import numpy as np
import pytest
import yaml

from layouts import face_to_face
from robot_layouts.core.errors import UnwritableFileError
from robot_layouts.motion import Motion, MotionError
from robots import LayoutError
from tests.experts.free_motions import swing
from tests.motion.motions import LAYOUT, busy_motion

CUBE = {"name": "cube", "shapes": [[[0.0, 0.0, 1.0]]], "pose": np.eye(4).tolist()}
FAR_AWAY = [[1.0, 0.0, 0.0, 1e30], *np.eye(4).tolist()[1:]]


def alike(one, other) -> bool:
    """Tell whether two values, and all that is in them, are the same to the last bit."""
    if hasattr(one, "__dataclass_fields__") and not isinstance(one, type):
        return all(alike(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other)
    if hasattr(one, "items"):
        return list(one) == list(other) and all(alike(one[key], other[key]) for key in one)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(alike, one, other))
    return one == other


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return busy_motion().save(tmp_path_factory.mktemp("motion") / "busy.json")


def test_a_motion_comes_back_as_it_was(file):
    motion = busy_motion()
    assert alike(Motion.load(file), motion)
    assert not alike(swing(LAYOUT), motion)
    assert json.loads(file.read_text())["layout"] == LAYOUT.to_yaml()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format": "other"}, "it is no motion: its format is not 'robot-layouts motion'"),
        ({"version": 2}, "version is 2; it must be 1"),
        ({"positons": {}}, "unknown key of a motion 'positons'. Did you mean 'positions'"),
        ({"times": None}, "times is None; it must be a list"),
        ({"times": [0.0, "1"]}, "times.1. is '1'; it must be a finite number"),
        ({"times": [1.0, 0.0]}, "times must begin with 0, increase, and be finite"),
        (
            {"positions": {"left": [[0.0], [1.0, 2.0]]}},
            "positions of left has rows of different lengths",
        ),
        ({"positions": {"left": [[0.0]]}}, "positions lacks right"),
        ({"velocities": [1.0]}, "velocities is .* it must be an object"),
        ({"layout": "version: 1"}, "robots"),
        ({"layout": 7}, "layout is 7; it must be a text"),
        ({"joints": {}}, "its robot 'left' has the joints None; a panda has panda_joint1"),
        ({"obstacles": {}}, "obstacles is .* it must be a list"),
        ({"obstacles": [{"name": 3, "shapes": []}]}, "obstacles.0..name is 3; it must be a text"),
        ({"obstacles": [{"name": "a", "shapes": [[1.0]]}]}, "0..0. is 1.0; it must be a list"),
        ({"obstacles": [{"name": "a", "shapes": [], "track": {}}]}, "it has no .*track.times"),
        ({"obstacles": [{**CUBE, "shapes": [[[0.0, 0.0, 1e30]]]}]}, "finite numbers, 1e.06 m at"),
        ({"obstacles": [{**CUBE, "pose": FAR_AWAY}]}, "finite numbers, 1e.06 at most"),
        ({"held": [{"place": "left"}]}, "it has no held.0..obstacle"),
        ({"table": [1.0]}, "table is .* it must be a list of 4 values or None"),
        ({"clearance": -1}, "clearance is -1"),
        ({"clearance": float("nan")}, "clearance is nan"),
        ({"largest_velocities": {"middle": [1.0]}}, "unknown robot of this motion 'middle'"),
    ],
)
def test_damaged_files_are_refused_in_words(file, tmp_path, change, words):
    document = {**json.loads(file.read_text()), **change}
    broken = tmp_path / "broken.json"
    broken.write_text(json.dumps(document))
    with pytest.raises(MotionError, match=rf"(?s)broken\.json.*{words}"):
        Motion.load(broken)


@pytest.mark.parametrize("cut", [0, 1, 500, 20_000, -3])
def test_files_cut_short_are_refused(file, tmp_path, cut):
    short = tmp_path / "short.json"
    short.write_bytes(file.read_bytes()[:cut])
    with pytest.raises(MotionError, match=r"short\.json"):
        Motion.load(short)


def test_what_is_not_there_and_what_ends_otherwise(tmp_path):
    with pytest.raises(MotionError, match=r"none\.json"):
        Motion.load(tmp_path / "none.json")
    with pytest.raises(MotionError, match=r"'motion\.npz'; the name must end in \.json"):
        swing(LAYOUT).save(tmp_path / "motion.npz")
    assert not list(tmp_path.iterdir())


def test_a_robot_that_nobody_can_look_up_is_not_saved(tmp_path):
    from dataclasses import replace

    from robots import RobotRegistry

    own = replace(RobotRegistry.load("panda"), reach=0.5)
    motion = swing(face_to_face({"left": own, "right": "panda"}, spacing=2.0))
    with pytest.raises(LayoutError, match="panda"):
        motion.save(tmp_path / "own.json")
    assert not list(tmp_path.iterdir())


def test_tables(tmp_path):
    motion = swing(LAYOUT)
    left, right = motion.to_csv(tmp_path / "tables", frequency=100)
    assert (left.name, right.name) == ("left.csv", "right.csv")
    with left.open() as file:
        head, *rows = csv.reader(file)
    assert head[:2] == ["time", "panda_joint1"]
    assert head[10] == "panda_joint1.velocity"
    numbers = np.array(rows, float)
    assert len(numbers) == 151
    assert np.array_equal(numbers[:, 1:10], motion.sample(numbers[:, 0])["left"])
    assert np.array_equal(numbers[:, 10:], motion.velocity(numbers[:, 0])["left"])
    with pytest.raises(UnwritableFileError, match=r"left\.csv is there already"):
        motion.to_csv(tmp_path / "tables")
    with pytest.raises(MotionError, match="frequency is 0; it must be a number from"):
        motion.to_csv(tmp_path / "others", frequency=0)


def test_trajectories_have_the_names_of_the_ros2_package(tmp_path):
    motion = swing(LAYOUT)
    files = motion.to_ros2(tmp_path / "trajectories", frequency=20)
    LAYOUT.to_ros2(tmp_path / "cell", visuals=False)
    config = yaml.safe_load((tmp_path / "cell/config/ros2_controllers.yaml").read_text())
    named = {name for name in config if name.endswith("_controller")}
    assert {file.stem for file in files} == named
    for file in files:
        trajectory = yaml.safe_load(file.read_text())
        joints = config[file.stem]["ros__parameters"]["joints"]
        assert trajectory["joint_names"] == joints
        last = trajectory["points"][-1]
        assert last["time_from_start"] == {"sec": 1, "nanosec": 500_000_000}
        assert len(last["positions"]) == len(last["velocities"]) == len(joints)
    arm = yaml.safe_load((tmp_path / "trajectories/left_arm_controller.yaml").read_text())
    assert arm["points"][-1]["positions"] == motion.end["left"][:7].tolist()
