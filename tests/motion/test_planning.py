"""Plans: goals of all kinds, what stands in the way, who waits for whom, and why there is none."""

from hashlib import sha256

import numpy as np
import pytest

from layouts import Placement
from layouts.layout import Layout
from robot_layouts.motion import MotionError, NoPlanError, RegionGoal, TcpGoal, plan
from robot_layouts.motion.collision.cell import Cell
from robot_layouts.motion.model.obstacles import Track, box
from robots import UnknownNameError
from robots.urdf.tcp import find_tcp
from tests.fresh_process import in_fresh_process
from tests.motion.two_pandas import DOWN, aside, cell, in_the_middle, turned


def a_post():
    return box("post", (0.1, 0.1, 1.4), (0.4, -0.45, 0.7))


def tcp(motion, name):
    """Where the TCP of a robot is at the end of a motion."""
    whole = Cell(motion.layout)
    robot, tree = motion.layout[name].robot, whole.models[name].kinematics
    poses = whole.poses(np.concatenate(list(motion.end.values()))[None])
    first = whole.links.index((name, tree.links[0]))
    return find_tcp(robot, tree).places(poses[:, first : first + len(tree.links)])[0]


def test_two_arms_pass_each_other():
    goals = {"left": turned("left", -1.4)[:7], "right": turned("right", -1.4)}
    motion = plan(cell(), aside(), goals)
    assert motion.certify().ok
    assert np.allclose(motion.start["left"], turned("left", 1.4))
    assert np.allclose(motion.end["left"], turned("left", -1.4))
    assert np.allclose(motion.end["right"], turned("right", -1.4))


def test_a_tcp_goal_is_reached_past_a_post():
    post, goal = a_post(), TcpGoal((0.0, -0.1, 0.3), DOWN)
    motion = plan(cell(), {"left": turned("left", -1.4)}, {"left": goal}, obstacles=[post])
    certificate = motion.certify()
    assert certificate.ok
    assert certificate.clearance is not None
    assert certificate.clearance.distance > 0
    assert tcp(motion, "left") == pytest.approx(goal.position, abs=2e-3)
    assert motion.moving == ("left",)
    assert motion.obstacles == (post,)


def test_a_wider_berth_is_given_where_it_is_asked_for():
    goals = {"left": TcpGoal((0.0, -0.1, 0.3), DOWN)}
    start = {"left": turned("left", -2.2), "right": turned("right", 1.4)}
    motion = plan(cell(), start, goals, obstacles=[a_post()], clearance=0.08)
    near = motion.certify().clearance
    assert near is not None
    assert near.distance > 0.08 - 0.01


def test_a_region_is_reached_somewhere():
    low, high = (-0.2, -0.3, 0.2), (0.2, -0.1, 0.4)
    end = tcp(plan(cell(), aside(), {"left": RegionGoal(low, high, DOWN)}), "left")
    assert (end > np.array(low) - 2e-3).all()
    assert (end < np.array(high) + 2e-3).all()


def test_a_held_body_is_carried_round_an_obstacle():
    whole = Cell(cell())
    start = whole.start.copy()
    start[whole.slices["left"]] = turned("left", 1.4)
    hand = whole.poses(start[None])[0, whole.links.index(("left", "panda_hand_tcp")), :3, 3]
    rod = whole.grasped("left", box("rod", (0.02, 0.3, 0.02), tuple(hand)), start)
    goals = {"left": turned("left", 0.6)}
    motion = plan(cell(), start, goals, held=[rod])
    assert motion.held == (rod,)
    assert motion.certify().ok


def test_an_arm_waits_until_another_has_left():
    there = plan(cell(), aside(), {"left": in_the_middle()})
    back = plan(cell(), there.end, {"left": turned("left", 1.4)})
    told = there.then(back, rest=1.0)
    motion = plan(cell(), aside(), {"right": in_the_middle()}, others={"left": told})
    assert motion.certify().ok
    assert motion.duration > there.duration + 1.0
    moments = np.linspace(0.0, told.duration, 50)
    assert np.allclose(motion.sample(moments)["left"], told.sample(moments)["left"], atol=1e-4)


def test_a_goal_that_another_keeps_is_a_goal_in_collision():
    stays = plan(cell(), aside(), {"left": in_the_middle()})
    with pytest.raises(NoPlanError, match="at the goal of right") as error:
        plan(cell(), aside(), {"right": in_the_middle()}, others={"left": stays})
    assert error.value.reason == "goal in collision"


def test_an_arm_lets_a_moving_body_pass():
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[:, :3, 3] = [(-1.5, 0.0, 0.35), (1.5, 0.0, 0.35)]
    ball = box("ball", (0.2, 0.2, 0.2)).moved(Track(np.array([0.0, 2.0]), poses))
    goal = {"left": in_the_middle()}
    motion = plan(cell(), aside(), goal, obstacles=[ball], control_mode="pd_joint_pos")
    assert motion.certify().ok
    alone = plan(cell(), aside(), goal, control_mode="pd_joint_pos")
    assert motion.duration > alone.duration


def test_each_arm_goes_at_its_own_pace():
    goals = {"left": turned("left", 1.2), "right": turned("right", -1.4)}
    together = plan(cell(), aside(), goals)
    apart = plan(cell(), aside(), goals, synchronised=False)
    assert apart.certify().ok

    def arrival(motion):
        away = np.abs(motion.positions["left"] - motion.end["left"]).max(axis=1)
        return motion.times[np.flatnonzero(away > 1e-3)[-1]]

    assert arrival(apart) < arrival(together) - 0.5


@pytest.mark.parametrize("mode", ["pd_joint_delta_pos", "pd_joint_pos"])
def test_slower_and_gentler_motions_take_longer(mode):
    goals = {"left": turned("left", -0.5)}
    usual = plan(cell(), aside(), goals, control_mode=mode)
    slow = plan(cell(), aside(), goals, control_mode=mode, velocity=0.3)
    gentle = plan(cell(), aside(), goals, control_mode=mode, acceleration=0.2)
    assert min(slow.duration, gentle.duration) > 1.5 * usual.duration
    assert gentle.certify().acceleration == pytest.approx(1.0, abs=0.05)


def test_who_is_there_already_stays():
    goals = {"left": turned("left", 1.4), "right": turned("right", -1.4)}
    motion = plan(cell(), aside(), goals)
    assert motion.moving == ("right",)
    still = plan(cell(), motion.end, goals)
    assert (still.moving, still.certify().ok) == ((), True)


# -- no plan -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("goals", "reason", "message"),
    [
        ({"left": TcpGoal((0, 3, 0.3))}, "unreachable", r"stays 2\.\d+ m away"),
        ({"left": [9.0, 0, 0, -1, 0, 1, 0]}, "unreachable", "panda_joint1 at 9, beyond its limits"),
        ({"left": TcpGoal((0.0, 0.6, 0.3), DOWN)}, "unreachable", "does not get to its goal"),
        (
            {"left": in_the_middle(), "right": in_the_middle()},
            "goal in collision",
            "goals of left and right exclude each other: there left/.* and right/.* overlap",
        ),
    ],
)
def test_the_reason_is_named(goals, reason, message):
    with pytest.raises(NoPlanError, match=message) as error:
        plan(cell(), aside(), goals)
    assert error.value.reason == reason


def test_a_start_in_collision_is_named_with_its_depth():
    block = box("block", (0.3, 0.3, 0.3), (0.0, -0.7, 0.3))
    with pytest.raises(NoPlanError, match=r"at the start .* and block overlap by \d") as error:
        plan(cell(), aside(), {"left": turned("left", 0.5)}, obstacles=[block])
    assert error.value.reason == "start in collision"


def test_an_obstacle_at_the_goal_is_named():
    block = box("block", (0.2, 0.2, 0.2), (0.0, 0.0, 0.3))
    with pytest.raises(NoPlanError, match="at the goal of left, TCP at .* and block overlap"):
        plan(cell(), aside(), {"left": in_the_middle()}, obstacles=[block])


def test_time_that_is_over_ends_the_search():
    with pytest.raises(NoPlanError, match="in the 0.001 s given") as error:
        plan(cell(), aside(), {"left": turned("left", -1.4)}, patience=0.001)
    assert error.value.reason == "not found"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"goals": {}}, "at least one place"),
        ({"goals": {"left": [1.0, 2.0]}}, "takes a TcpGoal"),
        ({"goals": {"left": in_the_middle()}, "seed": -1}, "seed is -1"),
        ({"goals": {"left": in_the_middle()}, "start": [0.0]}, "takes 18 finite numbers"),
        ({"goals": {"left": in_the_middle()}, "clearance": -1}, "clearance is -1"),
        ({"goals": {"left": in_the_middle()}, "velocity": 2}, "velocity is 2"),
    ],
)
def test_what_makes_no_sense_is_refused(arguments, message):
    with pytest.raises(MotionError, match=message):
        plan(cell(), **arguments)


def test_a_wrong_place_is_refused_by_name():
    with pytest.raises(UnknownNameError, match="Did you mean 'left'"):
        plan(cell(), aside(), {"lef": in_the_middle()})


def test_a_pose_that_is_none_is_refused():
    with pytest.raises(MotionError, match="length"):
        TcpGoal((0, 0, 0), (1, 1, 0, 0))
    with pytest.raises(MotionError, match="low must be lower"):
        RegionGoal((1, 0, 0), (0, 1, 1))


# -- limbs -------------------------------------------------------------------------------------


@pytest.mark.example_robots
def test_limbs_of_one_robot_move_without_the_rest_of_it():
    layout = Layout({"baxter": Placement("baxter")})
    start = np.array(layout["baxter"].start_qpos)
    joints = layout["baxter"].robot.joints
    left = layout.arm("left").robot
    goal = [start[joints.index(joint)] for joint in left.arm_joints]
    goal[0] += 0.3
    motion = plan(layout, goals={"left": goal})
    assert motion.certify().ok
    moved = np.flatnonzero(motion.end["baxter"] != start).tolist()
    assert moved == [joints.index(left.arm_joints[0])]


# -- determinism -------------------------------------------------------------------------------


def fingerprint() -> str:
    start = {"left": turned("left", -1.4), "right": turned("right", 1.4)}
    goals = {"left": TcpGoal((0.0, -0.1, 0.3), DOWN), "right": turned("right", -1.4)}
    motion = plan(cell(), start, goals, obstacles=[a_post()], seed=3)
    return sha256(b"".join(qpos.tobytes() for qpos in motion.positions.values())).hexdigest()


@pytest.mark.long
def test_a_seed_gives_one_motion_however_many_threads_there_are(monkeypatch):
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        monkeypatch.setenv(name, "2")  # here it is 1
    assert fingerprint() == in_fresh_process(fingerprint)


def test_motion_is_light_to_import():
    assert in_fresh_process(loaded_by_motion) == []


def loaded_by_motion() -> list[str]:
    import sys

    from robot_layouts import motion  # noqa: F401

    return [name for name in ("ompl", "toppra", "fcl", "sapien", "torch") if name in sys.modules]
