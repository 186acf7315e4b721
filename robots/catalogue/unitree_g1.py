"""Unitree G1 of 29 joints, two arms on legs that stand still: 7 + 7 action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, JointGroup, Limb, RobotDescriptor
from robots.parts import among, both_sides, mirrored

PITCH, YAW, ELBOW = (-3.0892, 2.6704), (-2.618, 2.618), (-1.0472, 2.0944)
WRIST = ((-1.9722221, 1.9722221), (-1.6144296, 1.6144296), (-1.6144296, 1.6144296))
LEFT_ARM = JointGroup(
    (
        "left_shoulder_pitch_joint",
        "left_shoulder_roll_joint",
        "left_shoulder_yaw_joint",
        "left_elbow_joint",
        "left_wrist_roll_joint",
        "left_wrist_pitch_joint",
        "left_wrist_yaw_joint",
    ),
    lower=(-0.09, -0.095, -0.1, -0.1, -0.1, -0.1, -0.1),
    upper=(0.09, 0.095, 0.1, 0.1, 0.1, 0.1, 0.1),
    stiffness=(3870.0, 3640.0, 1000.0, 1000.0, 1000.0, 1000.0, 1000.0),
    damping=(51.6, 48.5, 12.8, 11.7, 4.35, 4.38, 2.71),
    force_limit=(25.0, 25.0, 25.0, 25.0, 25.0, 5.0, 5.0),
    delta=True,
    approximate_ik=True,
    limits=(PITCH, (-1.5882, 2.2515), YAW, ELBOW, *WRIST),
)
RIGHT_ARM = replace(
    LEFT_ARM,
    joints=mirrored(LEFT_ARM.joints),
    limits=(PITCH, (-2.2515, 1.5882), YAW, ELBOW, *WRIST),
)
LEFT_LEG = (
    "left_hip_pitch_joint",
    "left_hip_roll_joint",
    "left_hip_yaw_joint",
    "left_knee_joint",
    "left_ankle_pitch_joint",
    "left_ankle_roll_joint",
)

UNITREE_G1 = RobotDescriptor(
    name="unitree_g1",
    urdf=UrdfLocator("example_g1_description", "urdf/g1_29dof_rev_1_0.urdf"),
    action_split=ActionSplit(
        left_arm=LEFT_ARM,
        right_arm=RIGHT_ARM,
        torso=JointGroup.hold(("waist_yaw_joint", "waist_roll_joint", "waist_pitch_joint")),
        legs=JointGroup.hold((*LEFT_LEG, *mirrored(LEFT_LEG))),
    ),
    tcp_link="left_rubber_hand",
    keyframes={"rest": (0,) * 29},
    limbs=both_sides(Limb("left_rubber_hand", 0.451, (0.0, 0.1002, 0.2918))),
    reach=0.552,  # of the left TCP, from the URDF
    source="example-robot-data 6.0.0, g1_description; drives from the inertia behind each joint",
    allowed_collisions=among(  # neighbours, and what overlaps however the joints stand
        ("left_shoulder_pitch_link", "head_link", "logo_link"),
        ("right_shoulder_pitch_link", "head_link", "logo_link"),
        ("left_hip_pitch_link", "pelvis_contour_link"),
        ("right_hip_pitch_link", "pelvis_contour_link"),
    ),
)
