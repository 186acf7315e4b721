"""Cameras that are set by name see what native's do with the same settings, bit by bit."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from contextlib import closing
from typing import Any

import numpy as np
import pytest
import torch

import tasks
from tests.native import NATIVE
from tests.quick import quick_cases
from tests.tasks.test_native_cameras import EVERYTHING, Look, differences, native_look, our_look

pytestmark = [*NATIVE, pytest.mark.usefixtures("renderer")]

HALF = math.sqrt(0.5)
ROLLED = [0.5, 0.3, 0.6, 0.16, 0.386, -0.134, -0.899]  # looks at the cube, and is rolled
INTRINSIC = np.array([[100.0, 0.0, 60.0], [0.0, 110.0, 50.0], [0.0, 0.0, 1.0]])

SETTINGS = {
    "pose, view and size": {
        "width": 96,
        "height": 64,
        "base_camera": {"pose": ROLLED, "fov": 1.2, "near": 0.02, "far": 5.0},
        "hand_camera": {"near": 0.05, "width": 80},
    },
    "an intrinsic matrix on a robot's own camera": {
        "hand_camera": {
            "intrinsic": INTRINSIC,
            "fov": None,
            "pose": [0.01, 0.02, 0.0, HALF, 0.0, 0.0, HALF],
        }
    },
    "slower shaders for one camera": {"hand_camera": {"shader_pack": "default"}},
    "slower shaders for all": {"shader_pack": "default"},
}


def unit(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings of their own, with quaternions of length 1, as ours must be."""
    found = copy.deepcopy(dict(settings))
    for own in found.values():
        if isinstance(own, dict) and "pose" in own:
            turned = np.array(own["pose"][3:])
            own["pose"] = [*own["pose"][:3], *(turned / np.linalg.norm(turned)).tolist()]
    return found


def our_differences(look: Look, task_id: str, obs_mode: str, **making: Any) -> list[str]:
    with closing(tasks.make(task_id, obs_mode=obs_mode, render_mode="rgb_array", **making)) as env:
        found = differences(look.observations, our_look(env, look.actions))
        picture = torch.from_numpy(env.render())
    same = picture.shape == look.picture.shape and torch.equal(picture, look.picture)
    return found if same else [*found, "picture"]


@pytest.mark.parametrize(
    "what",
    quick_cases(SETTINGS, ["pose, view and size", "slower shaders for one camera"]),
)
def test_settings_by_name_are_native_s(what: str):
    sensors = unit(SETTINGS[what])
    native = {"robot_uid": "panda_wristcam", "sensors": copy.deepcopy(sensors)}
    look = native_look("PickCube-v1", EVERYTHING, **native)
    making = {"robots": "panda_wristcam", "sensor_configs": sensors}
    assert our_differences(look, "PickCube-v1", EVERYTHING, **making) == []
    if "size" in what:
        sensors["base_camera"]["pose"][3] = 0.17
        sensors = unit(sensors)
        found = our_differences(
            look, "PickCube-v1", EVERYTHING, **{**making, "sensor_configs": sensors}
        )
        assert "/sensor_data/base_camera/rgb at 0" in found
        assert not [name for name in found if "hand_camera" in name]


@pytest.mark.long
def test_traced_rays_are_native_s():
    """Of three kinds one, as minutes go into each: they differ in how many rays they trace."""
    configs = {"shader_pack": "rt-fast", "width": 32, "height": 24}
    more = {"human_render_camera_configs": configs}
    look = native_look("PickCube-v1", "rgb+normal", sensors=dict(configs), **copy.deepcopy(more))
    making = {"sensor_configs": configs, **more}
    assert our_differences(look, "PickCube-v1", "rgb+normal", **making) == []


@pytest.mark.parametrize("shaders", quick_cases(["minimal", "default"], ["minimal"]))
def test_shadows_and_the_picture_for_people_are_native_s(shaders: str):
    making = {
        "enable_shadow": True,
        "human_render_camera_configs": unit(
            {"width": 300, "render_camera": {"height": 200, "pose": ROLLED, "shader_pack": shaders}}
        ),
    }
    sensors = {"shader_pack": shaders}
    look = native_look("PickCube-v1", "rgb", sensors=dict(sensors), **copy.deepcopy(making))
    assert look.picture.shape == (1, 200, 300, 3)
    assert our_differences(look, "PickCube-v1", "rgb", sensor_configs=sensors, **making) == []
    making["enable_shadow"] = False
    found = our_differences(look, "PickCube-v1", "rgb", sensor_configs=sensors, **making)
    assert {"/sensor_data/base_camera/rgb at 0", "picture"} <= {*found}


@pytest.mark.long
def test_settings_by_native_s_names_of_two_robots():
    sensors = unit(
        {
            "far": 20.0,
            "base_camera": {"pose": ROLLED},
            "panda_wristcam-1-hand_camera": {"fov": None, "intrinsic": INTRINSIC},
        }
    )
    task_id = "TwoRobotPickCube-v1"
    look = native_look(task_id, "rgbd", sensors=copy.deepcopy(sensors))
    assert our_differences(look, task_id, "rgbd", sensor_configs=sensors) == []
    sensors["right.hand_camera"] = sensors.pop("panda_wristcam-1-hand_camera")
    assert our_differences(look, task_id, "rgbd", sensor_configs=sensors) == []
