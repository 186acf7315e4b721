"""PAL Robotics TIAGo Pro, two arms, on a base that stands still: 2 × (7 + 1) action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.descriptor import (
    ActionSplit,
    Fingers,
    GripperMaterial,
    JointGroup,
    Limb,
    RobotDescriptor,
    names,
)
from robots.parts import among, both_sides, mirrored

BEND, WRIST, TURN = (-2.443461, 1.134464), (-1.8849556, 3.0019662), (-2.6179938, 2.6179938)
TIPS = ("gripper_left_fingertip_left_link", "gripper_left_fingertip_right_link")
OPEN = 0.80285144  # rad
FINGERS = Fingers(
    TIPS,
    opening_signs=(1, 1),
    max_angle=110.0,
    opening_axes=((1.0, 0.0, 0.0), (1.0, 0.0, 0.0)),  # as the tips part
)
BASE = (
    "base_link",
    "base_antenna_left_link",
    "base_antenna_right_link",
    "base_dock_link",
    "base_front_laser_link",
    "base_rear_laser_link",
    "torso_base_link",
    "suspension_front_left_link",
    "suspension_front_right_link",
    "suspension_rear_left_link",
    "suspension_rear_right_link",
)
LEFT_ARM = JointGroup(
    names("arm_left_", 1, 7, "_joint"),
    lower=(*(-0.04,) * 4, *(-0.1,) * 3),
    upper=(*(0.04,) * 4, *(0.1,) * 3),
    stiffness=(2.57e4, 3.23e4, 8480.0, 7940.0, 1000.0, 1000.0, 1000.0),
    damping=(343.0, 431.0, 113.0, 106.0, 7.94, 8.06, 1.61),
    force_limit=(73.1, 92.0, 26.0, 26.0, 26.0, 26.0, 26.0),
    delta=True,
    approximate_ik=True,
    limits=((-0.5235988, 4.712389), BEND, TURN, BEND, (-3.6651914, 1.5707964), WRIST, TURN),
)
RIGHT_ARM = replace(
    LEFT_ARM,
    joints=mirrored(LEFT_ARM.joints),
    limits=((-4.712389, 0.5235988), BEND, TURN, BEND, (-1.5707964, 3.6651914), WRIST, TURN),
)
LEFT_GRIPPER = JointGroup(  # one motor moves both linkages
    (
        "gripper_left_finger_joint",
        "gripper_left_inner_finger_left_joint",
        "gripper_left_outer_finger_right_joint",
        "gripper_left_inner_finger_right_joint",
        "gripper_left_fingertip_left_joint",
        "gripper_left_fingertip_right_joint",
    ),
    0.0,
    OPEN,
    stiffness=2.0,
    damping=0.1,
    force_limit=10.0,
    mimic=True,
    multipliers=(-1, -1, -1, -1, 1, 1),
    offsets=(*(OPEN,) * 4, *(-OPEN,) * 2),
    reset_noise=False,
)
LEFT_HAND = (
    "arm_left_7_link",
    "gripper_left_base_link",
    "gripper_left_inner_finger_left_link",
    "gripper_left_outer_finger_left_link",
    "gripper_left_fingertip_left_link",
    "gripper_left_inner_finger_right_link",
    "gripper_left_outer_finger_right_link",
    "gripper_left_fingertip_right_link",
)

TIAGO_PRO = RobotDescriptor(
    name="tiago_pro",
    urdf=UrdfLocator("example_tiago_pro_description", "robots/tiago_pro.urdf"),
    action_split=ActionSplit(
        left_arm=LEFT_ARM,
        left_gripper=LEFT_GRIPPER,
        right_arm=RIGHT_ARM,
        right_gripper=replace(LEFT_GRIPPER, joints=mirrored(LEFT_GRIPPER.joints)),
        torso=JointGroup.hold(("torso_lift_joint",), unit="m"),
        head=JointGroup.hold(("head_1_joint", "head_2_joint")),
        wheels=JointGroup.hold(
            (
                "wheel_front_left_joint",
                "wheel_front_right_joint",
                "wheel_rear_left_joint",
                "wheel_rear_right_joint",
            )
        ),
    ),
    tcp_link="gripper_left_base_link",
    tcp_position_links=TIPS,
    fingers=FINGERS,
    gripper_material=GripperMaterial((*TIPS, *mirrored(TIPS)), 2.0, 2.0, 0.0, patch_radius=0.1),
    keyframes={
        "rest": (
            0.343331,
            0.067992,
            0.503395,
            -0.938694,
            -1.153419,
            2.114344,
            0.018755,
            *(0,) * 6,
            -0.498625,
            0.597775,
            1.222533,
            0.340459,
            -0.694559,
            1.880084,
            0.630249,
            *(0,) * 13,
        )
    },
    limbs=both_sides(
        Limb("gripper_left_base_link", 1.032, (0.0653, 0.1592, 0.7537), FINGERS, TIPS)
    ),
    reach=1.2,  # of the left TCP, from the URDF
    source="example-robot-data 6.0.0, tiago_pro_description; drives from each joint's inertia",
    allowed_collisions=among(
        (*BASE, "torso_lift_link", "torso_head_link", "arm_left_1_link", "arm_right_1_link"),
        (*BASE, "wheel_front_left_link"),
        (*BASE, "wheel_front_right_link"),
        (*BASE, "wheel_rear_left_link"),
        (*BASE, "wheel_rear_right_link"),
        LEFT_HAND,
        mirrored(LEFT_HAND),
        ("arm_left_6_link", "gripper_left_base_link"),
        ("arm_right_6_link", "gripper_right_base_link"),
        ("head_1_link", "head_front_camera_link", "torso_lift_link"),
    ),
)
