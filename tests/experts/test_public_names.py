"""What `experts` offers to whoever writes one: for arms of few joints, in closed loops too."""

from dataclasses import replace

import numpy as np
import pytest

import tasks
from robot_layouts import experts
from robot_layouts.experts import (
    Waypoint,
    cube_grips,
    find_expert,
    first_success,
    held_at,
    pick,
    rehearse,
)
from robot_layouts.kinematics.rotations import rotate
from robots import ActionError, RobotRegistry
from robots.gripper_motion import gripper_turn


def test_every_name_is_explained():
    assert experts.__all__ == sorted(experts.__all__, key=lambda n: (not n.isupper(), n))
    for name in {*experts.__all__} - {"CLOSED", "OPEN", "Pose"}:
        assert name in experts.__doc__
        assert getattr(experts, name).__doc__ or name in ("Expert", "Script")


def test_jaws_whose_tips_make_the_tcp_have_a_frame():
    """Of an SO-100's fixed jaw, which points along its own -y and has the other one at -x."""
    turned = gripper_turn(RobotRegistry.load("so100"))
    np.testing.assert_allclose(rotate(turned, [0, 0, 1]), [0.07, -1, 0], atol=0.01)
    np.testing.assert_allclose(rotate(turned, [0, 1, 0]), [-1, -0.07, 0], atol=0.01)
    assert gripper_turn(RobotRegistry.load("panda")) is None
    same = replace(RobotRegistry.load("so100"), tcp_position_links=("Fixed_Jaw_tip",))
    assert gripper_turn(same) is None  # nothing says how it opens


def test_fingers_say_where_a_gripper_points_whose_tcp_link_does_not():
    """A Fetch's TCP link has x ahead, and a Panda's z."""
    turned = gripper_turn(RobotRegistry.load("fetch"))
    np.testing.assert_allclose(rotate(turned, [0, 0, 1]), [1, 0, 0], atol=0.01)
    np.testing.assert_allclose(rotate(turned, [0, 1, 0]), [0, 1, 0], atol=0.01)


def test_a_limb_whose_tips_make_its_tcp_has_a_frame_too():
    dual = RobotRegistry.load("mobile_panda_dual")
    fingers = ("left_panda_leftfinger", "left_panda_rightfinger")
    left = replace(dual.limbs["left"], tcp_link="left_panda_hand", tcp_position_links=fingers)
    limb = replace(dual, limbs={**dual.limbs, "left": left}).parts["left"]
    turned = gripper_turn(limb)
    np.testing.assert_allclose(rotate(turned, [0, 0, 1]), [0, 0, 1], atol=0.01)
    np.testing.assert_allclose(np.abs(rotate(turned, [0, 1, 0])), [0, 1, 0], atol=0.01)


def _pick_small_cube(scene):
    """Grips a little above the cube's middle, jaws half closed, then carried in parts."""

    def grips(scene):
        position, quaternion = scene.body("cube")
        return cube_grips((position + [0, 0, 0.004], quaternion))

    def goal(scene):
        return held_at(scene, "arm", "cube", scene.body("goal_site")[0], yaws=(0, 0.4, -0.4))

    carry = (Waypoint(f"carry {i}", goal, 0.0, near=0.03) for i in range(6))
    return [{"arm": [*pick("arm", "cube", grips, opening=-0.2, above=0.04, around=0.08), *carry]}]


def test_an_arm_whose_tcp_is_no_link_picks_like_any_other():
    task = tasks.make("PickCubeSO100-v1", max_episode_steps=100)
    plan = first_success(task, 7, _pick_small_cube)
    task.close()
    assert plan.reason == ""
    assert len(plan) < 100


def test_a_closed_loop_acts_until_it_succeeds():
    task = tasks.make("PushCube-v1")
    plan = find_expert("PushCube-v1")(task, 0)
    left = iter(plan)
    looped = rehearse(task, 0, lambda scene: {"arm": next(left)})
    np.testing.assert_array_equal(looped, plan)
    assert looped.reason == ""
    still = rehearse(task, 0, lambda scene: np.zeros(8))
    assert still.reason == "no success within 50 steps"
    with pytest.raises(ActionError, match=r"shape \(1, 7\); it must be \(1, 8\)"):
        rehearse(task, 0, lambda scene: np.zeros(7))
    task.close()
