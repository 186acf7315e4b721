"""Images, camera parameters and what is told beside them are native's, bit by bit.

Native takes the textures of a camera in the order of a hash, so the order of those keys is free.
"""

from contextlib import closing
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
import torch

import tasks
from parity.native import make_native, native_action, native_action_dim, quiet
from robot_layouts.simulation import Camera
from tests.native import NATIVE, TASKS

pytestmark = [*NATIVE, pytest.mark.usefixtures("renderer")]

EVERYTHING = "rgb+depth+segmentation+position"
# Pictures for people are 512 × 512 here and taken from a fixed place, by decision.
OTHER_PICTURES = {"DrawTriangle-v1": "1280 × 960", "PlugCharger-v1": "rides on the receptacle"}
SEED = 7


class Look(NamedTuple):
    """What native told: after a reset, then after each step, and the picture for people."""

    actions: np.ndarray
    observations: list[Any]
    picture: torch.Tensor


def native_look(task_id: str, obs_mode: str, steps: int = 1, **making: Any) -> Look:
    env = make_native(task_id, obs_mode=obs_mode, **making)
    with closing(env), quiet():
        size = steps, native_action_dim(env)
        actions = np.random.default_rng(SEED).uniform(-1, 1, size).astype(np.float32)
        told = [env.reset(seed=SEED, options={"reconfigure": True})[0]]
        told.extend(env.step(native_action(env, action))[0] for action in actions)
        return Look(actions, told, env.render_rgb_array())


def our_look(env: tasks.MultiRobotTask, actions: np.ndarray) -> list[Any]:
    told = [env.reset(SEED, {"reconfigure": True})[0]]
    told.extend(env.step(action[None])[0] for action in actions)
    return told


def leaves(tree: Any, name: str = "") -> dict[str, torch.Tensor]:
    if not isinstance(tree, dict):
        return {name: tree}
    return {k: x for key, part in tree.items() for k, x in leaves(part, f"{name}/{key}").items()}


def differences(native: list[Any], ours: list[Any]) -> list[str]:
    """Name what differs, and when; a key that one side lacks differs, and so does a dtype."""
    assert len(native) == len(ours) > 0
    found: list[str] = []
    for t, (theirs, own) in enumerate(zip(map(leaves, native), map(leaves, ours), strict=True)):
        found.extend(f"{name} at {t} is one side's" for name in theirs.keys() ^ own.keys())
        for name in theirs.keys() & own.keys():
            a, b = theirs[name], own[name]
            if (a.dtype, a.shape) != (b.dtype, b.shape) or not torch.equal(a, b):
                found.append(f"{name} at {t}")
    return sorted(found)


@pytest.fixture(scope="module")
def pick() -> Look:
    return native_look("PickCube-v1", EVERYTHING)


def test_a_fixed_camera_sees_what_native_sees(pick: Look):
    with closing(tasks.make("PickCube-v1", obs_mode=EVERYTHING, render_mode="rgb_array")) as env:
        told = our_look(env, pick.actions)
        assert differences(pick.observations, told) == []
        assert set(told[0]["sensor_data"]["base_camera"]) == set(EVERYTHING.split("+"))
        assert torch.equal(torch.from_numpy(env.render()), pick.picture)
        # Looking for people, goal shown, changes nothing of what is observed.
        assert differences(pick.observations, our_look(env, pick.actions)) == []


CAMERA = Camera((0.3, 0.0, 0.6), (-0.1, 0.0, 0.1))


@pytest.mark.parametrize(
    ("mutant", "part"),
    [
        (replace(CAMERA, fov=CAMERA.fov * 1.01), "sensor_param/base_camera/intrinsic_cv"),
        (replace(CAMERA, target=(-0.1, 0.001, 0.1)), "sensor_data/base_camera/rgb"),
    ],
)
def test_another_camera_is_noticed(pick: Look, mutant: Camera, part: str):
    with closing(tasks.make("PickCube-v1", obs_mode=EVERYTHING, cameras=[mutant])) as env:
        assert f"/{part} at 1" in differences(pick.observations, our_look(env, pick.actions))


def test_a_camera_is_turned_as_native_turns_it():
    with quiet():
        import mani_skill.envs  # noqa: F401
        from mani_skill.utils.sapien_utils import look_at as natively
    from robot_layouts.simulation.sapien3.studio import look_at

    for eye, target in np.random.default_rng(0).uniform(-1, 1, (500, 2, 3)).round(2).tolist():
        theirs, ours = natively(eye, target).sp, look_at(tuple(eye), tuple(target))
        assert np.array_equal(theirs.p, ours.p)
        assert np.array_equal(theirs.q, ours.q)


@pytest.mark.long
@pytest.mark.parametrize("task_id", TASKS)
def test_every_clone_sees_what_native_sees(task_id: str):
    look = native_look(task_id, EVERYTHING, steps=5)
    with closing(tasks.make(task_id, obs_mode=EVERYTHING, render_mode="rgb_array")) as env:
        assert differences(look.observations, our_look(env, look.actions)) == []
        same = look.picture.shape[1:] == (512, 512, 3) and torch.equal(
            torch.from_numpy(env.render()), look.picture
        )
        assert same == (task_id not in OTHER_PICTURES)
