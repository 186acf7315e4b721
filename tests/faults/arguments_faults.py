"""Wrong arguments of tasks: numbers that are none, names that do not exist, cameras."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import tasks
from robot_layouts.simulation import Camera
from tests.faults.fault import Fault

AREA = "arguments"
TASK = "PickCube-v1"
HUGE, INF = 1e300, math.inf

# Of each argument: a wrong value for its checker, and what its own bounds leave out.
WRONG_FIELDS: dict[str, tuple[Any, ...]] = {
    "num_envs": (0, "4", 10**30),
    "obs_mode": ("stat", 5, "rgb+", "rgbd+state", None, "rgb\0"),
    "reward_mode": ("stat", "DENSE"),
    "control_mode": ("stat", "pd_joint_delta"),
    "simulator": ("stat", None, "mujico"),
    "render_mode": ("stat", "human"),
    "headless": (False, "yes"),
    "check_layout": ("no",),
    "cameras": (5, None, "base_camera", ["base_camera"], {1: 2}, [None], 2.5),
    "sensor_configs": (
        5,
        ["base_camera"],
        {"base": {}},
        {1: 2},
        {"base_camera": 5},
        {"fov": "wide"},
    )
    + (
        {"width": True},
        {"pose": (1, 2)},
        {"pose": (INF,) * 7},
        {"intrinsic": ((10**400,) * 3,) * 3},
    )
    + ({"mount": 5}, {"mount": ("arm", 5)}, {"shader_pack": 5}, {"base_camera": {5: 1}}),
    "human_render_camera_configs": (5, {"base_camera": {}}, {"render_camera": {"far": 0}}),
    "enable_shadow": (5, "yes", None),
    "touch": (5, "fingers", ["arm"], {"hand": True}, {5: True}, {"arm": 5}, {"arm": []})
    + ({"arm": [5]}, {"arm": [[5]]}, {"arm": ["palm"]}, {"arm": ["panda_hand"] * 2}),
    "physics": (5, "fast", {"timestep": 0.01}, [], True),
    "layout": (5, "ring", {"arm": "panda"}, [], True),
    "robots": (5, ["panda"], ("panda",), {"panda"}, {"arm": 5}, {"arm": None}, {"hand": "panda"})
    + ({"arm": ["panda"]}, {5: "panda"}, "pandda", b"panda", True, {"arm": "pandda"}),
    "max_episode_steps": (0, "50", 2**31),
    "control_frequency": (0, -20, "20", 500, 150, 1e9, 100.1, 30, 19, 1e-9),
    "num_env": (2,),
    "seed": (0,),
    "": (1,),
}

WRONG_CAMERA: dict[str, tuple[Any, ...]] = {
    "eye": ("abc", (1e308, 0, 0), (0.0, 0.0, 0.1)),
    "target": (None, (INF, 0, 0)),
    "width": ("128", 0, 10**9),
    "height": ("128", 0),
    "fov": ("wide", 0, math.pi),
    "near": (None, 0, 1000.0),
    "far": (None, 1e-3, 1e308),
    "name": (None, 5, b"eye"),
    "quaternion": (5, (1.0, 0.0, 0.0, 0.0)),
    "mount": (5, "arm", ("arm",), ("arm", 5)),
    "intrinsic": (5, "K", ((1.0, 0.0, 0.0),) * 3),
    "shader": (5, "quick", ["rt"]),
}


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for name, values in WRONG_FIELDS.items():
        for value in values:
            yield Fault(AREA, f"make({_call(name, value)})", partial(_make, {name: value}))
    for task_id in (None, 5, "", "PickCub-v1", b"PickCube-v1", ["PickCube-v1"], "\0", "../x:Y"):
        yield Fault(AREA, f"make: task {task_id!r}", partial(_make, {"task_id": task_id}))
    mounted = {"sensor_configs": {"mount": ("arm", "palm")}, "obs_mode": "rgb"}
    yield Fault(AREA, "make: a camera on a link that is not there", partial(_make, mounted))
    for name, values in WRONG_CAMERA.items():
        for value in values:
            yield Fault(AREA, f"Camera({_call(name, value)})", partial(_camera, name, value))
    for names in ((), (5,), ("",), ("PickCube-v1",), (None,), ("Mine-v1", 5), (["Mine-v1"],)):
        yield Fault(AREA, f"register_task{names!r}", partial(_register, names))


def _call(name: str, value: Any) -> str:
    text = repr(value).replace(repr(10**400), "10**400")
    return f"{name}={text if len(text) < 40 else text[:40] + '…'}"


def _make(arguments: dict[str, Any], folder: Path) -> None:
    tasks.make(**{"task_id": TASK, **arguments}).close()


def _camera(name: str, value: Any, folder: Path) -> None:
    needed = {"eye": (0.0, 0.0, 0.1), "target": (0.0, 0.0, 0.0)}
    if (name, value) == ("eye", needed["eye"]):
        needed["target"] = value
    Camera(**{**needed, name: value})


def _register(names: tuple[Any, ...], folder: Path) -> None:
    class Mine(tasks.MultiRobotTask):
        """A task of one's own."""

    tasks.register_task(*names)(Mine)
