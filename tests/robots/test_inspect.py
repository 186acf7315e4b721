"""The command `robot-layouts robots inspect`."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot_layouts import __main__ as console
from robot_layouts.__main__ import main
from robot_layouts.core.paths import default_root
from robots import RobotRegistry
from robots.assets.store import AssetStore
from robots.inspect import find_urdf, report
from tests.catalogue import every_robot

ROBOTS = RobotRegistry.names()


@pytest.mark.parametrize("name", every_robot())
def test_a_report_names_every_joint_number_keyframe_and_camera(name):
    robot = RobotRegistry.load(name)
    text = report(robot, AssetStore(default_root()))
    for part in (*robot.joints, *robot.keyframes, robot.source, robot.tcp_link):
        assert part in text
    for number in robot.describe_action():
        assert str(number) in text
    for camera in robot.cameras:
        assert f"{camera.name} on {camera.link}: 128 × 128 pixels" in text


def test_limits_units_and_mimics_are_told(store):
    text = report(RobotRegistry.load("panda"), store)
    assert "-2.8973 … 2.8973 rad" in text
    assert "(URDF: mimics panda_finger_joint1)" in text
    assert "-0.01 … 0.04 m" in text
    assert "TCP at (0.615, 0, 0.1698) m from the base" in text


def test_files_are_told_with_state_and_source(store, physics, fill):
    robot = RobotRegistry.load("panda")
    assert "not in" in find_urdf(robot, store)[1]
    fill(store, physics)
    store.path(physics[0]).write_bytes(b"damaged")
    text = report(robot, store)
    assert "panda_v2.urdf (verified)" in text
    assert "11 files, 0.1 MB: 10 verified, 1 differs from the manifest" in text
    assert "10 files, 10.4 MB: 10 missing" in text
    assert "licence CC BY-NC 4.0" in text


def test_without_any_copy_the_report_says_what_is_missing(store, monkeypatch):
    from robots.assets.manifest import SourceError

    def refuse(name: str) -> Path:
        raise SourceError(f"{name} is not installed")

    monkeypatch.setattr("robots.inspect.find_package", refuse)
    text = report(RobotRegistry.load("panda"), store)
    assert "is missing; `robot-layouts robots fetch panda` fetches it" in text
    assert "not known without the URDF" in text
    assert "arm.panda_joint7" in text


def test_inspecting_fetches_nothing(store):
    assert main(["robots", "inspect", "panda"]) == 0
    assert not store.root.exists()


def test_list_has_a_row_for_every_robot(capsys):
    assert console.main(["robots", "list"]) == 0
    rows = capsys.readouterr().out.splitlines()
    assert [row.split()[0] for row in rows[1:]] == list(ROBOTS)


def test_an_unknown_robot_is_one_line(capsys):
    assert main(["robots", "inspect", "padna"]) == 2
    assert capsys.readouterr().err.startswith("error: unknown robot 'padna'. Did you mean 'panda'?")
