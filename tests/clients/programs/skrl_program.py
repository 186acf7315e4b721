"""skrl: PPO in our environments and vectors, MAPPO with robots as agents."""

import sys
from typing import Any

import gymnasium
from skrl.envs.wrappers.torch import wrap_env
from skrl.utils.runner.torch import Runner

import tasks

PUSH = "RobotLayouts/PushCube-v1"


def settings(agent: str, timesteps: int) -> dict[str, Any]:
    layers = [{"name": "net", "input": "OBSERVATIONS", "layers": [32], "activations": "elu"}]
    critic = "STATES" if agent == "MAPPO" else "OBSERVATIONS"
    return {
        "models": {
            "separate": True,
            "policy": {"class": "GaussianMixin", "network": layers, "output": "ACTIONS"},
            "value": {
                "class": "DeterministicMixin",
                "network": [{**layers[0], "input": critic}],
                "output": "ONE",
            },
        },
        "memory": {"class": "RandomMemory", "memory_size": -1},
        "agent": {
            "class": agent,
            "rollouts": 20,
            "learning_epochs": 1,
            "learning_rate_scheduler": "KLAdaptiveLR",
            "learning_rate_scheduler_kwargs": {"kl_threshold": 0.008},
            "observation_preprocessor": "RunningStandardScaler",
            "state_preprocessor": "RunningStandardScaler" if agent == "MAPPO" else None,
            "value_preprocessor": "RunningStandardScaler",
            "experiment": {"directory": sys.argv[1], "write_interval": 0, "checkpoint_interval": 0},
        },
        "trainer": {
            "class": "SequentialTrainer",
            "timesteps": timesteps,
            "headless": True,
        },
    }


def learn(env: Any, agent: str, timesteps: int = 120) -> None:
    wrapped = wrap_env(env)
    Runner(wrapped, settings(agent, timesteps)).run("train")
    wrapped.close()


if __name__ == "__main__":
    learn(gymnasium.make(PUSH), "PPO")
    learn(gymnasium.make_vec(PUSH, num_envs=4, num_workers=2), "PPO")
    pair = tasks.parallel_env("TwoRobotPickCube-v1", robots={"right": "panda_stick"})
    learn(pair, "IPPO")
    learn(tasks.parallel_env("TwoRobotPickCube-v1"), "MAPPO")
