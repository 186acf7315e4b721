"""The comparison notices clones that are slightly wrong, and passes native against native."""

from dataclasses import replace

import numpy as np
import pytest

import tasks
from layouts import Layout
from parity.episodes import random_episodes
from parity.lockstep import EpisodeResult, NativeSide, OurSide, compare
from robot_layouts.simulation import State
from robot_layouts.simulation.sapien3.world import BuiltWorld
from robots import RobotDescriptor, RobotRegistry
from tasks.episode import Episode
from tests.motions import touching_episode
from tests.native import NATIVE, against_native, complaints, pair
from tests.quick import quick_cases

pytestmark = NATIVE

MUTATED = ("PickCube-v1", "PushT-v1", "TwoRobotPickCube-v1")  # this tests the tester, not tasks
PANDA = RobotRegistry.load("panda")


def with_arm(robot: RobotDescriptor, **changes: float) -> RobotDescriptor:
    arm = robot.action_split.groups["arm"]
    return replace(robot, action_split=robot.action_split.replace(arm=replace(arm, **changes)))


def quantities(result: EpisodeResult) -> set[str]:
    return {quantity for quantity, delta in result.max_difference.items() if delta > 0}


def play(task_id: str, episode: Episode, **made_with) -> EpisodeResult:
    """Compare native with a task made differently, over one episode."""
    (result,) = against_native(task_id, tasks.make(task_id, **made_with)).play([episode])
    return result


@pytest.mark.parametrize("task_id", quick_cases(MUTATED, MUTATED[:1]))
def test_native_equals_native(task_id):
    first = pair(task_id).native
    episodes = [*random_episodes([0], 40, first.action_dim), touching_episode(task_id, 1)]
    results = list(compare(first, NativeSide(task_id), episodes))
    assert complaints(results) == []
    assert results[1].contact_steps > 0


@pytest.mark.parametrize("task_id", quick_cases(MUTATED, MUTATED[:1]))
def test_stiffer_drives(task_id):
    layout = tasks.get_task_class(task_id).layout
    stiffer = {name: with_arm(p.robot, stiffness=1010.0) for name, p in layout.items()}
    episode = random_episodes([0], 10, layout.action_dim)[0]
    result = play(task_id, episode, robots=stiffer)
    assert result.first_difference.step == 1
    assert {"qpos", "qvel", "observation"} <= quantities(result)


def test_an_action_range_wider_by_one_bit():
    upper = float(np.nextafter(np.float32(0.1), np.float32(1)))
    result = play(
        "PickCube-v1",
        random_episodes([0], 60, 8)[0],
        robots={"arm": with_arm(PANDA, upper=upper)},
    )
    assert {"qpos", "observation"} <= quantities(result)
    assert result.max_difference["qpos"] < 1e-3, "a tolerance would have let this pass"


def test_slippery_fingers():
    material = replace(PANDA.gripper_material, static_friction=0.3, dynamic_friction=0.3)
    slippery = replace(PANDA, gripper_material=material)
    without_touch = random_episodes([0], 20, 8)[0]
    assert play("PickCube-v1", without_touch, robots={"arm": slippery}).equal
    result = play("PickCube-v1", touching_episode("PickCube-v1", 0), robots={"arm": slippery})
    assert result.first_difference.step > 10, "before the fingers touched the cube"
    assert {"object pose", "object velocity"} <= quantities(result)


def test_arms_that_swapped_places():
    layout = tasks.get_task_class("TwoRobotPickCube-v1").layout
    swapped = Layout({"left": layout["right"], "right": layout["left"]})
    result = play("TwoRobotPickCube-v1", random_episodes([0], 5, 16)[0], layout=swapped)
    assert result.first_difference.step == 0
    assert {"root", "observation"} <= quantities(result)


def test_arms_that_swapped_their_actions(monkeypatch):
    episode = random_episodes([0], 5, 16)[0]
    env = tasks.make("TwoRobotPickCube-v1")
    both = against_native("TwoRobotPickCube-v1", env)
    straight = both.ours.step
    monkeypatch.setattr(both.ours, "step", lambda actions: straight(np.roll(actions, 8, axis=1)))
    (result,) = both.play([episode])
    assert result.first_difference.step == 1
    assert "qpos" in quantities(result)


@pytest.mark.parametrize("task_id", quick_cases(MUTATED, MUTATED[:1]))
def test_velocities_that_outlive_a_reset(task_id, monkeypatch):
    """Only in reused worlds, and only where the episode before ended in motion."""
    monkeypatch.setattr(BuiltWorld, "clear", _forgets_to_stop)
    both = against_native(task_id, tasks.make(task_id))
    in_motion = [
        Episode(seed, touching_episode(task_id, seed).actions[:cut])
        for seed in range(4)
        for cut in (40, 52, 60)
    ]
    assert both.play(in_motion[:1], "fresh")[0].equal
    both.forget()
    results = compare(both.native, both.ours, in_motion, history="reused")
    wrong = next((result for result in results if not result.equal), None)
    assert wrong is not None, "no episode ended in motion"
    assert wrong.first_difference.step == 0, "a reset returns velocities"


def _forgets_to_stop(world: BuiltWorld) -> None:
    for body in world.bodies.values():
        if body.declared.anchored:
            body.entity.set_pose(body.start_pose)


def test_a_threshold(monkeypatch):
    is_static = State.is_static
    monkeypatch.setattr(
        State, "is_static", lambda s, robot, speed: is_static(s, robot, 1.25 * speed)
    )
    both = against_native("PickCube-v1", tasks.make("PickCube-v1"))
    results = both.play([touching_episode("PickCube-v1", seed) for seed in range(3)])
    found = [result for result in results if not result.equal]
    assert [quantities(result) for result in found] == [{"info"}] * len(found) != []
    assert {result.first_difference.entry for result in found} == {"is_robot_static"}


def test_a_weaker_notion_of_grasping():
    picky = replace(PANDA, fingers=replace(PANDA.fingers, min_force=30.0))
    result = play("PickCube-v1", touching_episode("PickCube-v1", 0), robots={"arm": picky})
    assert {"info", "observation", "reward"} <= quantities(result)
    assert "object pose" not in quantities(result)


def test_another_reward_mode():
    ours = OurSide(tasks.make("PickCube-v1", reward_mode="dense"))
    native = pair("PickCube-v1").native
    (result,) = compare(native, ours, random_episodes([0], 5, 8))
    assert quantities(result) == {"reward"}


@pytest.mark.long
def test_one_environment_of_a_batch(monkeypatch):
    """A mistake in one environment is found, and not laid at its neighbours' door."""
    both = pair("PickCube-v1", num_envs=8)
    straight = both.ours.step

    def meddle(actions):
        actions = actions.copy()
        actions[3, 0] += 0.01
        return straight(actions)

    monkeypatch.setattr(both.ours, "step", meddle)
    results = both.play(random_episodes(range(8), 5, 8))
    assert [result.seed for result in results if not result.equal] == [3]
