"""robomimic: trains on an export, and its policy plays in the task that the export comes from."""

import sys
from pathlib import Path

import gymnasium
import numpy as np
import torch
from robomimic.algo import RolloutPolicy, algo_factory
from robomimic.config import config_factory
from robomimic.utils import file_utils, obs_utils
from robomimic.utils.dataset import SequenceDataset

from robot_layouts.data.export.dataset import Export, export
from robot_layouts.data.recording.record import record

TASK = "PushCube-v1"


def main(folder: Path) -> None:
    record(TASK, range(3), folder / "recording", workers=0)
    export(Export(folder / "recording" / "trajectory.h5", "robomimic", folder / "dataset"))
    path = str(folder / "dataset" / "low_dim.hdf5")
    config = config_factory("bc")
    with config.values_unlocked():
        config.observation.modalities.obs.low_dim = ["arm_qpos", "arm_tcp_pose", "object"]
    obs_utils.initialize_obs_utils_with_config(config)
    described = file_utils.get_shape_metadata_from_dataset(
        path, all_obs_keys=config.all_obs_keys, verbose=False
    )
    model = algo_factory(
        "bc", config, described["all_shapes"], described["ac_dim"], torch.device("cpu")
    )
    data = SequenceDataset(
        path, obs_keys=config.all_obs_keys, dataset_keys=("actions", "rewards", "dones"),
        filter_by_attribute="train", seq_length=1,
    )  # fmt: skip
    model.set_train()
    for batch in torch.utils.data.DataLoader(data, batch_size=16, shuffle=True):
        batch = model.process_batch_for_training(batch)
        batch = model.postprocess_batch_for_training(batch, obs_normalization_stats=None)
        info = model.train_on_batch(batch, epoch=0)
    assert np.isfinite(info["losses"]["action_loss"].item())

    described = file_utils.get_env_metadata_from_dataset(path)
    env = gymnasium.make(
        f"tasks:RobotLayouts/{described['env_name']}",
        obs_mode="robomimic",
        **described["env_kwargs"],
    )
    policy = RolloutPolicy(model)
    policy.start_episode()
    obs, _ = env.reset(seed=0)
    over = False
    while not over:
        obs, _, terminated, truncated, _ = env.step(policy(ob=obs))
        over = terminated or truncated


if __name__ == "__main__":
    main(Path(sys.argv[1]))
