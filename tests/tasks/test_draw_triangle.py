import pytest
import torch

import tasks
from robots import SimulationError
from tasks import TaskEnv

STILL = torch.zeros(1, 7)
DOWN = torch.tensor([[0.0, 1.0, 0.0, -0.4, 0.0, 0.0, 0.0]])  # until the stick presses the canvas


def drawn(env: TaskEnv, index: int = 0) -> list[str]:
    actors = env.get_state_dict()["actors"]
    return [name for name, rows in actors.items() if name[:3] == "dot" and rows[index, 2] > 0]


@pytest.mark.parametrize(
    ("task", "dots"), [("DrawTriangle-v1", 300), ("TableTopFreeDraw-v1", 1010)]
)
def test_the_dots_are_used_up_one_per_step_and_then_it_says_so(task, dots):
    env = tasks.make(task, num_envs=2)
    env.reset(seed=0)
    env.step(STILL.repeat(2, 1))
    env.reset(seed=[5], env_ids=[1])
    for _ in range(dots - 1):
        env.step(STILL.repeat(2, 1))
    before = env.get_state_dict()["articulations"]["panda_stick"]
    with pytest.raises(
        SimulationError, match=rf"environments \[0\] have used up their {dots} dots"
    ):
        env.step(torch.ones(2, 7))
    assert torch.equal(env.get_state_dict()["articulations"]["panda_stick"], before)
    env.reset(env_ids=[0])
    env.step(STILL.repeat(2, 1))
    with pytest.raises(SimulationError, match=r"environments \[1\] have"):
        env.step(STILL.repeat(2, 1))


@pytest.mark.parametrize("task", ["DrawTriangle-v1", "TableTopFreeDraw-v1"])
def test_a_low_stick_leaves_a_dot_where_it_is(task):
    env = tasks.make(task)
    env.reset(seed=0)
    steps = 0
    while not drawn(env):
        obs = env.step(DOWN)[0]
        steps += 1
        assert steps < 60
    assert drawn(env) == [f"dot_{steps - 1}"]
    dot = env.get_state_dict()["actors"][f"dot_{steps - 1}"][0]
    tip = obs[0, env.observation_slices["tcp_pose"]]
    assert torch.equal(dot[:2], tip[:2])
    assert dot[2].item() == pytest.approx(0.0215)


def test_a_partial_reset_wipes_one_canvas_only():
    env = tasks.make("DrawTriangle-v1", num_envs=2)
    env.reset(seed=0)
    while not drawn(env):
        env.step(DOWN.repeat(2, 1))
    dots = drawn(env)
    assert drawn(env, 1) == dots
    corners = env.observation_slices["vertices"]
    before = env.step(DOWN.repeat(2, 1))[0]
    obs = env.reset(seed=[9], env_ids=[1])[0]
    assert drawn(env)[: len(dots)] == dots
    assert drawn(env, 1) == []
    assert torch.equal(obs[0, corners], before[0, corners])
    assert not torch.equal(obs[1, corners], before[1, corners])
