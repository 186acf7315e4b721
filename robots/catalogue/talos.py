"""PAL Robotics Talos, two arms with grippers on a body that stands still: 2 × (7 + 1) numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, GripperMaterial, JointGroup, Limb, RobotDescriptor, names
from robots.parts import among, both_sides, mirrored

LIMITS = (
    (-2.443461, 2.443461),
    (-2.3561945, 0.0),
    (-2.5307274, 2.5307274),
    (-1.3962634, 1.3962634),
    (-0.6981317, 0.6981317),
)
LEFT_ARM = JointGroup(
    names("arm_left_", 1, 7, "_joint"),
    lower=(*(-0.04,) * 4, -0.065, -0.1, -0.1),
    upper=(*(0.04,) * 4, 0.065, 0.1, 0.1),
    stiffness=(4.17e4, 3.06e4, 8410.0, 7410.0, 1000.0, 1000.0, 1000.0),
    damping=(556.0, 409.0, 112.0, 98.7, 10.4, 10.3, 10.2),
    force_limit=(119.0, 87.2, 23.9, 21.1, 3.0, 6.6, 6.6),
    delta=True,
    approximate_ik=True,
    limits=((-1.5707964, 0.5235988), (0.0, 2.8797932), *LIMITS),
)
RIGHT_ARM = replace(
    LEFT_ARM,
    joints=mirrored(LEFT_ARM.joints),
    limits=((-0.5235988, 1.5707964), (-2.8797932, 0.0), *LIMITS),
)
LEFT_GRIPPER = JointGroup(
    ("gripper_left_joint",),
    lower=-1.0471976,
    upper=0.0,
    stiffness=1e3,
    damping=2e2,
    force_limit=1.0,
    reset_noise=False,
    limits=((-1.0471976, 0.0),),
)
LEFT_HAND = (
    "gripper_left_base_link",
    "gripper_left_motor_double_link",
    "gripper_left_inner_double_link",
    "gripper_left_fingertip_1_link",
    "gripper_left_fingertip_2_link",
    "gripper_left_motor_single_link",
    "gripper_left_inner_single_link",
    "gripper_left_fingertip_3_link",
)
LEFT_WRIST = (*names("arm_left_", 5, 7, "_link"), "wrist_left_ft_link", "wrist_left_ft_tool_link")
LEFT_LEG = names("leg_left_", 1, 6, "_joint")
LEFT_REST = (-0.3, 0.8, -0.4, -1.7, -0.5, 0.2, 0.0, 0.0)
RIGHT_REST = (0.3, -0.8, 0.4, -1.7, 0.5, -0.2, 0.0, 0.0)

TALOS = RobotDescriptor(
    name="talos",
    urdf=UrdfLocator("example_talos_data", "robots/talos_reduced.urdf"),
    action_split=ActionSplit(
        left_arm=LEFT_ARM,
        left_gripper=LEFT_GRIPPER,
        right_arm=RIGHT_ARM,
        right_gripper=replace(LEFT_GRIPPER, joints=mirrored(LEFT_GRIPPER.joints)),
        torso=JointGroup.hold(("torso_1_joint", "torso_2_joint")),
        head=JointGroup.hold(("head_1_joint", "head_2_joint")),
        legs=JointGroup.hold((*LEFT_LEG, *mirrored(LEFT_LEG))),
    ),
    tcp_link="gripper_left_fingertip_2_link",
    gripper_material=GripperMaterial((*LEFT_HAND, *mirrored(LEFT_HAND)), 2.0, 2.0, 0.0, 0.1),
    keyframes={"rest": (*LEFT_REST, *RIGHT_REST, *(0,) * 16)},
    limbs=both_sides(Limb("gripper_left_fingertip_2_link", 0.898, (0.0, 0.1575, 0.3042))),
    reach=1.055,  # of the left TCP, from the URDF
    source="example-robot-data 6.0.0, talos_data; drives from the inertia behind each joint",
    allowed_collisions=among(
        (*LEFT_WRIST, *LEFT_HAND),
        mirrored((*LEFT_WRIST, *LEFT_HAND)),
        ("leg_left_1_link", "leg_left_3_link"),
        ("leg_left_4_link", "leg_left_6_link"),
        ("leg_right_1_link", "leg_right_3_link"),
        ("leg_right_4_link", "leg_right_6_link"),
        ("head_1_link", "rgbd_link"),
        ("base_link", "torso_2_link"),
    ),
)
