"""Minari: a dataset collected with infos, loaded again, and its environment recovered from it."""

import os
import sys

os.environ["MINARI_DATASETS_PATH"] = sys.argv[1]

import gymnasium
import minari
import numpy as np

import tasks


def collect(task_id: str, **fields: object) -> None:
    env = minari.DataCollector(
        gymnasium.make(f"RobotLayouts/{task_id}", **fields), record_infos=True
    )
    for seed in range(2):
        env.reset(seed=seed)
        over = False
        while not over:
            *_, terminated, truncated, _ = env.step(env.action_space.sample())
            over = terminated or truncated
    name = f"robot-layouts/{task_id.lower().removesuffix('-v1')}-v0"
    env.create_dataset(dataset_id=name, algorithm_name="random", description="random actions")
    env.close()
    check(name, task_id)
    minari.delete_dataset(name)


def check(name: str, task_id: str) -> None:
    dataset = minari.load_dataset(name)
    episode = dataset[0]
    assert dataset.total_episodes == 2
    for key in ("elapsed_steps", "is_success", "seed", "success"):
        assert len(episode.infos[key]) == len(episode.rewards) + 1, key
    recovered = dataset.recover_environment()
    assert recovered.spec.max_episode_steps == tasks.get_task_class(task_id).max_episode_steps
    recovered.reset(seed=0)
    for action, reward in zip(episode.actions, episode.rewards, strict=True):
        assert recovered.step(action)[1] == np.float64(reward)


if __name__ == "__main__":
    collect("PickCube-v1")
    collect("PushCube-v1", obs_mode="state_dict")
    collect("TwoRobotPickCube-v1", robots={"right": "panda_stick"})
