"""SuperSuit: robots as agents with one policy, learned by Stable-Baselines3 in two processes."""

import supersuit
from stable_baselines3 import PPO

import tasks

PAIR = "TwoRobotPickCube-v1"


def learn(num_cpus: int) -> None:
    env = supersuit.pettingzoo_env_to_vec_env_v1(tasks.parallel_env(PAIR))
    env = supersuit.concat_vec_envs_v1(env, 2, num_cpus=num_cpus, base_class="stable_baselines3")
    assert env.num_envs == 4
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=64, n_epochs=1)
    model.learn(512)
    assert model.num_timesteps == 512
    env.close()


if __name__ == "__main__":
    learn(num_cpus=1)
    learn(num_cpus=2)
    unequal = tasks.parallel_env(PAIR, robots={"right": "panda_stick"})
    padded = supersuit.pad_action_space_v0(supersuit.pad_observations_v0(unequal))
    observations, _ = supersuit.frame_stack_v1(padded, 3).reset(seed=0)
    assert observations["left"].shape == observations["right"].shape
