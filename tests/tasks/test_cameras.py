"""Observing with cameras: what is drawn, when, for whom, and what each front makes of it."""

from contextlib import closing

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env

import tasks
from robot_layouts.simulation import Camera
from robot_layouts.simulation.rendering import Observers
from robots import TaskError
from tests.fresh_process import in_fresh_process

TASK = "PickCube-v1"
SMALL = [Camera((0.3, 0.0, 0.6), (-0.1, 0.0, 0.1), width=48, height=32)]


drawing = pytest.mark.usefixtures("drawn")


def seen(obs, camera: str = "base_camera", texture: str = "rgb") -> torch.Tensor:
    return obs["sensor_data"][camera][texture]


@drawing
def test_an_observation_is_as_the_scenario_wants_it():
    with closing(tasks.make(TASK, 2, obs_mode="rgb+depth+position", cameras=SMALL)) as env:
        obs, _ = env.reset(seed=3)
        shapes = {key: (x.shape, x.dtype) for key, x in obs["sensor_data"]["base_camera"].items()}
        assert shapes == {
            "rgb": ((2, 32, 48, 3), torch.uint8),
            "depth": ((2, 32, 48, 1), torch.int16),
            "position": ((2, 32, 48, 3), torch.int16),
        }
        assert list(obs) == ["agent", "extra", "sensor_param", "sensor_data"]
        assert list(obs["extra"]) == ["is_grasped", "tcp_pose", "goal_pos"]
        assert env.observation_slices == {}
        space = env.single_observation_space["sensor_data"]["base_camera"]
        assert (space["rgb"].dtype, space["depth"].dtype) == (np.uint8, np.int16)
        assert not torch.equal(*seen(obs))
        depth = seen(obs, texture="depth").float()[..., 0]
        assert torch.equal(depth, -seen(obs, texture="position").float()[..., 2])
        assert 0.3 < depth[0, 16, 24] / 1000 < 0.8  # m; the table is 0.64 m away


def _twice() -> bool:
    """Draw, let go of all that draws, and draw again; return whether both saw the same."""
    images: list[torch.Tensor] = []
    for _ in range(2):
        with closing(tasks.make(TASK, obs_mode="rgb", cameras=SMALL)) as env:
            images.append(seen(env.reset(seed=0)[0]).clone())
        del env
    return torch.equal(*images)


@pytest.mark.long  # the other tests keep what draws alive
@drawing
def test_a_world_after_the_last_one_that_was_drawn_is_drawn_alike():
    assert in_fresh_process(_twice)


@drawing
def test_state_beside_images_is_the_state():
    fields = {"cameras": SMALL}
    with (
        closing(tasks.make(TASK, obs_mode="rgb+state", **fields)) as with_images,
        closing(tasks.make(TASK)) as plain,
    ):
        for env in (with_images, plain):
            env.reset(seed=5, options={"reconfigure": True})
        for action in np.random.default_rng(0).uniform(-1, 1, (5, 1, 8)).astype(np.float32):
            mixed, flat = with_images.step(action), plain.step(action)
            assert torch.equal(mixed[0]["state"], flat[0])
            assert torch.equal(mixed[1], flat[1])
        assert with_images.observation_slices == plain.observation_slices
        assert list(mixed[0]) == ["sensor_param", "sensor_data", "state"]


@drawing
def test_only_what_changed_is_drawn_again(monkeypatch: pytest.MonkeyPatch):
    drawn: list[int] = []
    begin = Observers.begin
    monkeypatch.setattr(
        Observers, "begin", lambda self, env: (drawn.append(env), begin(self, env))[1]
    )
    with closing(tasks.make(TASK, 3, obs_mode="rgb", cameras=SMALL)) as env:
        first, _ = env.reset(seed=0)
        drawn.clear()
        second, _ = env.reset(seed=[9], env_ids=[1])
        assert drawn == [1]
        assert [torch.equal(seen(first)[i], seen(second)[i]) for i in range(3)] == [1, 0, 1]
        kept = seen(second).clone()
        third, *_ = env.step(np.ones((3, 8), np.float32), env_ids=[0, 2])
        assert drawn == [1, 0, 2]
        assert [torch.equal(seen(second)[i], seen(third)[i]) for i in range(3)] == [0, 1, 0]
        assert torch.equal(seen(second), kept), "a later picture must not change an earlier one"
        state = env.get_state_dict()
        state["actors"]["cube"][1, :3] = torch.tensor([-0.1, 0.0, 0.02])
        env.set_state_dict(state)
        drawn.clear()
        fourth, _ = env.reset(seed=[9], env_ids=[0])
        assert drawn == [0, 1, 2]
        assert not torch.equal(seen(third)[1], seen(fourth)[1])


def green(picture: torch.Tensor | np.ndarray) -> int:
    red, green, blue = np.moveaxis(np.asarray(picture).astype(int), -1, 0)
    return int(((green > 120) & (red < 60) & (blue < 60)).sum())


@drawing
def test_goals_are_shown_to_people_only():
    view = [Camera((0.6, 0.7, 0.6), (0.0, 0.0, 0.35), width=512, height=512, fov=1.0)]
    with closing(tasks.make(TASK, obs_mode="rgb", render_mode="rgb_array", cameras=view)) as env:
        for _ in range(2):
            obs, _ = env.reset(seed=0)
            assert green(env.render()) > 50
            assert green(seen(obs)) == 0
            obs, *_ = env.step(np.zeros((1, 8), np.float32))
            assert green(seen(obs)) == 0


@drawing
@pytest.mark.parametrize("task_id", ["FourRobotStack-v1", "Relay-v1", "TwoRobotPushPick-v1"])
def test_every_robot_brings_its_cameras(task_id: str):
    cls = tasks.get_task_class(task_id)
    place = list(cls.layout)[-1]
    with closing(
        tasks.make(task_id, obs_mode="depth", robots={place: "panda_wristcam"}, cameras=SMALL)
    ) as env:
        obs, _ = env.reset(seed=0)
        own = f"panda_wristcam-{len(cls.layout) - 1}-hand_camera"
        assert list(obs["sensor_data"]) == ["base_camera", own]
        assert env.observer.seen_by(place) == ["base_camera", own]
        assert env.observer.seen_by(next(iter(cls.layout))) == ["base_camera"]
        assert seen(obs, own, "depth").float().std() > 0
        assert not [key for key in obs["extra"] if "to_" in key]  # ways to objects are privileged


@pytest.mark.parametrize(
    ("cameras", "robot", "message"),
    [
        ([*SMALL, *SMALL], "panda", "two cameras are called 'base_camera'"),
        (
            [Camera((1, 0, 1), (0, 0, 0), "hand_camera")],
            "panda_wristcam",
            "of the robot 'arm' are called 'hand_camera'",
        ),
    ],
)
def test_names_of_cameras_differ(cameras: list[Camera], robot: str, message: str):
    with pytest.raises(TaskError, match=message):
        tasks.make(TASK, obs_mode="rgb", cameras=cameras, robots=robot)


@drawing
def test_what_cannot_be_seen_is_said(monkeypatch: pytest.MonkeyPatch):
    cls = tasks.get_task_class(TASK)
    monkeypatch.setattr(cls, "sensed", ("tcp_poze",))
    with pytest.raises(TaskError, match="part that is sensed 'tcp_poze'. Did you mean 'tcp_pose'"):
        tasks.make(TASK, obs_mode="rgb")
    monkeypatch.setattr(cls, "cameras", ())
    with pytest.raises(TaskError, match="there is no camera"):
        tasks.make(TASK, obs_mode="rgb")


# -- fronts ----------------------------------------------------------------------------------


@drawing
@pytest.mark.filterwarnings("ignore:.*:UserWarning")
def test_gymnasium_takes_images():
    env = gymnasium.make(f"RobotLayouts/{TASK}", obs_mode="rgbd", cameras=SMALL)
    check_env(env.unwrapped, skip_render_check=True)
    obs, _ = env.reset(seed=3)
    assert env.observation_space.contains(obs)
    with closing(tasks.make(TASK, obs_mode="rgbd", cameras=SMALL)) as task:
        theirs, _ = task.reset(3, {"reconfigure": True})
        for texture in ("rgb", "depth"):
            own = obs["sensor_data"]["base_camera"][texture]
            assert own.dtype == seen(theirs, texture=texture).numpy().dtype
            np.testing.assert_array_equal(own, seen(theirs, texture=texture)[0])
    env.close()


@drawing
def test_interfaces_show_what_cameras_see():
    fields = {"cameras": SMALL}
    env = gymnasium.make(f"RobotLayouts/{TASK}", render_mode="sensors", **fields)
    env.reset(seed=3)
    assert env.render().shape == (32, 2 * 48, 3)  # colours and depth
    env.close()
    vec = gymnasium.make_vec(
        f"RobotLayouts/{TASK}", num_envs=2, num_workers=0, render_mode="all", **fields
    )
    vec.reset(seed=3)
    assert [picture.shape for picture in vec.render()] == [(512, 512 + 48, 3)] * 2
    vec.close()


@drawing
def test_interfaces_give_points_and_flags():
    fields = {"obs_mode": "pointcloud", "cameras": SMALL}
    env = gymnasium.make(f"RobotLayouts/{TASK}", **fields)
    vec = gymnasium.make_vec(f"RobotLayouts/{TASK}", num_envs=2, num_workers=0, **fields)
    alone, _ = env.reset(seed=4)
    both, _ = vec.reset(seed=4)
    assert env.observation_space.contains(alone)
    assert vec.observation_space.contains(both)
    for points in (alone["pointcloud"], {k: x[0] for k, x in both["pointcloud"].items()}):
        assert {k: (x.shape, x.dtype) for k, x in points.items()} == {
            "xyzw": ((32 * 48, 4), np.float32),
            "rgb": ((32 * 48, 3), np.uint8),
            "segmentation": ((32 * 48, 1), np.int16),
        }
        np.testing.assert_array_equal(points["xyzw"], alone["pointcloud"]["xyzw"])
    assert alone["extra"]["is_grasped"].dtype == both["extra"]["is_grasped"].dtype == bool
    for interface in (env, vec):
        interface.close()
    with pytest.raises(TaskError, match="parallel_env takes no obs_mode='pointcloud'"):
        tasks.parallel_env(TASK, **fields)


@drawing
def test_the_last_images_of_an_episode_are_kept(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(tasks.get_task_class(TASK), "max_episode_steps", 1)
    fields = {"obs_mode": "rgb", "cameras": SMALL}
    vec = gymnasium.make_vec(
        f"RobotLayouts/{TASK}", num_envs=2, num_workers=0, autoreset_mode="SameStep", **fields
    )
    action = np.ones((2, 8), np.float32)
    with closing(tasks.make(TASK, 2, **fields)) as task:
        for env in (vec, task):
            env.reset(seed=4)
        last, *_ = task.step(action)
        first, _ = task.reset()
        obs, _, _, truncated, info = vec.step(action)
        assert truncated.all()
        np.testing.assert_array_equal(obs["sensor_data"]["base_camera"]["rgb"], seen(first))
        for i, final in enumerate(info["final_obs"]):
            image = final["sensor_data"]["base_camera"]["rgb"]
            assert image.dtype == np.uint8
            np.testing.assert_array_equal(image, seen(last)[i])
    vec.close()


@drawing
def test_agents_see_through_the_task_s_cameras_and_their_own():
    from pettingzoo.test import parallel_api_test

    palm = Camera((0.0, 0.0, 0.05), (0.0, 0.0, 1.0), "palm", 32, 32, mount=("left", "panda_hand"))
    fields = {"obs_mode": "depth", "cameras": [*SMALL, palm]}
    with closing(tasks.parallel_env("TwoRobotPickCube-v1", **fields)) as env:
        parallel_api_test(env, num_cycles=2)
        obs, _ = env.reset(seed=0)
        for i, (robot, more) in enumerate({"left": {"palm"}, "right": set()}.items()):
            own = {"base_camera", f"panda_wristcam-{i}-hand_camera", *more}
            assert set(obs[robot]["sensor_data"]) == set(obs[robot]["sensor_param"]) == own
            assert obs[robot]["agent"]["qpos"].shape == (9,)
    with pytest.raises(TaskError, match="takes no obs_mode='none'"):
        tasks.parallel_env("TwoRobotPickCube-v1", obs_mode="none")
