"""Cameras that are set by name, ride on links, or have an intrinsic matrix or own shaders."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sapien
import torch

import tasks
from robot_layouts.simulation import Camera
from robots import RobotLayoutsError, RobotRegistry, SimulationError, TaskError
from tasks.engine.cameras import cameras_again, describe_cameras, load_cameras
from tests.tasks.test_cameras import drawing, seen

TASK = "PickCube-v1"
EYE, TARGET = (0.3, 0.0, 0.6), (-0.1, 0.0, 0.1)
SMALL = Camera(EYE, TARGET, width=48, height=32)
INTRINSIC = ((40.0, 0.0, 20.0), (0.0, 50.0, 18.0), (0.0, 0.0, 1.0))
HAND = RobotRegistry.load("panda_wristcam").cameras[0]


def reset(**making: Any) -> Any:
    making = {"obs_mode": "rgb+depth", **making}
    with closing(tasks.make(making.pop("task", TASK), **making)) as env:
        return env.reset(seed=3)[0]


@drawing
def test_a_camera_rides_on_a_link_as_a_robot_s_own_does():
    twin = Camera(
        HAND.position, name="twin", quaternion=HAND.quaternion, mount=("arm", HAND.link), near=0.01
    )
    with closing(
        tasks.make(TASK, obs_mode="rgb+depth", robots="panda_wristcam", cameras=[twin])
    ) as env:
        obs, _ = env.reset(seed=3)
        for _ in range(2):
            for texture in ("rgb", "depth"):
                assert torch.equal(seen(obs, "twin", texture), seen(obs, "hand_camera", texture))
            before = seen(obs, "twin").clone()
            obs, *_ = env.step(np.ones((1, 8), np.float32))
            assert not torch.equal(before, seen(obs, "twin"))


@drawing
def test_a_camera_of_the_task_is_mounted_by_name():
    pose = [*HAND.position, *HAND.quaternion]
    configs = {"base_camera": {"mount": ["arm", HAND.link], "pose": pose, "far": 100.0}}
    obs = reset(robots="panda_wristcam", sensor_configs=configs)
    assert torch.equal(seen(obs), seen(obs, "hand_camera"))
    moved = reset(
        robots="panda_wristcam", sensor_configs={"hand_camera": {"mount": ("arm", "panda_link5")}}
    )
    assert not torch.equal(seen(moved, "hand_camera"), seen(obs, "hand_camera"))


@drawing
def test_a_camera_rolls():
    from robot_layouts.simulation.sapien3.studio import look_at

    level = look_at(EYE, TARGET)
    over = level * sapien.Pose(q=[0.0, 1.0, 0.0, 0.0])  # upside down, about where it looks
    as_declared = reset(cameras=[SMALL])
    size = {"width": 48, "height": 32}
    same = reset(sensor_configs={**size, "base_camera": {"pose": level}})
    assert torch.equal(seen(same), seen(as_declared))
    turned = reset(sensor_configs={**size, "base_camera": {"pose": over}})
    depth, upright = (seen(x, texture="depth").int() for x in (turned, as_declared))
    near = (depth.flip(1, 2) - upright).abs() <= 2  # mm
    assert near.float().mean() > 0.95


@drawing
def test_an_intrinsic_matrix_is_told_and_seen():
    wide = reset(cameras=[SMALL])
    own = reset(sensor_configs={"width": 48, "height": 32, "base_camera": {"intrinsic": INTRINSIC}})
    told = own["sensor_param"]["base_camera"]["intrinsic_cv"]
    assert told.tolist() == [[list(row) for row in INTRINSIC]]
    assert not torch.equal(seen(own), seen(wide))
    declared = reset(cameras=[Camera(EYE, TARGET, width=48, height=32, intrinsic=INTRINSIC)])
    assert torch.equal(seen(own), seen(declared))
    larger = reset(
        cameras=[Camera(EYE, TARGET, width=48, height=32, intrinsic=INTRINSIC)],
        camera_size=(100, 64),
    )
    told = larger["sensor_param"]["base_camera"]["intrinsic_cv"]
    assert told.tolist() == [[[80.0, 0.0, 42.0], [0.0, 100.0, 36.0], [0.0, 0.0, 1.0]]]


WRONG = [
    (
        {"sensor_configs": {"base_camra": {}}},
        "in sensor_configs 'base_camra'. Did you mean 'base_camera'",
    ),
    ({"sensor_configs": {"widht": 3}}, "Did you mean 'width'"),
    (
        {"sensor_configs": {"base_camera": {"fovy": 1.0}}},
        "in sensor_configs of 'base_camera' 'fovy'. Did you mean 'fov'",
    ),
    ({"sensor_configs": {"base_camera": 3}}, "sensor_configs['base_camera'] is 3; a mapping"),
    ({"sensor_configs": [3]}, "sensor_configs is [3]; a mapping"),
    (
        {"sensor_configs": {"base_camera": {"fov": 1.0, "intrinsic": INTRINSIC}}},
        "has both fov and intrinsic",
    ),
    (
        {"sensor_configs": {"intrinsic": [[1, 0, 0], [0, 1, 0]]}},
        "it must be ((fx, 0, cx), (0, fy, cy), (0, 0, 1)) in pixels",
    ),
    ({"sensor_configs": {"intrinsic": np.eye(3) * 2}}, "it must be ((fx, 0, cx)"),
    ({"sensor_configs": {"pose": [0, 0, 1]}}, "pose is (0.0, 0.0, 1.0); it takes 7 finite numbers"),
    ({"sensor_configs": {"pose": [0, 0, 1, 2, 0, 0, 0]}}, "has length 2; a rotation has length 1"),
    ({"sensor_configs": {"width": 0}}, "base_camera: width is 0"),
    ({"sensor_configs": {"hand_camera": {"width": 0}}}, "width is 0 pixels"),
    (
        {"sensor_configs": {"mount": "panda_hand"}},
        "a robot in the layout and a link of it are needed",
    ),
    (
        {"sensor_configs": {"hand_camera": {"mount": ("left", "panda_hand")}}},
        "is a camera of 'arm' and cannot ride on 'left'",
    ),
    (
        {"sensor_configs": {"shader_pack": "defualt"}},
        "shader 'defualt' is not offered; choices: 'minimal', 'default', 'rt'",
    ),
    (
        {"human_render_camera_configs": {"base_camera": {}}},
        "camera or setting in human_render_camera_configs 'base_camera'",
    ),
    (
        {"human_render_camera_configs": {"render_camera": {"far": 0.001}}},
        "they must be 0 < near < far",
    ),
    ({"enable_shadow": 1}, "enable_shadow is 1; it must be True or False"),
]


@pytest.mark.parametrize(("making", "message"), WRONG)
def test_wrong_settings_are_refused_before_anything_is_built(
    making: dict[str, Any], message: str, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(tasks.engine.env, "Simulation", None)
    with pytest.raises(RobotLayoutsError) as error:
        tasks.make(TASK, robots="panda_wristcam", **making)
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({}, "base_camera has neither target and quaternion; it needs one of them"),
        ({"target": TARGET, "quaternion": (1, 0, 0, 0)}, "has both target and quaternion"),
        ({"target": TARGET, "fov": 1.0, "intrinsic": INTRINSIC}, "has both fov and intrinsic"),
        ({"target": TARGET, "mount": ("arm",)}, "a robot in the layout and a link of it"),
        ({"target": TARGET, "shader": "rt-slow"}, "shader 'rt-slow' is not offered; choices"),
        ({"target": TARGET, "fov": 0.0}, "fov is 0.0; it must be a number from 0.001 to 3.14059 r"),
        ({"target": TARGET, "near": 2.0, "far": 1.0}, "near is 2.0 m, far 1.0 m"),
        ({"target": TARGET, "width": 0}, "width is 0"),
        ({"target": EYE}, "cannot look at the point where it is"),
    ],
)
def test_a_camera_checks_itself(fields: dict[str, Any], message: str):
    with pytest.raises(SimulationError, match=message):
        Camera(EYE, **fields)


@drawing
@pytest.mark.parametrize(
    ("mount", "message"),
    [
        (("arn", "panda_hand"), "robot of this layout 'arn'. Did you mean 'arm'"),
        (("arm", "panda_hnad"), "link of arm 'panda_hnad'. Did you mean 'panda_hand'"),
    ],
)
def test_a_mount_that_is_not_there(mount: tuple[str, str], message: str):
    with pytest.raises(RobotLayoutsError, match=message):
        reset(cameras=[Camera(EYE, TARGET, mount=mount)])
    making = {"render_mode": "rgb_array", "human_render_camera_configs": {"mount": mount}}
    with (
        closing(tasks.make(TASK, **making)) as env,
        pytest.raises(RobotLayoutsError, match=message),
    ):
        env.render()


@drawing
def test_people_see_through_a_camera_on_a_link():
    configs = {"mount": ("arm", "panda_hand"), "pose": [0.1, 0, 0, 0.7071, 0, -0.7071, 0]}
    making = {"render_mode": "rgb_array", "human_render_camera_configs": configs}
    with closing(tasks.make(TASK, **making)) as env:
        env.reset(seed=0)
        before = env.render()
        env.step(np.ones((1, 8), np.float32))
        assert before.std() > 10
        assert (env.render() != before).any()


def test_shaders_that_do_not_tell_what_is_asked_for():
    with pytest.raises(
        SimulationError, match="shaders 'minimal', which tell no normal; 'default' do"
    ):
        tasks.make(TASK, obs_mode="rgb+normal", sensor_configs={"shader_pack": "minimal"})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("camera: []", "unknown entry 'camera'. Did you mean 'cameras'?"),
        ("cameras: {eye: [0, 0, 1]}", "cameras is {'eye': [0.0, 0.0, 1.0]}; it must be"),
        ("cameras: [{eye: [0, 0, 1], targt: [0, 0, 0]}]", "Did you mean 'target'?"),
        ("cameras: [{target: [0, 0, 0]}]", "has no eye: where it is (m)"),
        ("cameras: [{eye: [0, 0, 1]}]", "neither target and quaternion"),
        ("cameras: [{eye: [0, 0, 1], target: [1, 0, 0], width: 2.5}]", "must be an integer"),
        ("sensor_configs: 3", "sensor_configs is 3.0; it must be an object"),
        ("cameras: [", "this is not YAML"),
        ("nothing", "it is 'nothing'; it must be an object"),
    ],
)
def test_a_file_that_declares_no_cameras(tmp_path: Path, text: str, message: str):
    path = tmp_path / "cameras.yaml"
    path.write_text(text)
    with pytest.raises(TaskError) as caught:
        load_cameras(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_file_declares_what_python_does(tmp_path: Path):
    path = tmp_path / "cameras.yaml"
    path.write_text("""
cameras:
  - {eye: [0.3, 0, 0.6], target: [-0.1, 0, 0.1], width: 48, height: 32}
sensor_configs:
  near: 0.02
  base_camera: {fov: 1, width: 24}
""")
    configs = {"near": 0.02, "base_camera": {"fov": 1.0, "width": 24}}
    assert load_cameras(path) == {"cameras": [SMALL], "sensor_configs": configs}
    described = describe_cameras([SMALL], configs)
    assert cameras_again(json.loads(json.dumps(described))) == load_cameras(path)
    assert describe_cameras([], None) == {}
