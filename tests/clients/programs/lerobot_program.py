"""LeRobot: reads an export, trains a policy on it, and evaluates it in the task it comes from."""

import sys
from pathlib import Path

import gymnasium
import torch
from lerobot.configs.types import FeatureType
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.envs.configs import EnvConfig
from lerobot.envs.factory import make_env, make_env_pre_post_processors
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.factory import make_policy, make_pre_post_processors
from lerobot.scripts.lerobot_eval import rollout
from lerobot.utils.import_utils import register_third_party_plugins

from robot_layouts.data.export.dataset import Export, export
from robot_layouts.data.recording.record import record

TASK = "PushCube-v1"


def dataset(folder: Path) -> LeRobotDataset:
    record(TASK, range(3), folder / "recording", workers=0)
    export(Export(folder / "recording" / "trajectory.h5", "lerobot", folder / "dataset"))
    chunk = [step / 20 for step in range(10)]
    return LeRobotDataset("local/push", root=folder / "dataset", delta_timestamps={"action": chunk})


def main(folder: Path) -> None:
    data = dataset(folder)
    config = ACTConfig(
        device="cpu", chunk_size=10, n_action_steps=10, dim_model=32, n_heads=2, dim_feedforward=32,
        n_encoder_layers=1, use_vae=False,
    )  # fmt: skip
    policy = make_policy(config, ds_meta=data.meta)
    prepare, finish = make_pre_post_processors(config, dataset_stats=data.meta.stats)
    optimizer = torch.optim.Adam(policy.parameters(), lr=1e-3)
    for batch in torch.utils.data.DataLoader(data, batch_size=16, shuffle=True):
        loss, _ = policy.forward(prepare(batch))
        loss.backward()
        optimizer.step()
        optimizer.zero_grad()
    policy.eval()
    assert all(kind.type is not FeatureType.VISUAL for kind in config.input_features.values())

    # By itself: the observation is a row of the dataset.
    env = gymnasium.make(f"tasks:RobotLayouts/{TASK}", obs_mode="lerobot")
    obs, _ = env.reset(seed=0)
    for _ in range(3):
        action = finish(policy.select_action(prepare({k: torch.tensor(x) for k, x in obs.items()})))
        obs, *_ = env.step(action[0].numpy())

    for part in (policy, prepare, finish):
        part.save_pretrained(folder / "policy")

    # By LeRobot's own evaluation, which finds our plugin.
    register_third_party_plugins()
    wanted = EnvConfig.get_choice_class("robot_layouts")(task=TASK, render_mode=None)
    (suite,) = make_env(wanted, n_envs=2).values()
    before, after = make_env_pre_post_processors(wanted, config)
    played = rollout(suite[0], policy, before, after, prepare, finish, seeds=[5, 6])
    assert played["action"].shape[2] == 8
    assert played["done"][:, -1].all()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
