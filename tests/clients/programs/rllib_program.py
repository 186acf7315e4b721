"""RLlib: PPO of one robot and of two as agents, in this process and in runners of its own."""

from typing import Any

import gymnasium
import ray
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
from ray.tune.registry import register_env

import tasks


def short() -> PPOConfig:
    config = PPOConfig().training(train_batch_size_per_learner=200, minibatch_size=50, num_epochs=1)
    return config.env_runners(num_env_runners=0)


def learn(config: PPOConfig) -> Any:
    algorithm = config.build_algo()
    result = algorithm.train()
    algorithm.stop()
    assert result["num_env_steps_sampled_lifetime"] >= 200
    return result["env_runners"]["episode_len_mean"]


if __name__ == "__main__":
    assert gymnasium.__version__ == "1.2.2"  # which RLlib pins
    ray.init(num_cpus=2, include_dashboard=False)
    assert learn(short().environment("RobotLayouts/PushCube-v1")) == 50
    runners = {"num_env_runners": 1, "num_envs_per_env_runner": 2, "rollout_fragment_length": 50}
    imported = "tasks:RobotLayouts/PushCube-v1"  # in runners nothing else imports it
    assert learn(short().environment(imported).env_runners(**runners)) == 50
    register_env(
        "pair",
        lambda config: ParallelPettingZooEnv(
            tasks.parallel_env("TwoRobotPickCube-v1", robots={"right": "panda_stick"})
        ),
    )
    agents = short().multi_agent(
        policies={"left", "right"}, policy_mapping_fn=lambda agent, episode, **_: agent
    )
    assert learn(agents.environment("pair")) == 100
