"""Unitree G1 on legs that stand still: 5 + 7 numbers for each arm and hand, and 1 for its torso."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, GripperMaterial, Home, JointGroup, Limb, RobotDescriptor
from robots.parts import among, both_sides, mirrored

LEFT_ARM = JointGroup(
    (
        "left_shoulder_pitch_joint",
        "left_shoulder_roll_joint",
        "left_shoulder_yaw_joint",
        "left_elbow_pitch_joint",
        "left_elbow_roll_joint",
    ),
    lower=-0.2,
    upper=0.2,
    delta=True,
    stiffness=1e3,
    damping=1e2,
    force_limit=100.0,
    limits=(
        (-2.9671, 2.7925),
        (-1.5882, 2.2515),
        (-2.618, 2.618),
        (-0.2268, 3.4208),
        (-2.0943, 2.0943),
    ),
)
LEFT_HAND = JointGroup(
    (
        "left_zero_joint",
        "left_one_joint",
        "left_two_joint",
        "left_three_joint",
        "left_four_joint",
        "left_five_joint",
        "left_six_joint",
    ),
    lower=-0.5,
    upper=0.5,
    delta=True,
    stiffness=1e3,
    damping=1e2,
    force_limit=100.0,
    limits=(
        (-0.523598, 0.523598),
        (-1.0, 1.2),
        (0.0, 1.84),
        (-1.84, 0.3),
        (-1.84, 0.0),
        (-1.84, 0.3),
        (-1.84, 0.0),
    ),
)
# The right side is the left one in a mirror.
RIGHT_ARM = replace(
    LEFT_ARM,
    joints=mirrored(LEFT_ARM.joints),
    limits=(
        (-2.9671, 2.7925),
        (-2.2515, 1.5882),
        (-2.618, 2.618),
        (-0.2268, 3.4208),
        (-2.0943, 2.0943),
    ),
)
RIGHT_HAND = replace(
    LEFT_HAND,
    joints=mirrored(LEFT_HAND.joints),
    limits=(
        (-0.523598, 0.523598),
        (-1.2, 1.0),
        (-1.84, -0.0),
        (-0.3, 1.84),
        (-0.0, 1.84),
        (-0.3, 1.84),
        (-0.0, 1.84),
    ),
)
LEFT_LINKS = (
    "left_one_link",
    "left_two_link",
    "left_three_link",
    "left_four_link",
    "left_five_link",
    "left_six_link",
    "left_palm_link",
)
LEFT_NEIGHBOURS = (LEFT_LINKS[0], *LEFT_LINKS[2:], "left_elbow_roll_link")
TORSO = replace(LEFT_ARM, joints=("torso_joint",), limits=((-2.618, 2.618),))

UNITREE_G1_UPPER_BODY = RobotDescriptor(
    name="unitree_g1_upper_body",  # ManiSkill: unitree_g1_simplified_upper_body
    urdf=UrdfLocator("maniskill_g1_humanoid", "g1_simplified_upper_body.urdf"),
    action_split=ActionSplit(
        left_arm=LEFT_ARM,
        left_gripper=LEFT_HAND,
        right_arm=RIGHT_ARM,
        right_gripper=RIGHT_HAND,
        torso=TORSO,
    ),
    tcp_link="left_tcp_link",
    gripper_material=GripperMaterial(
        (*LEFT_LINKS, *mirrored(LEFT_LINKS)), 2.0, 2.0, 0.0, patch_radius=0.1
    ),
    keyframes={"standing": (0,) * 25, "rest": (0,) * 25},
    home=Home(position=(0.0, 0.0, 0.755)),
    limbs=both_sides(Limb("left_tcp_link", 0.531, (-0.0025, 0.104, 0.2593))),
    reach=0.64,  # of the left TCP, from the URDF
    source="mani_skill 3.0.1, agents/robots/unitree_g1/g1_upper_body.py",
    allowed_collisions=among(
        LEFT_NEIGHBOURS,
        mirrored(LEFT_NEIGHBOURS),
        ("torso_link", "left_shoulder_roll_link", "right_shoulder_roll_link"),
    ),
)
