"""robomimic: reads an export with cameras, learns from it, and plays in the task."""

import json
import sys
from pathlib import Path

import gymnasium
import h5py
import numpy as np
import torch
from robomimic.algo import RolloutPolicy, algo_factory
from robomimic.config import config_factory
from robomimic.utils import file_utils, obs_utils
from robomimic.utils.dataset import SequenceDataset
from tray_recording import CAMERAS, LENGTHS, ROBOTS, SIZE, TASK, TEXT, environment, observed, record

from robot_layouts.data.export.dataset import Export, export
from robot_layouts.data.reading.recording import Recording

FAR = 3000.0  # mm, that counts as 1 in what the network sees
KEYS = [camera.replace(".", "_") for camera in CAMERAS]


def near(depth):
    """Return depth (mm, 16 bits) as robomimic's networks take it: 0 to 1, the channel first."""
    distance = (depth * 1.0) % 65536  # an array or a tensor
    return obs_utils.batch_image_hwc_to_chw((distance / FAR).clip(0, 1))


def main(folder: Path) -> None:
    recording = record(folder / "recording" / "trajectory.h5")
    options = {"cameras": "all", "depth": True, "size": SIZE, "include_failures": True}
    wanted = Export(recording, "robomimic", folder / "data", **options)  # type: ignore[arg-type]
    export(wanted)
    path = str(folder / "data" / "image.hdf5")

    config = config_factory("bc")
    with config.values_unlocked():
        config.observation.modalities.obs.low_dim = ["left_qpos", "right_qpos"]
        config.observation.modalities.obs.rgb = [f"{key}_image" for key in KEYS]
        config.observation.modalities.obs.depth = [f"{key}_depth" for key in KEYS]
        rgb = config.observation.encoder.rgb
        rgb.core_kwargs.feature_dimension = 8
        rgb.core_kwargs.backbone_kwargs.pretrained = False
    obs_utils.initialize_obs_utils_with_config(config)
    obs_utils.DepthModality.set_obs_processor(near)

    env = environment("robomimic+cameras+depth")
    with Recording(recording) as file:
        episodes = [list(observed(env, episode)) for episode in file]
    data = SequenceDataset(
        path, obs_keys=config.all_obs_keys, dataset_keys=("actions", "rewards", "dones"),
        frame_stack=1, seq_length=1, hdf5_cache_mode=None,
    )  # fmt: skip
    assert len(data) == sum(LENGTHS)
    numbered = ((e, t) for e, steps in enumerate(LENGTHS) for t in range(steps))
    for (episode, t), item in zip(numbered, data, strict=False):
        for rows, moment in (("obs", t), ("next_obs", t + 1)):
            for key in KEYS:
                for name in (f"{key}_image", f"{key}_depth"):
                    seen = episodes[episode][moment][name]
                    assert np.array_equal(item[rows][name][0], seen), (rows, name)
    with h5py.File(path) as file:
        assert json.loads(file["data/demo_1"].attrs["ep_meta"]) == {"lang": TEXT}

    described = file_utils.get_shape_metadata_from_dataset(
        path, all_obs_keys=config.all_obs_keys, verbose=False
    )
    assert described["use_images"]
    model = algo_factory(
        "bc", config, described["all_shapes"], described["ac_dim"], torch.device("cpu")
    )
    model.set_train()
    for batch in torch.utils.data.DataLoader(data, batch_size=3):
        batch = model.process_batch_for_training(batch)
        batch = model.postprocess_batch_for_training(batch, obs_normalization_stats=None)
        info = model.train_on_batch(batch, epoch=0)
    assert np.isfinite(info["losses"]["action_loss"].item())

    described = file_utils.get_env_metadata_from_dataset(path)
    assert described["env_kwargs"]["robots"] == ROBOTS
    env = gymnasium.make(
        f"tray:RobotLayouts/{described['env_name']}",
        obs_mode="robomimic+cameras+depth",
        **described["env_kwargs"],
    )
    policy = RolloutPolicy(model)
    policy.start_episode()
    obs, _ = env.reset(seed=0)
    for _ in range(2):
        shown = {
            name: obs_utils.process_obs(x, obs_key=name)
            for name, x in obs.items()
            if name in config.all_obs_keys
        }
        obs, *_ = env.step(policy(ob=shown))
    assert TASK.endswith(described["env_name"])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
