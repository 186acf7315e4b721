"""Unitree G1 of 29 joints, two arms on legs that stand still: 7 + 7 action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, JointGroup, RobotDescriptor
from robots.link_pairs import among
from robots.parts import both_sides

# fmt: off
SIDES = ("left", "right")
ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch",
       "wrist_yaw")
LEG = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
PITCH, YAW, ELBOW = (-3.0892, 2.6704), (-2.618, 2.618), (-1.0472, 2.0944)
WRIST = ((-1.9722221, 1.9722221), (-1.6144296, 1.6144296), (-1.6144296, 1.6144296))
LEFT_ARM = JointGroup(
    tuple(f"left_{joint}_joint" for joint in ARM),
    lower=(-0.09, -0.095, -0.1, -0.1, -0.1, -0.1, -0.1),
    upper=(0.09, 0.095, 0.1, 0.1, 0.1, 0.1, 0.1),
    stiffness=(3870.0, 3640.0, 1000.0, 1000.0, 1000.0, 1000.0, 1000.0),
    damping=(51.6, 48.5, 12.8, 11.7, 4.35, 4.38, 2.71),
    force_limit=(25.0, 25.0, 25.0, 25.0, 25.0, 5.0, 5.0), delta=True,
    limits=(PITCH, (-1.5882, 2.2515), YAW, ELBOW, *WRIST),
)
RIGHT_ARM = replace(
    LEFT_ARM,
    joints=tuple(f"right_{joint}_joint" for joint in ARM),
    limits=(PITCH, (-2.2515, 1.5882), YAW, ELBOW, *WRIST),
)

UNITREE_G1 = RobotDescriptor(
    name="unitree_g1",
    urdf=UrdfLocator("example_g1_description", "urdf/g1_29dof_rev_1_0.urdf"),
    action_split=ActionSplit(
        left_arm=LEFT_ARM,
        right_arm=RIGHT_ARM,
        torso=JointGroup.hold(
            tuple(f"waist_{way}_joint" for way in ("yaw", "roll", "pitch"))),
        legs=JointGroup.hold(
            tuple(f"{side}_{joint}_joint" for side in SIDES for joint in LEG)),
    ),
    tcp_link="left_rubber_hand",
    keyframes={"rest": (0,) * 29},
    limbs=both_sides("{side}_rubber_hand", 0.451, (0.0, 0.1002, 0.2918)),
    reach=0.552,  # of the left TCP, from the URDF
    source="example-robot-data 6.0.0, g1_description; drives from the inertia behind each joint",
    allowed_collisions=among(  # neighbours, and what overlaps however the joints stand
        *((f"{side}_shoulder_pitch_link", "head_link", "logo_link") for side in SIDES),
        *((f"{side}_hip_pitch_link", "pelvis_contour_link") for side in SIDES),
    ),
)
