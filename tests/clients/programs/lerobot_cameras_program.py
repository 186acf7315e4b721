"""LeRobot: reads exports with cameras, learns from one, and evaluates that in the task."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.envs.configs import EnvConfig
from lerobot.envs.factory import make_env, make_env_pre_post_processors
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.factory import make_policy, make_pre_post_processors
from lerobot.scripts.lerobot_eval import rollout
from lerobot.utils.import_utils import register_third_party_plugins
from tray_recording import (
    CAMERAS,
    LENGTHS,
    ROBOTS,
    ROOT,
    SIZE,
    TASK,
    TEXT,
    environment,
    observed,
    record,
)

from robot_layouts.data.export.dataset import Export, export
from robot_layouts.data.reading.recording import Recording

sys.path.insert(0, str(ROOT / "integrations" / "lerobot_env_robot_layouts"))


def main(folder: Path) -> None:
    recording = record(folder / "recording" / "trajectory.h5")
    forms: dict[str, dict[str, Any]] = {"videos": {}, "images": {"images": True, "depth": True}}
    for name, options in forms.items():
        options |= {"cameras": "all", "size": SIZE, "include_failures": True}
        export(Export(recording, "lerobot", folder / name, **options))

    env = environment("lerobot+cameras+depth")
    with Recording(recording) as file:
        rows = [row for episode in file for row in list(observed(env, episode))[:-1]]

    images = LeRobotDataset("local/tray", root=folder / "images")
    assert len(images) == len(rows) == sum(LENGTHS)
    for item, row in zip(images, rows, strict=True):
        assert item["task"] == TEXT
        for camera in CAMERAS:
            key = f"observation.images.{camera}"
            rgb = torch.from_numpy(row[key]).permute(2, 0, 1)
            assert torch.equal((item[key] * 255).round().to(torch.uint8), rgb)
            depth = row[f"{key}_depth"].view(np.uint16)[..., 0].astype(np.float32)
            assert np.array_equal(item[f"{key}_depth"][0].numpy(), depth)

    chunk = [step / 20 for step in range(4)]
    videos = LeRobotDataset(
        "local/tray", root=folder / "videos", delta_timestamps={"action": chunk}
    )
    for item, row in zip(videos, rows, strict=True):
        for camera in CAMERAS:
            shown = item[f"observation.images.{camera}"].permute(1, 2, 0).numpy() * 255
            wanted = row[f"observation.images.{camera}"]
            others = [np.abs(shown - r[f"observation.images.{camera}"]).mean() for r in rows]
            assert np.abs(shown - wanted).mean() <= min(others) + 1
            assert np.abs(shown - wanted).mean() < 12

    config = ACTConfig(
        device="cpu", chunk_size=4, n_action_steps=4, dim_model=32, n_heads=2, dim_feedforward=32,
        n_encoder_layers=1, use_vae=False, pretrained_backbone_weights=None,
    )  # fmt: skip
    policy = make_policy(config, ds_meta=videos.meta)
    prepare, finish = make_pre_post_processors(config, dataset_stats=videos.meta.stats)
    batch = next(iter(torch.utils.data.DataLoader(videos, batch_size=6)))
    loss, _ = policy.forward(prepare(batch))
    loss.backward()
    assert torch.isfinite(loss)
    assert {f"observation.images.{camera}" for camera in CAMERAS} < {*config.input_features}
    policy.eval()

    register_third_party_plugins()
    wanted = EnvConfig.get_choice_class("robot_layouts")(
        task=TASK, robots=ROBOTS, render_mode=None, cameras=True, camera_size=list(SIZE),
        max_episode_steps=10,
    )  # fmt: skip
    (suite,) = make_env(wanted, n_envs=1).values()
    before, after = make_env_pre_post_processors(wanted, config)
    played = rollout(suite[0], policy, before, after, prepare, finish, seeds=[5])
    assert played["action"].shape[2] == 16


if __name__ == "__main__":
    main(Path(sys.argv[1]))
