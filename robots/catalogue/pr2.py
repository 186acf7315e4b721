"""Willow Garage PR2, two arms with grippers, on a base that stands still: 2 × (7 + 1) numbers."""

from dataclasses import replace
from math import pi

from robots.assets.locator import UrdfLocator
from robots.descriptor import (
    ActionSplit,
    Fingers,
    GripperMaterial,
    JointGroup,
    Limb,
    RobotDescriptor,
)
from robots.parts import among, both_sides, mirrored

TURNS = (-2 * pi, 2 * pi)  # of joints that turn without end
LIMITS = ((-2.3213, 0.0), TURNS, (-2.094, 0.0), TURNS)
LEFT_ARM = JointGroup(
    (
        "l_shoulder_pan_joint",
        "l_shoulder_lift_joint",
        "l_upper_arm_roll_joint",
        "l_elbow_flex_joint",
        "l_forearm_roll_joint",
        "l_wrist_flex_joint",
        "l_wrist_roll_joint",
    ),
    (*(-0.04,) * 4, *(-0.1,) * 3),
    (*(0.04,) * 4, *(0.1,) * 3),
    stiffness=(9.99e4, 6.59e4, 9510.0, 9940.0, 1000.0, 1000.0, 1000.0),
    damping=(1330.0, 879.0, 127.0, 133.0, 12.7, 10.3, 7.39),
    delta=True,
    approximate_ik=True,
    force_limit=(284.0, 188.0, 30.0, 30.0, 30.0, 10.0, 10.0),
    limits=((-0.7146018, 2.2853982), (-0.5236, 1.3963), (-0.8, 3.9), *LIMITS),
)
RIGHT_ARM = replace(
    LEFT_ARM,
    joints=mirrored(LEFT_ARM.joints),
    limits=((-2.2853982, 0.7146018), (-0.5236, 1.3963), (-3.9, 0.8), *LIMITS),
)
LEFT_FINGERS = (
    "l_gripper_l_finger_link",
    "l_gripper_r_finger_link",
    "l_gripper_l_finger_tip_link",
    "l_gripper_r_finger_tip_link",
)
LEFT_TIPS = Fingers(LEFT_FINGERS[2:], max_angle=110.0)
# The URDF turns one of these against its limits; here all turn alike, as on the robot.
LEFT_GRIPPER = JointGroup(
    (
        "l_gripper_l_finger_joint",
        "l_gripper_r_finger_joint",
        "l_gripper_l_finger_tip_joint",
        "l_gripper_r_finger_tip_joint",
        "l_gripper_l_parallel_root_joint",
        "l_gripper_r_parallel_root_joint",
    ),
    0.0,
    0.548,
    stiffness=1e2,
    damping=1e1,
    force_limit=100.0,
    mimic=True,
    reset_noise=False,
)
LEFT_LINKS = (
    (
        "l_shoulder_pan_link",
        "l_shoulder_lift_link",
        "l_upper_arm_roll_link",
        "l_upper_arm_link",
    ),
    ("l_upper_arm_roll_link", "l_upper_arm_link", "l_elbow_flex_link", "l_forearm_roll_link"),
    ("l_elbow_flex_link", "l_forearm_roll_link", "l_forearm_link", "l_wrist_flex_link"),
    ("l_forearm_link", "l_wrist_flex_link", "l_wrist_roll_link", "l_gripper_palm_link"),
    (
        "l_wrist_flex_link",
        "l_wrist_roll_link",
        "l_gripper_palm_link",
        "l_gripper_l_parallel_link",
        "l_gripper_r_parallel_link",
        *LEFT_FINGERS,
    ),
)
LEFT_REST = (0.501771, 0.020107, 2.22013, -1.07038, 0.340878, -0.742479, -0.142704)
RIGHT_REST = (-0.501771, 0.020107, -2.22013, -1.07038, -0.340878, -0.742479, 0.142704)

PR2 = RobotDescriptor(
    name="pr2",
    urdf=UrdfLocator("example_pr2_description", "urdf/pr2.urdf"),
    action_split=ActionSplit(
        left_arm=LEFT_ARM,
        left_gripper=LEFT_GRIPPER,
        right_arm=RIGHT_ARM,
        right_gripper=replace(LEFT_GRIPPER, joints=mirrored(LEFT_GRIPPER.joints)),
        torso=JointGroup.hold(("torso_lift_joint",), unit="m"),
        head=JointGroup.hold(("head_pan_joint", "head_tilt_joint", "laser_tilt_mount_joint")),
    ),
    tcp_link="l_gripper_tool_frame",
    fingers=LEFT_TIPS,
    gripper_material=GripperMaterial((*LEFT_FINGERS, *mirrored(LEFT_FINGERS)), 2.0, 2.0, 0.0, 0.1),
    keyframes={"rest": (*LEFT_REST, *(0.548,) * 6, *RIGHT_REST, *(0.548,) * 6, *(0,) * 4)},
    limbs=both_sides(Limb("l_gripper_tool_frame", 1.001, (-0.05, 0.188, 0.7907), LEFT_TIPS)),
    reach=1.195,  # of the left TCP, from the URDF
    source="example-robot-data 6.0.0, pr2_description; drives from the inertia behind each joint",
    allowed_collisions=among(
        *LEFT_LINKS,
        *mirrored(LEFT_LINKS),
        ("l_shoulder_pan_link", "base_link"),
        ("r_shoulder_pan_link", "base_link"),
        ("l_shoulder_lift_link", "torso_lift_link"),
        ("r_shoulder_lift_link", "torso_lift_link"),
        ("double_stereo_link", "head_pan_link"),
    ),
)
