"""LeRobot's own commands, and what they report."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

POLICY_PLUGIN = Path(__file__).parents[1] / "plugins" / "lerobot_policy_replay"


def command(name: str, *words: str, fails: bool = False, **variables: str) -> str:
    """Run one of LeRobot's commands, and return everything that it says."""
    program = Path(sys.executable).with_name(name)
    done = subprocess.run(
        [program, *words],
        env={**os.environ, "HF_HUB_OFFLINE": "1", "WANDB_MODE": "disabled", **variables},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert (done.returncode != 0) == fails, done.stdout[-6000:]
    return done.stdout


def evaluated(folder: Path, *words: str, **variables: str) -> dict[str, Any]:
    """Let ``lerobot-eval`` evaluate a policy, and return what it reports."""
    said = command("lerobot-eval", *words, f"--output_dir={folder}", **variables)
    reported: dict[str, Any] = json.loads((folder / "eval_info.json").read_text())
    assert f"'pc_success': {reported['overall']['pc_success']}" in said
    return reported


def successes(reported: dict[str, Any], task: str) -> list[bool]:
    """Return which episodes of a task were a success, in the order of their seeds."""
    (found,) = [part for part in reported["per_task"] if part["task_group"] == task]
    return found["metrics"]["successes"]


TINY_ACT = (
    *("--policy.type=act", "--policy.chunk_size=20", "--policy.n_action_steps=20"),
    *("--policy.dim_model=64", "--policy.n_heads=2", "--policy.dim_feedforward=128"),
    *("--policy.n_encoder_layers=1", "--policy.use_vae=false"),
)
TINY_DIFFUSION = ("--policy.type=diffusion", "--policy.down_dims=[16,32]", "--policy.n_groups=4")


def train(dataset: Path, folder: Path, *words: str, policy: tuple[str, ...] = TINY_ACT) -> Path:
    """Let ``lerobot-train`` train a tiny policy, and return the folder of the policy."""
    command(
        "lerobot-train", "--dataset.repo_id=local/pair", f"--dataset.root={dataset}", *policy,
        "--policy.device=cpu", "--policy.push_to_hub=false",
        "--policy.pretrained_backbone_weights=null", "--num_workers=0", "--env_eval_freq=0",
        "--wandb.enable=false", f"--output_dir={folder}", *words,
    )  # fmt: skip
    return folder / "checkpoints" / "last" / "pretrained_model"


def install_replay(folder: Path) -> Path:
    """Install the policy that remembers recordings into a folder, and return that."""
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    source = folder.with_name(f"{folder.name}_source")  # building leaves files behind
    source.mkdir(parents=True)
    subprocess.run(["cp", "-r", f"{POLICY_PLUGIN}/.", source], check=True)
    subprocess.run(
        [*install, "--no-build-isolation", "--target", str(folder), str(source)], check=True
    )
    return folder
