"""Vectors on a device: what is refused, how episodes begin and end, and MuJoCo's own beside them.

The device is the processor, where the same kernels run, but for how they are shared out.
"""

from contextlib import closing

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode

import tasks
from robot_layouts.experts import find_expert
from robot_layouts.experts.registry import EXPERTS
from robots import ActionError, SimulationError, TaskError, UnknownNameError
from tasks import Randomization, Uniform
from tasks.interfaces.device import DeviceTask

TASK = "PushCube-v1"
STEPS = 4  # of an episode
APART = 1e-4  # rad, m: how far float32 may be from MuJoCo's float64
PRESSED = 2e-4  # m: likewise, of fingers that are pressed together, which tremble by as much
# At 1, drives of Pandas are at their limit of force to the last bit, on either side of it.
SHORT = np.float32(0.99)
OBSERVED = 2e-3  # of observations, which have speeds in them (rad/s)
REFUSED = {
    **dict.fromkeys(("DrawTriangle-v1", "TableTopFreeDraw-v1"), "one by one"),
    "PegInsertionSide-v1": "geometry changes",
    **{f"RotateValveLevel{level}-v1": "geometry changes" for level in range(5)},
}


def made(mode="NEXT_STEP", num_envs=3, task=TASK, **fields):
    fields = {"starts": 5, "max_episode_steps": STEPS, "device": "cpu", **fields}
    return gymnasium.make_vec(
        f"RobotLayouts/{task}",
        num_envs=num_envs,
        simulator="mujoco_warp",
        autoreset_mode=mode,
        **fields,
    )


# -- what needs no engine -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"obs_mode": "rgb"}, "does without obs_mode='rgb' .of state, state_dict, none.; sim"),
        ({"render_mode": "rgb_array"}, "does without render_mode"),
        ({"touch": True}, "does without touch"),
        ({"randomization": Randomization(gravity=Uniform(5, 6))}, "randomization of gravity"),
        ({"device": "gpu"}, "device is 'gpu'; 'cuda:0' or 'cpu' is needed"),
        ({"num_envs": 0}, "num_envs"),
        ({"starts": 0}, "starts"),
        ({"autoreset_mode": "soon"}, "autoreset_mode"),
    ],
)
def test_what_a_device_cannot_do_is_refused(fields, message):
    with pytest.raises((TaskError, UnknownNameError), match=message):
        DeviceTask(TASK, **{"num_envs": 2, "device": "cpu", **fields})


def test_a_card_that_is_not_there_is_named():
    with pytest.raises(SimulationError, match="'cuda:9' is not there: torch finds . cards"):
        DeviceTask(TASK, 2, "cuda:9")


def test_a_task_itself_is_not_made_on_a_device():
    with pytest.raises(TaskError, match=r"gymnasium.make_vec\('RobotLayouts/…'"):
        tasks.make(TASK, simulator="mujoco_warp")


# -- episodes -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def engine():
    pytest.importorskip("mujoco_warp")


@pytest.mark.long
@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_episodes_begin_and_end_as_vectors_have_it(engine, mode):
    with closing(made(mode)) as env, closing(tasks.make(TASK, 3, simulator="mujoco")) as host:
        obs, info = env.reset(seed=[7, 2022, 40])
        begun, _ = host.reset(seed=[7, 2022, 40])
        assert info["seed"].tolist() == [7, 2022, 40]
        torch.testing.assert_close(obs, begun, atol=APART, rtol=0)
        idle = torch.zeros(env.action_space.shape)
        for step in range(1, STEPS + 1):
            obs, reward, terminated, truncated, info = env.step(idle)
            seen, earned, *_ = host.step(idle)
            assert truncated.tolist() == [step == STEPS] * 3
            assert not terminated.any()
            torch.testing.assert_close(reward, earned, atol=APART, rtol=0)
            last = info["final_obs"] if mode is AutoresetMode.SAME_STEP else obs
            torch.testing.assert_close(last, seen, atol=OBSERVED, rtol=0)
        if mode is AutoresetMode.DISABLED:
            obs, *_, truncated, info = env.step(idle)
            assert info["elapsed_steps"].tolist() == [STEPS + 1] * 3
            assert truncated.all()
            return
        if mode is AutoresetMode.NEXT_STEP:
            obs, reward, terminated, truncated, info = env.step(idle)
            assert not torch.stack((reward.bool(), terminated, truncated)).any()
        else:
            assert info["_final_obs"].all()
            assert info["final_info"]["elapsed_steps"].tolist() == [STEPS] * 3
        assert info["elapsed_steps"].tolist() == [0, 0, 0]
        begun, _ = host.reset(seed=info["seed"].tolist())
        torch.testing.assert_close(obs, begun, atol=APART, rtol=0)


@pytest.mark.long
def test_a_mask_resets_some_worlds_and_leaves_the_others(engine):
    with closing(made("DISABLED")) as env:
        env.reset(seed=3)
        for _ in range(2):
            before, *_ = env.step(torch.ones(env.action_space.shape))
        mask = np.array([False, True, False])
        obs, info = env.reset(options={"reset_mask": mask})
        assert info["elapsed_steps"].tolist() == [2, 0, 2]
        assert torch.equal(obs[[0, 2]], before[[0, 2]])
        assert not torch.equal(obs[1], before[1])
        with pytest.raises(TaskError, match="reset_mask must be 3 booleans"):
            env.reset(options={"reset_mask": [0, 1, 0]})


@pytest.mark.long
def test_equal_seeds_give_equal_bits_wherever_they_are(engine):
    def played(seeds, count):
        with closing(made(num_envs=count)) as env:
            said = [env.reset(seed=seeds)[0][0]]
            for step in range(STEPS + 4):
                obs, reward, *_ = env.step(torch.full(env.action_space.shape, 0.1 * step))
                said += [obs[0], reward[:1]]
        return torch.cat(said)

    alone = played([11, 5, 6], 3)
    assert torch.equal(alone, played([11, 5, 6], 3))
    assert torch.equal(alone, played([11, 8], 2))
    assert not torch.equal(alone, played([12, 5, 6], 3))


@pytest.mark.long
def test_actions_are_checked_before_anything_moves(engine):
    with closing(made()) as env:
        before, _ = env.reset(seed=0)
        shape = env.action_space.shape
        for wrong, message in (
            (torch.zeros(2, 8), r"has shape \(2, 8\); it must be \(3, 8\)"),
            (torch.zeros(shape, dtype=torch.int64), "has dtype torch.int64; it must be floating"),
            ([[0.0] * 8] * 3, "a tensor or an array is needed"),
            ({}, r"has no numbers for \['arm'\]"),
        ):
            with pytest.raises(ActionError, match=message):
                env.step(wrong)
        with pytest.raises(UnknownNameError, match="Did you mean 'arm'"):
            env.step({"arn": torch.zeros(shape)})
        obs, *_ = env.step({"arm": np.zeros(shape, np.float32)})
        assert (obs - before).abs().max() > 0


@pytest.mark.long
def test_a_world_that_diverges_is_truncated_and_begins_anew(engine):
    with closing(made(num_envs=2)) as env:
        env.reset(seed=0)
        action, nowhere = torch.zeros(env.action_space.shape), torch.full((2, 3), torch.nan)
        env.task.simulation.place("cube", nowhere, where=torch.tensor([False, True]))
        obs, reward, _, truncated, info = env.step(action)
        assert info["diverged"].tolist() == truncated.tolist() == [False, True]
        assert not obs[1].any()
        assert reward[1] == 0
        assert obs.isfinite().all()
        obs, *_, info = env.step(torch.zeros_like(action))
        assert obs.isfinite().all()
        assert info["elapsed_steps"].tolist() == [2, 0]


VARIED = Randomization(mass={"cube": Uniform(0.1, 9.0)}, stiffness={"arm": Uniform(0.5, 1.5)})


@pytest.mark.long
@pytest.mark.parametrize(
    "fields",
    [
        {"randomization": VARIED},
        {"control_mode": "pd_ee_delta_pose"},
        {"control_mode": "pd_ee_target_delta_pos"},
        {"control_mode": "pd_joint_vel"},
    ],
)
def test_what_varies_and_control_modes_are_those_of_mujoco(engine, fields):
    with (
        closing(made("DISABLED", task="PickCube-v1", **fields)) as env,
        closing(tasks.make("PickCube-v1", 3, simulator="mujoco", **fields)) as host,
    ):
        env.reset(seed=30)
        host.reset(seed=30)
        for _ in range(4):
            action = torch.full(env.action_space.shape, 0.7)
            obs, *_ = env.step(action)
            seen, *_ = host.step(action)
            torch.testing.assert_close(obs, seen, atol=OBSERVED, rtol=0)
        assert (obs[0] - obs[1]).abs().max() > 0.01


@pytest.mark.long
def test_each_world_has_the_instruction_of_its_seed(engine):
    task = "CellThrowLevers-v1"
    told = tasks.get_task_class(task).instruction
    with closing(made("DISABLED", task=task)) as env:
        host = tasks.make(task, 3, simulator="mujoco")
        with closing(host):
            _, info = env.reset(seed=[1, 6, 11])
            _, said = host.reset(seed=[1, 6, 11])
            assert [told[i] for i in info["phrasing"].tolist()] == said["instruction"].tolist()
            idle = torch.zeros(env.action_space.shape)
            _, reward, *_ = env.step(idle)
            _, earned, *_ = host.step(idle)
            torch.testing.assert_close(reward, earned, atol=APART, rtol=0)
            assert reward.unique().numel() == 3
        _, info = env.reset(
            seed=[2, None, None], options={"reset_mask": np.array([True, False, False])}
        )
        assert info["phrasing"].tolist() == [2, 6, 11]


# -- every task -----------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("task", [t for t in tasks.list_tasks() if t in EXPERTS or t in REFUSED])
def test_every_task_goes_as_in_mujoco_or_is_refused(engine, task):
    if task in REFUSED:
        with pytest.raises(TaskError, match=REFUSED[task]):
            DeviceTask(task, 2, "cpu", starts=2)
        return
    with (
        closing(DeviceTask(task, 2, "cpu", "DISABLED", starts=1)) as env,
        closing(tasks.make(task, simulator="mujoco")) as host,
    ):
        seed = env.seeds[0]
        plan = SHORT * np.asarray(list(find_expert(task)(host, seed)), np.float32)
        env.reset(seed=[seed, seed])
        host.reset(seed)
        for action in plan[:8]:
            obs, *_, info = env.step(np.repeat(action[None], 2, 0))
            seen, *_, told = host.step(action[None])
            joints = torch.from_numpy(host.state.joint_positions)
            found = env.state.joint_positions
            assert (found - joints).abs().max() <= PRESSED
            assert torch.equal(found[0], found[1])
            assert torch.equal(info["success"], told["success"].expand(2))
        assert not info["overflowed"].any()
