import numpy as np
import torch

import tasks


def test_the_tcp_lies_between_the_jaws_and_the_arm_stands_as_in_native():
    env = tasks.make("PickCubeSO100-v1", num_envs=2)
    obs, _ = env.reset(seed=0)
    state = env.simulation.read()
    tips = [state.link_position("arm", f"{jaw}_Jaw_tip") for jaw in ("Fixed", "Moving")]
    tcp = obs[:, env.observation_slices["tcp_pose"]]
    assert np.array_equal(tcp[:, :3], (tips[0] + tips[1]) / 2)
    assert np.array_equal(tcp[:, 3:], state.link_pose("arm", "Fixed_Jaw")[:, 3:])
    assert state.arm_qvel("arm").shape == (2, 5)
    noise = state.qpos("arm") - np.array(env.layout["arm"].start_qpos, np.float32)
    assert (noise != 0).all()
    assert np.abs(noise).max() < 0.1


def test_the_cube_lies_within_reach_of_the_small_arm():
    env = tasks.make("PickCubeSO100-v1", num_envs=16)
    obs, _ = env.reset(seed=0)
    cube = obs[:, env.observation_slices["obj_pose"]]
    assert (cube[:, :2] - torch.tensor([-0.46, 0.0])).abs().max() <= 0.05 + 1e-6
    assert torch.allclose(cube[:, 2], torch.tensor(0.0125))
    assert (obs[:, env.observation_slices["goal_pos"]][:, 2] <= 0.0125 + 0.08).all()
