"""Scripts are played as they are written, for one arm as for two."""

import gc
import re
import weakref
from collections.abc import Iterator
from functools import partial

import numpy as np
import pytest

import tasks
from robot_layouts.experts import find_expert
from robot_layouts.experts.geometry import gripper_facing, nearest_quarter_turn, yaw_of
from robot_layouts.experts.rehearsal import (
    Attempt,
    Rehearsal,
    first_success,
    rehearse,
    rehearsed,
    rehearsing,
    search,
)
from robot_layouts.experts.script import CLOSED, OPEN, Pose, Scene, Waypoint
from robots import TaskError, UnknownNameError
from tasks.episode import play
from tests.data.expert_plays import same_episodes
from tests.tasks.randomization.declarations import TASK, VARIED

FORWARD, DOWN = 0.0, gripper_facing(0.0, 0.0)


def over_cube(scene: Scene, above: float) -> list[Pose]:
    position, quaternion = scene.body("cube")
    direction = nearest_quarter_turn(yaw_of(quaternion))
    return [(position + [0, 0, above], gripper_facing(direction, 0.0))]


def to_goal(scene: Scene) -> list[Pose]:
    return [(scene.body("goal_site")[0], scene.tcp("arm")[1])]


HELD = partial(Scene.grasps, robot="arm", body="cube")
PICK = {
    "arm": (
        Waypoint("above", partial(over_cube, above=0.06), OPEN, near=0.1),
        Waypoint("around", partial(over_cube, above=0.0), OPEN, near=0.02),
        Waypoint("grasp", None, CLOSED, steps=3, until=HELD),
        Waypoint("carry", to_goal, CLOSED, near=0.0),
    )
}


def nowhere(scene: Scene) -> list[Pose]:
    return [(np.array([5.0, 0.0, 0.0]), DOWN)]


def test_one_arm_plays_a_script():
    task = tasks.make("PickCube-v1")
    actions = first_success(task, 0, lambda scene: [PICK])
    assert len(actions) < 50
    assert play(task, 0, actions).solved


def test_a_plan_that_fails_is_returned_as_it_is():
    task = tasks.make("PickCube-v1")
    actions = first_success(task, 0, lambda scene: [{}])
    assert actions.shape == (50, 8)
    assert actions.reason == "the episode ended at arm.start"
    assert not play(task, 0, actions).solved


def test_a_script_that_is_done_has_some_time_to_succeed():
    task = tasks.make("PickCube-v1", max_episode_steps=400)
    script = {"arm": PICK["arm"][:1]}  # above the cube, and no farther
    actions = first_success(task, 0, lambda scene: [script])
    assert len(actions) < 200
    assert actions.reason == "the script ended at arm.above"


def test_no_plan_at_all_is_an_error():
    script = {"arm": (Waypoint("far", nowhere),)}
    with pytest.raises(TaskError, match=r"^no plan: arm\.far is out of reach"):
        first_success(tasks.make("PickCube-v1"), 3, lambda scene: [script])


def test_attempts_end_with_the_first_that_succeeds():
    """Each is made from a fresh world, and sees what came of the one before."""
    lifted: list[bool] = []

    def attempts(rehearsal: Rehearsal) -> Iterator[Attempt]:
        for script in ({"arm": PICK["arm"][:3]}, PICK, {}):
            rehearsal.begin(0)
            yield rehearsal.play(script)
            lifted.append(rehearsal.scene().grasps("arm", "cube"))

    task = tasks.make("PickCube-v1")
    actions = search(task, 0, attempts)
    assert lifted == [True]
    np.testing.assert_array_equal(actions, first_success(task, 0, lambda scene: [PICK]))


def test_a_rehearsal_of_a_world_that_varies_is_what_its_actions_do_again():
    task = tasks.make(TASK, randomization=VARIED)
    plan = find_expert(TASK)(task, 0)
    happened = rehearsed(task, 0, plan)
    assert happened is not None
    assert happened.drawn is not None
    assert same_episodes(happened, play(task, 0, plan))


def test_a_closed_loop_that_fails_was_an_episode_too():
    task = tasks.make("PickCube-v1", reward_mode="sparse", max_episode_steps=9)
    plan = rehearse(task, 4, lambda scene: np.full(8, 0.1))
    happened = rehearsed(task, 4, plan)
    assert happened is not None
    assert same_episodes(happened, play(task, 4, plan))
    assert happened.reason == plan.reason == "no success within 9 steps"


def test_other_actions_than_those_rehearsed_have_no_episode_yet():
    task, other = (tasks.make("PickCube-v1", max_episode_steps=9) for _ in range(2))
    plan = rehearse(task, 0, lambda scene: np.zeros(8))
    assert rehearsed(task, 0, plan) is not None
    assert rehearsed(task, 1, plan) is None
    assert rehearsed(other, 0, plan) is None
    assert rehearsed(task, 0, plan[:-1]) is None
    plan[3, 2] = 0.5
    assert rehearsed(task, 0, plan) is None
    assert rehearsed(task, 0, np.zeros((9, 8), np.float32)) is None


STILL = np.zeros((4, 8), np.float32)


def sets_state_back(rehearsal: Rehearsal) -> None:
    before = rehearsal.task.get_state_dict()
    rehearsal.task.step(STILL[:1] + 1.0)
    rehearsal.task.set_state_dict(before)


@pytest.mark.parametrize(
    ("interlude", "kept"),
    [
        (lambda rehearsal: None, True),
        (lambda rehearsal: rehearsal.task.step(STILL[:1]), False),
        (lambda rehearsal: rehearsal.task.reset(0), False),
        (lambda rehearsal: rehearsal.task.set_state_dict(rehearsal.task.get_state_dict()), False),
        (sets_state_back, False),
    ],
    ids=["nothing", "a step", "a reset", "a state", "a look ahead"],
)
def test_what_does_not_follow_from_the_actions_alone_is_no_episode(interlude, kept: bool):
    """Another begin forgets it."""
    rehearsal = Rehearsal(tasks.make("PickCube-v1"))
    rehearsal.begin(0)
    rehearsal.step(STILL[0])
    interlude(rehearsal)
    for action in STILL[1:]:
        rehearsal.step(action)
    assert (rehearsal.episode(STILL) is not None) == kept
    rehearsal.begin(0)
    assert rehearsal.episode(STILL[:0]) is None
    for action in STILL:
        rehearsal.step(action)
    assert rehearsal.episode(STILL) is not None


def test_a_task_has_one_private_copy_which_is_lent_once():
    task = tasks.make("PickCube-v1")
    with rehearsing(task) as first, rehearsing(task) as inner:
        assert inner is not first
    with rehearsing(task) as again:
        assert again is first
    with pytest.raises(ZeroDivisionError), rehearsing(task) as lost:
        1 / 0  # noqa: B018
    with rehearsing(task) as fresh:
        assert fresh is not lost


def test_a_private_copy_goes_with_its_task():
    task = tasks.make("PickCube-v1")
    with rehearsing(task) as rehearsal:
        copy = weakref.ref(rehearsal.task)
    del rehearsal, task
    gc.collect()
    assert copy() is None


def test_a_waypoint_turns_joints():
    rehearsal = Rehearsal(tasks.make("PickCube-v1"))
    start = rehearsal.begin(0).qpos("arm")
    change = np.array([0.3, 0, 0, 0.2, 0, 0, -0.1])
    rehearsal.play({"arm": (Waypoint("turn", turn=lambda arm: change),)})
    np.testing.assert_allclose(rehearsal.scene().qpos("arm")[:7] - start[:7], change, atol=0.01)


@pytest.mark.parametrize("heading", [-1.4, 0.0, 1.4])
@pytest.mark.parametrize("distance", [0.25, 0.35])
def test_an_arm_of_few_joints_reaches_a_place(heading: float, distance: float):
    rehearsal = Rehearsal(tasks.make("PickCubeSO100-v1"))
    rehearsal.begin(0)
    base = np.array(rehearsal.task.layout["arm"].base_position)
    place = base + [distance * np.cos(heading), distance * np.sin(heading), 0.1]
    go = Waypoint("go", at=lambda scene: place)
    for _ in range(2):  # 50 steps are not enough to turn so far
        rehearsal.play({"arm": (go,)})
    np.testing.assert_allclose(rehearsal.scene().tcp("arm")[0], place, atol=0.01)


@pytest.fixture(scope="module")
def two_arms() -> Rehearsal:
    return Rehearsal(tasks.make("TwoRobotPickCube-v1"))


@pytest.mark.parametrize(("careful", "farthest"), [(False, 0.5), (True, 0.01)])
def test_a_careful_arm_comes_to_rest_before_it_goes_on(careful: bool, farthest: float):
    begun: list[float] = []

    def down(scene: Scene) -> list[Pose]:
        place, quaternion = scene.tcp("arm")
        begun.append(float(np.linalg.norm(place - over_cube(scene, 0.3)[0][0])))
        return [(place - (0.0, 0.0, 0.05), quaternion)]

    rehearsal = Rehearsal(tasks.make("PickCube-v1"))
    rehearsal.begin(0)
    over = Waypoint("over", partial(over_cube, above=0.3), near=0.3)
    script = {"arm": (over, Waypoint("down", down))}
    rehearsal.play(script, around=True, careful=careful)
    assert farthest / 10 < begun[0] < farthest


def test_a_careful_arm_that_is_kept_from_its_pose_goes_on_where_it_is_near_enough():
    def into_the_table(scene: Scene) -> list[Pose]:
        (x, y, _), quaternion = scene.tcp("arm")
        return [(np.array([x, y + 0.15, -0.02]), quaternion)]

    rehearsal = Rehearsal(tasks.make("PickCube-v1"))
    rehearsal.begin(0)
    script = {"arm": (Waypoint("press", into_the_table, CLOSED, near=0.2), Waypoint("open", None))}
    attempt = rehearsal.play(script, careful=True)
    assert "blocked" not in attempt.reason
    assert attempt.actions[-1, 7] == OPEN


def test_a_waypoint_waits_for_another_robot(two_arms):
    """Without it the left arm opens its fingers at once; with it after 10 steps of the right."""
    two_arms.begin(0)
    attempt = two_arms.play(
        {
            "left": (
                Waypoint("shut", None, CLOSED),
                Waypoint("open", None, OPEN, after=("right.wait",)),
            ),
            "right": (Waypoint("wait", None, steps=10),),
        }
    )
    fingers = attempt.actions[:, 7].tolist()
    assert 8 <= fingers.index(OPEN) <= 12
    assert set(fingers[: fingers.index(OPEN)]) == {CLOSED}


def both_to_the_middle(scene: Scene) -> list[Pose]:
    return [(np.array([0.0, 0.0, 0.3]), scene.tcp("left")[1])]


def test_arms_that_touch_have_failed(two_arms):
    """The attempt ends there and says who; so does a closed loop."""
    crash = {name: (Waypoint("middle", both_to_the_middle),) for name in ("left", "right")}
    two_arms.begin(0)
    attempt = two_arms.play(crash)
    assert not attempt.success
    assert re.fullmatch(r"(left|right)\.panda_\w+ touches (left|right)\.panda_\w+", attempt.reason)
    assert len(attempt.actions) < 60
    actions = iter(attempt.actions)
    assert rehearse(two_arms.task, 0, lambda scene: next(actions)).reason == attempt.reason


def test_waiting_for_an_unknown_waypoint_is_refused(two_arms):
    script = {"left": (Waypoint("idle", after=("left.ilde",)),)}
    with pytest.raises(
        UnknownNameError, match=r"waypoint.*'left\.ilde'. Did you mean 'left\.idle'"
    ):
        two_arms.play(script)


def test_an_unknown_robot_is_refused(two_arms):
    with pytest.raises(UnknownNameError, match="robot of this layout 'lefd'. Did you mean 'left'"):
        two_arms.play({"lefd": (Waypoint("idle"),)})
