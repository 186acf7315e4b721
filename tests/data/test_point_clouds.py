"""A fixed number of points from all cameras, in one frame, from a box, the same each time."""

from pathlib import Path

import numpy as np
import pytest

import robot_layouts as rl
import tasks
from robot_layouts.data.point_clouds import point_cloud, world_points
from robot_layouts.data.reading.recording import Recording
from robots import TaskError

TASK = "PushCube-v1"
BOX = ((0.31, -0.3, 0.005), (0.9, 0.3, 0.5))  # m, from the base of the arm; above the table
SIZE = (48, 32)
TURNED = (0.1, -0.2, 0.3, np.cos(0.4), 0.0, 0.0, np.sin(0.4))  # 0.8 rad about z


def flat(places, colours=None, seen=None):
    """An observation of some points, as `pointcloud` gives them."""
    xyz = np.asarray(places, np.float32)
    ones = np.ones(len(xyz)) if seen is None else np.asarray(seen)
    rgb = np.zeros((len(xyz), 3), np.uint8) if colours is None else np.asarray(colours, np.uint8)
    return {"pointcloud": {"xyzw": np.column_stack([xyz, ones]).astype(np.float32), "rgb": rgb}}


def test_points_are_drawn_once_before_any_is_drawn_again():
    observation = flat(np.arange(30).reshape(10, 3))
    drawn = point_cloud(observation, 10, seed=3)
    assert drawn["count"] == 10
    assert sorted(drawn["xyz"][:, 0].tolist()) == [*range(0, 30, 3)]
    twice = point_cloud(observation, 25, seed=3)["xyz"][:, 0].tolist()
    assert sorted(twice[:10]) == sorted(twice[10:20]) == [*range(0, 30, 3)]
    assert drawn["xyz"].tobytes() == point_cloud(observation, 10, seed=3)["xyz"].tobytes()
    assert drawn["xyz"].tobytes() != point_cloud(observation, 10, seed=4)["xyz"].tobytes()


def test_a_box_leaves_out_points_and_what_shows_nothing_is_never_drawn():
    observation = flat(
        [(0, 0, 0), (1, 0, 0), (0.5, 0, 0)], [[9, 9, 9], [5, 5, 5], [7, 7, 7]], [1, 1, 0]
    )
    drawn = point_cloud(observation, 4, box=((-0.1, -1, -1), (0.6, 1, 1)))
    assert drawn["count"] == 1
    assert drawn["rgb"].tolist() == [[9, 9, 9]] * 4
    nothing = point_cloud(observation, 4, box=((5, 5, 5), (6, 6, 6)))
    assert nothing["count"] == 0
    assert not nothing["xyz"].any()
    assert not nothing["rgb"].any()


def test_a_frame_is_where_points_are_measured_from():
    drawn = point_cloud(flat([(1.1, -0.2, 0.3)] * 2), 1, frame=TURNED)
    np.testing.assert_allclose(drawn["xyz"][0], [np.cos(0.8), -np.sin(0.8), 0], atol=1e-6)
    rows = np.array([(0, 0, 0, 1, 0, 0, 0), (1, 0, 0, 1, 0, 0, 0)])
    pair = {"pointcloud": {"xyzw": np.ones((2, 5, 4), np.float32)}}
    assert point_cloud(pair, 1, frame=rows)["xyz"][:, 0, 0].tolist() == [1, 0]


@pytest.mark.usefixtures("renderer")
def test_positions_depth_and_point_clouds_of_all_cameras_show_the_same():
    clouds = []
    for mode in ("pointcloud", "rgb+position+segmentation", "rgb+depth+segmentation"):
        env = tasks.make("TwoRobotPickCube-v1", obs_mode=mode, camera_size=SIZE)
        clouds.append(world_points(env.reset(seed=0)[0]))
    first, *others = clouds
    near = first["seen"] & (np.abs(first["xyz"]).max(-1) < 5)  # m; positions end at 32 m
    assert first["xyz"].shape == (1, 3 * SIZE[0] * SIZE[1], 3)
    for other, tolerance in zip(others, (1e-5, 6e-3), strict=True):  # m; depth is in mm
        assert np.array_equal(first["seen"], other["seen"])
        assert np.array_equal(first["rgb"], other["rgb"])
        assert np.abs(first["xyz"] - other["xyz"])[near].max() < tolerance


@pytest.mark.usefixtures("renderer")
def test_a_recording_has_the_points_that_the_environment_had(tmp_path: Path):
    how = {"obs_mode": "pointcloud", "camera_size": SIZE}
    rl.record(TASK, [4], tmp_path, workers=0, **how)
    env = tasks.make(TASK, num_envs=2, **how)
    with Recording(tmp_path) as file:
        states = file[0].states["articulations"]["panda"]
        asked = {"box": BOX, "frame": states[0, :7], "seed": 9}
        whole = point_cloud(file.observations(0), 64, **asked)
        actions = file[0].actions
    base = env.layout["arm"]
    assert states[0, :7].tolist() == pytest.approx(
        [*base.base_position, *base.base_quaternion], abs=1e-6
    )
    assert (whole["xyz"][..., 0] > 0.3).all()
    obs, _ = env.reset(seed=[4, 5], options={"reconfigure": True})
    for step in range(len(actions) + 1):
        rows = point_cloud(obs, 64, **asked)
        assert rows["xyz"].shape == (2, 64, 3)
        for name, values in whole.items():
            assert rows[name][0].tobytes() == values[step].tobytes(), (step, name)
        if step < len(actions):
            obs = env.step(np.stack([actions[step]] * 2))[0]


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        ({"points": 0}, "points is 0; it must be an integer of 1 or more"),
        ({"seed": -1}, "seed is -1"),
        ({"box": ((0, 0, 0), (1, 0, 1))}, "it must be its lowest and its highest corner"),
        ({"frame": (0, 0, 0)}, r"frame has shape \(3,\); it must be a pose"),
        ({"frame": (0, 0, 0, 1, 1, 0, 0)}, "a quaternion wxyz of length 1"),
        ({"observation": {"agent": {}, "extra": {}}}, "It has agent, extra"),
        (
            {"observation": {"sensor_data": {"one": {"rgb": 0}}, "sensor_param": {"one": {}}}},
            "observe in obs_mode 'pointcloud'",
        ),
    ],
)
def test_what_is_wrong_is_said(wrong, complaint):
    with pytest.raises(TaskError, match=complaint):
        point_cloud(**{"observation": flat([(0, 0, 0)]), "points": 1} | wrong)
