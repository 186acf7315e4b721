"""Observations are native's in every mode: values, the order of keys, spaces, pictures of them.

Native takes the textures of a camera out of a set, so in the order of a hash that differs from
process to process. `textures_in_order` lets it take them in the order in which it declares them.
"""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.wrappers import FlattenObservation

import tasks
from parity.native import make_native, native_action, native_action_dim, quiet
from tasks.engine.pictures import tiled
from tests.native import NATIVE, TASKS
from tests.quick import quick_cases

pytestmark = [*NATIVE, pytest.mark.usefixtures("renderer", "textures_in_order")]

SEED = 7
EVERYTHING = "rgb+depth+segmentation+position"
STATES = ("state", "state_dict", "none")
QUICK = (  # modes of native's usual shaders
    *("rgb", "depth", "segmentation", "position", "rgbd", "pointcloud", "sensor_data", EVERYTHING),
    *("rgb+none", "rgb+rgb", "state+none", "state+state_dict", "segmentation+state+rgb"),
    *("depth+state_dict", "rgb+state+state_dict", "pointcloud+state"),
)
SLOW = (  # which native's shaders called "default" alone have
    "normal",
    "albedo",
    "rgb+normal",
    "segmentation+albedo+state",
    "albedo+depth+none+normal+position+rgb+segmentation+state_dict",
)
SHADERS = {"shader_pack": "default"}  # native's sensor_configs for these
OTHER_ROBOTS = {  # that native's task allows or a Panda stands for: a wrist with a camera, or none
    **{f"{task}-v1": "panda" for task in ("StackCube", "StackPyramid")},
    **{f"{task}-v1": "panda_wristcam" for task in ("LiftPegUpright", "PickCube", "PlaceSphere")},
    **{f"{task}-v1": "panda_wristcam" for task in ("PokeCube", "PullCube", "PullCubeTool")},
    **{f"{task}-v1": "panda_wristcam" for task in ("PushCube", "RollBall")},
}


@pytest.fixture
def textures_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    from mani_skill.sensors import camera

    monkeypatch.setattr(camera, "set", dict.fromkeys, raising=False)


def told(tree: Any, name: str = "") -> list[tuple[str, Any]]:
    """Return the leaves of an observation or a space by their paths, in order, and empty parts."""
    if not isinstance(tree, dict | gymnasium.spaces.Dict) or not tree:
        return [(name, {} if tree == {} or isinstance(tree, gymnasium.spaces.Dict) else tree)]
    return [leaf for key, part in tree.items() for leaf in told(part, f"{name}/{key}")]


def differences(native: Any, ours: Any) -> list[str]:
    """Name what differs of two observations or spaces: keys, their order, a type or a value."""
    theirs, own = told(native), told(ours)
    if [name for name, _ in theirs] != [name for name, _ in own]:
        return [f"keys: {[name for name, _ in theirs]} and {[name for name, _ in own]}"]
    return [name for (name, a), (_, b) in zip(theirs, own, strict=True) if not same(a, b)]


def same(a: Any, b: Any) -> bool:
    if not isinstance(a, torch.Tensor):
        return a == b
    return (a.dtype, a.shape) == (b.dtype, b.shape) and torch.equal(a, b)


def test_a_difference_is_noticed():
    flag, turned = torch.zeros(2), torch.tensor([0.0, 1e-7])
    one = {"extra": {"flag": flag, "pose": flag}}
    assert differences(one, {"extra": {"flag": flag.clone(), "pose": flag}}) == []
    assert differences(one, {"extra": {"flag": flag, "pose": turned}}) == ["/extra/pose"]
    assert differences(one, {"extra": {"flag": flag.bool(), "pose": flag}}) == ["/extra/flag"]
    for other in ({"pose": flag, "flag": flag}, {"flag": flag}):
        assert differences(one, {"extra": other})[0].startswith("keys: ")


@contextmanager
def native_in(task_id: str, mode: str, **making: Any) -> Iterator[Any]:
    with closing(make_native(task_id, obs_mode=mode, **making)) as env, quiet():
        yield env


def set_mode(native: Any, mode: str) -> None:
    """Let native observe something else from now on; making it anew takes a second."""
    from mani_skill.envs.utils.observations import parse_obs_mode_to_struct

    native._obs_mode, native.obs_mode_struct = mode, parse_obs_mode_to_struct(mode)
    native.update_obs_space(native.get_obs())


def watch(native: Any, modes: tuple[str, ...], steps: int) -> tuple[np.ndarray, dict[str, Any]]:
    """Play an episode; return its actions and, by mode, what native observed and its space."""
    size = steps, native_action_dim(native)
    actions = np.random.default_rng(SEED).uniform(-1, 1, size).astype(np.float32)
    native.reset(seed=SEED, options={"reconfigure": True})
    seen: dict[str, list[Any]] = {mode: [] for mode in modes}
    for action in (None, *actions):
        if action is not None:
            native.step(native_action(native, action))
        for mode in modes:
            set_mode(native, mode)
            seen[mode].append((native.get_obs(), native.single_observation_space))
    return actions, seen


def compare(task_id: str, mode: str, actions: np.ndarray, seen: list[Any], **making: Any) -> None:
    with closing(tasks.make(task_id, obs_mode=mode, **making)) as env:
        own = [env.reset(SEED, {"reconfigure": True})[0]]
        own += [env.step(action[None])[0] for action in actions]
        for (observed, space), ours in zip(seen, own, strict=True):
            assert differences(observed, ours) == []
            assert differences(space, env.single_observation_space) == []
        assert env.observation_space == gymnasium.vector.utils.batch_space(space, 1)


@pytest.fixture(scope="module")
def pick() -> Iterator[Any]:
    with native_in("PickCube-v1", "state") as native:
        yield native


@pytest.mark.parametrize("mode", ["state_dict", "pointcloud", EVERYTHING])
def test_a_mode_observes_what_native_does(pick: Any, mode: str):
    actions, seen = watch(pick, (mode,), steps=1)
    compare("PickCube-v1", mode, actions, seen[mode])


def test_a_robots_own_camera_is_in_every_mode(pick: Any):
    making = {"robots": {"arm": "panda_wristcam"}, "camera_size": (48, 32)}
    sizes = {"width": 48, "height": 32}
    modes = ("pointcloud", "sensor_data")
    with native_in("PickCube-v1", "rgb", robot_uid="panda_wristcam", sensors=sizes) as native:
        actions, seen = watch(native, modes, steps=1)
    for mode in modes:
        compare("PickCube-v1", mode, actions, seen[mode], **making)


# Both observe flags.
@pytest.mark.parametrize(
    "task_id", quick_cases(["PickCube-v1", "StackPyramid-v1"], ["StackPyramid-v1"])
)
def test_a_flattened_state_dict_is_natives_state(task_id: str):
    with native_in(task_id, "state") as native:
        native.reset(seed=SEED, options={"reconfigure": True})
        action = native.single_action_space.sample()
        expected = native.step(action)[0][0].numpy()
    ours = FlattenObservation(gymnasium.make(f"RobotLayouts/{task_id}", obs_mode="state_dict"))
    ours.reset(seed=SEED, options={"reconfigure": True})
    observed, *_ = ours.step(action)
    assert observed.dtype == ours.observation_space.dtype == np.float32
    assert np.array_equal(observed, expected)
    ours.close()


@pytest.mark.parametrize(
    "task_id", quick_cases(["PickCube-v1", "TwoRobotPickCube-v1"], ["TwoRobotPickCube-v1"])
)
def test_a_segmentations_numbers_stand_for_what_they_do_in_native(task_id: str):
    with native_in(task_id, "state") as native:
        theirs = {
            number: (type(part).__name__, part.name)
            for number, part in native.segmentation_id_map.items()
        }
    with closing(tasks.make(task_id, 2, obs_mode="segmentation", camera_size=(32, 32))) as env:
        own = env.segmentation_id_map
        kinds = {number: "Actor" if p.robot is None else "Link" for number, p in own.items()}
        assert {number: (kinds[number], p.name) for number, p in own.items()} == theirs
        assert {p.robot for p in own.values()} == {None, *env.layout}
        for seen in env.start[0]["sensor_data"]["base_camera"]["segmentation"]:
            assert set(seen.unique().tolist()) <= {0, *own}


# -- pictures for people ---------------------------------------------------------------------


SHOWN = ("state", "rgb", "pointcloud", "sensor_data", "depth+position")


@pytest.mark.parametrize("mode", quick_cases(SHOWN, ["state", "depth+position"]))
def test_what_cameras_see_is_shown_as_native_shows_it(pick: Any, mode: str):
    pick.reset(seed=SEED, options={"reconfigure": True})
    set_mode(pick, mode)
    sensors, everything = pick.render_sensors(), pick.render_all()
    for render_mode, theirs in (("sensors", sensors), ("all", everything)):
        with closing(tasks.make("PickCube-v1", obs_mode=mode, render_mode=render_mode)) as env:
            before, _ = env.reset(SEED, {"reconfigure": True})
            assert torch.equal(torch.from_numpy(env.render()), theirs)
            after, _ = env.reset(SEED, {"reconfigure": True})
            assert mode == "state" or differences(before, after) == []


def test_pictures_of_several_sizes_lie_where_native_puts_them():
    from mani_skill.utils.visualization.misc import tile_images as natively

    sizes = [(8, 8), (4, 4), (4, 4), (4, 6), (2, 6), (3, 6), (8, 2), (1, 2)]
    rng = np.random.default_rng(0)
    for count in range(1, len(sizes) + 1):
        for order in (sizes, sizes[::-1]):
            pictures = [rng.integers(0, 255, (2, *s, 3)).astype(np.uint8) for s in order[:count]]
            expected = natively([torch.from_numpy(p) for p in pictures])
            assert torch.equal(torch.from_numpy(tiled(pictures)), expected)


# -- the whole table -------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("task_id", TASKS)
@pytest.mark.parametrize("modes", [(*STATES, *QUICK), SLOW], ids=["minimal", "default"])
def test_every_clone_observes_what_native_does_in_every_mode(task_id: str, modes: tuple[str, ...]):
    sensors = SHADERS if modes is SLOW else None
    with native_in(task_id, "rgb", sensors=sensors) as native:
        actions, seen = watch(native, modes, steps=2)
    for mode in modes:
        compare(task_id, mode, actions, seen[mode])


@pytest.mark.long
@pytest.mark.parametrize(("task_id", "robot"), OTHER_ROBOTS.items())
def test_clones_observe_what_native_does_with_other_robots_and_sizes(task_id: str, robot: str):
    modes = (f"{EVERYTHING}+state_dict", "pointcloud", "sensor_data")
    sizes = {"width": 64, "height": 96}
    with native_in(task_id, "rgb", robot_uid=robot, sensors=sizes) as native:
        actions, seen = watch(native, modes, steps=2)
    for mode in modes:
        making = {"robots": robot, "camera_size": (64, 96)}
        compare(task_id, mode, actions, seen[mode], **making)
