"""tianshou: its vectors, its high-level PPO experiment, and its view of robots as agents."""

import gymnasium
import numpy as np
from pettingzoo.utils import parallel_to_aec
from tianshou import env as vectors
from tianshou.highlevel.config import OnPolicyTrainingConfig
from tianshou.highlevel.env import EnvFactoryRegistered, VectorEnvType
from tianshou.highlevel.experiment import ExperimentConfig, PPOExperimentBuilder

import tasks

PUSH = "RobotLayouts/PushCube-v1"


def step(kind: str) -> None:
    vector = getattr(vectors, kind)([lambda: gymnasium.make(PUSH) for _ in range(2)])
    vector.seed(3)
    vector.reset()
    obs, _, _, _, infos = vector.step(np.zeros((2, 8), np.float32))
    assert obs.shape == (2, 35)
    assert [info["elapsed_steps"] for info in infos] == [1, 1]
    vector.close()


def learn() -> None:
    training = OnPolicyTrainingConfig(
        max_epochs=1,
        epoch_num_steps=200,
        batch_size=50,
        num_training_envs=2,
        num_test_envs=2,
        collection_step_num_env_steps=100,
        update_step_num_repetitions=1,
    )
    factory = EnvFactoryRegistered(task=PUSH, venv_type=VectorEnvType.SUBPROC)
    config = ExperimentConfig(persistence_enabled=False, watch=False)
    result = PPOExperimentBuilder(factory, config, training).build().run()
    assert result.trainer_result.update_step >= 1


def robots_as_agents() -> None:
    env = vectors.PettingZooEnv(parallel_to_aec(tasks.parallel_env("TwoRobotPickCube-v1")))
    first, _ = env.reset()
    second, *_ = env.step(np.zeros(8, np.float32))
    assert [first["agent_id"], second["agent_id"]] == ["left", "right"]


if __name__ == "__main__":
    for name in ("DummyVectorEnv", "SubprocVectorEnv", "ShmemVectorEnv"):
        step(name)
    learn()
    robots_as_agents()
