"""Unitree G1 of 29 joints with hands of three fingers, on legs that stand still: 2 × (7 + 7)."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.unitree_g1 import UNITREE_G1
from robots.descriptor import ActionSplit, Fingers, GripperMaterial, JointGroup, Limb
from robots.parts import PINCH, among, mirrored

GROUPS = UNITREE_G1.action_split.groups
LEFT_GRIPPER = JointGroup(
    (
        "left_hand_thumb_0_joint",
        "left_hand_thumb_1_joint",
        "left_hand_thumb_2_joint",
        "left_hand_middle_0_joint",
        "left_hand_middle_1_joint",
        "left_hand_index_0_joint",
        "left_hand_index_1_joint",
    ),
    lower=-0.1,
    upper=0.1,
    delta=True,
    stiffness=(18.4, 26.4, 2.42, 26.5, 2.42, 26.5, 2.42),
    damping=(0.123, 0.176, 0.0162, 0.176, 0.0162, 0.176, 0.0162),
    force_limit=(2.45, 1.4, 1.4, 1.4, 1.4, 1.4, 1.4),
    armature=(6.82e-5, 9.8e-5, 8.98e-6, 9.8e-5, 8.98e-6, 9.8e-5, 8.98e-6),
    reset_noise=False,
    limits=(
        (-1.0471976, 1.0471976),
        (-0.61086524, 1.0471976),
        (0.0, 1.7453293),
        (-1.5707964, 0.0),
        (-1.7453293, 0.0),
        (-1.5707964, 0.0),
        (-1.7453293, 0.0),
    ),
)
RIGHT_GRIPPER = replace(
    LEFT_GRIPPER,
    joints=mirrored(LEFT_GRIPPER.joints),
    limits=(
        (-1.0471976, 1.0471976),
        (-1.0471976, 0.61086524),
        (-1.7453293, -0.0),
        (-0.0, 1.5707964),
        (-0.0, 1.7453293),
        (-0.0, 1.5707964),
        (-0.0, 1.7453293),
    ),
)
LEFT_FINGERS = (
    "left_hand_thumb_0_link",
    "left_hand_thumb_1_link",
    "left_hand_thumb_2_link",
    "left_hand_middle_0_link",
    "left_hand_middle_1_link",
    "left_hand_index_0_link",
    "left_hand_index_1_link",
)
# How thumb and index finger meet.
LEFT_PINCH = (-0.344, 0.9732, 0.1416, -0.4422, -1.4436, -0.4422, -1.4436)
RIGHT_PINCH = (-0.344, -0.9732, -0.1416, 0.4422, 1.4436, 0.4422, 1.4436)
LEFT = Limb(
    "left_hand_palm_link",
    0.568,
    (0.0, 0.1002, 0.2918),
    Fingers(
        ("left_hand_thumb_2_link", "left_hand_index_1_link"),
        opening_signs=(-1, 1),
        max_angle=110.0,
        opening_axes=((0.844, -0.536, -0.034), (-0.745, 0.62, 0.246)),
    ),
    tcp_offset=(0.1022, -0.0645, 0.0242),
)
RIGHT = replace(
    LEFT,
    tcp_link="right_hand_palm_link",
    base=(0.0, -0.1002, 0.2918),
    fingers=Fingers(
        ("right_hand_thumb_2_link", "right_hand_index_1_link"),
        opening_signs=(-1, -1),
        max_angle=110.0,
        opening_axes=((0.844, 0.536, -0.034), (0.745, 0.62, -0.246)),
    ),
    tcp_offset=(0.1022, 0.0645, 0.0242),
)
LEFT_LINKS = (
    ("left_wrist_yaw_link", "left_hand_palm_link", "left_hand_thumb_0_link"),
    ("left_wrist_yaw_link", "left_hand_palm_link", "left_hand_index_0_link"),
    ("left_wrist_yaw_link", "left_hand_palm_link", "left_hand_middle_0_link"),
)

UNITREE_G1_WITH_HANDS = replace(
    UNITREE_G1,
    name="unitree_g1_with_hands",
    urdf=UrdfLocator("example_g1_description", "urdf/g1_29dof_with_hand_rev_1_0.urdf"),
    action_split=ActionSplit(
        left_arm=GROUPS["left_arm"],
        left_gripper=LEFT_GRIPPER,
        right_arm=GROUPS["right_arm"],
        right_gripper=RIGHT_GRIPPER,
        torso=GROUPS["torso"],
        legs=GROUPS["legs"],
    ),
    tcp_link="left_hand_palm_link",
    tcp_offset=LEFT.tcp_offset,
    fingers=LEFT.fingers,
    gripper_material=GripperMaterial(
        (*LEFT_FINGERS, *mirrored(LEFT_FINGERS)), 2.0, 2.0, 0.0, patch_radius=0.1
    ),
    keyframes={
        "rest": (0,) * 43,
        PINCH: (*(0,) * 7, *LEFT_PINCH, *(0,) * 7, *RIGHT_PINCH, *(0,) * 15),
    },
    limbs={"left": LEFT, "right": RIGHT},
    reach=0.668,  # of the left TCP, from the URDF
    allowed_collisions=among(  # neighbours, and what overlaps however the joints stand
        ("left_shoulder_pitch_link", "head_link", "logo_link"),
        ("right_shoulder_pitch_link", "head_link", "logo_link"),
        *LEFT_LINKS,
        *mirrored(LEFT_LINKS),
        ("left_wrist_pitch_link", "left_hand_palm_link"),
        ("right_wrist_pitch_link", "right_hand_palm_link"),
        ("left_hip_pitch_link", "pelvis_contour_link"),
        ("right_hip_pitch_link", "pelvis_contour_link"),
    ),
)
