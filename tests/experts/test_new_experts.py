"""Experts of this project's own tasks: with how many robots, and of which kinds, they succeed."""

from dataclasses import replace

import pytest

import tasks
from layouts import Layout
from robot_layouts.experts import find_expert
from robot_layouts.experts.script import Scene
from robots import TaskError
from tasks.episode import play
from tests.tasks.test_relay import mixed, three_kinds

OWN = sorted(set(tasks.list_tasks()) - set(tasks.list_clones()))


@pytest.mark.long
@pytest.mark.parametrize("task_id", OWN)
def test_it_succeeds_on_18_of_20_seeds(task_id: str):
    env = tasks.make(task_id)
    solved = [play(env, seed, find_expert(task_id)(env, seed)).solved for seed in range(20)]
    assert sum(solved) >= 18, f"failed: {[seed for seed, good in enumerate(solved) if not good]}"


@pytest.mark.long
@pytest.mark.parametrize(
    "layout", [three_kinds(), mixed(5, 0.85), mixed(8, 0.95)], ids=("three", "five", "eight")
)
def test_the_baton_goes_round_mixed_rings(layout: Layout):
    assert len({placement.robot.name for placement in layout.values()}) >= 3
    env = tasks.make("Relay-v1", layout=layout)
    assert play(env, 0, find_expert("Relay-v1")(env, 0)).solved


def test_every_robot_of_the_relay_delivers_in_turn():
    env = tasks.make("Relay-v1")
    env.reset(0, options={"reconfigure": True})
    state = env.simulation.read()
    nearest: list[tuple[int, str]] = []
    for action in find_expert("Relay-v1")(env, 0):
        before = int(env.evaluate(state)["zones_visited"][0])
        info = env.step(action[None])[4]
        state = env.simulation.read()
        if int(info["zones_visited"][0]) > before:
            ways = {robot: float(state.tcp_distance(robot, "baton")[0]) for robot in env.layout}
            nearest.append((before, min(ways, key=ways.__getitem__)))
    assert nearest == list(enumerate(env.layout))


def test_arms_that_cannot_reach_say_so():
    env = tasks.make("TwoRobotLiftBar-v1", robots={"left": "so100"})
    with pytest.raises((TaskError, RuntimeError)):
        find_expert("TwoRobotLiftBar-v1")(env, 0)


@pytest.mark.parametrize(
    ("task_id", "place"),
    [
        ("TwoRobotLiftBar-v1", "right"),
        ("TwoRobotPushPick-v1", "picker"),
        ("FourRobotStack-v1", "north"),
    ],
)
def test_an_arm_without_fingers_is_refused(task_id: str, place: str):
    with pytest.raises(TaskError, match=f"'{place}' needs fingers .*: it is a panda_stick"):
        tasks.make(task_id, robots={place: "panda_stick"})


def test_a_gripper_pushes_where_a_stick_stood():
    env = tasks.make("TwoRobotPushPick-v1", robots={"pusher": "panda"})
    assert play(env, 0, find_expert("TwoRobotPushPick-v1")(env, 0)).solved


def test_arms_that_stand_elsewhere_are_planned_for():
    layout = tasks.get_task_class("TwoRobotLiftBar-v1").layout
    nearer = replace(layout["left"], position=(0.05, -0.65, 0.0))
    env = tasks.make("TwoRobotLiftBar-v1", layout=Layout({**layout, "left": nearer}))
    assert play(env, 0, find_expert("TwoRobotLiftBar-v1")(env, 0)).solved


@pytest.mark.long
@pytest.mark.parametrize("factor", [0.95, 1.05])
def test_four_arms_stack_cubes_of_another_size(factor: float):
    larger = tasks.Randomization(size={"cube_*": factor})
    env = tasks.make("FourRobotStack-v1", obs_mode="none", randomization=larger)
    env.reset(seed=3)
    assert Scene(env).scale("cube_west") == factor
    assert play(env, 3, find_expert(env.task_id)(env, 3)).solved
    env.close()
