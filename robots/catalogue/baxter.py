"""Rethink Robotics Baxter, two arms with grippers: 2 × (7 + 1) action numbers."""

from dataclasses import replace

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

BODY = ("torso", "sonar_ring", "pedestal", "collision_head_link_1", "collision_head_link_2")
LEFT_ARM = JointGroup(
    ("left_s0", "left_s1", "left_e0", "left_e1", "left_w0", "left_w1", "left_w2"),
    lower=(-0.04, -0.04, -0.04, -0.04, -0.09, -0.1, -0.1),
    upper=(0.04, 0.04, 0.04, 0.04, 0.09, 0.1, 0.1),
    stiffness=(9.83e4, 7.87e4, 2.45e4, 1.83e4, 2320.0, 2080.0, 1000.0),
    damping=(1310.0, 1050.0, 327.0, 245.0, 31.0, 27.8, 12.7),
    force_limit=(280.0, 224.0, 69.7, 52.2, 15.0, 15.0, 15.0),
    delta=True,
    approximate_ik=True,
    limits=(
        (-1.70168, 1.70168),
        (-2.147, 1.047),
        (-3.05418, 3.05418),
        (-0.05, 2.618),
        (-3.059, 3.059),
        (-1.5707964, 2.094),
        (-3.059, 3.059),
    ),
)
LEFT_GRIPPER = JointGroup(
    ("l_gripper_l_finger_joint", "l_gripper_r_finger_joint"),
    lower=-0.01,
    upper=0.020833,
    stiffness=1e3,
    damping=1e2,
    force_limit=20.0,
    mimic=True,
    multipliers=(1.0, -1.0),
    unit="m",
    reset_noise=False,
    limits=((0.0, 0.020833), (-0.020833, 0.0)),
)
TIPS = ("l_gripper_l_finger_tip", "l_gripper_r_finger_tip")
FINGERS = ("l_gripper_l_finger", "l_gripper_r_finger")
HAND = ("left_wrist", "left_hand_link", "left_gripper_base_link")
LEFT_ARM_LINKS = (
    (
        "left_upper_shoulder",
        "left_lower_shoulder",
        "left_upper_elbow_visual",
        "left_upper_elbow",
        "left_lower_elbow",
    ),
    (
        "left_upper_elbow",
        "left_lower_elbow",
        "left_upper_forearm",
        "left_upper_forearm_visual",
        "left_lower_forearm",
        "left_wrist",
    ),
    ("left_lower_forearm", "left_wrist", "left_hand_link", "left_gripper_base_link"),
)
LEFT_FINGER_LINKS = (
    (*HAND, "l_gripper_l_finger", "l_gripper_l_finger_tip"),
    (*HAND, "l_gripper_r_finger", "l_gripper_r_finger_tip"),
)
REST = (-0.55, 0.0, 0.75, 0.0, 1.26, 0.0, 0.020833, -0.020833)  # "neutral", arms turned in

BAXTER = RobotDescriptor(
    name="baxter",
    urdf=UrdfLocator("example_baxter_description", "urdf/baxter.urdf"),
    action_split=ActionSplit(
        left_arm=LEFT_ARM,
        left_gripper=LEFT_GRIPPER,
        right_arm=replace(LEFT_ARM, joints=mirrored(LEFT_ARM.joints)),
        right_gripper=replace(LEFT_GRIPPER, joints=mirrored(LEFT_GRIPPER.joints)),
        head=JointGroup.hold(("head_pan",)),
    ),
    tcp_link="left_gripper",
    fingers=Fingers(TIPS),
    gripper_material=GripperMaterial(
        (*TIPS, *mirrored(TIPS), *FINGERS, *mirrored(FINGERS)), 2.0, 2.0, 0.0, 0.1
    ),
    limbs=both_sides(Limb("left_gripper", 1.201, (0.064, 0.259, 0.1296), Fingers(TIPS))),
    keyframes={"rest": (-0.3, *REST, 0.3, *REST, 0.0)},
    reach=1.468,  # of the left TCP, from the URDF; data sheet 1.21 from the shoulder
    source="example-robot-data 6.0.0, baxter_description; drives from each joint's inertia",
    allowed_collisions=among(
        (*BODY, "head", "screen"),
        (*BODY, "left_upper_shoulder", "left_lower_shoulder"),
        (*BODY, "right_upper_shoulder", "right_lower_shoulder"),
        *LEFT_ARM_LINKS,
        *mirrored(LEFT_ARM_LINKS),
        *LEFT_FINGER_LINKS,
        *mirrored(LEFT_FINGER_LINKS),
        FINGERS,
        mirrored(FINGERS),
    ),
)
