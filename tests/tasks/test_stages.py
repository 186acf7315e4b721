"""Stages, instructions and settings: what a task says of an episode besides its success."""

from contextlib import closing

import gymnasium
import numpy as np
import pytest

import tasks
from layouts import single
from robots import TaskError, UnknownNameError
from tasks import Area, CellTask, Cube, Randomization, Table, Uniform, register_task
from tasks.description import instruction_of
from tasks.interfaces.vector import VectorTask
from tests.tasks.own import put

FAR, NEAR, HIGH = (0.2, 0.3, 0.02), (0.2, -0.3, 0.02), (0.2, -0.3, 0.3)
PHRASES = ("Raise the cube.", "Lift the cube up.", "Up with it.")


class StagedLift(CellTask):
    """Raise the cube over the middle."""

    layout = single({"arm": "panda"})
    max_episode_steps = 20
    instruction = PHRASES
    stages = {"is_near": 0.3, "is_above": 0.6, "success": 1.0}  # noqa: RUF012
    varied = {"mass": {"cube": Uniform(0.5, 2.0)}}  # noqa: RUF012
    table = Table()
    cube = Cube(0.02, spawn=Area(x=(-0.1, 0.1), y=(0.1, 0.2), yaw=(-0.5, 0.5)))

    def evaluate(self, state):
        """Success: twice as high as above."""
        place = state.position("cube")
        near = abs(place[:, 0] - NEAR[0]) + abs(place[:, 1] - NEAR[1]) < 0.05
        return {"is_near": near, "is_above": place[:, 2] > 0.1, "success": place[:, 2] > 0.5}

    def ways(self, state):
        """Of the hand to the cube."""
        return [state.tcp_distance("arm", "cube")]


@pytest.fixture(scope="module", autouse=True)
def registered():
    register_task("StagedLift-v1")(StagedLift)  # not before other tests have listed all tasks


@pytest.fixture
def env():
    with closing(tasks.make("StagedLift-v1")) as made:
        made.reset(seed=0)
        yield made


def passed(env, place):
    """Put the cube somewhere, take a step, and return what is told of stages."""
    put(env, cube=place)
    info = env.step(np.zeros((1, 8), np.float32))[-1]
    return int(info["stage"]), str(info["stage_name"][0]), round(float(info["stage_score"]), 6)


class TestStages:
    def test_they_are_passed_in_order_and_stay_passed(self, env):
        assert passed(env, FAR) == (0, "", 0.0)
        assert passed(env, (0.2, 0.3, 0.3)) == (0, "", 0.0)  # above, but never near
        assert passed(env, NEAR) == (1, "is_near", 0.3)
        assert passed(env, FAR) == (1, "is_near", 0.3)
        assert passed(env, HIGH) == (2, "is_above", 0.6)
        assert passed(env, FAR) == (2, "is_above", 0.6)

    def test_several_are_passed_at_once(self, env):
        assert passed(env, HIGH) == (2, "is_above", 0.6)

    def test_success_passes_all(self, env):
        assert passed(env, (0.2, 0.3, 0.8)) == (3, "success", 1.0)

    def test_a_new_episode_begins_with_none(self, env):
        passed(env, HIGH)
        assert int(env.reset(seed=1)[1]["stage"]) == 0

    def test_environments_pass_them_for_themselves(self):
        with closing(tasks.make("StagedLift-v1", num_envs=2)) as env:
            env.reset(seed=0)
            state = env.get_state_dict()
            state["actors"]["cube"][1, :3] = state["actors"]["cube"].new_tensor(NEAR)
            env.set_state_dict(state)
            info = env.step(np.zeros((2, 8), np.float32))[-1]
            assert info["stage"].tolist() == [0, 1]
            assert env.reset(seed=[5], env_ids=[1])[1]["stage"].tolist() == [0, 0]

    def test_the_reward_takes_their_score(self, env):
        put(env, cube=HIGH)
        _, reward, *_ = env.step(np.zeros((1, 8), np.float32))
        near = 1.0 - np.tanh(5.0 * float(env.state.tcp_distance("arm", "cube")[0]))
        assert float(reward) == pytest.approx(0.6 * 0.6 + 0.4 * near, abs=1e-6)

    def test_tasks_without_stages_tell_nothing_of_them(self):
        with closing(tasks.make("PickCube-v1")) as plain:
            assert not {"stage", "stage_name", "stage_score", "instruction"} & {*plain.reset()[1]}

    @pytest.mark.parametrize(
        "stages",
        [
            {"success": 0.5},
            {"is_near": 0.5, "is_above": 0.4, "success": 1.0},
            {"success": 1.0, "is_near": 2.0},
            {"is_near": "half", "success": 1.0},
            ["success"],
        ],
    )
    def test_scores_that_do_not_rise_to_success_are_refused(self, stages):
        with pytest.raises(TaskError, match="Wrong.stages is .*the last {'success': 1.0}"):
            type("Wrong", (StagedLift,), {"stages": stages})(StagedLift.scenario)

    def test_a_stage_that_is_no_flag_is_refused(self):
        wrong = type("Wrong", (StagedLift,), {"stages": {"is_nera": 0.5, "success": 1.0}})
        with pytest.raises(UnknownNameError, match="'is_nera'. Did you mean 'is_near'"):
            wrong(StagedLift.scenario)


class TestInstructions:
    def test_the_seed_chooses_among_them(self):
        with closing(tasks.make("StagedLift-v1", num_envs=4)) as env:
            told = env.reset(seed=1)[1]["instruction"].tolist()
            assert told == [PHRASES[1], PHRASES[2], PHRASES[0], PHRASES[1]]
            info = env.step(np.zeros((4, 8), np.float32))[-1]
            assert info["instruction"].tolist() == told
        assert [instruction_of(StagedLift, seed) for seed in (0, 4)] == [PHRASES[0], PHRASES[1]]

    def test_gymnasium_and_its_vectors_tell_it(self):
        with closing(gymnasium.make("RobotLayouts/StagedLift-v1")) as env:
            assert env.reset(seed=2)[1]["instruction"] == PHRASES[2]
        with closing(VectorTask("StagedLift-v1", 2, 0)) as vector:
            mask = np.array([False, True])
            vector.reset(seed=3)
            info = vector.reset(seed=[None, 7], options={"reset_mask": mask})[1]
            assert info["instruction"].tolist() == [None, PHRASES[1]]

    def test_lerobot_asks_for_that_of_each_environment(self):
        with closing(tasks.lerobot_vec_env("StagedLift-v1", 2, 0)) as env:
            env.reset(seed=[4, 5])
            assert env.call("task_description") == (PHRASES[1], PHRASES[2])

    def test_none_is_refused(self):
        with pytest.raises(TaskError, match=r"instruction is \(\); a sentence is needed"):
            type("Mute", (StagedLift,), {"instruction": ()})(StagedLift.scenario)


class TestSettings:
    def test_fixed_begins_in_the_middle_of_every_area(self):
        with closing(tasks.make("StagedLift-v1", num_envs=3, randomization="fixed")) as env:
            env.reset(seed=8)
            np.testing.assert_allclose(
                env.state.position("cube"), [[0.0, 0.15, 0.02]] * 3, atol=1e-6
            )
            np.testing.assert_allclose(np.abs(env.state.quaternion("cube")[:, 0]), 1.0)

    def test_varied_is_what_the_class_declares(self):
        with closing(tasks.make("StagedLift-v1", randomization="varied")) as env:
            assert env.scenario.randomization == Randomization(**StagedLift.varied)

    def test_part_of_an_area(self):
        half = Randomization(spread=0.5)
        with (
            closing(tasks.make("StagedLift-v1", num_envs=8)) as whole,
            closing(tasks.make("StagedLift-v1", num_envs=8, randomization=half)) as part,
        ):
            for env in (whole, part):
                env.reset(seed=0)
            middle = np.array([0.0, 0.15, 0.02])
            wide, narrow = (env.state.position("cube") - middle for env in (whole, part))
            np.testing.assert_allclose(narrow, wide / 2, atol=1e-6)
        assert Randomization.from_json(half.to_json()) == half

    def test_a_setting_that_a_task_has_not_is_refused(self):
        with pytest.raises(UnknownNameError, match="setting of PickCube 'varied'.*fixed, spread"):
            tasks.make("PickCube-v1", randomization="varied")
