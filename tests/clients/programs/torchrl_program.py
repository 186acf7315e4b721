"""torchrl: environments by id, its wrappers, our vectors, robots as agents, a critic of states."""

import gymnasium
import torch
from torchrl.envs import GymEnv, GymWrapper, ParallelEnv, PettingZooWrapper, check_env_specs
from torchrl.envs.libs.pettingzoo import MarlGroupMapType

import tasks

PUSH = "RobotLayouts/PushCube-v1"


def by_id() -> None:
    env = GymEnv(PUSH)
    check_env_specs(env)
    rollout = env.rollout(60)
    assert rollout.batch_size == (50,)
    assert rollout["next", "truncated"][-1].item()
    assert GymEnv(PUSH, frame_skip=4).rollout(60).batch_size == (13,)


def in_processes() -> None:
    env = ParallelEnv(2, lambda: GymEnv(PUSH))
    assert env.rollout(5).batch_size == (2, 5)
    env.close()
    batched = GymEnv(PUSH, num_envs=2)
    assert batched.rollout(5).batch_size == (2, 5)
    batched.close()


def wrapped() -> None:
    env = GymWrapper(gymnasium.make(PUSH, obs_mode="state_dict"))
    check_env_specs(env)
    assert env.rollout(3)["next", "agent", "qpos"].shape == (3, 9)


def our_vector(autoreset_mode: str) -> None:
    vector = gymnasium.make_vec(PUSH, num_envs=4, num_workers=2, autoreset_mode=autoreset_mode)
    env = GymWrapper(vector)
    check_env_specs(env)
    rollout = env.rollout(60, break_when_any_done=False)
    assert rollout.batch_size == (4, 60)
    assert rollout["next", "done"].sum() == 4
    assert rollout["next", "observation"].isfinite().all()
    env.close()


def robots_as_agents() -> None:
    pair = tasks.parallel_env("TwoRobotPickCube-v1", robots={"right": "panda_stick"})
    env = PettingZooWrapper(pair, return_state=True)
    check_env_specs(env)
    rollout = env.rollout(3)
    assert rollout["left", "action"].shape == (3, 1, 8)
    assert rollout["right", "action"].shape == (3, 1, 7)
    assert rollout["next", "state"].shape == (3, *pair.state_space.shape)


def a_central_critic() -> None:
    """MAPPO's: one value of the state of all."""
    env = PettingZooWrapper(
        tasks.parallel_env("TwoRobotPickCube-v1"),
        return_state=True,
        group_map=MarlGroupMapType.ALL_IN_ONE_GROUP,
    )
    rollout = env.rollout(3)
    assert rollout["agents", "observation"].shape == (3, 2, 48)
    critic = torch.nn.Linear(env.observation_spec["state"].shape[-1], 1)
    assert critic(rollout["state"]).shape == (3, 1)


if __name__ == "__main__":
    by_id()
    in_processes()
    wrapped()
    our_vector("SAME_STEP")
    our_vector("DISABLED")
    robots_as_agents()
    a_central_critic()
