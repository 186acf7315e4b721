"""Pictures of recordings whose worlds look different: those that the episode's cameras saw."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

import tasks
from robot_layouts.data import record
from robot_layouts.data.playing.replay import replay
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import FILE, Recording
from robot_layouts.simulation.rendering import Observers
from tasks import CameraShift, Distractors, Light, Randomization, Surface, Texture, Uniform, Whole

TASK, SEED = "PickCube-v1", 3
VARIED = Randomization(
    cameras={"*": CameraShift(y=Uniform(-0.05, 0.05), fov=Uniform(0.9, 1.1))},
    lights={"*": Light(turn=Uniform(-1, 1), strength=Uniform(0.5, 1.5))},
    colors={"*": Surface(red=Uniform(0, 1), share=0.5)},
    textures={"table-workspace": Texture()},
    distractors=Distractors(count=Whole(1, 3), x=Uniform(-0.4, -0.3)),
)


@pytest.mark.usefixtures("renderer")
def test_a_recording_brings_back_what_cameras_saw(tmp_path: Path) -> None:
    summary = record(TASK, [SEED], tmp_path, workers=0, randomization=VARIED)
    assert not summary.failed
    with Recording(tmp_path / FILE) as file, closing(task_for(file, pictures=True)) as env:
        (episode,) = file
        assert {"cameras", "lights", "colors", "textures", "distractors"} == {
            *(episode.drawn or {})
        }
        assert replay(env, episode).agrees
        seeing = tasks.make(TASK, obs_mode="rgb", randomization=VARIED)
        cameras = Observers(env.simulation, seeing.observer.cameras, ("rgb",))
        env.reset(SEED, options={"reconfigure": True})
        obs, _ = seeing.reset(SEED, options={"reconfigure": True})
        for action in episode.actions[:3]:
            expected = obs["sensor_data"]["base_camera"]["rgb"][0].numpy()
            assert np.array_equal(cameras.look(0)["base_camera"].images["rgb"], expected)
            env.step(action[None])
            obs, *_ = seeing.step(action[None])
