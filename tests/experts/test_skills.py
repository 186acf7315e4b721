"""Skills in physics: arms take things, put them down, push, pour, and work together."""

from math import pi

import numpy as np
import pytest

import tasks
from layouts import Layout, Placement, single
from objects import ObjectRegistry
from robot_layouts import experts
from robot_layouts.experts import (
    Scene,
    Waypoint,
    first_success,
    grasp,
    hand_over,
    insert,
    lift,
    lift_together,
    place,
    point_at,
    pour,
    pouring,
    press,
    resting,
)
from robot_layouts.experts.rehearsal import rehearsing
from robots import RobotRegistry, TaskError, UnknownNameError
from robots.grafting import with_gripper
from tasks import Area, MultiRobotTask, Object, register_task

load = ObjectRegistry.load
LEFT = Area(x=-0.05, y=-0.2)
RIGHT = Area(x=-0.05, y=0.2)


class OneArm(MultiRobotTask):
    """A Panda before a table."""

    layout = single({"arm": "panda"})
    max_episode_steps = 300


class TwoArms(MultiRobotTask):
    """A Panda and a UR5 with a Panda's hand, face to face."""

    layout = Layout(
        {
            "left": Placement("panda", (-0.1, -0.55, 0.0), rpy=(0.0, 0.0, pi / 2)),
            "right": Placement(
                with_gripper(RobotRegistry.load("ur5"), "panda"),
                (-0.1, 0.55, 0.0),
                rpy=(0.0, 0.0, -pi / 2),
            ),
        }
    )
    max_episode_steps = 500


def made(cls):
    register_task(f"TestSkill{cls.__name__}-v1")(cls)
    return tasks.make(f"TestSkill{cls.__name__}-v1", obs_mode="none", check_layout=False)


def played(env, script, seed=0):
    """Plan with a script, check that the plan holds in the caller's own world, and return it."""
    plan = first_success(env, seed, lambda scene: [script])
    assert plan.reason == ""
    env.reset(seed=seed)
    for action in plan:
        info = env.step(action[None])[4]
    assert info["success"].all()
    return plan


class Put(OneArm):
    mug = Object("mug", spawn=Area(x=-0.05, y=-0.2, yaw="any"))
    tray = Object("tray", spawn=RIGHT)

    def evaluate(self, state):
        """Success: the mug stands on the tray, and the gripper has left it."""
        near = state.planar_distance("mug", "tray") < 0.05
        stands = state.position("mug")[:, 2] < 0.02
        return {"success": near & stands & (state.tcp_distance("arm", "mug") > 0.12)}


def test_a_thing_is_put_on_another_one():
    env, mug, tray = made(Put), load("mug"), load("tray")
    there = resting(mug, lambda scene: point_at(scene, "tray", tray.point("middle"))[0])
    taken = grasp(env, "arm", "mug", mug, goals=there, up=0.08)
    names = [waypoint.name for waypoint in (*taken, *place(env, "arm", "mug", there))]
    assert names == [
        *("above mug", "around mug", "grasp mug", "hold mug"),
        *("over mug", "place mug", "release mug", "leave mug"),
    ]
    played(env, {"arm": (*taken, *place(env, "arm", "mug", there))})


def test_parts_that_may_be_held_are_those_that_the_grasps_name():
    env = made(Put)
    with pytest.raises(TaskError, match="mug is grasped at handle, rim, not at 'spout'"):
        grasp(env, "arm", "mug", load("mug"), parts=["spout"])


def test_a_gripper_that_opens_for_no_grasp_says_so():
    env = made(Put)
    wide = load("brick").scaled(2.5)
    with pytest.raises(TaskError, match="'arm' takes what is less than 72 mm wide; brick is 150"):
        grasp(env, "arm", "mug", wide)


class Walled(MultiRobotTask):
    layout = Layout({"arm": Placement("so101", (-0.36, 0.0, 0.0))})
    max_episode_steps = 200
    box = Object("box", spawn=Area(x=-0.1, y=0.0, yaw=0.4))

    def evaluate(self, state):
        """Success: the arm holds it above the table."""
        return {"success": (state.position("box")[:, 2] > 0.02) & state.is_grasping("arm", "box")}


def test_jaws_that_swing_close_on_a_thin_wall_without_pushing_it_away():
    env, box = made(Walled), load("box")
    played(env, {"arm": (*grasp(env, "arm", "box", box), *lift(env, "arm", "box", 0.04))})


class Leaning(MultiRobotTask):
    layout = Walled.layout
    max_episode_steps = 100
    jug = Object("jug", spawn=Area(x=-0.1, y=0.012, yaw=0.36))

    def evaluate(self, state):
        """Success: the arm holds it."""
        return {"success": state.is_grasping("arm", "jug")}


def test_a_hand_leans_where_the_arm_cannot_draw_it_back_from_a_grasp_else():
    env, jug = made(Leaning), load("jug")
    played(env, {"arm": grasp(env, "arm", "jug", jug, up=0.045)})


class Turned(MultiRobotTask):
    layout = Layout({"arm": Placement("so101", (-0.364, 0.0, 0.0))})
    max_episode_steps = 100
    peg = Object("peg", spawn=Area(x=-0.0884, y=-0.0099, yaw=-2.96))

    def evaluate(self, state):
        """Success: the arm holds it above the table."""
        return {"success": (state.position("peg")[:, 2] > 0.02) & state.is_grasping("arm", "peg")}


def test_what_an_arm_of_few_joints_holds_turns_with_its_hand_and_so_is_not_in_its_jaws():
    env, peg = made(Turned), load("peg")
    script = {"arm": (*grasp(env, "arm", "peg", peg, up=0.045), *lift(env, "arm", "peg", 0.045))}
    assert "no room to lift" not in first_success(env, 0, lambda scene: [script]).reason


class Far(OneArm):
    mug = Object("mug", spawn=Area(x=0.3, y=0.5))

    def evaluate(self, state):
        """Never."""
        return {"success": state.position("mug")[:, 2] > 10.0}


def test_a_plan_says_what_is_out_of_reach():
    env, mug = made(Far), load("mug")
    with pytest.raises(TaskError, match="'arm' cannot reach far enough to take mug"):
        first_success(env, 0, lambda scene: [{"arm": grasp(env, "arm", "mug", mug)}])


class Button(OneArm):
    bell = Object("button", kind="kinematic", spawn=Area(x=-0.05, y=0.1, yaw=0.5))

    def evaluate(self, state):
        """Success: it is pressed."""
        return {"success": state.joint("bell", "cap") > 0.006}


def test_closed_fingers_press_a_button():
    env, button = made(Button), load("button")
    pressed = press(env, "arm", "bell", button, "cap", 0.006, point=button.point("top"))
    played(env, {"arm": pressed})
    with pytest.raises(UnknownNameError, match="cap"):
        press(env, "arm", "bell", button, "lid", 0.006, point=button.point("top"))


class Socket(OneArm):
    peg = Object("peg", spawn=Area(x=-0.05, y=-0.2, yaw=0.4))
    socket = Object("socket", kind="kinematic", scale=1.2, spawn=Area(x=-0.05, y=0.15))

    def evaluate(self, state):
        """Success: the peg is in, by 2 cm at least; the hole is 65 mm above the table."""
        near = state.planar_distance("peg", "socket") < 0.008
        return {"success": near & (state.position("peg")[:, 2] < 0.044)}


@pytest.mark.long
def test_a_peg_goes_into_a_wide_socket():
    env, peg, socket = made(Socket), load("peg"), Socket.socket.descriptor

    def hole(scene):
        return point_at(scene, "socket", socket.point("hole"))

    script = (
        *grasp(env, "arm", "peg", peg, parts=["end"], up=0.1),
        *lift(env, "arm", "peg", 0.12),
        *insert(env, "arm", "peg", peg.point("tip"), hole, 0.025),
    )
    played(env, {"arm": script})


class Pour(OneArm):
    jug = Object("jug", spawn=LEFT)
    bowl = Object("bowl", kind="kinematic", spawn=RIGHT)

    def evaluate(self, state):
        """Success: the jug is held over the bowl, and its opening looks aside."""
        turned = state.pose("jug")[:, 3:]
        upright = 1 - 2 * (turned[:, 1] ** 2 + turned[:, 2] ** 2)
        over = state.planar_distance("jug", "bowl") < 0.25
        return {"success": (upright < 0.1) & over & state.is_grasping("arm", "jug")}


@pytest.mark.long
def test_a_jug_is_poured_out_over_a_bowl():
    env, jug = made(Pour), load("jug")
    spout = jug.point("spout")

    def over(scene):
        return scene.body("bowl")[0] + (0.0, 0.0, 0.22)

    script = (
        *grasp(env, "arm", "jug", jug, up=0.1, ways=pouring(spout, over)),
        *lift(env, "arm", "jug", 0.12),
        *pour(env, "arm", "jug", spout, over),
    )
    played(env, {"arm": script})


class Hand(TwoArms):
    peg = Object("peg", spawn=Area(x=-0.1, y=-0.1, yaw=0.3))

    def evaluate(self, state):
        """Success: the right arm alone holds it."""
        alone = state.is_grasping("right", "peg") & ~state.is_grasping("left", "peg")
        return {"success": alone & (state.tcp_distance("left", "peg") > 0.08)}


@pytest.mark.long
def test_an_arm_hands_a_thing_over_to_another_make():
    env = made(Hand)
    played(env, hand_over(env, "left", "right", "peg", load("peg")))


@pytest.mark.long
def test_an_arm_hands_over_what_it_holds_already():
    env, peg = made(Hand), load("peg")
    script = hand_over(env, "left", "right", "peg", peg, held=True)
    holding = (
        *grasp(env, "left", "peg", peg, parts=["end"], up=0.08),
        *lift(env, "left", "peg", 0.1),
    )
    played(env, {**script, "left": (*holding, *script["left"])})


@pytest.mark.long
def test_a_hand_over_that_is_played_again_takes_other_grasps():
    env = made(Hand)
    script, tries = hand_over(env, "left", "right", "peg", load("peg")), []
    with rehearsing(env) as copy:
        for _ in range(2):
            copy.begin(0)
            tries.append(copy.play(script, until="left.hold peg").actions)
    assert len(tries[0])
    assert not np.array_equal(*tries)


class Cup(TwoArms):
    cup = Object("cup", spawn=Area(x=-0.1, y=-0.1, yaw=0.3))

    def evaluate(self, state):
        """Success: the right arm alone holds it."""
        alone = state.is_grasping("right", "cup") & ~state.is_grasping("left", "cup")
        return {"success": alone & (state.tcp_distance("left", "cup") > 0.08)}


@pytest.mark.long
def test_a_giver_leaves_the_taker_a_grasp_where_hands_from_above_have_no_room():
    env = made(Cup)
    played(env, hand_over(env, "left", "right", "cup", load("cup")))


class Bolt(TwoArms):
    bolt = Object("bolt", spawn=Area(x=-0.1))

    def evaluate(self, state):
        """Success: the right arm alone holds it."""
        alone = state.is_grasping("right", "bolt") & ~state.is_grasping("left", "bolt")
        return {"success": alone & (state.tcp_distance("left", "bolt") > 0.08)}


@pytest.mark.long
def test_two_hands_find_each_other_at_a_thing_as_short_as_a_finger():
    env = made(Bolt)
    played(env, hand_over(env, "left", "right", "bolt", load("bolt")))


class Together(TwoArms):
    tray = Object("tray", spawn=Area(x=-0.1, yaw=pi / 2))

    def evaluate(self, state):
        """Success: both hold it, 8 cm high."""
        both = state.is_grasping("left", "tray") & state.is_grasping("right", "tray")
        return {"success": both & (state.position("tray")[:, 2] > 0.08)}


@pytest.mark.long
def test_two_arms_of_different_makes_lift_a_tray_level():
    env = made(Together)
    plan = played(env, lift_together(env, ["left", "right"], "tray", load("tray"), 0.1))
    env.reset(seed=0)
    for action in plan:
        env.step(action[None])
        turned = env.state.pose("tray")[0, 3:]
        assert 2 * np.hypot(*turned[1:3]) < 0.2  # rad from level


class Opened(OneArm):
    max_episode_steps = 40

    def evaluate(self, state):
        """Success: the fingers are half open."""
        return {"success": np.abs(state.qpos("arm")[:, -2:] - 0.02).max(axis=1) < 1e-3}


def test_how_far_a_gripper_opens_is_worked_out_when_its_waypoint_begins():
    env, seen = made(Opened), []

    def half(scene: Scene) -> float:
        seen.append(scene.qpos("arm")[-1])
        return 0.5

    script = [Waypoint("shut", share=0.0, steps=8), Waypoint("open", share=half)]
    played(env, {"arm": script})
    assert len(seen) == 1
    assert seen[0] < 0.01  # m; not before


def test_a_gripper_goes_on_as_before_where_a_waypoint_says_nothing():
    """A waypoint without a gripper's number keeps what the one before squeezed."""
    env, mug = made(Put), load("mug")
    seen = []

    def holds(scene: Scene) -> bool:
        seen.append(scene.pressure("arm", "mug"))
        return len(seen) == 30

    script = [
        *grasp(env, "arm", "mug", mug, up=0.08),
        experts.hold("arm", "mug", steps=10),
        Waypoint("look", gripper=None, until=holds),
    ]
    plan = first_success(env, 0, lambda scene: [{"arm": script}])
    assert "ended at arm.look" in plan.reason
    assert min(seen) > 3.0  # N
