"""LeRobot's own commands with pixels: train on what three cameras see, and evaluate that."""

import json
import sys
from pathlib import Path

import numpy as np
from lerobot_commands import evaluated, successes, train
from lerobot_env_robot_layouts import LeRobotPolicy

from robot_layouts.data import evaluate
from robot_layouts.data.export.dataset import Export, export
from robot_layouts.data.recording.record import record

TASK, SIZE, STEPS = "TwoRobotPickCube-v1", (64, 48), 8
CAMERAS = {"base_camera", "left.hand_camera", "right.hand_camera"}


def main(folder: Path) -> None:
    record(TASK, range(1), folder / "recording", workers=0)
    recording = folder / "recording" / "trajectory.h5"
    export(Export(recording, "lerobot", folder / "dataset", cameras="all", size=SIZE))
    policy = train(folder / "dataset", folder / "act", "--steps=2", "--batch_size=4")
    inputs = json.loads((policy / "config.json").read_text())["input_features"]
    assert {f"observation.images.{camera}" for camera in CAMERAS} < {*inputs}

    reported = evaluated(
        folder / "evaluated", f"--policy.path={policy}", "--policy.device=cpu",
        "--env.type=robot_layouts", f"--env.task={TASK}", "--env.cameras=true",
        f"--env.camera_size={list(SIZE)}", f"--env.max_episode_steps={STEPS}",
        "--eval.n_episodes=2", "--eval.batch_size=1", "--seed=0",
    )  # fmt: skip
    ours = evaluate(
        LeRobotPolicy.load(policy, TASK), TASK, range(2), workers=0,
        obs_mode="lerobot+cameras", camera_size=SIZE, max_episode_steps=STEPS,
    )  # fmt: skip
    assert successes(reported, TASK) == [*ours.successes.values()]
    returns = reported["per_task"][0]["metrics"]["sum_rewards"]
    sums = np.float32([*ours.returns.values()])  # LeRobot adds in another order
    assert np.allclose(returns, sums, rtol=1e-6, atol=0), (returns, sums)
    films = [Path(path) for path in reported["overall"]["video_paths"]]
    assert len(films) == 2
    assert all(film.stat().st_size > 2000 for film in films), "they show something"


if __name__ == "__main__":
    main(Path(sys.argv[1]))
