"""TwoRobotPushPick: the cube starts out of the picker's reach, and has to be held at the goal."""

import numpy as np
import pytest

import tasks
from robot_layouts.experts import find_expert
from robot_layouts.experts.geometry import gripper_facing
from robot_layouts.experts.script import Scene
from robot_layouts.simulation.sapien3.arms import SapienArm
from robot_layouts.simulation.sapien3.backend import worlds_below
from robot_layouts.simulation.solvers import InverseKinematics
from robots import TaskError
from tests.tasks.own import look, make, put

TASK = "TwoRobotPushPick-v1"


@pytest.mark.parametrize("seed", range(5))
def test_the_cube_starts_where_only_the_pusher_reaches_it(seed: int):
    env = tasks.make(TASK)
    env.reset(seed)
    scene, world = Scene(env), worlds_below(env.simulation)[0]
    cube, goal = scene.body("cube")[0], scene.body("goal_site")[0]

    def reaches(robot: str, place: np.ndarray, forward: float) -> bool:
        solver = InverseKinematics(SapienArm(world, robot))
        poses = [(place, gripper_facing(forward, lean)) for lean in np.radians((0, 20, 40))]
        return any(solver.solve(*pose, scene.qpos(robot)) is not None for pose in poses)

    assert reaches("pusher", cube, np.pi / 2)
    assert not reaches("picker", cube, -np.pi / 2)
    assert reaches("picker", goal, -np.pi / 2)


def test_within_reach_is_told_by_the_cubes_place():
    env = make(TASK)
    assert not put(env, cube=(0.0, -0.06, 0.02))["is_cube_in_reach"].any()
    assert put(env, cube=(0.0, -0.04, 0.02))["is_cube_in_reach"].all()


def test_at_the_goal_but_not_held_is_no_success():
    env = make(TASK)
    goal = env.simulation.read().position("goal_site")[0].tolist()
    told = put(env, cube=tuple(goal))
    assert told["is_cube_placed"].all()
    assert not told["success"].any()
    x, y, z = goal
    assert not put(env, cube=(x, y, z + 0.026))["is_cube_placed"].any()


def test_rewards_rise_to_their_largest():
    env = tasks.make(TASK)
    env.reset(1, options={"reconfigure": True})
    plan = find_expert(TASK)(env, 1)
    steps = [env.step(action[None]) for action in plan]
    rewards = [float(step[1][0]) for step in steps]
    assert rewards[-1] == 1.0
    assert max(rewards[:-1]) < 1.0
    held = [bool(step[4]["is_cube_grasped"][0]) for step in steps]
    assert max(rewards[: held.index(True)]) < min(rewards[held.index(True) :])
    assert look(env)["success"].all()


def test_a_stick_in_the_pickers_place_is_refused():
    with pytest.raises(TaskError, match="'picker' needs fingers that grasp, and it has none"):
        make(TASK, robots={"picker": "panda_stick"})
