import numpy as np
import pytest

import tasks
from robot_layouts.simulation.sapien3.backend import worlds_below
from tasks import TaskEnv

HALF = 0.02


def put(env: TaskEnv, **places: tuple[float, float, float]) -> dict[str, np.ndarray]:
    """Put bodies somewhere and return what the task tells of them."""
    for name, position in places.items():
        env.simulation.worlds[0].set_pose(name, position)
    return env.evaluate(env.simulation.read())


@pytest.mark.parametrize(
    ("cube", "stacked"),
    [
        ((0.0, 0.0, 3 * HALF), True),
        ((0.033, 0.0, 3 * HALF), True),  # a half diagonal and 5 mm: 33.3 mm
        ((0.034, 0.0, 3 * HALF), False),
        ((0.0, 0.0, 3 * HALF + 0.0049), True),
        ((0.0, 0.0, 3 * HALF + 0.0051), False),
        ((0.0, 0.0, 3 * HALF - 0.0051), False),
    ],
)
@pytest.mark.parametrize("task_id", ["StackCube-v1", "TwoRobotStackCube-v1"])
def test_what_counts_as_stacked(task_id: str, cube: tuple[float, float, float], stacked: bool):
    found = put(tasks.make(task_id), cubeB=(0.0, 0.0, HALF), cubeA=cube)
    assert found["is_cubeA_on_cubeB"].item() is stacked


def test_a_stack_must_be_at_rest():
    env = tasks.make("StackCube-v1")
    stack = {"cubeB": (0.0, 0.0, HALF), "cubeA": (0.0, 0.0, 3 * HALF)}
    assert put(env, **stack)["success"].all()
    cube = worlds_below(env.simulation)[0].bodies["cubeA"].component
    cube.set_angular_velocity([0.0, 0.0, 0.6])
    assert not put(env, **stack)["success"].any()


@pytest.mark.parametrize(
    ("top", "success"),
    [
        ((0.0, 0.021, 3 * HALF), True),
        ((0.0, 0.021, -HALF), True),  # native takes the size of the difference in height
        ((0.0, 0.021, HALF), False),
        ((0.0, 0.105, 3 * HALF), False),
    ],
)
def test_what_counts_as_a_pyramid(top: tuple[float, float, float], success: bool):
    base = {"cubeA": (0.0, 0.0, HALF), "cubeB": (0.0, 0.042, HALF)}
    found = put(tasks.make("StackPyramid-v1"), **base, cubeC=top)
    assert found["success"].item() is success


def test_the_sphere_must_lie_in_the_bin():
    env = tasks.make("PlaceSphere-v1")
    bin_position = (0.05, 0.0, 0.0025)
    assert put(env, bin=bin_position, sphere=(0.05, 0.004, 0.025))["success"].all()
    assert not put(env, bin=bin_position, sphere=(0.05, 0.006, 0.025))["success"].any()
    assert not put(env, bin=bin_position, sphere=(0.05, 0.0, 0.031))["success"].any()


def test_the_lower_cube_must_reach_its_target():
    env = tasks.make("TwoRobotStackCube-v1")
    goal = (0.0, -0.1, 1e-3)
    for y, placed in ((-0.041, True), (-0.039, False)):
        found = put(env, goal_region=goal, cubeB=(0.0, y, HALF), cubeA=(0.0, y, 3 * HALF))
        assert found["is_cubeA_on_cubeB"].all()
        assert found["cubeB_placed"].item() is placed
        assert found["success"].item() is placed
