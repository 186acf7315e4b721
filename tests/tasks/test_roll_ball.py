import numpy as np
import torch

import tasks
from tasks.maniskill.roll_ball import HIT_OFFSET


def put_ball_where_the_arm_should_hit_it(env: tasks.MultiRobotTask) -> None:
    """Place the balls so that the TCPs are at the point to hit from, without a step."""
    state = env.simulation.read()
    tcp, goal = state.tcp_position("arm"), state.position("goal_region")
    way = goal - tcp
    ball = env.get_state_dict()["actors"]["ball"].clone()
    ball[:, :3] = torch.from_numpy(
        tcp + way / np.linalg.norm(way, axis=1, keepdims=True) * HIT_OFFSET
    )
    env.set_state_dict({"actors": {"ball": ball}})


def reward(env: tasks.MultiRobotTask) -> np.ndarray:
    state = env.simulation.read()
    return env.dense_reward(
        state, np.zeros(env.action_space.shape, np.float32), env.evaluate(state)
    )


def test_having_been_behind_the_ball_counts_until_the_next_reset():
    env = tasks.make("RollBall-v1", num_envs=3, reward_mode="dense")
    env.reset(seed=0)
    at_rest = env.get_state_dict()
    assert (reward(env) < 1).all()
    put_ball_where_the_arm_should_hit_it(env)
    assert (reward(env) > 1).all()
    env.set_state_dict(at_rest)
    assert (reward(env) > 1).all()
    env.reset(seed=[1], env_ids=[1])
    assert (reward(env) > 1).tolist() == [True, False, True]
    env.reset()
    assert (reward(env) < 1).all()
