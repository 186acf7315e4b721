"""How grippers move: openings, the point between the fingers, and the frame."""

from dataclasses import replace

import numpy as np
import pytest

from robots import ActionSplit, DescriptorError, RobotDescriptor, RobotRegistry
from robots.from_urdf import guess_descriptor
from robots.gripper_motion import SHARES, aiming_joints, gripper_motion
from robots.parts import PINCH


def load(name: str) -> RobotDescriptor:
    robot = RobotRegistry.load(name)
    return next(iter(robot.parts.values())) if robot.limbs else robot


@pytest.mark.parametrize(
    ("name", "widest"),  # m: twice what one finger of each slides; of jaws, their tips when open
    [("panda", 0.08), ("fetch", 0.1), ("so100", 0.1357), ("koch", 0.0774)],
)
def test_how_wide_it_opens(name: str, widest: float):
    motion = gripper_motion(load(name))
    assert motion.widest == pytest.approx(widest, abs=1e-4)
    assert motion.openings[0] == pytest.approx(0.0)
    assert (np.diff(motion.openings) > 0).all()


def test_jaws_whose_shapes_meet_before_their_joints_stop_open_from_there():
    motion = gripper_motion(load("panda_pinch"))  # at 15 mm of the 60 that each of them slides
    at = [np.interp(share, SHARES, motion.openings) for share in (0.0, 0.25, 0.5, 1.0)]
    assert at == pytest.approx([0.0, 0.0, 0.03, 0.09], abs=1e-4)


def test_how_far_fingers_reach_beyond_the_place_where_they_hold_things():
    """A Fetch's TCP lies in the middle of pads of 6 cm, and what points the other way is none."""
    assert gripper_motion(load("panda")).beyond == pytest.approx(0.0095, abs=1e-4)  # m
    assert gripper_motion(load("fetch")).beyond == pytest.approx(0.031, abs=1e-4)


@pytest.mark.parametrize(
    "name", ["panda", "so100", "koch", pytest.param("baxter", marks=pytest.mark.long)]
)
def test_a_share_gives_the_opening_that_was_asked_for(name: str):
    motion = gripper_motion(load(name))
    opening = 0.6 * motion.widest
    share = motion.share(opening)
    at = np.interp(share, np.linspace(0, 1, len(motion.openings)), motion.openings)
    assert opening <= at < opening + motion.widest / 50
    assert motion.share_at(motion.positions(share)) == pytest.approx(share)
    assert motion.share(2 * motion.widest) == 1.0


def test_fingers_of_many_joints_close_until_thumb_and_finger_meet():
    """The tips part as all joints go from the keyframe `pinch` back to where the hand is open."""
    robot = guess_descriptor(load("fixed_inspire_hand_left").urdf.locate()).descriptor
    motion = gripper_motion(robot)
    for share, name in ((0.0, PINCH), (1.0, "rest")):
        at = dict(zip(robot.joints, robot.keyframe(name), strict=True))
        assert motion.positions(share) == pytest.approx([at[joint] for joint in motion.joints])
    assert motion.openings[0] == pytest.approx(0.0)
    assert (np.diff(motion.openings) > 0).all()
    assert motion.widest > 0.05  # m


def test_sliding_fingers_keep_their_middle_and_a_swinging_jaw_moves_it():
    panda, koch = gripper_motion(load("panda")), gripper_motion(load("koch"))
    assert np.allclose(panda.middle(0.0), panda.middle(1.0), atol=1e-9)
    assert np.linalg.norm(koch.middle(1.0) - koch.middle(0.0)) > 0.03


def test_the_frame_opens_as_the_pads_part():
    """A Koch's jaws open along its TCP's x axis; its fingers' axes are native's, which is y."""
    assert np.allclose(abs(gripper_motion(load("koch")).turn[:, 1]), (1, 0, 0), atol=0.2)
    assert np.allclose(gripper_motion(load("panda")).turn, np.eye(3), atol=1e-6)


@pytest.mark.parametrize("name", ["panda", "so100", "koch"])
def test_force_and_step_are_inverse(name: str):
    motion = gripper_motion(load(name))
    force = motion.force(1e-4, 0.5)
    assert motion.pressing(force, 0.5) * motion.slope(0.5) == pytest.approx(1e-4)
    assert motion.slope(1.2) == pytest.approx(motion.slope(1.04))  # forced beyond its end


def test_a_gripper_that_stays_where_it_is_has_no_two_ends():
    panda = load("panda")
    group = panda.action_split.groups["gripper"]
    shut = replace(group, lower=-0.02, upper=-0.01)  # below the joints' limits: 0 to 0.04 m
    with pytest.raises(DescriptorError, match="no two ends between which it moves"):
        gripper_motion(replace(panda, action_split=panda.action_split.replace(gripper=shut)))


def test_without_fingers_there_is_none():
    with pytest.raises(DescriptorError, match="panda_stick has no fingers"):
        gripper_motion(load("panda_stick"))


def test_jaws_that_swing_are_turned_against_each_other_as_they_open():
    sliding, swinging = gripper_motion(load("panda")), gripper_motion(load("so101"))
    assert sliding.angles.max() < 1e-6
    assert sliding.widest_within(0.1) == sliding.widest
    assert swinging.angles[0] < 1e-6
    assert swinging.angles[-1] > 1.5
    assert 0 < swinging.widest_within(0.1) < swinging.widest_within(0.3) < swinging.widest


@pytest.mark.parametrize(
    ("name", "limb", "others"),
    [
        ("panda", None, ()),
        ("baxter", "left", ()),
        ("fetch", None, ("head_pan_joint", "head_tilt_joint", "torso_lift_joint")),
    ],
)
def test_a_head_and_the_torso_that_carries_it_do_not_aim_an_arm(
    name: str, limb: str | None, others: tuple[str, ...]
):
    robot = RobotRegistry.load(name)
    arm = robot.parts[limb] if limb else robot
    assert set(arm.arm_joints) - set(aiming_joints(robot, arm)) == set(others)


def test_of_a_linkage_only_its_leaders_press():
    panda = load("panda")
    groups = panda.action_split.groups
    led = replace(groups["gripper"], leaders=("panda_finger_joint1",), lead=0.01)
    robot = replace(panda, action_split=ActionSplit(**{**groups, "gripper": led}))
    whole, half = gripper_motion(panda), gripper_motion(robot)
    assert half.force(1e-4, 0.5) == pytest.approx(whole.force(1e-4, 0.5) / 2)


def test_jaws_that_stay_apart_when_closed_are_open_by_so_much():
    panda = load("panda")
    groups = panda.action_split.groups
    ajar = replace(groups["gripper"], lower=0.006, upper=0.04)
    motion = gripper_motion(replace(panda, action_split=ActionSplit(**{**groups, "gripper": ajar})))
    assert motion.openings[[0, -1]] == pytest.approx((0.012, 0.08), abs=1e-4)
